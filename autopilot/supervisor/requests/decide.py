"""How a request changes the flight: the table from requests to their handlers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from autopilot.services.records import Verdict
from autopilot.services.requests import (
    Arm,
    ChangeAltitude,
    ChangeSpeed,
    Continue,
    EnableFence,
    FollowAttitude,
    FollowRates,
    FollowSetpoint,
    FollowStick,
    FollowTarget,
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
from autopilot.supervisor.requests.arming import arm, run_checks, terminate
from autopilot.supervisor.requests.guided import follow_attitude, follow_rates, follow_setpoint, follow_stick
from autopilot.supervisor.requests.heading import look_at, turn_heading
from autopilot.supervisor.requests.mission import (
    continue_mission,
    replace_mission,
    set_current,
    start_mission,
)
from autopilot.supervisor.requests.modes import enable_fence, land, pause, return_home, set_home, set_mode
from autopilot.supervisor.requests.orbit import orbit
from autopilot.supervisor.requests.payload import grab, release_load, winch
from autopilot.supervisor.requests.reposition import change_altitude, change_speed, reposition
from autopilot.supervisor.requests.takeoff import takeoff
from autopilot.supervisor.requests.target import follow_target
from autopilot.supervisor.requests.verdicts import Decision, Handler, temporarily_denied
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import IN_AIR, Flight, View, is_landing
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import LookAt, TurnHeading


def decide(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """The flight after the request, and the verdict on it; an unknown request is unsupported.

    While readings are missing, nothing that would end the landing is accepted, except a release of the load.
    """
    handler = HANDLERS.get(type(request))
    if handler is None:
        return flight, Verdict(mavlink.MAV_RESULT_UNSUPPORTED)
    after, verdict = handler(flight, request, view, settings)
    ends_landing = is_landing(flight) and after.phase in IN_AIR and not is_landing(after)
    if view.estimate_problems and ends_landing and not isinstance(request, Release):
        # the next tick would begin the landing anew
        return flight, temporarily_denied(f"Landing continues: {view.estimate_problems[0]}")
    if after.is_failsafe and after.legs is not flight.legs:  # now it does as commanded
        after = replace(after, is_failsafe=False)
    return after, verdict


HANDLERS: dict[type, Handler] = {
    Arm: arm,
    Takeoff: takeoff,
    Land: land,
    ReturnHome: return_home,
    SetMode: set_mode,
    StartMission: start_mission,
    Pause: pause,
    Continue: continue_mission,
    SetCurrent: set_current,
    ReplaceMission: replace_mission,
    Reposition: reposition,
    FollowSetpoint: follow_setpoint,
    FollowAttitude: follow_attitude,
    FollowRates: follow_rates,
    FollowStick: follow_stick,
    FollowTarget: follow_target,
    TurnHeading: turn_heading,
    LookAt: look_at,
    Orbit: orbit,
    ChangeAltitude: change_altitude,
    SetHome: set_home,
    EnableFence: enable_fence,
    Winch: winch,
    Release: release_load,
    Grab: grab,
    ChangeSpeed: change_speed,
    Terminate: terminate,
    RunPrearmChecks: run_checks,
}
