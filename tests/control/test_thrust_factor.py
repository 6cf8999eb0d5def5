"""Rotors that give less than commanded, as their speeds show."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autopilot.control.actuators.mixer import (
    FORCE,
    MISSED_COUNT,
    REPORTED_SPEED,
    mix,
    new_rotors,
    thrust_and_moment,
)
from autopilot.control.actuators.thrust_factor import (
    DEAD_BAND,
    MIN_FACTOR,
    applied_factor,
    learned_factor,
    mix_with_factor,
)
from autopilot.vehicle.layout import PLUS
from autopilot.vehicle.rotors import mixer_table
from autopilot.wire.convert.simulator import rotor_speed_rpm

TABLE = mixer_table(PLUS)
SHARE = 0.004  # 250 Hz, 1 s
HOVER_N = 4.905


def told(forces, vehicle):
    """The memory of rotors whose reported speeds correspond to these forces."""
    rotors = new_rotors()
    rotors[REPORTED_SPEED, :4] = [rotor_speed_rpm(force, vehicle.rotor_max) for force in forces]
    return rotors


def test_the_factor_is_found_in_the_time_constant(bebop):
    """A hover is commanded with the known factor, and the rotors give four fifths of the command."""
    factor, factors = 1.0, []
    for _ in range(2000):
        rotors = told([0.8 * HOVER_N / factor / 4.0] * 4, bebop)
        factor = learned_factor(factor, HOVER_N, bebop, 1.0, TABLE, rotors, SHARE)
        factors.append(factor)
    assert factors[-1] == pytest.approx(0.8, abs=1e-3)
    # with F / f = 0.8 / k the law of the module is k' = (0.8 - k) / T
    assert factors[249] == pytest.approx(0.8 + 0.2 * math.exp(-1.0), abs=2e-3)


@pytest.mark.parametrize(
    ("forces", "thrust", "missed"),
    [
        ([0.0] * 4, HOVER_N, 0.0),  # no speed was ever reported
        ([1.0] * 4, 0.3, 0.0),  # standing, rotors idle
        ([1.3, 1.3, 1.3, 0.0], HOVER_N, 1.0),  # one of them has failed
    ],
)
def test_what_tells_nothing_is_not_learned_from(bebop, forces, thrust, missed):
    rotors = told(forces, bebop)
    rotors[MISSED_COUNT, 3] = missed
    assert learned_factor(0.9, thrust, bebop, 1.0, TABLE, rotors, SHARE) == 0.9


def test_it_stays_within_its_bounds(bebop):
    factor = 1.0
    for _ in range(3000):
        factor = learned_factor(factor, HOVER_N, bebop, 1.0, TABLE, told([0.35] * 4, bebop), SHARE)
    assert factor == MIN_FACTOR


def test_as_little_as_the_speeds_cannot_tell_counts_for_nothing():
    assert [applied_factor(factor) for factor in (1.0 - DEAD_BAND, 1.0, 1.0 + DEAD_BAND)] == [1.0, 1.0, 1.0]
    assert applied_factor(0.8) == pytest.approx(0.8 + DEAD_BAND)


def test_weak_rotors_are_asked_for_more_and_give_what_was_wanted(bebop):
    rotors, wanted = new_rotors(), (HOVER_N, (0.02, -0.01, 0.005))
    mixed = mix_with_factor(0.8, *wanted, bebop, 1.0, TABLE, rotors)
    assert mixed.saturated == 0
    assert (mixed.achieved_thrust, *mixed.achieved_moment) == pytest.approx((wanted[0], *wanted[1]))
    rotors[FORCE] *= 0.8
    thrust, moment = thrust_and_moment(rotors, bebop, TABLE)
    assert (thrust, *moment) == pytest.approx((wanted[0], *wanted[1]))


def test_they_are_asked_for_no_more_than_they_can_and_it_is_known_what_comes(bebop):
    rotors = new_rotors()
    mixed = mix_with_factor(0.8, 100.0, (0.0, 0.0, 0.0), bebop, 1.0, TABLE, rotors)
    assert rotors[FORCE, :4] == pytest.approx([bebop.rotor_max] * 4)
    assert mixed.achieved_thrust == pytest.approx(0.8 * 4.0 * bebop.rotor_max)
    assert mixed.saturated == 0b1111


def test_rotors_that_are_as_believed_are_asked_for_the_same_to_the_bit(bebop):
    one, other = new_rotors(), new_rotors()
    demand = (5.3, (0.05, -0.02, 0.01), bebop, 1.0, TABLE)
    assert mix_with_factor(1.0, *demand, one) == mix(*demand, other)
    assert np.array_equal(one, other)
