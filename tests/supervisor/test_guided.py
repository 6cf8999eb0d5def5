"""Setpoints, sticks and circles: what is asked, and how the load follows it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.geometry.linear import ZERO, Vec3, norm, sub
from autopilot.guidance.legs import LOAD_POSITION, transfer_leg
from autopilot.guidance.setpoint_follower import (
    NOWHERE,
    Circle,
    Follow,
    FollowLimits,
    PositionSetpoint,
    Posture,
    begin_following,
    governed,
)
from autopilot.onboard.snapshot import mode_of
from autopilot.services import identity
from autopilot.services.requests import (
    Arm,
    FollowAttitude,
    FollowSetpoint,
    FollowStick,
    Land,
    Orbit,
    Pause,
    ReturnHome,
    SetHome,
    SetMode,
    Takeoff,
)
from autopilot.supervisor.state import Guide, Phase, pace_of, setpoint
from autopilot.wire.dialect import plumbline as m
from missions import model
from tests.doubles.craft import Craft
from tests.doubles.motion import CABLE_LENGTH, TICK_S
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, Sky

OFFBOARD = SetMode(identity.OFFBOARD, 0)
POSCTL = SetMode(identity.POSCTL, 0)
DENIED, LATER = m.MAV_RESULT_DENIED, m.MAV_RESULT_TEMPORARILY_REJECTED
PACE = FollowLimits(1.5, 5.0, 1.5, 13.1)


def at(*position: float, **more: Any) -> FollowSetpoint:
    x, y, z = position
    return FollowSetpoint((x, y, z), more.get("velocity", NOWHERE), NOWHERE, more.get("relative", False))


def moving(*velocity: float) -> FollowSetpoint:
    vx, vy, vz = velocity
    return FollowSetpoint(NOWHERE, (vx, vy, vz), NOWHERE, False)


def stream(sky: Sky, request: Any, seconds: float) -> None:
    """The request at every tick, 50 Hz."""
    for _ in range(round(seconds * 1e6 / STEP_US)):
        assert sky.ask(request).result == ACCEPTED
        sky.tick()


def offboard(request: Any) -> Sky:
    sky = Sky().airborne()
    stream(sky, request, 0.1)
    assert sky.ask(OFFBOARD).result == ACCEPTED
    return sky


# ---- the motion


def led(
    asked: PositionSetpoint | Circle, seconds: float, leg: Follow | None = None, begin_us: int = 0
) -> list[Any]:
    """Jets at every 20 ms on the way."""
    leg = leg or begin_following((ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), PACE.rate)
    found = []
    for k in range(round(seconds / 0.02)):
        now_us = begin_us + 20_000 * k
        leg = leg.onward(0.02 if k else 0.0, asked, PACE, now_us)
        found.append(leg.jet(0.0))
    return [*found, leg]


finite = st.floats(-20.0, 20.0)
vectors = st.tuples(finite, finite, finite)


@settings(max_examples=40, deadline=None)
@given(asked=st.lists(vectors, min_size=2, max_size=5), kinds=st.lists(st.booleans(), min_size=5, max_size=5))
def test_no_derivative_jumps_whatever_is_asked(asked: list[Vec3], kinds: list[bool]) -> None:
    leg = begin_following(((0.0, 0.0, 5.0), ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), PACE.rate)
    now_us = 0
    for vector, is_place in zip(asked, kinds, strict=False):
        wish = (
            PositionSetpoint(vector, NOWHERE, NOWHERE, now_us)
            if is_place
            else PositionSetpoint(velocity=vector, since_us=now_us)
        )
        for _ in range(10):
            now_us += 20_000
            after = leg.onward(0.02, wish, PACE, now_us)
            for n, (before_, after_) in enumerate(zip(leg.jet(0.02), after.jet(0.0), strict=True)):
                # derivative n is of the size rate^n of what is moved, and is kept to rounding
                assert norm(sub(before_, after_)) <= 1e-9 * 40.0 * PACE.rate**n
            leg = after


@settings(max_examples=60, deadline=None)
@given(at_s=st.floats(0.0, 9.7), place=vectors, is_place=st.booleans())
def test_from_any_motion_it_goes_on_within_the_acceleration(at_s: float, place: Vec3, is_place: bool) -> None:
    before = transfer_leg((0.0, 0.0, 3.0), (10.0, 0.0, 3.0), 3.0, PACE.accel, LOAD_POSITION)
    wish = PositionSetpoint(place) if is_place else PositionSetpoint(velocity=place)
    *jets, _ = led(wish, 3.0, begin_following(before.jet(at_s), PACE.rate))
    # 300 of them: 1.50 m/s^2 and 5.9 m/s^3; with a point begun at the velocity alone 1.63 and 16.5
    assert max(norm(jet[2]) for jet in jets) < 1.05 * PACE.accel
    assert max(norm(jet[3]) for jet in jets) < 8.0


@settings(max_examples=60, deadline=None)
@given(height=st.floats(0.3, 6.0), wish=vectors, seconds=st.floats(0.1, 8.0))
def test_it_comes_to_rest_over_the_floor_wherever_it_was_led(
    height: float, wish: Vec3, seconds: float
) -> None:
    leg = begin_following(((0.0, 0.0, height), ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), PACE.rate)
    *_, leg = led(PositionSetpoint(velocity=wish), seconds, leg)
    legs, end = leg.stopped(0.013, PACE.accel)
    last = leg.jet(0.013)
    for leg in legs:
        for n, (before_, after_) in enumerate(zip(last, leg.jet(0.0), strict=True)):
            assert norm(sub(before_, after_)) <= 1e-9 * 40.0 * PACE.rate**n
        for k in range(21):
            jet = leg.jet(k / 20 * leg.duration_s)
            # 300 of them: no lower than 0.29999 m, and 1.50 m/s^2
            assert jet[0][2] > 0.299
            assert norm(jet[2]) < 1.05 * PACE.accel
        last = leg.jet(leg.duration_s)
    assert norm(sub(last[0], end)) < 1e-9 and norm(last[1]) < 1e-9


def test_derivatives_are_those_of_the_motion() -> None:
    *_, leg = led(PositionSetpoint((3.0, -2.0, 4.0)), 1.0)
    h = 1e-4
    for n in range(6):
        change = sub(leg.jet(0.1 + h)[n], leg.jet(0.1 - h)[n])
        slope = leg.jet(0.1)[n + 1]
        wrong = norm(
            (change[0] / (2 * h) - slope[0], change[1] / (2 * h) - slope[1], change[2] / (2 * h) - slope[2])
        )
        # a central difference is wrong by h^2 / 6 of the derivative two orders on
        assert wrong < 1e-5 * PACE.rate ** (n + 1) + 1e-6


def test_a_far_place_is_reached_within_speed_and_acceleration_and_not_overshot() -> None:
    *jets, leg = led(PositionSetpoint((12.0, 0.0, 3.0)), 15.0)
    assert norm(sub(leg.jet(0.0)[0], (12.0, 0.0, 3.0))) < 1e-3
    assert max(norm(jet[1]) for jet in jets) < 1.001 * PACE.speed
    assert max(norm(jet[2]) for jet in jets) < 1.001 * PACE.accel
    assert max(jet[0][0] for jet in jets) < 12.001  # measured: 4 um short of it


def test_a_velocity_is_reached_and_held_and_stops() -> None:
    *_, leg = led(PositionSetpoint((math.nan, math.nan, 2.0), (2.0, 1.0, math.nan)), 6.0)
    assert norm(sub(leg.jet(0.0)[1], (2.0, 1.0, 0.0))) < 1e-2
    *_, leg = led(PositionSetpoint(velocity=ZERO), 6.0, leg)
    assert norm(leg.jet(0.0)[1]) < 1e-3
    still = leg.jet(0.0)[0]
    *_, leg = led(PositionSetpoint(velocity=ZERO), 5.0, leg)
    assert norm(sub(leg.jet(0.0)[0], still)) < 1e-3


def test_no_velocity_leads_below_the_floor() -> None:
    leg = begin_following(((0.0, 0.0, 3.0), ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), PACE.rate)
    *jets, leg = led(PositionSetpoint(velocity=(0.0, 0.0, -3.0)), 12.0, leg)
    assert 0.27 < min(jet[0][2] for jet in jets) <= leg.jet(0.0)[0][2] + 0.03
    assert leg.jet(0.0)[0][2] == pytest.approx(0.3, abs=0.02)


def test_a_place_that_moves_is_followed_without_lag() -> None:
    *_, leg = led(PositionSetpoint(ZERO, (1.0, 0.0, 0.0)), 10.0)
    # the last update was at 9.98 s
    assert leg.jet(0.0)[0][0] == pytest.approx(9.98, abs=5e-3)


def test_a_circle_is_flown_on_its_radius() -> None:
    circle = Circle((0.0, 0.0, 3.0), 2.0, 0.6, 0.0, 0, 3.0)
    *jets, _ = led(circle, 30.0)
    for jet in jets[-300:]:
        assert math.hypot(jet[0][0], jet[0][1]) == pytest.approx(2.0, abs=2e-3)
        assert norm(jet[1]) == pytest.approx(1.2, abs=2e-3)


@given(x=vectors, v=vectors, place=vectors, now=st.integers(0, 10**9))
def test_the_governor_never_asks_for_more_than_its_acceleration(
    x: Vec3, v: Vec3, place: Vec3, now: int
) -> None:
    point = governed(x, v, PositionSetpoint(place, v, x, 0), PACE, now)
    assert all(map(math.isfinite, (*point[0], *point[1], *point[2])))
    assert norm(point[2]) <= PACE.accel * 1.000001


# ---- the supervisor


def test_offboard_needs_a_stream() -> None:
    sky = Sky().airborne()
    before = sky.flight
    verdict = sky.ask(OFFBOARD)
    assert verdict.result == LATER and verdict.text
    assert sky.flight == before
    assert sky.ask(at(1.0, 0.0, 2.0)).result == ACCEPTED
    sky.wait(0.6)
    assert sky.ask(OFFBOARD).result == LATER  # that was too long ago
    assert sky.ask(at(1.0, 0.0, 2.0)).result == ACCEPTED
    assert sky.ask(OFFBOARD).result == ACCEPTED
    assert mode_of(sky.flight) == (identity.OFFBOARD, 0)


def test_offboard_brings_the_load_to_the_setpoint_and_holds_when_it_is_lost() -> None:
    sky = offboard(at(3.0, -1.0, 2.5))
    stream(sky, at(3.0, -1.0, 2.5), 12.0)
    assert norm(sub(sky.view.x_load, (3.0, -1.0, 2.5))) < 0.01
    assert sky.flight.phase == Phase.GUIDED
    sky.wait(SETTINGS.setpoints.offboard_loss_us * 1e-6 - 0.05)
    assert sky.flight.phase == Phase.GUIDED
    sky.wait(0.2)
    assert sky.flight.phase == Phase.HOLD
    assert sky.texts[-1] == "Nothing heard from setpoints any more: holding"
    assert norm(sub(sky.view.x_load, (3.0, -1.0, 2.5))) < 0.01


def test_a_relative_setpoint_is_from_where_the_load_is() -> None:
    sky = offboard(at(0.0, 0.0, 2.0))
    assert sky.ask(at(1.0, math.nan, math.nan, relative=True)).result == ACCEPTED
    asked = sky.flight.setpoints.offboard.asked
    assert isinstance(asked, PositionSetpoint)
    assert asked.position[0] == pytest.approx(sky.view.x_load[0] + 1.0)
    assert math.isnan(asked.position[1])


def test_setpoints_for_the_vehicle_are_a_cable_above_those_for_the_load() -> None:
    sky = Sky(
        settings=replace(SETTINGS, setpoints=replace(SETTINGS.setpoints, guides_vehicle=True))
    ).airborne()
    sky.ask(at(0.0, 0.0, 5.0))
    asked = sky.flight.setpoints.offboard.asked
    assert isinstance(asked, PositionSetpoint)
    assert asked.position[2] == pytest.approx(5.0 - CABLE_LENGTH)


def test_offboard_from_the_ground_takes_off_when_asked_up() -> None:
    sky = Sky()
    stream(sky, at(0.0, 0.0, 0.0), 0.1)
    assert sky.ask(OFFBOARD).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert mode_of(sky.flight) == (identity.OFFBOARD, 0)
    stream(sky, at(0.0, 0.0, 0.0), 1.0)
    assert sky.flight.phase == Phase.ARMED
    while sky.flight.phase != Phase.GUIDED:
        stream(sky, at(1.0, 0.0, 3.0), 0.1)
        assert mode_of(sky.flight) == (identity.OFFBOARD, 0)
        assert sky.now_us < 60_000_000
    stream(sky, at(1.0, 0.0, 3.0), 8.0)
    assert norm(sub(sky.view.x_load, (1.0, 0.0, 3.0))) < 0.01


def test_an_attitude_is_followed_and_calmed_afterwards() -> None:
    lean = FollowAttitude((0.1, 0.0, math.sqrt(0.99)), 0.5)
    sky = offboard(lean)
    sky.tick()
    leg = sky.flight.legs[0]
    assert isinstance(leg, Posture)
    assert leg.lean.thrust_n == pytest.approx(SETTINGS.weight_n)
    stream(sky, lean, 1.0)
    stream(sky, at(0.0, 0.0, 2.0), 8.0)
    assert isinstance(sky.flight.legs[0], Follow)
    stream(sky, lean, 0.5)
    assert isinstance(sky.flight.legs[0], Posture)
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
    assert sky.ask(POSCTL).result == LATER
    stream(sky, FollowStick((1.0, 0.0, 0.0)), 0.1)
    assert sky.ask(POSCTL).result == ACCEPTED
    assert mode_of(sky.flight) == (identity.POSCTL, 0)
    stream(sky, FollowStick((1.0, 0.0, 0.0)), 4.0)
    assert sky.view.v_load[0] == pytest.approx(SETTINGS.setpoints.stick_speed_m_s, rel=0.01)
    stream(sky, FollowStick(ZERO), 5.0)
    assert norm(sky.view.v_load) < 0.01
    sky.wait(1.0)
    assert sky.flight.phase == Phase.HOLD
    assert sky.texts[-1] == "Nothing heard from the stick any more: holding"


def test_an_orbit_is_flown_about_its_centre_without_a_stream() -> None:
    sky = Sky().airborne()
    assert sky.ask(Orbit(2.0, 1.0, 0.0, 0.0, 3.0)).result == ACCEPTED
    assert sky.flight.setpoints.guide == Guide.ORBIT
    sky.wait(20.0)
    x, v = sky.view.x_load, sky.view.v_load
    assert math.hypot(x[0], x[1]) == pytest.approx(2.0, abs=0.01)
    assert x[2] == pytest.approx(3.0, abs=0.01)
    assert x[0] * v[1] - x[1] * v[0] < 0.0  # clockwise
    assert mode_of(sky.flight) == (identity.AUTO, identity.AUTO_LOITER)
    assert sky.ask(Orbit(-2.0, 1.0, 0.0, 0.0, 3.0)).result == ACCEPTED
    sky.wait(20.0)
    x, v = sky.view.x_load, sky.view.v_load
    assert x[0] * v[1] - x[1] * v[0] > 0.0


def test_a_circle_of_so_many_turns_ends_in_a_hold() -> None:
    sky = Sky().airborne()
    begun_us = sky.now_us
    assert sky.ask(Orbit(2.0, 1.0, 0.0, 0.0, 3.0, turns=1.5)).result == ACCEPTED
    sky.run(lambda sky: sky.flight.phase == Phase.HOLD, 40.0)
    # 1.5 turns of 2 m at 1 m/s, and half of the ramp, 4 v / a, in which the speed is reached
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
    assert pace_of(sky.flight, SETTINGS).rate == pytest.approx(3.5 * math.sqrt(9.81 / 0.7))


# ---- ArduPilot's GUIDED

ARDUPILOT = replace(SETTINGS, setpoints=replace(SETTINGS.setpoints, guided_mode=True))
GUIDED = SetMode(identity.AUTO, identity.AUTO_LOITER, number=4)
LOITER = SetMode(identity.AUTO, identity.AUTO_LOITER, number=5)


def guided() -> Sky:
    """GUIDED, armed, taken off, as ArduPilot's clients do it; GUIDED is asked for again on the way."""
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
    assert identity.ARDUPILOT.mode(*mode_of(sky.flight)).name == "GUIDED"  # type: ignore[union-attr]


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
    assert sky.flight.setpoints.guide == Guide.OFFBOARD


