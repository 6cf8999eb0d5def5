"""The model of the load against its invariants, and the filter against a load that follows the model."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from gcs.recorded.column_map import load_map
from gcs.recorded.estimates import FilterRows, filtered_estimates
from gcs.recorded.load_model import LoadModel, step_load, thrust_tilt
from gcs.recorded.smoothing import Floats

STILL = (0.0,) * 8
CALM = load_map("telemetry").load_model(3.0)


def swing(model: LoadModel, seconds: float, start: float, step: float = 0.02) -> Floats:
    """Rows of q_x, q_y and their rates, of a load that is released at the angle `start`."""
    state = (math.sin(start), 0.0, 0.0, 0.0, 0.0, 0.0)
    found = [state]
    for _ in range(round(seconds / step)):
        state = step_load(state, step, STILL, STILL, model)
        found.append(state)
    return np.array(found)


def test_energy_of_a_swing_without_drag_stays() -> None:
    found = swing(CALM, 20.0, 0.8)
    qx, qxd = found[:, 0], found[:, 2]
    qz = -np.sqrt(1.0 - qx**2)
    energy = 0.5 * CALM.length_m * (qxd**2 + (qx * qxd / qz) ** 2) + CALM.gravity_m_s2 * qz
    assert energy == pytest.approx(energy[0], abs=1e-5)


def test_a_small_swing_has_the_period_of_a_pendulum() -> None:
    found = swing(CALM, 7.0, 0.01)
    down = np.flatnonzero(np.diff(np.sign(found[:, 0])) != 0)
    assert 2 * 0.02 * (down[1] - down[0]) == pytest.approx(
        2 * math.pi * math.sqrt(CALM.length_m / CALM.gravity_m_s2), abs=0.05
    )


def accelerated(rows_hz: float, seconds: float = 8.0) -> tuple[float, float]:
    """The cable's direction after a sinusoidal motion of the vehicle that so many rows a second specify."""
    omega, size = 5.0, 4.0
    state, step = (0.05, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0 / rows_hz
    times = np.arange(round(seconds * rows_hz) + 1) * step
    drives = [
        (size * math.sin(omega * t), 0.0, 0.0, -size / omega * math.cos(omega * t), 0.0, 0.0, 0.0, 0.0)
        for t in times
    ]
    for before, after in itertools.pairwise(drives):
        state = step_load(state, step, before, after, CALM)
    return state[0], state[1]


def test_the_motion_between_two_rows_is_known_from_both_ends() -> None:
    """The acceleration has the integral that the velocities specify."""
    exact = accelerated(1000.0)
    errors = [abs(accelerated(rate)[0] - exact[0]) for rate in (10.0, 20.0)]
    assert errors[0] < 2e-4
    assert errors[1] < errors[0] / 8.0


def test_wash_pushes_outwards_and_drag_brakes() -> None:
    beside = (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
    calm = step_load(beside, 0.02, STILL, STILL, CALM)
    washed = step_load(beside, 0.02, STILL, STILL, CALM._replace(wash_per_s2=1.0, wash_radius_m=0.4))
    assert washed[2] > calm[2]
    turned = step_load(beside, 0.02, STILL, STILL, CALM._replace(swirl_per_s2=1.0, wash_radius_m=0.4))
    assert turned[3] > calm[3] == pytest.approx(0.0, abs=1e-12)
    assert np.max(np.abs(swing(CALM._replace(drag_per_m=0.05), 20.0, 0.5)[-200:, 0])) < 0.9 * math.sin(0.5)


def test_the_thrust_leans_towards_a_load_that_pulls_aside() -> None:
    level = (0.0,) * 6
    aside = (0.2, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert thrust_tilt(level, STILL, CALM) == (0.0, 0.0)
    # a hovering vehicle whose cable pulls to +x leans to -x, by the ratio of the masses
    pull = CALM.mass_ratio * math.sqrt(1.0 - 0.04)
    expected = -pull * 0.2 / (1.0 + pull * math.sqrt(1.0 - 0.04))
    assert thrust_tilt(aside, STILL, CALM)[0] == pytest.approx(expected, rel=1e-9)


def test_a_filter_that_sees_the_load_is_consistent() -> None:
    """With the position noise that the model states, innovations are as large as the filter predicts."""
    rng = np.random.default_rng(5)
    model = CALM._replace(seen_m=5e-3, turbulence_m_s2=1e-3, force_density=1e-3)
    truth = swing(model, 40.0, 0.3)
    n = len(truth)
    measurements = np.zeros((n, 6))
    measurements[:, :2] = model.length_m * truth[:, :2] + rng.normal(0.0, model.seen_m, (n, 2))
    measurements[:, 4] = 1.0
    rows = FilterRows(0.02 * np.arange(n), np.zeros((n, 8)), np.zeros((n, 8)), measurements)
    found = filtered_estimates(rows, model, load=True, tilt=False)
    assert np.mean(found.squares[100:, 0]) == pytest.approx(2.0, abs=0.25)
    error = found.states[100:, :2] - truth[100:, :2]
    variance = found.covariances[100:, [0, 1], [0, 1]]
    assert np.mean(error**2 / variance) < 1.6
    assert np.std(error) * model.length_m < 0.4 * model.seen_m


def test_nothing_is_carried_over_a_break() -> None:
    n = 400
    measurements = np.zeros((n, 6))
    measurements[:, 4] = 1.0
    measurements[200:, 0] = 1.0  # the load is suddenly elsewhere
    measurements[200, 5] = 1.0
    rows = FilterRows(0.02 * np.arange(n), np.zeros((n, 8)), np.zeros((n, 8)), measurements)
    found = filtered_estimates(rows, CALM, load=True, tilt=False)
    assert (found.squares[[199, 200], 0] >= 0.0).all()
    assert found.states[200, 0] == pytest.approx(1.0 / CALM.length_m)
