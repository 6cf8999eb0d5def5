"""What the supervisor answers to a request, and what becomes of the flight by it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from autopilot.geometry.linear import Vec3, add, norm, scale, sub
from autopilot.guidance.legs import Hold, carry_leg, reel_leg, top_of
from autopilot.guidance.setpoint_follower import NEVER_US, AttitudeSetpoint, Circle, PositionSetpoint, Stream
from autopilot.services import identity
from autopilot.services.records import Verdict
from autopilot.services.requests import (
    Arm,
    ChangeAltitude,
    ChangeSpeed,
    Continue,
    FollowAttitude,
    FollowSetpoint,
    FollowStick,
    Grab,
    Land,
    Orbit,
    Pause,
    Release,
    ReplaceMission,
    Reposition,
    ReturnHome,
    RunPrearmChecks,
    SetCurrent,
    SetHome,
    SetMode,
    StartMission,
    Takeoff,
    Terminate,
    Winch,
)
from autopilot.supervisor.advance import (
    RELEASED_TEXT,
    TRANSITIONS,
    begin_step,
    disarmed,
    happen,
    release,
)
from autopilot.supervisor.mission_checks import (
    LEAST_ALTITUDE_M,
    lift_altitude_m,
    mission_trouble,
    reel_trouble,
    upload_trouble,
)
from autopilot.supervisor.phase_legs import LEAST_REEL_M, as_flown, asked_motion, length_at, stop
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    ON_GROUND,
    Event,
    Flight,
    Guide,
    MissionPlan,
    Phase,
    Selected,
    View,
    below,
    forbidden,
    off_mission,
)
from autopilot.wire.dialect import plumbline as mavlink
from missions import model

ACCEPTED = Verdict(mavlink.MAV_RESULT_ACCEPTED)
GROUND_SPEED_M_S = 0.3  # an arming vehicle moves no faster
TILT_TO_ARM_RAD = math.radians(20.0)
FARTHEST_M = 100_000.0
LEAST_RADIUS_M = 0.2
LEAST_SPEED_M_S = 0.05
RAMP_SHARE = 4.0  # a circle is begun with a quarter of the acceleration along it
STREAM_US = 500_000  # a stream is there where its last setpoint is no older: two a second
LEVEL_HOME_M = 1.0
CIRCLE_POINTS = 72
LONGEST_CIRCLE_S = 1e9
SLOWEST_M_S, FASTEST_M_S = 0.05, 15.0
LEAST_REEL_M_S = 0.01


def _denied(text: str) -> Verdict:
    return Verdict(mavlink.MAV_RESULT_DENIED, text)


def _later(text: str) -> Verdict:
    return Verdict(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, text)


def _wrong_phase(flight: Flight, what: str) -> Verdict:
    return _later(f"{what} denied while {flight.phase.name.lower()}")


Decision = tuple[Flight, Verdict]


def decide(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """The flight after the request, and the verdict on it; an unknown request is unsupported."""
    handler = _HANDLERS.get(type(request))
    if handler is None:
        return flight, Verdict(mavlink.MAV_RESULT_UNSUPPORTED)
    return handler(flight, request, view, settings)


def arming_complaints(flight: Flight, view: View, settings: Settings) -> tuple[str, ...]:
    """What keeps the vehicle from being armed, in words."""
    found = list(view.complaints)
    if not view.tilt_rad <= TILT_TO_ARM_RAD:
        found.append(f"tilted by {math.degrees(view.tilt_rad):.0f} deg")
    if not norm(view.v_quad) <= GROUND_SPEED_M_S:
        found.append(f"moving at {norm(view.v_quad):.1f} m/s")
    place = below(view.x_quad, settings) if flight.cable.released else view.x_load
    where = forbidden(flight.area.fence, place, settings) if settings.fence.action else ""
    if where:
        found.append(where)
    return tuple(found)


def _arm(flight: Flight, request: Arm, view: View, settings: Settings) -> Decision:
    if not request.arm:
        if flight.phase == Phase.DISARMED:
            return flight, ACCEPTED
        if flight.phase not in ON_GROUND and not request.force:
            return flight, _denied("Disarming denied: in the air")
        after = happen(flight, Event.DISARM, view, settings)
        return (disarmed(after), ACCEPTED) if after else (flight, _denied("Disarming denied"))
    if flight.phase == Phase.ARMED:
        return flight, ACCEPTED
    if flight.phase != Phase.DISARMED:
        return flight, _denied("Arming denied: in the air")
    complaints = arming_complaints(flight, view, settings)
    if complaints and not request.force:
        return flight, _denied(f"Arming denied: {complaints[0]}")
    after = happen(flight, Event.ARM, view, settings)
    assert after is not None
    if flight.selected == Selected.MISSION:
        begun, verdict = _begin_mission(after, view, settings)
        return (begun if verdict.result == ACCEPTED.result else flight), verdict
    if flight.selected == Selected.TAKEOFF:
        return _take_off(after, view, settings), ACCEPTED
    return after, ACCEPTED


def _take_off(flight: Flight, view: View, settings: Settings) -> Flight:
    after = happen(
        replace(flight, mission=replace(flight.mission, speed_m_s=settings.motion.speed_m_s)),
        Event.TAKEOFF,
        view,
        settings,
    )
    assert after is not None
    return after


def _takeoff(flight: Flight, request: Takeoff, view: View, settings: Settings) -> Decision:
    altitude = settings.motion.takeoff_altitude_m if request.altitude_m is None else request.altitude_m
    if not altitude >= LEAST_ALTITUDE_M:
        return flight, _denied(f"Take-off denied: load height {altitude:.2f} m, least {LEAST_ALTITUDE_M} m")
    flight_up = replace(
        flight,
        mission=replace(flight.mission, takeoff_altitude_m=altitude, active=False),
        selected=Selected.TAKEOFF,
    )
    if flight.phase == Phase.DISARMED:
        return flight_up, ACCEPTED
    if flight.phase == Phase.ARMED:
        return _take_off(flight_up, view, settings), ACCEPTED
    return flight, _denied("Take-off denied: in the air")


def _begin_mission(flight: Flight, view: View, settings: Settings) -> Decision:
    """Start the mission at `flight.step`, from the ground or from the air."""
    before, plan = flight, flight.mission.plan
    if not plan.steps:
        return flight, _denied("Mission denied: there is none")
    if plan.prepared.pending:
        return flight, Verdict(mavlink.MAV_RESULT_IN_PROGRESS, "Mission begins when its paths are prepared")
    trouble = mission_trouble(flight, view, settings)
    if trouble:
        return flight, _denied(f"Mission denied: {trouble}")
    if plan.prepared.refusal:
        return flight, _denied(f"Mission denied: {plan.prepared.refusal}")
    if flight.phase == Phase.DISARMED:
        return replace(flight, selected=Selected.MISSION), ACCEPTED
    flight = replace(
        flight, mission=replace(flight.mission, active=True, done=False), selected=Selected.MISSION
    )
    if flight.phase == Phase.ARMED:
        altitude = lift_altitude_m(plan, settings)
        return _take_off(
            replace(flight, mission=replace(flight.mission, takeoff_altitude_m=altitude)), view, settings
        ), ACCEPTED
    event = Event.LAND if isinstance(plan.steps[flight.mission.step], model.Land) else Event.MISSION
    if (before.phase, event) not in TRANSITIONS:
        return before, _wrong_phase(before, "Mission")
    return begin_step(flight, view, settings), ACCEPTED


def _start_mission(flight: Flight, request: StartMission, view: View, settings: Settings) -> Decision:
    before = flight
    if request.first is not None:
        flight, verdict = _set_current(flight, SetCurrent(request.first), view, settings)
        if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
            return before, verdict
    if flight.mission.active and flight.phase not in ON_GROUND and flight.phase != Phase.HOLD:
        return flight, ACCEPTED
    begun, verdict = _begin_mission(flight, view, settings)
    return (begun if verdict.result == mavlink.MAV_RESULT_ACCEPTED else before), verdict


def _set_current(flight: Flight, request: SetCurrent, view: View, settings: Settings) -> Decision:
    if not 0 <= request.seq < flight.mission.plan.items:
        return flight, _denied(
            f"Mission item {request.seq} denied: the mission has {flight.mission.plan.items}"
        )
    step = next((i for i, seq in enumerate(flight.mission.plan.sequence) if seq >= request.seq), None)
    if step is None:
        return flight, _denied(f"Mission item {request.seq} denied: nothing is flown from there")
    moved = replace(
        flight,
        mission=replace(flight.mission, step=step, step_anchor=None, done=False),
        cable=replace(flight.cable, reel_to_m=None),
    )
    if flight.mission.active and flight.phase == Phase.SET_DOWN:
        return flight, _wrong_phase(flight, f"Mission item {request.seq}")
    if flight.mission.active and flight.phase in (Phase.MISSION, Phase.LOWER):
        trouble = mission_trouble(moved, view, settings)
        if trouble:
            return flight, _denied(f"Mission item {request.seq} denied: {trouble}")
        return begin_step(moved, view, settings), ACCEPTED
    return moved, ACCEPTED


def _hold(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    if flight.phase in ON_GROUND:
        return replace(flight, selected=Selected.NOTHING), ACCEPTED
    after = happen(off_mission(flight), Event.HOLD, view, settings)
    return (after, ACCEPTED) if after else (flight, _wrong_phase(flight, "Hold"))


def _land(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    if flight.phase in ON_GROUND or flight.phase in (Phase.LOWER, Phase.SET_DOWN):
        return flight, ACCEPTED
    after = happen(off_mission(flight), Event.LAND, view, settings)
    return (after, ACCEPTED) if after else (flight, _wrong_phase(flight, "Landing"))


def _return_home(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    after = happen(off_mission(flight), Event.RETURN, view, settings)
    return (after, ACCEPTED) if after else (flight, _wrong_phase(flight, "Return"))


def _mode_takeoff(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    return _takeoff(flight, Takeoff(None), view, settings)


def _mode_mission(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    return _start_mission(flight, StartMission(None), view, settings)


def _offboard(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    if flight.phase == Phase.GUIDED and flight.setpoints.guide == Guide.OFFBOARD:
        return flight, ACCEPTED
    # one is enough: MAVSDK asks for the mode right behind its first
    if not flight.setpoints.offboard.alive(view.now_us, STREAM_US):
        return flight, _later("OFFBOARD denied: send setpoints first, more than two a second")
    if flight.phase in ON_GROUND:
        return replace(
            flight, selected=Selected.OFFBOARD, mission=replace(flight.mission, active=False)
        ), ACCEPTED
    return _guide(flight, Guide.OFFBOARD, "OFFBOARD", view, settings)


def _position_control(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    if not flight.setpoints.manual.alive(view.now_us, settings.setpoints.manual_loss_us):
        return flight, _later("POSCTL denied: no MANUAL_CONTROL is heard")
    if flight.phase in ON_GROUND:
        return flight, _later("POSCTL denied: take off first")
    return _guide(flight, Guide.MANUAL, "POSCTL", view, settings)


def _guide(flight: Flight, guide: Guide, what: str, view: View, settings: Settings) -> Decision:
    if flight.legs and top_of(flight.legs[0]) is not None:
        return flight, _later(f"{what} denied while the winch works")
    after = happen(
        replace(
            flight,
            setpoints=replace(flight.setpoints, guide=guide),
            mission=replace(flight.mission, active=False),
        ),
        Event.GUIDE,
        view,
        settings,
    )
    return (after, ACCEPTED) if after else (flight, _wrong_phase(flight, what))


_MODES: dict[tuple[int, int], Callable[[Flight, Any, View, Settings], Decision]] = {
    (identity.AUTO, identity.AUTO_TAKEOFF): _mode_takeoff,
    (identity.AUTO, identity.AUTO_LOITER): _hold,
    (identity.AUTO, identity.AUTO_MISSION): _mode_mission,
    (identity.AUTO, identity.AUTO_RTL): _return_home,
    (identity.AUTO, identity.AUTO_LAND): _land,
    (identity.OFFBOARD, 0): _offboard,
    (identity.POSCTL, 0): _position_control,
}


def _set_mode(flight: Flight, request: SetMode, view: View, settings: Settings) -> Decision:
    main, sub_mode = request.main, request.sub
    if (main, sub_mode) == (identity.AUTO, 0):
        sub_mode = identity.AUTO_MISSION
    handler = _MODES.get((main, sub_mode))
    if handler is None:
        return flight, _denied(f"Mode {main}/{sub_mode} denied: not flown by this vehicle")
    heeds = request.number in (None, identity.ARDUPILOT_GUIDED) or handler is not _hold
    if settings.setpoints.guided_mode and handler is _hold and heeds and _in_guided_mode(flight):
        return flight, ACCEPTED
    after, verdict = handler(flight, request, view, settings)
    return (replace(after, heeds=heeds) if verdict.result == ACCEPTED.result else after), verdict


def _in_guided_mode(flight: Flight) -> bool:
    """Whether what is flown is a part of ArduPilot's GUIDED: a take-off, the way to a place, setpoints."""
    if flight.mission.active:
        return False
    rising = flight.phase in (Phase.TAUTEN, Phase.LIFT) or (flight.phase == Phase.HOLD and flight.heeds)
    return rising or (flight.phase == Phase.GUIDED and flight.setpoints.guide != Guide.MANUAL)


