"""Setpoints, sticks and circles: what is requested, and how the load follows it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.geometry.linear import ZERO, Vec3, norm, sub
from autopilot.guidance.heading import FacePoint
from autopilot.guidance.setpoint_follower import (
    UNSPECIFIED,
    PositionSetpoint,
    TrackAttitude,
    TrackPosition,
)
from autopilot.onboard.snapshot import reported_mode
from autopilot.services import identity
from autopilot.services.records import Verdict
from autopilot.services.requests import (
    Arm,
    FollowAttitude,
    FollowSetpoint,
    FollowStick,
    Land,
    Orbit,
    Pause,
    Reposition,
    ReturnHome,
    SetHome,
    SetMode,
    Takeoff,
)
from autopilot.supervisor.state import Phase, SetpointSource, follow_limits
from autopilot.wire.dialect import plumbline as m
from tests.doubles.motion import CABLE_LENGTH
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, Sky

OFFBOARD = SetMode(identity.OFFBOARD, 0)
POSCTL = SetMode(identity.POSCTL, 0)
DENIED, LATER = m.MAV_RESULT_DENIED, m.MAV_RESULT_TEMPORARILY_REJECTED


def at(*position: float, **more: Any) -> FollowSetpoint:
    x, y, z = position
    return FollowSetpoint(
        (x, y, z), more.get("velocity", UNSPECIFIED), UNSPECIFIED, more.get("relative", False)
    )


def moving(*velocity: float) -> FollowSetpoint:
    vx, vy, vz = velocity
    return FollowSetpoint(UNSPECIFIED, (vx, vy, vz), UNSPECIFIED, False)


def stream(sky: Sky, request: Any, seconds: float) -> None:
    """Make the request at every tick, 50 Hz."""
    for _ in range(round(seconds * 1e6 / STEP_US)):
        assert sky.ask(request).result == ACCEPTED
        sky.tick()


def offboard(request: Any) -> Sky:
    sky = Sky().airborne()
    stream(sky, request, 0.1)
    assert sky.ask(OFFBOARD).result == ACCEPTED
    return sky


# ---- streams, sticks and circles


def test_offboard_needs_a_stream() -> None:
    sky = Sky().airborne()
    before = sky.flight
    verdict = sky.ask(OFFBOARD)
    assert verdict.result == LATER and verdict.text
    assert sky.flight == before
    assert sky.ask(at(1.0, 0.0, 2.0)).result == ACCEPTED
    sky.wait(0.6)
    assert sky.ask(OFFBOARD).result == LATER  # the setpoint is too old
    assert sky.ask(at(1.0, 0.0, 2.0)).result == ACCEPTED
    assert sky.ask(OFFBOARD).result == ACCEPTED
    assert reported_mode(sky.flight) == (identity.OFFBOARD, 0)


def test_offboard_brings_the_load_to_the_setpoint_and_holds_when_it_is_lost() -> None:
    sky = offboard(at(3.0, -1.0, 2.5))
    stream(sky, at(3.0, -1.0, 2.5), 12.0)
    assert norm(sub(sky.view.x_load, (3.0, -1.0, 2.5))) < 0.01
    assert sky.flight.phase == Phase.GUIDED
    sky.wait(SETTINGS.setpoints.offboard_loss_us * 1e-6 - 0.05)
    assert sky.flight.phase == Phase.GUIDED
    sky.wait(0.2)
    assert sky.flight.phase == Phase.HOLD
    assert sky.texts[-1] == "Nothing usable from setpoints any more: holding"
    assert norm(sub(sky.view.x_load, (3.0, -1.0, 2.5))) < 0.01


def test_a_circle_of_positions_with_velocities_is_flown_on_its_radius() -> None:
    """Their acceleration follows from the velocities; without it the load would be 0.32 m outside."""
    sky = Sky().airborne()
    start_us = sky.view.now_us
    for k in range(1000):
        t = (sky.view.now_us - start_us) * 1e-6
        x, y = 5.0 * math.cos(0.3 * t), 5.0 * math.sin(0.3 * t)
        assert sky.ask(at(x, y, 2.0, velocity=(-0.3 * y, 0.3 * x, 0.0))).result == ACCEPTED
        if k == 0:
            assert sky.ask(OFFBOARD).result == ACCEPTED
        sky.tick()
        if k > 700:
            assert math.hypot(sky.view.x_load[0], sky.view.x_load[1]) == pytest.approx(5.0, abs=0.02)


def limits_told(request_at: Callable[[float], FollowSetpoint], seconds: float) -> set[str | None]:
    """What is said of a stream that is followed."""
    sky = offboard(request_at(0.0))
    told = set()
    for number in range(round(seconds * 1e6 / STEP_US)):
        told.add(sky.ask(request_at(number * STEP_US * 1e-6)).text)
        sky.tick()
    return told


@pytest.mark.parametrize(
    ("speed_m_s", "text"), [(1.6, None), (2.0, "Setpoint limited: over 1.5 m/s^2 (MIS_ACCEL)")]
)
def test_a_path_that_needs_more_than_the_greatest_acceleration_is_told_of(
    speed_m_s: float, text: str | None
) -> None:
    """A circle of 2 m at 1.6 and at 2 m/s, by positions and velocities; its beginning is a step of the
    velocity."""

    def on_circle(t: float) -> FollowSetpoint:
        c, s = math.cos(0.5 * speed_m_s * t), math.sin(0.5 * speed_m_s * t)
        return at(2.0 * c, 2.0 * s, 2.0, velocity=(-speed_m_s * s, speed_m_s * c, 0.0))

    assert limits_told(on_circle, 8.0) == {None, text}


@pytest.mark.parametrize(
    ("velocity", "accel", "text"),
    [
        ((3.0, 4.0, UNSPECIFIED[0]), UNSPECIFIED, None),
        ((3.0, 4.0, 3.0), UNSPECIFIED, "Setpoint limited: over 5 m/s (MPC_XY_VEL_MAX)"),
        ((1.0, 0.0, 0.0), (1.5, 0.0, 0.0), None),
        ((1.0, 0.0, 0.0), (0.0, 1.5, 1.0), "Setpoint limited: over 1.5 m/s^2 (MIS_ACCEL)"),
    ],
)
def test_a_velocity_or_acceleration_beyond_its_limit_is_told_of(
    velocity: Vec3, accel: Vec3, text: str | None
) -> None:
    request = FollowSetpoint(UNSPECIFIED, velocity, accel, False)
    assert limits_told(lambda _: request, 0.1) == {text}
    held = Sky().airborne()
    assert held.ask(request).text is None, "while it is not followed"


def test_a_velocity_that_changes_at_once_is_not_told_of() -> None:
    steps = [moving(0.5 * (step % 2), 0.0, 0.0) for step in range(5)]
    assert limits_told(lambda t: steps[int(t / 2.0)], 9.0) == {None}
    places = [at(0.0, 0.0, 2.0, velocity=(0.6 * (step % 2), 0.0, 0.0)) for step in range(5)]
    assert limits_told(lambda t: places[int(t / 2.0)], 9.0) == {None}


def test_a_relative_setpoint_is_from_where_the_load_is() -> None:
    sky = offboard(at(0.0, 0.0, 2.0))
    assert sky.ask(at(1.0, math.nan, math.nan, relative=True)).result == ACCEPTED
    asked = sky.flight.setpoints.offboard.setpoint
    assert isinstance(asked, PositionSetpoint)
    assert asked.position[0] == pytest.approx(sky.view.x_load[0] + 1.0)
    assert math.isnan(asked.position[1])


def test_setpoints_for_the_vehicle_are_a_cable_above_those_for_the_load() -> None:
    guided = replace(SETTINGS.setpoints, target_is_vehicle=True)
    sky = Sky(settings=replace(SETTINGS, setpoints=guided)).airborne()
    sky.ask(at(0.0, 0.0, 5.0))
    asked = sky.flight.setpoints.offboard.setpoint
    assert isinstance(asked, PositionSetpoint)
    assert asked.position[2] == pytest.approx(5.0 - CABLE_LENGTH)


def test_offboard_that_asks_for_nothing_above_the_ground_is_disarmed_with_the_reason() -> None:
    for asked in (FollowAttitude((0.0, 0.0, 1.0), 0.7), at(0.0, 0.0, 0.0)):
        sky = Sky()
        stream(sky, asked, 0.1)
        assert sky.ask(OFFBOARD).result == ACCEPTED
        assert sky.ask(Arm(True, False)).result == ACCEPTED
        stream(sky, asked, 9.9)
        assert sky.flight.phase == Phase.ARMED
        stream(sky, asked, 0.2)
        assert sky.flight.phase == Phase.DISARMED
        assert "Disarmed: no setpoint (position or velocity) above the ground for 10 s" in sky.texts


def test_offboard_from_the_ground_takes_off_when_asked_up() -> None:
    sky = Sky()
    stream(sky, at(0.0, 0.0, 0.0), 0.1)
    assert sky.ask(OFFBOARD).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert reported_mode(sky.flight) == (identity.OFFBOARD, 0)
    stream(sky, at(0.0, 0.0, 0.0), 1.0)
    assert sky.flight.phase == Phase.ARMED
    while sky.flight.phase != Phase.GUIDED:
        stream(sky, at(1.0, 0.0, 3.0), 0.1)
        assert reported_mode(sky.flight) == (identity.OFFBOARD, 0)
        assert sky.now_us < 60_000_000
    stream(sky, at(1.0, 0.0, 3.0), 8.0)
    assert norm(sub(sky.view.x_load, (1.0, 0.0, 3.0))) < 0.01


def test_an_attitude_is_followed_and_calmed_afterwards() -> None:
    lean = FollowAttitude((0.1, 0.0, math.sqrt(0.99)), 0.5)
    sky = offboard(lean)
    sky.tick()
    leg = sky.flight.legs[0]
    assert isinstance(leg, TrackAttitude)
    assert leg.setpoint.thrust_n == pytest.approx(SETTINGS.weight_n)
    stream(sky, lean, 1.0)
    stream(sky, at(0.0, 0.0, 2.0), 8.0)
    assert isinstance(sky.flight.legs[0], TrackPosition)
    stream(sky, lean, 0.5)
    assert isinstance(sky.flight.legs[0], TrackAttitude)
    assert sky.ask(Pause()).result == ACCEPTED
    sky.wait(6.0)
    assert sky.flight.phase == Phase.HOLD


@pytest.mark.parametrize(
    ("request_", "phase"), [(Pause(), Phase.HOLD), (Land(), Phase.LOWER), (ReturnHome(), Phase.RETURN)]
)
def test_commands_take_over(request_: Any, phase: Phase) -> None:
    sky = offboard(moving(1.0, 0.0, 0.0))
    stream(sky, moving(1.0, 0.0, 0.0), 3.0)
    assert sky.ask(request_).result == ACCEPTED
    sky.tick()
    assert sky.flight.phase == phase


def test_the_stick_leads_and_is_lost() -> None:
    sky = Sky().airborne()
    assert sky.ask(POSCTL) == Verdict(
        LATER, "POSCTL denied: no stick; send MANUAL_CONTROL or RC_CHANNELS_OVERRIDE"
    )
    poshold = SetMode(identity.POSCTL, 0, 16, "POSHOLD")
    assert sky.ask(poshold) == Verdict(
        LATER, "POSHOLD denied: no stick; send MANUAL_CONTROL or RC_CHANNELS_OVERRIDE"
    )
    stream(sky, FollowStick((1.0, 0.0, 0.0)), 0.1)
    assert sky.ask(POSCTL).result == ACCEPTED
    assert reported_mode(sky.flight) == (identity.POSCTL, 0)
    stream(sky, FollowStick((1.0, 0.0, 0.0)), 4.0)
    assert sky.view.v_load[0] == pytest.approx(SETTINGS.setpoints.stick_speed_m_s, rel=0.01)
    stream(sky, FollowStick(ZERO), 5.0)
    assert norm(sky.view.v_load) < 0.01
    sky.wait(1.0)
    assert sky.flight.phase == Phase.HOLD
    assert sky.texts[-1] == "Nothing usable from the stick any more: holding"


def test_an_orbit_is_flown_about_its_centre_without_a_stream() -> None:
    sky = Sky().airborne()
    assert sky.ask(Orbit(2.0, 1.0, 0.0, 0.0, 3.0)).result == ACCEPTED
    assert sky.flight.setpoints.source == SetpointSource.ORBIT
    sky.wait(20.0)
    x, v = sky.view.x_load, sky.view.v_load
    assert math.hypot(x[0], x[1]) == pytest.approx(2.0, abs=0.01)
    assert x[2] == pytest.approx(3.0, abs=0.01)
    assert x[0] * v[1] - x[1] * v[0] < 0.0  # clockwise
    assert reported_mode(sky.flight) == (identity.AUTO, identity.AUTO_LOITER)
    assert sky.ask(Orbit(-2.0, 1.0, 0.0, 0.0, 3.0)).result == ACCEPTED
    sky.wait(20.0)
    x, v = sky.view.x_load, sky.view.v_load
    assert x[0] * v[1] - x[1] * v[0] > 0.0


def test_the_nose_points_to_the_centre_of_a_circle_or_stays() -> None:
    sky = Sky().airborne()
    assert sky.ask(Orbit(2.0, 1.0, 0.0, 0.0, 3.0, faces_centre=True)).result == ACCEPTED
    sky.wait(20.0)
    x = sky.view.x_load
    assert (
        math.dist(
            (math.cos(sky.flight.heading.angle), math.sin(sky.flight.heading.angle)),
            (-x[0] / 2.0, -x[1] / 2.0),
        )
        < 0.02
    )
    assert sky.ask(Orbit(2.0, 1.0, 0.0, 0.0, 3.0)).result == ACCEPTED  # as before
    sky.wait(1.0)
    assert sky.flight.heading.aim == FacePoint((0.0, 0.0, 0.0))
    assert sky.ask(Orbit(2.0, 1.0, 0.0, 0.0, 3.0, faces_centre=False)).result == ACCEPTED
    sky.wait(5.0)
    assert sky.flight.heading.rate == 0.0
    refused = sky.flight
    assert sky.ask(Orbit(2.0, 1.0, 0.0, 0.0, 0.1, faces_centre=True)).result == DENIED
    assert sky.flight == refused


def test_a_circle_without_numbers_is_that_being_flown_or_the_vehicles() -> None:
    sky = Sky().airborne()
    here = sky.view.x_load
    assert sky.ask(Orbit(None, None, None, None, None)).result == ACCEPTED
    circle = sky.flight.setpoints.circle
    assert circle is not None and circle.centre == pytest.approx(here)
    speed = sky.flight.mission.speed_m_s
    assert abs(circle.rate) * circle.radius == pytest.approx(speed)
    assert speed * speed / circle.radius <= 0.5 * SETTINGS.motion.accel_m_s2 + 1e-9
    assert sky.ask(Orbit(-3.0, 0.5, 1.0, 2.0, 3.0)).result == ACCEPTED
    sky.wait(5.0)
    assert sky.ask(Orbit(None, None, None, None, 4.0)).result == ACCEPTED
    circle = sky.flight.setpoints.circle
    assert circle is not None
    assert (circle.centre, circle.radius) == ((1.0, 2.0, 4.0), 3.0)
    assert circle.rate == pytest.approx(0.5 / 3.0)  # counter-clockwise, as before


@pytest.mark.parametrize(
    ("orbit", "reason"),
    [
        (Orbit(1e9, 1.0, None, None, None), "radius 1e+09 m; must be 0.2 ... 100000 m"),
        (Orbit(2.0, 1.0, 1e9, None, None), "centre more than 100000 m from home"),
        (Orbit(2.0, 1.0, None, None, 0.1), "load height 0.10 m, min 0.3 m"),
        (Orbit(2.0, math.nan, None, None, None), "speed nan m/s; must be 0.05 ... 5 m/s"),
    ],
)
def test_the_refusal_of_a_circle_names_what_is_wrong(orbit: Orbit, reason: str) -> None:
    assert Sky().airborne().ask(orbit) == Verdict(DENIED, f"Orbit denied: {reason}")


@pytest.mark.parametrize("speed", [0.01, 15.1, 1e9])
def test_a_speed_that_cannot_be_flown_refuses_a_reposition(speed: float) -> None:
    sky = Sky().airborne()
    verdict = sky.ask(Reposition(3.0, 0.0, 2.0, True, speed))
    assert verdict == Verdict(DENIED, f"Reposition denied: speed {speed:.2f} m/s; must be 0.05 ... 15 m/s")
    assert sky.flight.phase == Phase.HOLD


def test_a_circle_of_so_many_turns_ends_in_a_hold() -> None:
    sky = Sky().airborne()
    begun_us = sky.now_us
    assert sky.ask(Orbit(2.0, 1.0, 0.0, 0.0, 3.0, turns=1.5)).result == ACCEPTED
    sky.run(lambda sky: sky.flight.phase == Phase.HOLD, 40.0)
    # 1.5 turns of radius 2 m at 1 m/s, and half of the ramp, 4 v / a, in which the speed is reached
    lasted = 1.5 * 2.0 * math.pi * 2.0 + 0.5 * 4.0 / SETTINGS.motion.accel_m_s2
    assert (sky.now_us - begun_us) * 1e-6 == pytest.approx(lasted, abs=0.05)
    assert sky.texts[-1] == "Circle flown: holding"
    sky.wait(5.0)
    assert norm(sky.view.v_load) < 1e-6


@pytest.mark.parametrize(
    "orbit",
    [
        Orbit(0.5, 2.0, None, None, None),
        Orbit(0.01, 0.1, None, None, None),
        Orbit(2.0, 0.0, None, None, None),
        Orbit(2.0, 1.0, None, None, 0.1),
        Orbit(2.0, math.nan, None, None, None),
        Orbit(math.nan, 1.0, None, None, None),
        Orbit(2.0, 1.0, math.inf, None, None),
    ],
)
def test_orbits_that_cannot_be_flown_are_refused(orbit: Orbit) -> None:
    sky = Sky().airborne()
    before = sky.flight
    verdict = sky.ask(orbit)
    assert verdict.result == DENIED and verdict.text
    assert sky.flight == before


def test_a_return_leads_to_the_home_that_was_set() -> None:
    sky = Sky().airborne()
    assert sky.ask(SetHome((3.0, 1.0, 0.2))).result == ACCEPTED
    assert sky.ask(SetHome((3.0, 1.0, 5.0))).result == DENIED
    assert sky.ask(ReturnHome()).result == ACCEPTED
    sky.run(lambda sky: sky.flight.phase == Phase.LOWER)
    assert norm(sub(sky.view.x_load, (3.0, 1.0, 2.0))) < 0.01


def test_the_pace_is_that_of_the_pendulum() -> None:
    sky = Sky().airborne()
    assert follow_limits(sky.flight, SETTINGS).rate == pytest.approx(3.5 * math.sqrt(9.81 / 0.7))


# ---- ArduPilot's GUIDED

ARDUPILOT = replace(SETTINGS, setpoints=replace(SETTINGS.setpoints, ardupilot_guided=True))
GUIDED = SetMode(identity.AUTO, identity.AUTO_LOITER, number=4)
LOITER = SetMode(identity.AUTO, identity.AUTO_LOITER, number=5)


def guided() -> Sky:
    """Set GUIDED, arm and take off as ArduPilot's clients do, which request GUIDED again on the way."""
    sky = Sky(settings=ARDUPILOT)
    for request in (GUIDED, Arm(True, False), Takeoff(2.0)):
        assert sky.ask(request).result == ACCEPTED
    sky.run(lambda sky: sky.flight.phase == Phase.LIFT)
    assert sky.ask(GUIDED).result == ACCEPTED
    assert sky.flight.phase == Phase.LIFT
    sky.run(lambda sky: sky.flight.phase == Phase.HOLD)
    return sky


