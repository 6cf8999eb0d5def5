"""The positions of a mission as the live page draws them."""

from __future__ import annotations

import math

import pytest

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import encode_steps
from gcs.view.places import waypoints_record
from missions.model import Delay, Land, Takeoff, Trajectory, Waypoint

HOME = Home()


def test_the_points_of_a_trajectory_count_from_the_position_before_it() -> None:
    path = Trajectory([(0.0,) * 4, (1.0, 1.0, 2.0, 0.5), (2.0, 0.0, 3.0, 0.0)])
    steps = (Takeoff(2.0), Waypoint(4.0, 5.0, 2.0), path, path, Delay(1.0), Land())
    found = waypoints_record(encode_steps(steps, HOME), HOME)
    expected = [
        *((0.0, 0.0, 0.0), (0.0, 0.0, -2.0), (5.0, 4.0, -2.0)),
        *((7.0, 5.0, -2.5), (8.0, 4.0, -2.0)),
        *((10.0, 5.0, -2.5), (11.0, 4.0, -2.0)),
    ]
    assert found[: len(expected)] == [pytest.approx(place, abs=0.01) for place in expected]


def test_a_point_without_a_place_is_left_out() -> None:
    items = encode_steps((Takeoff(2.0), Trajectory([(0.0,) * 4, (1.0, 1.0, 2.0, 0.5)])), HOME)
    nowhere = items[-1]._replace(param2=math.nan)
    assert len(waypoints_record((*items[:-1], nowhere), HOME)) == 2


def test_of_a_long_trajectory_some_points_are_drawn_and_the_last_one() -> None:
    long = Trajectory([(0.1 * k, 0.001 * k, 0.0, 0.0) for k in range(1000)])
    found = waypoints_record(encode_steps((Takeoff(2.0), long), HOME), HOME)
    assert 100 < len(found) < 250
    assert found[-1] == pytest.approx((0.0, 0.999, -2.0), abs=0.01)
