"""How long a mission should take."""

from __future__ import annotations

import pytest

from autopilot.trajectory.timeline import expected_duration_s
from missions.model import Delay, Land, Mission, Signals, Speed, Takeoff, Term, Waypoint


def seconds(*steps):
    return expected_duration_s(Mission("m", "", "", (), (Takeoff(2.0), *steps, Land())))


def test_what_has_a_duration_counts_with_it():
    term = Term("x", 1.0, 0.0, 5.0, None, 0.0)
    longer = seconds(Signals(50.0, (term,)), Delay(30.0)) - seconds(Signals(10.0, (term,)), Delay(3.0))
    assert longer == pytest.approx(67.0)
    held = seconds(Waypoint(5.0, 0.0, 2.0, hold_s=4.0)) - seconds(Waypoint(5.0, 0.0, 2.0))
    assert held == pytest.approx(4.0)


def test_half_the_speed_takes_twice_as_long():
    """Far enough that the acceleration sets no bound."""
    there = Waypoint(1000.0, 0.0, 2.0)
    rest = seconds(Speed(1.0), Waypoint(0.0, 0.0, 2.0))
    slow, fast = (seconds(Speed(speed), there) - rest for speed in (1.0, 2.0))
    assert slow == pytest.approx(2.0 * fast)


def test_a_place_is_left_from_where_the_load_is():
    out_and_back = seconds(Waypoint(50.0, 0.0, 2.0), Waypoint(0.0, 0.0, 2.0))
    out_and_stay = seconds(Waypoint(50.0, 0.0, 2.0), Waypoint(50.0, 0.0, 2.0))
    assert out_and_back > out_and_stay