def test_one_place_is_enough_in_guided() -> None:
    sky = guided()
    assert sky.ask(at(2.0, 1.0, 3.0)).result == ACCEPTED
    sky.wait(12.0)
    assert sky.flight.phase == Phase.GUIDED
    assert norm(sub(sky.view.x_load, (2.0, 1.0, 3.0))) < 0.01
    assert sky.ask(GUIDED).result == ACCEPTED
    assert sky.flight.phase == Phase.GUIDED
    assert identity.ARDUPILOT.mode(*reported_mode(sky.flight)).name == "GUIDED"  # type: ignore[union-attr]


def test_a_velocity_in_guided_ceases_after_its_time() -> None:
    sky = guided()
    assert sky.ask(moving(1.0, 0.0, 0.0)).result == ACCEPTED
    sky.wait(ARDUPILOT.setpoints.guided_loss_us * 1e-6 - 0.1)
    assert sky.flight.phase == Phase.GUIDED and sky.view.v_load[0] > 0.9
    sky.wait(0.2)
    assert sky.flight.phase == Phase.HOLD
    sky.wait(5.0)
    assert norm(sky.view.v_load) < 1e-6
    assert sky.ask(at(0.0, 0.0, 2.0)).result == ACCEPTED
    assert sky.flight.phase == Phase.GUIDED