def test_with_other_identities_holding_heeds_no_setpoint() -> None:
    sky = Sky().airborne()
    assert sky.ask(at(2.0, 1.0, 3.0)).result == ACCEPTED
    assert sky.flight.phase == Phase.HOLD


# ---- in flight


def test_steps_of_an_offboard_stream_in_the_simulator() -> None:
    craft = Craft()
    craft.wait(1.0)
    assert craft.command(m.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 2.0) == ACCEPTED
    assert craft.command(m.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    craft.run(lambda craft: craft.flight.phase == Phase.HOLD)

    def say(n: float, e: float, d: float) -> None:
        craft.send(
            m.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, 1, 0x9F8, n, e, d, 0, 0, 0, 0, 0, 0, 0, 0
            )
        )

    def follow(n: float, e: float, d: float, seconds: float) -> float:
        """Worst distance of the load from its own reference."""
        worst = 0.0
        for k in range(round(seconds / TICK_S)):
            if k % 12 == 0:
                say(n, e, d)
            craft.tick()
            if isinstance(craft.flight.legs[0], Follow):
                t = (craft.onboard.now_us - craft.flight.leg_start_us) * 1e-6
                worst = max(worst, norm(sub(craft.truth.x_load, craft.flight.legs[0].jet(t)[0])))
        return worst

    follow(0.0, 0.0, -2.0, 0.3)
    assert craft.command(m.MAV_CMD_DO_SET_MODE, 1.0, 6.0) == ACCEPTED
    worst = max(follow(2.0, 0.0, -2.0, 4.0), follow(2.0, 3.0, -3.0, 5.0), follow(-1.0, 0.0, -2.0, 6.0))
    # measured 6 mm on the way and 7 mm in the end; a step that is not smoothed throws the load by decimetres
    assert worst < 0.02
    assert norm(sub(craft.truth.x_load, (0.0, -1.0, 2.0))) < 0.02
    craft.wait(1.5)
    assert craft.flight.phase == Phase.HOLD


