"""Rotors: limits, lag, geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.plant.rotors import decay, limited, thrust_and_moment
from sitl.plant.step import advance, advance_many
from sitl.vehicles.sim_parameters import apply, sim_parameters

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
    thrust, moment = thrust_and_moment(force, bebop)
    assert [thrust, *moment] == pytest.approx(matrix @ np.array(force), abs=EXACT)


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


@given(st.tuples(*[st.floats()] * 4))
def test_every_command_is_limited(bebop, command):
    assert all(bebop.rotor_min <= force <= bebop.rotor_max for force in limited(command, bebop))


def test_command_that_is_no_number_stops_the_rotor(bebop):
    nan = math.nan
    assert limited((nan, 1.0, math.inf, -math.inf), bebop) == (0.0, 1.0, bebop.rotor_max, 0.0)


def test_unlimited_rotors_follow_any_command(thesis):
    assert limited((-3.0, 0.0, 7.0, 1e3), thesis) == (-3.0, 0.0, 7.0, 1e3)


def test_a_failing_rotor_gives_its_share_of_what_it_could(bebop):
    failing = bebop._replace(rotor_share=(1.0, 0.0, 0.25, 1.0))
    assert limited((1.0, 1.0, 9.0, 0.5), failing) == (1.0, 0.0, 0.25 * bebop.rotor_max, 0.5)


def test_failing_rotors_are_named_by_the_bits_of_a_parameter(bebop):
    table = sim_parameters(bebop)
    assert apply(bebop, table).rotor_share == (1.0, 1.0, 1.0, 1.0)
    table.set("SIM_ENGINE_FAIL", 5.0)
    table.set("SIM_ENGINE_MUL", 0.5)
    assert apply(bebop, table).rotor_share == (0.5, 1.0, 0.5, 1.0)
