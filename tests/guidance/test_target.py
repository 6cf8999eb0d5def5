"""The motion of a target by its reports, and the place beside it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import atan2, cos, degrees, isnan, pi, radians, remainder, sin, tau
from random import Random

import pytest

from autopilot.geometry.linear import ZERO, Vec3, add, norm, scale, sub
from autopilot.guidance.target import Target, TargetPlace, first_report

BEHIND = TargetPlace(3.0, False, 4.0, pi, 5.0, 1.0)
SECOND_US = 1_000_000


def east_going(speed: float) -> Target:
    return first_report((10.0, 0.0, 1.0), (speed, 0.0, 0.0), None, 0, ZERO)


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
    rising = first_report((0.0, 0.0, 5.0), (1.0, 0.0, 0.5), None, 0, ZERO)
    over_home, over_target = BEHIND, replace(BEHIND, height_over_target=True)
    assert (rising.setpoint(over_home).position[2], rising.setpoint(over_home).velocity[2]) == (3.0, 0.0)
    assert (rising.setpoint(over_target).position[2], rising.setpoint(over_target).velocity[2]) == (8.0, 0.5)


def test_a_standing_target_that_is_new_is_followed_from_where_the_load_is() -> None:
    standing = first_report((10.0, 0.0, 0.0), None, None, 0, (10.0, 7.0, 2.0))
    assert degrees(standing.course) == pytest.approx(-90.0)
    assert standing.setpoint(BEHIND).position == pytest.approx((10.0, 4.0, 3.0))


def test_a_target_that_stops_keeps_its_course() -> None:
    stopped = east_going(2.0).reported((12.0, 0.0, 1.0), (0.01, -0.01, 0.0), None, SECOND_US, BEHIND)
    assert stopped.course == 0.0


def test_a_velocity_that_is_not_reported_follows_from_the_positions() -> None:
    true_velocity: Vec3 = (1.5, -2.0, 0.0)
    target = first_report(ZERO, None, None, 0, (-1.0, 0.0, 0.0))
    assert target.velocity == ZERO
    errors = []
    for k in range(1, 9):
        target = target.reported(scale(float(k), true_velocity), None, None, k * SECOND_US, BEHIND)
        errors.append(norm(sub(target.velocity, true_velocity)))
    # a report takes 1 - 1/e of the error away with a time constant of one second
    assert errors[0] == pytest.approx(2.5 / 2.718, rel=1e-3)
    assert errors[-1] < 2.5 * 0.37**7
    slow = replace(BEHIND, smoothing_s=5.0)
    slowly = first_report(ZERO, None, None, 0, ZERO).reported(true_velocity, None, None, SECOND_US, slow)
    assert norm(slowly.velocity) < 0.5


def test_two_reports_at_the_same_time_count_as_one() -> None:
    target = first_report(ZERO, None, None, 0, ZERO)
    assert target.reported((5.0, 0.0, 0.0), None, None, 0, BEHIND) == target


def test_the_place_moves_round_a_target_that_turns_back_no_faster_than_asked() -> None:
    """The shorter way round, at 5 m/s on a circle of 4 m."""
    target = east_going(2.0)
    before = target.course
    for k in range(1, 5):
        target = target.reported(target.position, (-2.0, -0.1, 0.0), None, k * SECOND_US // 2, BEHIND)
        turned = remainder(target.course - before, tau)
        assert -5.0 / 4.0 / 2.0 - 1e-9 <= turned <= 0.0
        before = target.course
    assert remainder(target.course, tau) == pytest.approx(-2.5)
    ahead = add(target.position, (-1.0, 0.0, 0.0))
    done = target.reported(ahead, (-2.0, -0.1, 0.0), None, 3 * SECOND_US, BEHIND)
    assert remainder(done.course, tau) == pytest.approx(-pi + 0.05, abs=1e-3)


def round_a_circle(radius: float, rate: float, t: float) -> tuple[Vec3, Vec3, Vec3]:
    x, y = radius * cos(rate * t), radius * sin(rate * t)
    return (x, y, 0.0), (-rate * y, rate * x, 0.0), (-(rate**2) * x, -(rate**2) * y, 0.0)


def test_an_acceleration_that_is_not_reported_follows_from_the_velocities() -> None:
    """Those of a circle: the error is the change of the acceleration in the time of smoothing."""
    (position, velocity, accel), rate = round_a_circle(20.0, 0.15, 0.0), 0.15
    target = first_report(position, velocity, None, 0, ZERO)
    assert target.accel == ZERO
    for k in range(1, 60):
        position, velocity, accel = round_a_circle(20.0, rate, 0.2 * k)
        target = target.reported(position, velocity, None, k * SECOND_US // 5, BEHIND)
    assert norm(sub(target.accel, accel)) == pytest.approx(norm(accel) * rate * BEHIND.smoothing_s, rel=0.02)
    assert target.course_rate == pytest.approx(rate, rel=1e-3)
    reported: Vec3 = (1.0, 2.0, 3.0)
    assert target.reported(position, velocity, reported, 13 * SECOND_US, BEHIND).accel == reported


@pytest.mark.parametrize("angle_deg", [180.0, 90.0, 0.0])
def test_the_place_beside_a_target_that_turns_moves_round_with_it(angle_deg: float) -> None:
    """Velocity, acceleration and its rate are the derivatives of the position of the place."""
    place = replace(BEHIND, angle=radians(angle_deg))

    def place_at(t: float) -> tuple[Vec3, ...]:
        position, velocity, accel = round_a_circle(20.0, 0.15, t)
        course = atan2(velocity[1], velocity[0])
        setpoint = Target(position, velocity, course, 0, accel, 0.15, moves=True).setpoint(place)
        return setpoint.position, setpoint.velocity, setpoint.accel, setpoint.accel_rate

    h = 1e-4
    for order in (0, 1, 2):
        change = sub(place_at(3.0 + h)[order], place_at(3.0 - h)[order])
        assert scale(0.5 / h, change) == pytest.approx(place_at(3.0)[order + 1], abs=1e-6)


def test_the_turning_of_a_slow_target_is_noise() -> None:
    slow = Target(ZERO, (0.5, 0.0, 0.0), 0.0, 0, ZERO, 1.0, moves=True)
    assert slow.setpoint(BEHIND).velocity == (0.5, 0.0, 0.0)


def reports(
    target: Target, velocity: Vec3, seconds: int, noise: float = 0.0, rng: Random | None = None
) -> Iterator[Target]:
    """A report a second of a target at this velocity, with noise in the level velocities."""
    for _ in range(seconds):
        level = ((v + rng.gauss(0.0, noise) if rng else v) for v in velocity[:2])
        now_us = target.at_us + SECOND_US
        target = target.reported(add(target.position, velocity), (*level, velocity[2]), None, now_us, BEHIND)
        yield target


@pytest.mark.parametrize("noise", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("moved", [False, True])
def test_noise_of_its_velocity_moves_no_place_beside_a_target_that_stands(noise: float, moved: bool) -> None:
    """A boat at its mooring, for twenty minutes."""
    for seed in range(20):
        moored = first_report((10.0, 0.0, 0.0), None, None, 0, (10.0, 7.0, 2.0))
        if moved:
            *_, moored = reports(moored, (0.0, -2.0, 0.0), 5)
            *_, moored = reports(moored, ZERO, 10)
        before = moored.setpoint(BEHIND)
        for target in reports(moored, ZERO, 1200, noise, Random(seed)):
            setpoint = target.setpoint(BEHIND)
            assert (setpoint.position, setpoint.heading) == (before.position, before.heading)
            assert not target.moves and setpoint.accel == ZERO


@pytest.mark.parametrize(("noise", "within_deg"), [(0.0, 1e-9), (0.1, 20.0), (0.2, 40.0)])
def test_the_course_of_a_target_that_walks_is_followed(noise: float, within_deg: float) -> None:
    """At 0.5 m/s, from rest; measured 16 deg and 33 deg at most."""
    for seed in range(20):
        start = first_report((10.0, 0.0, 0.0), None, None, 0, (10.0, 7.0, 2.0))
        for k, target in enumerate(reports(start, (0.0, 0.5, 0.0), 100, noise, Random(seed))):
            error = remainder(target.course - 0.5 * pi, tau)
            if k >= 20 or (not noise and k >= 10):
                assert abs(degrees(error)) <= within_deg
        assert target.moves


def test_a_target_that_moves_stands_only_at_a_lower_speed_than_the_one_at_which_it_starts() -> None:
    speed = (0.35, 0.0, 0.0)
    *_, started = reports(first_report(ZERO, None, None, 0, ZERO), speed, 30)
    *_, slowed = reports(east_going(0.0), (0.5, 0.0, 0.0), 30)
    *_, slowed = reports(slowed, speed, 30)
    assert (started.moves, slowed.moves) == (False, True)
    for target in (started, slowed):
        assert target.setpoint(BEHIND).velocity == pytest.approx(speed, abs=1e-3)


def test_a_target_that_stops_at_once_stands_at_once() -> None:
    """What is left of its mean velocity moves nothing."""
    for target in reports(east_going(2.0), ZERO, 30):
        assert target.setpoint(BEHIND).velocity == ZERO
        assert target.course == 0.0
    assert not target.moves


def test_a_target_that_only_rises_is_followed_at_once() -> None:
    over_target = replace(BEHIND, height_over_target=True)
    *_, rising = reports(east_going(0.0), (0.0, 0.0, 1.0), 1)
    assert rising.setpoint(over_target).velocity == (0.0, 0.0, 1.0)
