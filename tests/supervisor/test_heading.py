"""The commanded heading: set by a request or by the setpoint that is followed, and what ends it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from autopilot.geometry.linear import IDENTITY, Mat3, column
from autopilot.guidance.heading import FacePoint, Heading, Spin, TurnTo
from autopilot.guidance.setpoint_follower import MAX_LEAN_DEG, UNSPECIFIED, TrackAttitude
from autopilot.services import identity
from autopilot.services.requests import (
    Arm,
    FollowAttitude,
    FollowRates,
    FollowSetpoint,
    FollowStick,
    Land,
    LookAt,
    Pause,
    Reposition,
    SetMode,
    TurnHeading,
)
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as m
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, Sky, view

NORTH, SOUTH, WEST = 0.5 * math.pi, -0.5 * math.pi, math.pi
OFFBOARD, POSCTL = SetMode(identity.OFFBOARD, 0), SetMode(identity.POSCTL, 0)
DENIED, LATER = m.MAV_RESULT_DENIED, m.MAV_RESULT_TEMPORARILY_REJECTED
ARDUPILOT = replace(SETTINGS, setpoints=replace(SETTINGS.setpoints, ardupilot_guided=True))
NORTH_NOSE: Mat3 = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def place(heading: float = math.nan, turning: float = math.nan, **more: Any) -> FollowSetpoint:
    return FollowSetpoint(
        (0.0, 0.0, 2.0), UNSPECIFIED, UNSPECIFIED, False, heading_rad=heading, yaw_rate_rad_s=turning
    )


def stream(sky: Sky, request: Any, seconds: float) -> None:
    """Make the request at every tick, 50 Hz."""
    for _ in range(round(seconds * 1e6 / STEP_US)):
        assert sky.ask(request).result == ACCEPTED
        sky.tick()


def offboard(sky: Sky, request: Any, seconds: float) -> None:
    stream(sky, request, 0.1)
    assert sky.ask(OFFBOARD).result == ACCEPTED
    stream(sky, request, seconds)


@pytest.fixture
def sky() -> Sky:
    return Sky().airborne()


def turned(sky: Sky, request: Any, seconds: float = 15.0) -> float:
    assert sky.ask(request).result == ACCEPTED
    sky.wait(seconds)
    assert sky.flight.heading.is_settled
    return sky.flight.heading.angle


# ---- by request


def test_to_a_heading_the_shorter_way_or_the_one_that_is_asked_for(sky: Sky) -> None:
    assert turned(sky, TurnHeading(NORTH)) == NORTH
    assert turned(sky, TurnHeading(WEST)) == pytest.approx(WEST)
    assert turned(sky, TurnHeading(SOUTH)) == pytest.approx(1.5 * math.pi)
    assert turned(sky, TurnHeading(WEST, sense=1), 20.0) == pytest.approx(WEST + 2.0 * math.pi)
    assert turned(sky, TurnHeading(SOUTH, sense=-1), 20.0) == pytest.approx(1.5 * math.pi)


def test_by_an_angle_more_than_once_round(sky: Sky) -> None:
    assert turned(sky, TurnHeading(-math.pi, relative=True)) == pytest.approx(-math.pi)
    assert sky.ask(TurnHeading(-math.pi, relative=True)).result == ACCEPTED
    sky.wait(0.5)
    # counted from the heading that it is turning to
    assert turned(sky, TurnHeading(-math.pi, relative=True), 20.0) == pytest.approx(-3.0 * math.pi)


def test_as_slowly_as_is_asked_for(sky: Sky) -> None:
    assert sky.ask(TurnHeading(NORTH, rate_rad_s=0.1)).result == ACCEPTED
    sky.wait(5.0)
    assert 0.3 < sky.flight.heading.angle < 0.5


def test_on_the_ground_the_nose_is_not_turned() -> None:
    ground = Sky()
    for request in (TurnHeading(NORTH), LookAt(5.0, 5.0), LookAt(None, None)):
        assert ground.ask(request).result == LATER
    assert ground.flight.heading.is_settled


def test_a_place_to_look_at_stays_ahead_until_it_is_let_go(sky: Sky) -> None:
    assert sky.ask(LookAt(0.0, 5.0)).result == ACCEPTED
    sky.wait(8.0)
    assert sky.flight.heading.angle == pytest.approx(NORTH, abs=1e-3)
    assert sky.ask(Reposition(5.0, 5.0, 2.0, True)).result == ACCEPTED
    sky.wait(25.0)
    assert sky.flight.heading.angle == pytest.approx(WEST, abs=1e-3)
    assert sky.ask(LookAt(None, None)).result == ACCEPTED
    sky.wait(5.0)
    assert sky.flight.heading.is_settled
    assert sky.ask(LookAt(1e9, 0.0)).result == sky.ask(LookAt(math.nan, 0.0)).result == DENIED


def test_looking_no_more_leaves_another_heading_alone(sky: Sky) -> None:
    assert sky.ask(TurnHeading(NORTH)).result == ACCEPTED
    assert sky.ask(LookAt(None, None)).result == ACCEPTED
    assert sky.flight.heading.aim == TurnTo(NORTH)


def test_a_place_to_go_to_has_a_heading(sky: Sky) -> None:
    assert sky.ask(Reposition(1.0, 0.0, 2.0, True, heading_rad=NORTH)).result == ACCEPTED
    sky.wait(10.0)
    assert sky.flight.heading.angle == NORTH
    assert sky.ask(Reposition(None, None, None, True, heading_rad=0.0)).result == ACCEPTED
    sky.wait(10.0)
    assert sky.flight.heading.angle == 0.0
    assert sky.view.x_load == pytest.approx((1.0, 0.0, 2.0), abs=1e-6)
    refused = sky.ask(Reposition(0.0, 0.0, -1.0, True, heading_rad=NORTH))
    assert refused.result == DENIED and sky.flight.heading.is_settled


# ---- by setpoints


def test_the_heading_of_a_setpoint_is_taken_once(sky: Sky) -> None:
    offboard(sky, place(NORTH), 6.0)
    assert sky.flight.heading.angle == pytest.approx(NORTH, abs=1e-3)
    stream(sky, place(), 1.0)  # states no heading
    assert sky.flight.heading.aim == TurnTo(NORTH, since_us=sky.flight.heading.aim.since_us)  # type: ignore[union-attr]
    # a heading requested in between holds until a setpoint states one
    assert sky.ask(TurnHeading(0.0)).result == ACCEPTED
    stream(sky, place(), 6.0)
    assert sky.flight.heading.angle == pytest.approx(0.0, abs=1e-3)
    stream(sky, place(NORTH), 6.0)
    assert sky.flight.heading.angle == pytest.approx(NORTH, abs=1e-3)


def test_setpoints_that_are_not_followed_turn_nothing(sky: Sky) -> None:
    stream(sky, place(NORTH), 1.0)
    assert sky.flight.heading.is_settled and sky.flight.heading.angle == 0.0


@pytest.mark.parametrize("then", ["silence", "hold", "place"])
def test_turning_lasts_as_long_as_it_is_asked_for(sky: Sky, then: str) -> None:
    offboard(sky, place(turning=0.5), 3.0)
    assert sky.flight.heading.aim == Spin(0.5)
    assert sky.flight.heading.rate == pytest.approx(0.5, abs=0.01)
    if then == "hold":
        assert sky.ask(Pause()).result == ACCEPTED
    if then == "place":
        stream(sky, place(), 8.0)
    else:
        sky.wait(9.0)
        assert sky.flight.phase == Phase.HOLD
    assert sky.flight.heading.is_settled
    assert 1.0 < sky.flight.heading.angle < 2.5


def test_the_stick_turns_and_flies_along_the_nose(sky: Sky) -> None:
    assert sky.ask(FollowStick((0.0, 0.0, 0.0))).result == ACCEPTED
    assert sky.ask(POSCTL).result == ACCEPTED
    stream(sky, FollowStick((0.0, 0.0, 0.0), yaw_rate=1.0), 4.0)
    assert sky.flight.heading.rate == pytest.approx(SETTINGS.heading.max_rate, abs=0.01)
    stream(sky, FollowStick((0.0, 0.0, 0.0)), 10.0)
    angle = sky.flight.heading.angle
    stream(sky, FollowStick((1.0, 0.0, 0.0)), 6.0)
    speed = SETTINGS.setpoints.stick_speed_m_s
    assert sky.view.v_load == pytest.approx((speed * math.cos(angle), speed * math.sin(angle), 0.0), abs=0.02)


def test_axes_of_the_nose(sky: Sky) -> None:
    turned(sky, TurnHeading(NORTH))
    nan = math.nan
    for asked, velocity in (
        ((1.0, nan, nan), (0.0, 1.0, 0.0)),
        ((0.0, 1.0, nan), (-1.0, 0.0, 0.0)),
        ((nan, nan, 0.3), (0.0, 0.0, 0.3)),
    ):
        offboard(sky, FollowSetpoint(UNSPECIFIED, asked, UNSPECIFIED, True, body=True), 6.0)
        assert sky.view.v_load == pytest.approx(velocity, abs=0.02)


@pytest.mark.parametrize(("settings", "angle"), [(SETTINGS, NORTH), (ARDUPILOT, SOUTH)])
def test_yaw_in_axes_of_the_nose_is_from_north_or_from_the_nose(settings: Any, angle: float) -> None:
    """The nose points south: yaw 0 means north to PX4, and no turn to ArduPilot."""
    sky = Sky(settings=settings).airborne()
    turned(sky, TurnHeading(SOUTH))
    forward = FollowSetpoint(UNSPECIFIED, (0.0, 0.0, 0.0), UNSPECIFIED, True, body=True, heading_rad=NORTH)
    stream(sky, forward, 0.1)
    if settings is SETTINGS:
        assert sky.ask(OFFBOARD).result == ACCEPTED
    stream(sky, forward, 15.0)
    assert math.remainder(sky.flight.heading.angle - angle, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-3)


def test_the_heading_of_an_attitude(sky: Sky) -> None:
    offboard(sky, FollowAttitude((0.0, 0.0, 1.0), None, heading_rad=NORTH), 6.0)
    assert sky.flight.heading.angle == pytest.approx(NORTH, abs=1e-3)


def test_attitudes_that_lean_too_far_are_refused(sky: Sky) -> None:
    for lean, result in ((MAX_LEAN_DEG - 1.0, ACCEPTED), (MAX_LEAN_DEG + 1.0, DENIED), (180.0, DENIED)):
        upward = (math.sin(math.radians(lean)), 0.0, math.cos(math.radians(lean)))
        assert sky.ask(FollowAttitude(upward, 0.5)).result == result


def test_body_rates_turn_the_attitude_from_where_it_is(sky: Sky) -> None:
    sky.view = sky.view._replace(attitude=NORTH_NOSE)
    offboard(sky, FollowRates((0.0, 0.0, 0.5), None), 2.0)
    leg = sky.flight.legs[0]
    assert isinstance(leg, TrackAttitude) and leg.attitude is not None
    begun = sky.view.attitude
    nose = column(leg.attitude, 0)
    # from the first tick on, `Sky` shows its own attitude
    angle = math.atan2(nose[1], nose[0]) - math.atan2(begun[1][0], begun[0][0])
    assert angle == pytest.approx(1.0, abs=0.03)
    assert sky.flight.heading.angle == pytest.approx(math.atan2(nose[1], nose[0]), abs=0.03)
    stream(sky, FollowRates((0.4, 0.0, 0.0), None), 1.0)
    leg = sky.flight.legs[0]
    assert isinstance(leg, TrackAttitude) and leg.attitude is not None
    assert math.acos(leg.upward(0.0)[2]) == pytest.approx(0.4, abs=0.01)
    # an attitude again: the heading continues from where the rates left it
    stream(sky, FollowAttitude((0.0, 0.0, 1.0), None), 0.1)
    leg = sky.flight.legs[0]
    assert isinstance(leg, TrackAttitude) and leg.attitude is None
    assert leg.upward(0.0) == (0.0, 0.0, 1.0)


def test_body_rates_lean_no_further_than_an_attitude_may(sky: Sky) -> None:
    offboard(sky, FollowRates((0.0, 1.0, 0.0), 0.5), 3.0)
    assert math.degrees(math.acos(sky.flight.legs[0].upward(0.0)[2])) == pytest.approx(MAX_LEAN_DEG, abs=2.0)  # type: ignore[union-attr]
    stream(sky, FollowRates((0.0, -1.0, 0.0), 0.5), 0.5)
    assert math.degrees(math.acos(sky.flight.legs[0].upward(0.0)[2])) < 40.0  # type: ignore[union-attr]


def test_a_place_is_not_gone_to_before_the_swing_is_calmed(sky: Sky) -> None:
    offboard(sky, FollowAttitude((0.0, 0.1, 1.0), None), 1.0)
    assert sky.ask(Reposition(1.0, 0.0, 2.0, True)).result == LATER
    assert sky.flight.phase == Phase.GUIDED
    assert sky.ask(Reposition(None, None, None, True, heading_rad=NORTH)).result == ACCEPTED
    assert sky.flight.phase == Phase.HOLD
    sky.wait(10.0)
    assert sky.ask(Reposition(1.0, 0.0, 2.0, True)).result == ACCEPTED


# ---- from flight to flight


def test_the_heading_stays_over_a_landing(sky: Sky) -> None:
    assert sky.ask(LookAt(0.0, 9.0)).result == ACCEPTED
    sky.wait(8.0)
    assert sky.ask(Land()).result == ACCEPTED
    sky.run(lambda sky: sky.flight.phase == Phase.DISARMED)
    heading = sky.flight.heading
    assert heading.is_settled and not isinstance(heading.aim, FacePoint)
    assert heading.angle == pytest.approx(NORTH, abs=0.2)


@pytest.mark.parametrize(("attitude", "angle"), [(IDENTITY, 0.0), (NORTH_NOSE, NORTH)])
def test_a_vehicle_that_was_turned_on_the_ground_flies_with_the_heading_it_has(
    attitude: Mat3, angle: float
) -> None:
    sky = Sky()
    sky.view = view(attitude=attitude)
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert sky.flight.heading.angle == pytest.approx(angle)
    assert sky.flight.heading.is_settled


def test_a_heading_that_was_lost_with_the_estimate_is_found_again() -> None:
    sky = Sky()
    sky.flight = replace(sky.flight, heading=Heading(math.nan))
    sky.view = view(attitude=NORTH_NOSE)
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert sky.flight.heading.angle == pytest.approx(NORTH)