def _replace_mission(flight: Flight, request: ReplaceMission, view: View, settings: Settings) -> Decision:
    if flight.mission.active and flight.phase not in ON_GROUND:
        return flight, _denied("Mission denied: the present one is being flown; pause it first")
    steps = tuple(located.step for located in request.steps)
    sequence = tuple(located.first for located in request.steps)
    beyond = upload_trouble(flight, steps, sequence, view, settings)
    if beyond:
        return flight, _denied(f"Mission denied: {beyond}")
    return flight, ACCEPTED


def _reposition(flight: Flight, request: Reposition, view: View, settings: Settings) -> Decision:
    if flight.phase not in CARRYING:
        return flight, _wrong_phase(flight, "Reposition")
    if flight.phase != Phase.HOLD and not request.change_mode:
        return flight, _later("Reposition denied: not holding")
    speed = flight.mission.speed_m_s if request.speed_m_s is None else request.speed_m_s
    if not SLOWEST_M_S <= speed <= FASTEST_M_S:
        return flight, _denied(f"Reposition denied: {speed:.2f} m/s; must be {SLOWEST_M_S} ... {FASTEST_M_S}")
    held, verdict = _hold(flight, request, view, settings)
    asked = (request.east_m, request.north_m, request.altitude_m)
    if verdict.result != mavlink.MAV_RESULT_ACCEPTED or asked == (None, None, None):
        return held, verdict
    resting = held.legs[-1]
    assert isinstance(resting, Hold)
    here = resting.position
    there: Vec3 = (
        here[0] if asked[0] is None else asked[0],
        here[1] if asked[1] is None else asked[1],
        here[2] if asked[2] is None else asked[2],
    )
    if not all(map(math.isfinite, there)):
        return flight, _denied("Reposition denied: not a place")
    if there[2] < LEAST_ALTITUDE_M:
        return flight, _denied(f"Reposition denied: load height {there[2]:.2f} m, least {LEAST_ALTITUDE_M} m")
    place = below(there, settings) if flight.cable.released else there
    beyond = forbidden(flight.area.fence, place, settings) if settings.fence.action else ""
    if beyond:
        return flight, _denied(f"Reposition denied: {beyond}")
    if norm(sub(there, here)) == 0.0:
        return held, ACCEPTED
    go = carry_leg(here, there, speed, settings.motion.accel_m_s2, settings.least_move_s)
    legs = as_flown(held, (*held.legs[:-1], go, Hold(there)))
    return replace(held, legs=legs, heeds=True), ACCEPTED


