"""An impact beyond the range of the inertial unit: what is unknown after it, and what readings say then."""

from __future__ import annotations

from math import nextafter

import numpy as np
import pytest

from autopilot.estimation.clipping import clipped_axes, update_clipping
from autopilot.estimation.records import (
    ACCEL_BIAS,
    RATE,
    VELOCITY,
    Clipping,
    EstimatorState,
    History,
    ImuReading,
    PoseReading,
    Vibration,
    blank_state,
    new_history,
)
from autopilot.geometry.linear import ZERO, Vec3
from tests.doubles.motion import TICK_S, bebop_tuning
from tests.doubles.readings import Readings, estimate

TUNING = bebop_tuning()
G, FULL = 9.81, TUNING.accel_range
LEVEL = (1.0, 0.0, 0.0, 0.0)
AT_REST = ImuReading(ZERO, (0.0, 0.0, G))
FALL_SPEED = 5.0  # m/s
HEIGHT = 1.0  # m
ROUNDING = 1e-9


def pose(age_s: float, height_m: float, climb_m_s: float) -> PoseReading:
    return PoseReading(age_s, (0.0, 0.0, height_m), LEVEL, (0.0, 0.0, climb_m_s), 1e-3, 1e-3, 1e-2)


def sinking() -> tuple[EstimatorState, History]:
    """A vehicle that has sunk at FALL_SPEED for half a second; its load is not measured."""
    state, history = blank_state(), new_history()
    for k in range(125):
        seen = pose(0.0, HEIGHT - FALL_SPEED * TICK_S * k, -FALL_SPEED)
        state = estimate(state, history, Readings(AT_REST, poses=(seen,)), TUNING, TICK_S)
    return state, history


def struck(
    state: EstimatorState, history: History, accel: Vec3 = (0.0, 0.0, FULL), ticks: int = 2
) -> EstimatorState:
    """The state after an impact of some ticks, and the first tick after it."""
    for _ in range(ticks):
        state = estimate(state, history, Readings(ImuReading(ZERO, accel)), TUNING, TICK_S)
    return estimate(state, history, Readings(AT_REST), TUNING, TICK_S)


def speed_stds(history: History) -> list[float]:
    return [float(np.sqrt(history.covariance[VELOCITY + i, VELOCITY + i])) for i in range(3)]


@pytest.mark.parametrize(
    ("value", "clipped"),
    [
        (0.0, 0.0),
        (0.99 * FULL, 0.0),
        (FULL, 1.0),
        (-FULL, 1.0),
        (float(np.float32(FULL)), 1.0),
        (nextafter(FULL, np.inf), 1.0),
        (1.01 * FULL, 0.0),  # the range is greater than assumed
    ],
)
def test_a_component_at_full_scale_is_cut(value: float, clipped: float) -> None:
    assert clipped_axes((value, 0.0, 0.0), FULL) == (clipped, 0.0, 0.0)
    assert clipped_axes((0.0, 0.0, value), FULL) == (0.0, 0.0, clipped)


def test_an_impact_makes_the_velocity_as_uncertain_as_it_is_fast_along_the_axis_that_was_cut() -> None:
    state, history = sinking()
    before = speed_stds(history)
    state = struck(state, history)
    after = speed_stds(history)
    assert FALL_SPEED < after[2] < 2.0 * FALL_SPEED
    assert max(after[:2]) < max(before[:2]) + 1.0
    assert state.uncertainty.speed == after[2]
    assert state.clipping.samples == 2.0


def test_a_harder_knock_at_rest_leaves_decimetres_per_second() -> None:
    state, history = blank_state(), new_history()
    for _ in range(125):
        seen = Readings(AT_REST, poses=(pose(0.0, HEIGHT, 0.0),))
        state = estimate(state, history, seen, TUNING, TICK_S)
    struck(state, history, ticks=1)
    assert 0.3 < speed_stds(history)[2] < 1.0


def test_a_reading_from_before_the_impact_is_dropped_and_the_next_one_decides() -> None:
    state, history = sinking()
    state = struck(state, history)
    speed, std = state.vehicle.v_quad[2], speed_stds(history)[2]
    stale = Readings(AT_REST, poses=(pose(0.03, HEIGHT, -FALL_SPEED),))
    state = estimate(state, history, stale, TUNING, TICK_S)
    assert state.vehicle.v_quad[2] == pytest.approx(speed, abs=0.1)
    assert speed_stds(history)[2] == pytest.approx(std, rel=0.1)
    height = state.vehicle.x_quad[2]
    for _ in range(3):
        seen = Readings(AT_REST, poses=(pose(0.0, height, 0.5),))
        state = estimate(state, history, seen, TUNING, TICK_S)
    assert state.vehicle.v_quad[2] == pytest.approx(0.5, abs=0.1)
    assert state.vehicle.rejected == 0.0
    assert state.resets == 1.0


def test_the_cable_shares_the_unknown_part_of_the_acceleration() -> None:
    """Along a horizontal body axis the vehicle gains speed, and the direction to a hanging load its rate."""
    state, history = sinking()
    load = state.load._replace(taut=1.0, q_cable=(0.0, 0.0, -1.0), across=(1.0, 0.0, 0.0), length=0.7)
    state = struck(state._replace(load=load), history, (FULL, 0.0, G))
    P = history.covariance
    correlation = P[VELOCITY, RATE] / np.sqrt(P[VELOCITY, VELOCITY] * P[RATE, RATE])
    assert correlation < -0.99, "the vehicle moves from under its load, which stays"
    assert np.array_equal(P, P.T)
    assert np.linalg.eigvalsh(P[:ACCEL_BIAS, :ACCEL_BIAS])[0] > -ROUNDING


def test_a_cut_rate_makes_the_attitude_uncertain() -> None:
    state, history = sinking()
    turning = ImuReading((TUNING.gyro_range, 0.0, 0.0), AT_REST.accel)
    tilt = state.uncertainty.tilt
    state = estimate(state, history, Readings(turning), TUNING, TICK_S)
    assert state.uncertainty.tilt > tilt + 0.5 * TUNING.gyro_range * TICK_S
    assert state.clipping.samples == 0.0, "of the accelerometer"


def test_a_vibration_that_reaches_the_full_scale_is_counted_and_is_no_impact() -> None:
    calm = blank_state().vibration
    shaking: Vibration = calm._replace(accel_var=(0.3 * FULL) ** 2)
    sample, never = ImuReading(ZERO, (0.0, 0.0, -FULL)), Clipping(ZERO, 0.0, 10.0, 4.0)
    shaken = update_clipping(never, shaking, sample, AT_REST, TUNING, TICK_S)
    assert shaken == Clipping(ZERO, 0.0, 10.0 + TICK_S, 5.0)
    hit = update_clipping(never, calm, sample, AT_REST, TUNING, TICK_S)
    assert hit == Clipping((0.0, 0.0, 1.0), 0.0, 0.0, 5.0)
    after = update_clipping(hit, calm, AT_REST, sample, TUNING, TICK_S)
    assert after == hit, "the impact lasts until the next sample, which is not counted"
    later = update_clipping(after, calm, AT_REST, AT_REST, TUNING, TICK_S)
    assert later == Clipping(ZERO, 0.0, TICK_S, 5.0)
