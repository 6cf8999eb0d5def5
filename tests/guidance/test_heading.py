"""The motion of the heading to an angle, at a rate, or towards a place: within its limits, without a jump."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.geometry.linear import ZERO
from autopilot.guidance.heading import (
    ARRIVAL_TOLERANCE,
    HEADING_EAST,
    LAG_RATE,
    Aim,
    FacePoint,
    Heading,
    HeadingLimits,
    Spin,
    TurnTo,
    heading_of,
    unwrap_near,
    wrap_pi,
)

LIMITS = HeadingLimits(approach_rate=1.0, max_rate=2.5, accel=1.0)
STEP_US = 4000
QUARTER = 0.5 * math.pi


def flown(heading: Heading, seconds: float, place=ZERO, velocity=ZERO, limits=LIMITS) -> list[Heading]:
    """The heading at each tick; the vehicle moves from a place at a constant velocity."""
    found = [heading]
    for _ in range(round(seconds * 1e6 / STEP_US)):
        now_us = found[-1].at_us + STEP_US
        t = (now_us - heading.at_us) * 1e-6
        at = tuple(x + t * v for x, v in zip(place, velocity, strict=True))
        found.append(replace(found[-1].advanced(now_us, at, velocity, limits), at_us=now_us))
    return found


def towards(aim: Aim, seconds: float, **world) -> list[Heading]:
    return flown(HEADING_EAST.with_aim(aim, 0), seconds, **world)


def test_at_first_the_nose_points_east_and_rests() -> None:
    assert HEADING_EAST.is_settled
    assert HEADING_EAST.reference(0.0) == ((1.0, 0.0, 0.0), ZERO, ZERO)
    assert HEADING_EAST.advanced(STEP_US, ZERO, ZERO, LIMITS) is HEADING_EAST


@pytest.mark.parametrize("angle", [QUARTER, -QUARTER, 3.0, -7.0, 0.01])
def test_it_comes_to_rest_at_the_angle(angle: float) -> None:
    path = towards(TurnTo(angle), 20.0)
    assert path[-1].is_settled and path[-1].angle == angle
    # it arrives without overshooting: measured 2e-3 of the way
    assert max(abs(h.angle) for h in path) < abs(angle) * 1.005
    way = [math.copysign(1.0, angle) * h.angle for h in path]
    assert way[0] == 0.0 and max(way) == pytest.approx(abs(angle), rel=5e-3)


def test_a_quarter_turn_takes_about_what_its_limits_say() -> None:
    """At 1 rad/s and 1 rad/s^2, of which 0.7 are used to plan the braking: 2.8 s at least."""
    path = towards(TurnTo(QUARTER), 20.0)
    there = next(k for k, h in enumerate(path) if abs(h.angle - QUARTER) < math.radians(2.0))
    assert 2.5 < there * STEP_US * 1e-6 < 4.5


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.floats(-9.0, 9.0).map(TurnTo),
            st.floats(-5.0, 5.0).map(Spin),
            st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.just(0.0)).map(FacePoint),
        ),
        min_size=1,
        max_size=4,
    ),
    st.floats(0.1, 3.0),
)
def test_whatever_is_asked_limits_are_kept_and_nothing_jumps(aims: list[Aim], seconds: float) -> None:
    heading = HEADING_EAST
    dt = STEP_US * 1e-6
    for aim in aims:
        path = flown(heading.with_aim(aim, heading.at_us), seconds, velocity=(0.5, -0.2, 0.0))
        for before, after in pairwise(path):
            assert abs(after.accel) <= LIMITS.accel + 1e-12
            assert abs(after.rate) <= LIMITS.max_rate + LIMITS.approach_rate
            assert (
                abs(after.accel - before.accel)
                <= 2.0 * LIMITS.accel * (1.0 - math.exp(-LAG_RATE * dt)) + ARRIVAL_TOLERANCE
            )
            assert abs(after.rate - before.rate) <= LIMITS.accel * dt + ARRIVAL_TOLERANCE
            assert (
                abs(after.angle - before.angle - dt * before.rate)
                <= LIMITS.accel * dt * dt + ARRIVAL_TOLERANCE
            )
        heading = path[-1]


def test_the_rate_asked_for_is_turned_with_and_no_faster_than_it_may() -> None:
    for asked, found in ((0.8, 0.8), (-0.8, -0.8), (9.0, 2.5)):
        assert towards(Spin(asked), 6.0)[-1].rate == pytest.approx(found, abs=1e-3)


def test_an_angle_that_moves_on_is_followed() -> None:
    path = towards(TurnTo(1.0, target_rate=0.5, since_us=0), 15.0)
    assert path[-1].angle == pytest.approx(1.0 + 0.5 * 15.0, abs=1e-3)
    assert path[-1].rate == pytest.approx(0.5, abs=1e-3)
    assert not path[-1].is_settled


def test_a_place_stays_ahead_of_a_vehicle_that_passes_it() -> None:
    """At 1 m/s past a place 4 m aside; the rate is fed forward."""
    path = towards(FacePoint((0.0, 4.0, 0.0)), 16.0, place=(-8.0, 0.0, 0.0), velocity=(1.0, 0.0, 0.0))
    for k in range(1000, len(path)):
        x = -8.0 + k * STEP_US * 1e-6
        assert abs(wrap_pi(path[k].angle - math.atan2(4.0, -x))) < math.radians(2.0)


def test_over_the_place_the_nose_stays() -> None:
    assert towards(FacePoint((0.1, 0.1, 0.0)), 5.0)[-1].angle == 0.0


def test_a_rate_of_its_own_is_kept() -> None:
    path = towards(TurnTo(3.0, max_rate=0.2), 5.0)
    assert max(h.rate for h in path) == pytest.approx(0.2, abs=1e-3)


def test_it_stops_where_it_can() -> None:
    spinning = towards(Spin(1.0), 3.0)[-1]
    path = flown(spinning.stopped(spinning.at_us, LIMITS), 20.0)
    assert path[-1].is_settled
    assert min(h.rate for h in path) > -0.02, "it swings back"
    assert path[-1].angle - spinning.angle < 2.0


def test_the_nose_is_differentiated() -> None:
    h = Heading(angle=0.7, rate=0.8, accel=-0.3)
    eps = 1e-4
    before, now, after = (h.reference(t) for t in (-eps, 0.0, eps))
    for k in range(2):
        slope = (np.array(after[k]) - np.array(before[k])) / (2.0 * eps)
        assert now[k + 1] == pytest.approx(tuple(slope), abs=1e-6)


def test_nothing_is_made_of_time_that_was_lost() -> None:
    heading = HEADING_EAST.with_aim(Spin(1.0), 0)
    assert abs(heading.advanced(60_000_000, ZERO, ZERO, LIMITS).angle) < 0.01


def test_angles_are_counted_on() -> None:
    three_turns = replace(HEADING_EAST, angle=6.0 * math.pi + 3.0)
    assert unwrap_near(-3.0, three_turns) == pytest.approx(6.0 * math.pi + 2.0 * math.pi - 3.0)
    assert wrap_pi(3.0 * math.pi / 2.0) == pytest.approx(-QUARTER)


def test_the_heading_of_an_attitude() -> None:
    c, s = math.cos(2.0), math.sin(2.0)
    assert heading_of(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))) == pytest.approx(2.0)
    assert math.isnan(heading_of(((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))))