@pytest.mark.parametrize("mode", [LOITER, SetMode(identity.AUTO, identity.AUTO_RTL, number=6)])
def test_setpoints_are_followed_in_guided_only(mode: SetMode) -> None:
    sky = guided()
    assert sky.ask(mode).result == ACCEPTED
    before = sky.flight.phase
    assert sky.ask(at(2.0, 1.0, 3.0)).result == ACCEPTED
    assert sky.flight.phase == before
    assert sky.ask(GUIDED).result == ACCEPTED
    assert sky.ask(at(2.0, 1.0, 3.0)).result == ACCEPTED
    assert sky.flight.phase == Phase.GUIDED


def test_a_setpoint_ends_a_circle_in_guided() -> None:
    sky = guided()
    assert sky.ask(Orbit(2.0, 1.0, 0.0, 0.0, 3.0)).result == ACCEPTED
    sky.wait(3.0)
    assert sky.ask(at(0.0, 0.0, 2.0)).result == ACCEPTED
    assert sky.flight.setpoints.source == SetpointSource.OFFBOARD


def test_with_other_identities_holding_heeds_no_setpoint() -> None:
    sky = Sky().airborne()
    assert sky.ask(at(2.0, 1.0, 3.0)).result == ACCEPTED
    assert sky.flight.phase == Phase.HOLD


# ---- any requests, in any order

number = st.floats(-30.0, 30.0) | st.just(math.nan)
triple = st.tuples(number, number, number)
some_request = (
    st.builds(FollowSetpoint, triple, triple, triple, st.booleans())
    | st.builds(FollowStick, st.tuples(*[st.floats(-1.0, 1.0)] * 3))
    | st.builds(Orbit, number, number, st.none() | number, st.none() | number, st.none() | number)
    | st.sampled_from([OFFBOARD, POSCTL, Pause(), ReturnHome(), Land(), SetHome(None)])
    | st.just(FollowAttitude((0.0, 0.0, 1.0), None))
)


@settings(max_examples=25, deadline=None)
@given(st.lists(some_request, max_size=12))
def test_any_requests_in_any_order_leave_something_to_fly(requests: list[Any]) -> None:
    sky = Sky().airborne()
    for request in requests:
        sky.ask(request)
        for _ in range(5):
            sky.tick()
            assert sky.flight.phase != Phase.FAILSAFE, sky.texts
            for leg in sky.flight.legs[:1]:
                t = (sky.now_us - sky.flight.leg_start_us) * 1e-6
                assert all(math.isfinite(value) for row in leg.jet(t) for value in row)
