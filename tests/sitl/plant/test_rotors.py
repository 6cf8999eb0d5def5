"""Rotors: limits, lag, geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.vehicle.layout import Rotor
from sitl.plant.by_value import advance, advance_many, rotors_of
from sitl.plant.rotors import SHARE, TARGET, decay, set_targets, wrenches
from sitl.settings import settings_of
from sitl.vehicles.sim_parameters import sim_parameters

CALM = (0.0, 0.0, 0.0)

# a lag that is exact whatever the step: rounding of a few operations
EXACT = 1e-14


def test_geometry_is_that_of_2_13(bebop):
    matrix = np.array(
        [
            [1.0, 1.0, 1.0, 1.0],
            [0.0, -bebop.arm, 0.0, bebop.arm],
            [bebop.arm, 0.0, -bebop.arm, 0.0],
            [-bebop.torque_ratio, bebop.torque_ratio, -bebop.torque_ratio, bebop.torque_ratio],
        ]
    )
    force = (1.1, 0.7, 0.4, 1.9)
    rotors = rotors_of(force, force)
    set_targets(rotors, bebop)
    for wrench in wrenches(rotors, bebop, 0.004):
        assert [wrench.thrust, *wrench.moment] == pytest.approx(matrix @ np.array(force), abs=EXACT)


@given(st.floats(0.0, 700.0))
def test_decay_is_exp(x):
    # each squaring doubles the rounding (2.2e-16) of a value found for 1/8 < x/2^k <= 1/4
    assert decay(x) == pytest.approx(math.exp(-x), rel=2.2e-16 * (2.0 + 16.0 * x), abs=1e-300)


@pytest.mark.parametrize("h", [4e-3, 1e-3, 0.3e-3])
def test_lag_is_exact_for_every_step(bebop, aloft, h):
    start = aloft(bebop, rotor_force=(0.2, 1.9, 1.0, 0.0))
    command = (1.5, 0.1, 1.0, 9.0)
    n = 40
    state = advance_many(start, bebop, command, CALM, h, n)
    left = math.exp(-n * h / bebop.rotor_tau)
    for before, asked, now in zip(
        start.rotor_force, (1.5, 0.1, 1.0, bebop.rotor_max), state.rotor_force, strict=True
    ):
        assert now == pytest.approx(asked + (before - asked) * left, abs=n * EXACT)


def test_no_lag_is_at_once(thesis, aloft):
    state = advance(aloft(thesis), thesis, (3.0, 2.0, 2.5, 2.5), CALM, 1e-3)
    assert state.rotor_force == (3.0, 2.0, 2.5, 2.5)


def followed(command, truth, share=(1.0,) * 4):
    """The forces that whole rotors, or failing ones, go to."""
    rotors = rotors_of((0.0,) * 4, command)
    rotors.rows[SHARE, :4] = share
    set_targets(rotors, truth)
    return tuple(rotors.rows[TARGET, :4].tolist())


@given(st.tuples(*[st.floats()] * 4))
def test_every_command_is_limited(bebop, command):
    assert all(bebop.rotor_min <= force <= bebop.rotor_max for force in followed(command, bebop))


def test_command_that_is_no_number_stops_the_rotor(bebop):
    nan = math.nan
    assert followed((nan, 1.0, math.inf, -math.inf), bebop) == (0.0, 1.0, bebop.rotor_max, 0.0)


def test_unlimited_rotors_follow_any_command(thesis):
    assert followed((-3.0, 0.0, 7.0, 1e3), thesis) == (-3.0, 0.0, 7.0, 1e3)


def test_a_failing_rotor_gives_its_share_of_what_it_could(bebop):
    failing = followed((1.0, 1.0, 9.0, 0.5), bebop, share=(1.0, 0.0, 0.25, 1.0))
    assert failing == (1.0, 0.0, 0.25 * bebop.rotor_max, 0.5)


def test_failing_rotors_are_named_by_the_bits_of_a_parameter(bebop):
    table = sim_parameters(bebop)
    assert settings_of(table).rotor_shares(6) == (1.0,) * 6
    table.set("SIM_ENGINE_FAIL", 37.0)
    table.set("SIM_ENGINE_MUL", 0.5)
    assert settings_of(table).rotor_shares(6) == (0.5, 1.0, 0.5, 1.0, 1.0, 0.5)


def test_each_rotor_has_a_place_a_lag_and_a_strength_of_its_own(bebop, aloft):
    """Compared with the sums of (2-13) over positions, and the exponential of each rotor's own lag."""
    layout = (
        Rotor(-1.0, 0.2, -1.0, 1.0, 1.0),
        Rotor(0.1, -1.0, 1.0, 1.5, 2.0),
        Rotor(0.8, 0.0, -0.9, 0.5, 0.0),
        Rotor(0.0, 1.0, 1.0, 1.0, 1.0),
        Rotor(0.5, 0.5, 1.2, 1.0, 0.5),
    )
    before, command = (1.0, 0.4, 0.2, 1.1, 0.9), (0.2, 9.0, 9.0, 1.5, 0.0)
    goes_to = np.clip(command, 0.0, bebop.rotor_max * np.array([r.strength for r in layout]))
    start = aloft(bebop, rotor_force=before)
    h, n = 2e-3, 10
    end = advance_many(start, bebop, command, CALM, h, n, layout)
    lags = bebop.rotor_tau * np.array([r.lag for r in layout])
    left = np.array([math.exp(-n * h / lag) if lag else 0.0 for lag in lags])
    assert end.rotor_force == pytest.approx(goes_to + left * (np.array(before) - goes_to), abs=n * EXACT)
    rotors = rotors_of(end.rotor_force, end.rotor_force, layout)
    set_targets(rotors, bebop)
    now = wrenches(rotors, bebop, h)[0]
    at = [(bebop.arm * r.x, bebop.arm * r.y, 0.0) for r in layout]
    pull = [np.array([0.0, 0.0, force]) for force in end.rotor_force]
    moment = sum(np.cross(place, force) for place, force in zip(at, pull, strict=True))
    moment[2] += sum(bebop.torque_ratio * r.yaw * f for r, f in zip(layout, end.rotor_force, strict=True))
    assert now.thrust == pytest.approx(sum(end.rotor_force), abs=10 * EXACT)
    assert now.moment == pytest.approx(moment, abs=10 * EXACT)
