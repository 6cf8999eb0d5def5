"""The motion of a target by its reports, and the place beside it."""

from __future__ import annotations

from dataclasses import replace
from math import cos, degrees, isnan, pi, radians, remainder, sin, tau

import pytest

from autopilot.geometry.linear import ZERO, Vec3, add, norm, scale, sub
from autopilot.guidance.target import Target, TargetPlace, first_report

BEHIND = TargetPlace(3.0, False, 4.0, pi, 5.0, 1.0)
SECOND_US = 1_000_000


def east_going(speed: float) -> Target:
    return first_report((10.0, 0.0, 1.0), (speed, 0.0, 0.0), 0, ZERO)


@pytest.mark.parametrize(
    ("angle_deg", "offset"),
    [(180.0, (-4.0, 0.0)), (0.0, (4.0, 0.0)), (90.0, (0.0, -4.0)), (-90.0, (0.0, 4.0))],
)
def test_the_angle_is_clockwise_from_the_course(angle_deg: float, offset: tuple[float, float]) -> None:
    setpoint = east_going(2.0).setpoint(replace(BEHIND, angle=radians(angle_deg)))
    assert setpoint.position == pytest.approx((10.0 + offset[0], offset[1], 3.0))
    assert setpoint.velocity == (2.0, 0.0, 0.0)
    facing = (cos(setpoint.heading), sin(setpoint.heading))
    assert facing == pytest.approx((-offset[0] / 4.0, -offset[1] / 4.0))


def test_over_the_target_there_is_no_direction_to_it() -> None:
    setpoint = east_going(2.0).setpoint(replace(BEHIND, distance_m=0.0))
    assert setpoint.position == (10.0, 0.0, 3.0)
    assert isnan(setpoint.heading)


def test_the_height_is_over_home_or_over_the_target_and_then_rises_with_it() -> None:
    rising = first_report((0.0, 0.0, 5.0), (1.0, 0.0, 0.5), 0, ZERO)
    over_home, over_target = BEHIND, replace(BEHIND, height_over_target=True)
    assert (rising.setpoint(over_home).position[2], rising.setpoint(over_home).velocity[2]) == (3.0, 0.0)
    assert (rising.setpoint(over_target).position[2], rising.setpoint(over_target).velocity[2]) == (8.0, 0.5)


def test_a_standing_target_that_is_new_is_followed_from_where_the_load_is() -> None:
    standing = first_report((10.0, 0.0, 0.0), None, 0, (10.0, 7.0, 2.0))
    assert degrees(standing.course) == pytest.approx(-90.0)
    assert standing.setpoint(BEHIND).position == pytest.approx((10.0, 4.0, 3.0))


def test_a_target_that_stops_keeps_its_course() -> None:
    stopped = east_going(2.0).reported((12.0, 0.0, 1.0), (0.01, -0.01, 0.0), SECOND_US, BEHIND)
    assert stopped.course == 0.0


def test_a_velocity_that_is_not_reported_follows_from_the_positions() -> None:
    true_velocity: Vec3 = (1.5, -2.0, 0.0)
    target = first_report(ZERO, None, 0, (-1.0, 0.0, 0.0))
    assert target.velocity == ZERO
    errors = []
    for k in range(1, 9):
        target = target.reported(scale(float(k), true_velocity), None, k * SECOND_US, BEHIND)
        errors.append(norm(sub(target.velocity, true_velocity)))
    # a report takes 1 - 1/e of the error away with a time constant of one second
    assert errors[0] == pytest.approx(2.5 / 2.718, rel=1e-3)
    assert errors[-1] < 2.5 * 0.37**7
    slow = replace(BEHIND, smoothing_s=5.0)
    assert (
        norm(first_report(ZERO, None, 0, ZERO).reported(true_velocity, None, SECOND_US, slow).velocity) < 0.5
    )


def test_two_reports_at_the_same_time_count_as_one() -> None:
    target = first_report(ZERO, None, 0, ZERO)
    assert target.reported((5.0, 0.0, 0.0), None, 0, BEHIND) == target


def test_the_place_moves_round_a_target_that_turns_back_no_faster_than_asked() -> None:
    """The shorter way round, at 5 m/s on a circle of 4 m."""
    target = east_going(2.0)
    before = target.course
    for k in range(1, 5):
        target = target.reported(target.position, (-2.0, -0.1, 0.0), k * SECOND_US // 2, BEHIND)
        turned = remainder(target.course - before, tau)
        assert -5.0 / 4.0 / 2.0 - 1e-9 <= turned <= 0.0
        before = target.course
    assert remainder(target.course, tau) == pytest.approx(-2.5)
    done = target.reported(add(target.position, (-1.0, 0.0, 0.0)), (-2.0, -0.1, 0.0), 3 * SECOND_US, BEHIND)
    assert remainder(done.course, tau) == pytest.approx(-pi + 0.05, abs=1e-3)
