"""Modes by request: hold, land and return home, and the table of PX4's modes that the vehicle supports."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from autopilot.services import identity
from autopilot.services.records import Verdict
from autopilot.services.requests import EnableFence, SetHome, SetMode, StartMission, Takeoff
from autopilot.supervisor.machine import requested_transition, start_phase_legs, transition, try_transition
from autopilot.supervisor.phase_legs import leads_home
from autopilot.supervisor.requests.guided import offboard, position_control
from autopilot.supervisor.requests.limits import MAX_DISTANCE_M
from autopilot.supervisor.requests.mission import start_mission
from autopilot.supervisor.requests.takeoff import takeoff
from autopilot.supervisor.requests.target import follow_me
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, Handler, denied, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ON_GROUND,
    ActionWhenArmed,
    Event,
    Flight,
    Phase,
    SetpointSource,
    View,
    interrupt_mission,
    is_landing,
)

MAX_HOME_HEIGHT_M = 1.0


def hold(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """Stop and hold; on the ground, select nothing."""
    if flight.phase in ON_GROUND:
        return replace(interrupt_mission(flight), action_when_armed=ActionWhenArmed.NOTHING), ACCEPTED
    after = requested_transition(interrupt_mission(flight), Event.HOLD, view, settings)
    return (after, ACCEPTED) if after else (flight, wrong_phase(flight, "Hold"))


def pause(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """Stop and hold; on the ground, cancel what begins with arming, if there is such a thing."""
    mission = flight.mission
    is_idle = flight.action_when_armed == ActionWhenArmed.NOTHING and not (mission.active or mission.waiting)
    if flight.phase in ON_GROUND and is_idle:
        return flight, wrong_phase(flight, "Pause", "nothing is under way")
    return hold(flight, request, view, settings)


def land(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """Set the load down where it is, and the vehicle beside it; on the ground, select nothing, and disarm."""
    if flight.phase == Phase.ARMED:
        return transition(flight, Event.DISARM, view, settings), ACCEPTED
    if flight.phase in ON_GROUND:
        return hold(flight, request, view, settings)
    not_returning = replace(flight, returning=False)
    if is_landing(flight):
        return not_returning, ACCEPTED
    after = try_transition(interrupt_mission(not_returning), Event.LAND, view, settings)
    return (after, ACCEPTED) if after else (flight, wrong_phase(flight, "Landing"))


def return_home(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """Fly to home or a nearer rally point, and land; on the way there, fly on, or to home if it has moved."""
    if flight.phase == Phase.RETURN:
        return flight if leads_home(flight) else start_phase_legs(flight, view, settings), ACCEPTED
    after = requested_transition(interrupt_mission(flight), Event.RETURN, view, settings)
    return (after, ACCEPTED) if after else (flight, wrong_phase(flight, "Return"))


def set_home(flight: Flight, request: SetHome, view: View, settings: Settings) -> Decision:
    """Set the place to which a return leads: this one, or the requested one."""
    place = view.x_quad if request.position is None else request.position
    if not math.hypot(place[0], place[1]) <= MAX_DISTANCE_M:
        return flight, denied(f"Home denied: more than {MAX_DISTANCE_M:g} m from the origin")
    if request.position is not None and not abs(place[2]) <= MAX_HOME_HEIGHT_M:
        return flight, denied("Home denied: its height must be that of the ground here, which is flat")
    return replace(flight, area=replace(flight.area, home=(place[0], place[1], 0.0))), ACCEPTED


def enable_fence(flight: Flight, request: EnableFence, view: View, settings: Settings) -> Decision:
    """Enable or disable the fence; a previous breach is forgotten."""
    area = flight.area.with_fence_switched(request.on)
    return replace(flight, area=area), Verdict(ACCEPTED.result, f"Fence {'on' if request.on else 'off'}")


def _mode_mission(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    return start_mission(flight, StartMission(None), view, settings)


def _mode_takeoff(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    return takeoff(flight, Takeoff(None), view, settings)


MODES: dict[tuple[int, int], Handler] = {
    (identity.AUTO, identity.AUTO_TAKEOFF): _mode_takeoff,
    (identity.AUTO, identity.AUTO_LOITER): hold,
    (identity.AUTO, identity.AUTO_MISSION): _mode_mission,
    (identity.AUTO, identity.AUTO_RTL): return_home,
    (identity.AUTO, identity.AUTO_LAND): land,
    identity.FOLLOW_MODE: follow_me,
    (identity.OFFBOARD, 0): offboard,
    (identity.POSCTL, 0): position_control,
}


def set_mode(flight: Flight, request: SetMode, view: View, settings: Settings) -> Decision:
    """Change to another of PX4's modes."""
    main, sub_mode = request.main, request.sub
    if (main, sub_mode) == (identity.AUTO, 0):
        sub_mode = identity.AUTO_MISSION
    handler = MODES.get((main, sub_mode))
    if handler is None:
        return flight, denied(
            f"{request.name or f'Mode {main}/{sub_mode}'} denied: not flown by this vehicle"
        )
    accepts_setpoints = request.number in (None, identity.ARDUPILOT_GUIDED) or handler is not hold
    if (
        settings.setpoints.ardupilot_guided
        and handler is hold
        and accepts_setpoints
        and _in_guided_mode(flight)
    ):
        return flight, ACCEPTED
    after, verdict = handler(flight, request, view, settings)
    return (
        replace(after, accepts_setpoints=accepts_setpoints) if verdict.result == ACCEPTED.result else after
    ), verdict


def _in_guided_mode(flight: Flight) -> bool:
    """Whether the present flight is part of ArduPilot's GUIDED: take-off, transfer to a place, setpoints."""
    if flight.mission.active:
        return False
    rising = flight.phase in (Phase.TAUTEN, Phase.LIFT) or (
        flight.phase == Phase.HOLD and flight.accepts_setpoints
    )
    by_setpoints = flight.setpoints.source in (SetpointSource.OFFBOARD, SetpointSource.ORBIT)
    return rising or (flight.phase == Phase.GUIDED and by_setpoints)