def test_offboard_hold_and_mission_follow_each_other_in_full_motion() -> None:
    """Each takes the load over while it moves, descends and brakes."""
    square = tuple(model.Waypoint(x, y, 2.0) for x, y in ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))
    craft = Craft(model.Takeoff(2.0), *square)
    craft.wait(1.0)
    assert craft.command(m.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 3.0) == ACCEPTED
    assert craft.command(m.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    craft.run(lambda craft: craft.flight.phase == Phase.HOLD)
    hold, mission, offboard = (1.0, 4.0, 3.0), (1.0, 4.0, 4.0), (1.0, 6.0)
    worst, lowest = 0.0, math.inf

    def fly(seconds: float, velocity: Vec3 | None = None) -> None:
        nonlocal worst, lowest
        for k in range(round(seconds / TICK_S)):
            if velocity is not None and k % 12 == 0:
                craft.send(
                    m.MAVLink_set_position_target_local_ned_message(
                        0, 1, 1, 1, 0xDC7, 0, 0, 0, *velocity, 0, 0, 0, 0, 0
                    )
                )
            craft.tick()
            jet = setpoint(craft.flight, craft.onboard.now_us)
            assert jet is not None
            worst = max(worst, norm(sub(craft.truth.x_load, jet[0])))
            lowest = min(lowest, craft.truth.x_load[2])

    fly(0.1, (0.0, 0.0, 0.0))
    for mode in (offboard, hold, mission, offboard, mission, offboard, hold, mission):
        assert craft.command(m.MAV_CMD_DO_SET_MODE, *mode) == ACCEPTED
        if mode == offboard:
            fly(2.5, (2.5, -1.0, 1.5))
        else:
            fly(0.4)
            fly(0.1, (2.5, -1.0, 1.5))  # heard, not followed
    craft.run(lambda craft: craft.flight.mission.step >= 2)  # the first waypoint is passed
    assert not any("given up" in text or "slack" in text for text in craft.texts)
    # measured 11 mm from the reference and 0.279 m; a stop that coasted on downwards ended on the ground
    assert worst < 0.025
    assert lowest > 0.26


# ---- whatever is asked, in any order

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
