"""Requests about the mission: begin it, continue it, another item, another mission."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from autopilot.services.records import Verdict
from autopilot.services.requests import ReplaceMission, SetCurrent, StartMission
from autopilot.supervisor.heading import with_step_heading_aims
from autopilot.supervisor.machine import transition
from autopilot.supervisor.mission import (
    is_lowering_step,
    present_item,
    start_step,
    step_event,
    with_current_step,
)
from autopilot.supervisor.requests.mission_checks import (
    is_prepared_from_here,
    is_taking_off,
    lift_altitude_m,
    mission_problem,
    remaining_timeline,
    upload_problem,
)
from autopilot.supervisor.requests.takeoff import start_takeoff
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ON_GROUND,
    ActionWhenArmed,
    Event,
    Flight,
    MissionPlan,
    Phase,
    View,
    interrupt_mission,
)
from autopilot.supervisor.table import TRANSITIONS
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import endless_loops
from missions import model

# steps for which a vehicle on the ground takes off
_STEPS_IN_THE_AIR = model.Takeoff | model.Waypoint | model.LoadPath | model.AttitudeRun


def _accepted_pending(what: str) -> Verdict:
    """The verdict on a request for which the vehicle holds, or stands armed, until paths are prepared."""
    return ACCEPTED._replace(text=f"{what} begins when its paths are prepared")


def start_at_current_step(flight: Flight, view: View, settings: Settings) -> Decision:
    """Start the mission at its present step, from the ground or from the air."""
    plan = flight.mission.plan
    if not plan.steps:
        return flight, denied("Mission denied: there is none")
    remaining = plan.steps[flight.mission.step :]
    if flight.phase in ON_GROUND and not any(isinstance(step, _STEPS_IN_THE_AIR) for step in remaining):
        return flight, denied("Mission denied: no item of it takes off")
    ahead = remaining_timeline(flight, view, settings)
    prepared = not plan.prepared.pending and is_prepared_from_here(flight, ahead, settings)
    problem = mission_problem(flight, ahead, settings) or (plan.prepared.refusal if prepared else "")
    if problem:
        return flight, denied(f"Mission denied: {problem}")
    if flight.phase == Phase.DISARMED:
        return replace(flight, action_when_armed=ActionWhenArmed.MISSION), ACCEPTED
    event = Event.LAND if is_lowering_step(flight) else Event.MISSION
    events = (event,) if prepared else (event, Event.HOLD)
    if flight.phase != Phase.ARMED and any((flight.phase, each) not in TRANSITIONS for each in events):
        return flight, wrong_phase(flight, "Mission")
    if not prepared:
        return _hold_until_prepared(flight, view, settings), _accepted_pending("Mission")
    flight = replace(
        flight,
        mission=replace(flight.mission, active=True, final_item=None, waiting=False),
        action_when_armed=ActionWhenArmed.MISSION,
    )
    if flight.phase == Phase.ARMED:
        altitude = lift_altitude_m(plan, settings)
        flight = replace(flight, mission=replace(flight.mission, takeoff_altitude_m=altitude))
        return start_takeoff(flight, view, settings), ACCEPTED
    if flight.mission.step_anchor is None:  # the step is begun, not resumed
        flight = with_step_heading_aims(flight, view, settings)
    return start_step(flight, event, view, settings), ACCEPTED


def _hold_until_prepared(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight that holds, or stands armed, until the paths of its mission are prepared.

    The request is accepted immediately and answered only once: clients (MAVSDK) cannot handle an answer in
    two parts.
    """
    if flight.phase != Phase.ARMED:
        flight = transition(interrupt_mission(flight), Event.HOLD, view, settings)
    return replace(
        flight, action_when_armed=ActionWhenArmed.MISSION, mission=replace(flight.mission, waiting=True)
    )


def start_mission(flight: Flight, request: StartMission, view: View, settings: Settings) -> Decision:
    """Fly the mission, from an item on or from the present one."""
    before = flight
    if request.first is not None and flight.mission.plan.item_count:  # else the refusal is about the mission
        flight, verdict = set_current(flight, SetCurrent(request.first, reset=True), view, settings)
        if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
            return before, verdict
    if flight.mission.active and flight.phase not in ON_GROUND and flight.phase != Phase.HOLD:
        if request.first is None:
            return flight, ACCEPTED
        return flight, ACCEPTED._replace(text=f"Mission begins again at item {request.first}")
    started, verdict = start_at_current_step(flight, view, settings)
    return (started if verdict.result == mavlink.MAV_RESULT_ACCEPTED else before), verdict


def continue_mission(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """Continue the mission at its present item."""
    if not flight.mission.plan.steps:
        return flight, denied("Nothing to continue: no mission is stored")
    return start_mission(flight, StartMission(None), view, settings)


def set_current(flight: Flight, request: SetCurrent, view: View, settings: Settings) -> Decision:
    """Make another item the present one; while the mission is flown, fly there immediately, or as soon as the
    path from there is prepared."""
    plan = flight.mission.plan
    seq = present_item(flight) if request.seq is None else request.seq
    item = f"Mission item {seq}"
    if not plan.item_count:
        return flight, denied(f"{item} denied: no mission is stored")
    if not 0 <= seq < plan.item_count:
        return flight, denied(f"{item} denied: the last is {plan.item_count - 1}")
    step = plan.step_of_item(seq, flight.mission.step, request.reset)
    if step is None:
        return flight, denied(f"{item} denied: nothing is flown from there")
    at_item = with_current_step(flight, step)
    if flight.mission.active and flight.phase == Phase.SET_DOWN:
        return flight, wrong_phase(flight, item)
    flies_on = flight.mission.active and flight.phase in (Phase.MISSION, Phase.LOWER)
    if not flies_on and not is_taking_off(flight):
        return at_item, ACCEPTED
    ahead = remaining_timeline(at_item, view, settings)
    problem = mission_problem(at_item, ahead, settings)
    if problem:
        return flight, denied(f"{item} denied: {problem}")
    if not flies_on:  # it is flown when the load is lifted
        return at_item, ACCEPTED
    if not is_prepared_from_here(at_item, ahead, settings):
        return _hold_until_prepared(at_item, view, settings), _accepted_pending(item)
    at_item = with_step_heading_aims(at_item, view, settings)
    return start_step(at_item, step_event(at_item), view, settings), ACCEPTED


def replace_mission(flight: Flight, request: ReplaceMission, view: View, settings: Settings) -> Decision:
    """Whether another mission may be stored."""
    if flight.mission.active and flight.phase not in ON_GROUND:
        return flight, denied("Mission denied: the present one is being flown; pause it first")
    steps = tuple(located.step for located in request.steps)
    sequence = tuple(located.first for located in request.steps)
    plan = MissionPlan(steps, sequence, request.count, loops=endless_loops(request.steps))
    problem = upload_problem(flight, plan, view, settings)
    if problem:
        return flight, denied(f"Mission denied: {problem}")
    return flight, ACCEPTED