def _follow_setpoint(flight: Flight, request: FollowSetpoint, view: View, settings: Settings) -> Decision:
    position = request.position
    if request.relative:
        position = add(position, asked_motion(flight, view, settings)[0])
    elif settings.setpoints.guides_vehicle and not flight.cable.released:
        position = (position[0], position[1], position[2] - settings.cable_length_m)
    if any(abs(value) > FARTHEST_M for value in position):
        return flight, _denied(f"Setpoint refused: more than {FARTHEST_M:g} m away")
    asked = PositionSetpoint(position, request.velocity, request.accel, view.now_us)
    return _heed(
        replace(flight, setpoints=replace(flight.setpoints, offboard=Stream(asked, view.now_us))),
        view,
        settings,
    ), ACCEPTED


def _heed(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight after a setpoint: in ArduPilot's GUIDED a vehicle that holds or circles follows it."""
    circles = flight.phase == Phase.GUIDED and flight.setpoints.guide == Guide.ORBIT
    if not settings.setpoints.guided_mode or not flight.heeds or not (flight.phase == Phase.HOLD or circles):
        return flight
    return _guide(flight, Guide.OFFBOARD, "Setpoint", view, settings)[0]


def _follow_attitude(flight: Flight, request: FollowAttitude, view: View, settings: Settings) -> Decision:
    if flight.cable.released:
        return flight, _denied("Attitude setpoint refused: the load is released, fly by position")
    thrust = (
        None
        if request.thrust is None
        else request.thrust / settings.setpoints.hover_share * settings.weight_n
    )
    asked = AttitudeSetpoint(request.upward, thrust)
    return _heed(
        replace(flight, setpoints=replace(flight.setpoints, offboard=Stream(asked, view.now_us))),
        view,
        settings,
    ), ACCEPTED


def _follow_stick(flight: Flight, request: FollowStick, view: View, settings: Settings) -> Decision:
    asked = PositionSetpoint(
        velocity=scale(settings.setpoints.stick_speed_m_s, request.share), since_us=view.now_us
    )
    return replace(flight, setpoints=replace(flight.setpoints, manual=Stream(asked, view.now_us))), ACCEPTED


def _orbit(flight: Flight, request: Orbit, view: View, settings: Settings) -> Decision:
    if flight.phase not in CARRYING:
        return flight, _wrong_phase(flight, "Orbit")
    here = asked_motion(flight, view, settings)[0]
    centre: Vec3 = (
        here[0] if request.east_m is None else request.east_m,
        here[1] if request.north_m is None else request.north_m,
        here[2] if request.altitude_m is None else request.altitude_m,
    )
    radius = abs(request.radius_m)
    speed = flight.mission.speed_m_s if request.speed_m_s is None else request.speed_m_s
    if not (math.isfinite(speed) and LEAST_RADIUS_M <= radius <= FARTHEST_M):
        return flight, _denied(f"Orbit denied: radius {radius:g} m, least {LEAST_RADIUS_M} m")
    if not all(abs(value) <= FARTHEST_M for value in centre) or centre[2] < LEAST_ALTITUDE_M:
        return flight, _denied(f"Orbit denied: load height {centre[2]:.2f} m, least {LEAST_ALTITUDE_M} m")
    if not LEAST_SPEED_M_S <= abs(speed) <= settings.setpoints.fastest_m_s:
        limits = f"{LEAST_SPEED_M_S:g} ... {settings.setpoints.fastest_m_s:g} m/s"
        return flight, _denied(f"Orbit denied: {speed:.2f} m/s; must be {limits}")
    inward = speed * speed / radius
    if inward > settings.motion.accel_m_s2:
        text = f"Orbit denied: {inward:.1f} m/s^2 inwards exceeds MIS_ACCEL {settings.motion.accel_m_s2:g}"
        return flight, _denied(text)
    for k in range(CIRCLE_POINTS if settings.fence.action else 0):
        at = 2.0 * math.pi * k / CIRCLE_POINTS
        there = add(centre, (radius * math.cos(at), radius * math.sin(at), 0.0))
        place = below(there, settings) if flight.cable.released else there
        beyond = forbidden(flight.area.fence, place, settings)
        if beyond:
            return flight, _denied(f"Orbit denied: {beyond}")
    out = sub(here, centre)
    phase = math.atan2(out[1], out[0]) if math.hypot(out[0], out[1]) > 0.0 else 0.0
    rate, ramp_s = -speed / request.radius_m, RAMP_SHARE * abs(speed) / settings.motion.accel_m_s2
    ends_us = NEVER_US
    if request.turns is not None:
        turning_s = min(2.0 * math.pi * request.turns / abs(rate) + 0.5 * ramp_s, LONGEST_CIRCLE_S)
        ends_us = view.now_us + round(1e6 * turning_s)
    circle = Circle(centre, radius, rate, phase, view.now_us, ramp_s, ends_us)
    return _guide(
        replace(flight, setpoints=replace(flight.setpoints, circle=circle)),
        Guide.ORBIT,
        "Orbit",
        view,
        settings,
    )


def _change_altitude(flight: Flight, request: ChangeAltitude, view: View, settings: Settings) -> Decision:
    return _reposition(flight, Reposition(None, None, request.altitude_m, True), view, settings)


def _set_home(flight: Flight, request: SetHome, view: View, settings: Settings) -> Decision:
    place = view.x_quad if request.position is None else request.position
    if not math.hypot(place[0], place[1]) <= FARTHEST_M:
        return flight, _denied(f"Home denied: more than {FARTHEST_M:g} m away")
    if request.position is not None and not abs(place[2]) <= LEVEL_HOME_M:
        return flight, _denied("Home denied: its height must be that of the ground here, which is flat")
    return replace(flight, area=replace(flight.area, home=(place[0], place[1], 0.0))), ACCEPTED


def _change_speed(flight: Flight, request: ChangeSpeed, view: View, settings: Settings) -> Decision:
    if not SLOWEST_M_S <= request.speed_m_s <= FASTEST_M_S:
        return flight, _denied(f"Speed {request.speed_m_s:.2f} m/s denied; must be 0.05 ... 15")
    return replace(flight, mission=replace(flight.mission, speed_m_s=request.speed_m_s)), ACCEPTED


def _release(flight: Flight, request: Release, view: View, settings: Settings) -> Decision:
    if flight.cable.released:
        return flight, Verdict(mavlink.MAV_RESULT_ACCEPTED, "Gripper: the load is released already")
    text = RELEASED_TEXT
    if flight.mission.active and flight.phase not in ON_GROUND:
        text += ", mission held" if flight.phase != Phase.SET_DOWN else ""
    return release(flight, view, settings), Verdict(mavlink.MAV_RESULT_ACCEPTED, text)


def _grab(flight: Flight, request: Grab, view: View, settings: Settings) -> Decision:
    if not flight.cable.released:
        return flight, ACCEPTED
    if flight.phase not in ON_GROUND:
        return flight, _denied("Gripper: a load can be taken on the ground only; land beside it")
    away = norm(sub(view.x_load, view.x_quad))
    if not away <= settings.cable_length_m:
        text = f"Gripper: the load lies {away:.1f} m away, the cable reaches {settings.cable_length_m:g} m"
        return flight, _denied(text)
    return replace(flight, cable=replace(flight.cable, released=False)), Verdict(
        mavlink.MAV_RESULT_ACCEPTED, "Load taken"
    )


def _winch(flight: Flight, request: Winch, view: View, settings: Settings) -> Decision:
    if flight.cable.released:
        return flight, _denied("Winch denied: the load is released, nothing hangs on the cable")
    if not settings.winch.usable:
        return flight, _denied("Winch denied: the law lqr flies one length of the cable")
    if flight.phase != Phase.HOLD or not isinstance(flight.legs[-1], Hold):
        return flight, _later("Winch denied: hold the load in the air first")
    speed = settings.winch.speed_m_s if request.speed_m_s is None else request.speed_m_s
    if not LEAST_REEL_M_S <= speed <= settings.winch.speed_m_s:
        limits = f"{LEAST_REEL_M_S:g} ... {settings.winch.speed_m_s:g} m/s (WNC_SPEED)"
        return flight, _denied(f"Winch denied: {speed:.2f} m/s; must be {limits}")
    legs, here = stop(flight, view, settings)
    length = length_at(flight, here, settings)
    wanted = length + request.length_m
    if math.isinf(request.length_m):
        wanted = settings.winch.longest_m if request.length_m > 0.0 else settings.winch.shortest_m
        # out to the end, or as far as the load may sink
        wanted = max(min(wanted, length + here[2] - LEAST_ALTITUDE_M), min(wanted, length))
    beyond = reel_trouble(wanted, here[2] + length - wanted, settings)
    if beyond:
        return flight, _denied(f"Winch denied: {beyond}")
    if abs(wanted - length) < LEAST_REEL_M:
        return replace(flight, legs=(*legs, Hold(here)), leg_start_us=view.now_us), ACCEPTED
    reel = reel_leg(here, length, wanted, speed, settings.winch.accel_m_s2)
    there = reel.end
    text = f"Winch: {length:.2f} m to {wanted:.2f} m"
    after = replace(flight, legs=(*legs, reel, Hold(there)), leg_start_us=view.now_us)
    return after, Verdict(mavlink.MAV_RESULT_ACCEPTED, text)


def _terminate(flight: Flight, request: Terminate, view: View, settings: Settings) -> Decision:
    after = happen(off_mission(flight), Event.FAIL, view, settings)
    if after is None:
        return flight, ACCEPTED
    return (disarmed(after) if after.phase == Phase.DISARMED else after), ACCEPTED


def _run_checks(flight: Flight, request: RunPrearmChecks, view: View, settings: Settings) -> Decision:
    complaints = arming_complaints(flight, view, settings)
    return flight, Verdict(mavlink.MAV_RESULT_ACCEPTED, "; ".join(complaints) or "Ready to arm")


def with_plan(flight: Flight, plan: MissionPlan) -> Flight:
    """The flight with another mission, rewound."""
    return replace(
        flight,
        mission=replace(flight.mission, plan=plan, step=0, step_anchor=None, done=False),
        cable=replace(flight.cable, reel_to_m=None),
    )


_HANDLERS: dict[type, Callable[[Flight, Any, View, Settings], Decision]] = {
    Arm: _arm,
    Takeoff: _takeoff,
    Land: _land,
    ReturnHome: _return_home,
    SetMode: _set_mode,
    StartMission: _start_mission,
    Pause: _hold,
    Continue: _mode_mission,
    SetCurrent: _set_current,
    ReplaceMission: _replace_mission,
    Reposition: _reposition,
    FollowSetpoint: _follow_setpoint,
    FollowAttitude: _follow_attitude,
    FollowStick: _follow_stick,
    Orbit: _orbit,
    ChangeAltitude: _change_altitude,
    SetHome: _set_home,
    Winch: _winch,
    Release: _release,
    Grab: _grab,
    ChangeSpeed: _change_speed,
    Terminate: _terminate,
    RunPrearmChecks: _run_checks,
}
