"""Requests about the mission: begin it, continue it, another item, another mission."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from autopilot.services.requests import ReplaceMission, SetCurrent, StartMission
from autopilot.supervisor.heading import heading_of_step
from autopilot.supervisor.machine import must_happen
from autopilot.supervisor.mission import at_step, begin_step, step_event
from autopilot.supervisor.requests.mission_checks import lift_altitude_m, mission_trouble, upload_trouble
from autopilot.supervisor.requests.takeoff import take_off
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import ON_GROUND, Event, Flight, Phase, Selected, View, off_mission
from autopilot.supervisor.table import TRANSITIONS
from autopilot.wire.dialect import plumbline as mavlink
from missions import model

_LATER = ACCEPTED._replace(text="Mission begins when its paths are prepared")


def begin_mission(flight: Flight, view: View, settings: Settings) -> Decision:
    """Start the mission at its present step, from the ground or from the air."""
    plan = flight.mission.plan
    if not plan.steps:
        return flight, denied("Mission denied: there is none")
    trouble = mission_trouble(flight, view, settings) or plan.prepared.refusal
    if trouble:
        return flight, denied(f"Mission denied: {trouble}")
    if flight.phase == Phase.DISARMED:
        return replace(flight, selected=Selected.MISSION), ACCEPTED
    event = Event.LAND if isinstance(plan.steps[flight.mission.step], model.Land) else Event.MISSION
    if flight.phase != Phase.ARMED and (flight.phase, event) not in TRANSITIONS:
        return flight, wrong_phase(flight, "Mission")
    if plan.prepared.pending:
        return _waiting(flight, view, settings), _LATER
    flight = replace(
        flight,
        mission=replace(flight.mission, active=True, done=False, waiting=False),
        selected=Selected.MISSION,
    )
    if flight.phase == Phase.ARMED:
        altitude = lift_altitude_m(plan, settings)
        flight = replace(flight, mission=replace(flight.mission, takeoff_altitude_m=altitude))
        return take_off(flight, view, settings), ACCEPTED
    if flight.mission.step_anchor is None:  # the step is begun, not resumed
        flight = heading_of_step(flight, view, settings)
    return begin_step(flight, event, view, settings), ACCEPTED


def _waiting(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight that holds, or stands armed, until the paths of its mission are prepared.

    The request is accepted immediately and answered only once: clients (MAVSDK) cannot handle an answer in
    two parts.
    """
    if flight.phase != Phase.ARMED:
        flight = must_happen(off_mission(flight), Event.HOLD, view, settings)
    return replace(flight, selected=Selected.MISSION, mission=replace(flight.mission, waiting=True))


def start_mission(flight: Flight, request: StartMission, view: View, settings: Settings) -> Decision:
    """Fly the mission, from an item on or from the present one."""
    before = flight
    if request.first is not None and flight.mission.plan.items:  # else the refusal is about the mission
        flight, verdict = set_current(flight, SetCurrent(request.first), view, settings)
        if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
            return before, verdict
    if flight.mission.active and flight.phase not in ON_GROUND and flight.phase != Phase.HOLD:
        return flight, ACCEPTED
    begun, verdict = begin_mission(flight, view, settings)
    return (begun if verdict.result == mavlink.MAV_RESULT_ACCEPTED else before), verdict


def continue_mission(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """Continue the mission at its present item."""
    return start_mission(flight, StartMission(None), view, settings)


def set_current(flight: Flight, request: SetCurrent, view: View, settings: Settings) -> Decision:
    """Make another item the present one; while the mission is flown, fly there immediately."""
    plan = flight.mission.plan
    if not plan.items:
        return flight, denied(f"Mission item {request.seq} denied: no mission is stored")
    if not 0 <= request.seq < plan.items:
        return flight, denied(f"Mission item {request.seq} denied: the last is {plan.items - 1}")
    step = next((i for i, seq in enumerate(plan.sequence) if seq >= request.seq), None)
    if step is None:
        return flight, denied(f"Mission item {request.seq} denied: nothing is flown from there")
    moved = at_step(flight, step, done=False)
    if flight.mission.active and flight.phase == Phase.SET_DOWN:
        return flight, wrong_phase(flight, f"Mission item {request.seq}")
    if flight.mission.active and flight.phase in (Phase.MISSION, Phase.LOWER):
        trouble = mission_trouble(moved, view, settings)
        if trouble:
            return flight, denied(f"Mission item {request.seq} denied: {trouble}")
        moved = heading_of_step(moved, view, settings)
        return begin_step(moved, step_event(moved), view, settings), ACCEPTED
    return moved, ACCEPTED


def replace_mission(flight: Flight, request: ReplaceMission, view: View, settings: Settings) -> Decision:
    """Whether another mission may be stored."""
    if flight.mission.active and flight.phase not in ON_GROUND:
        return flight, denied("Mission denied: the present one is being flown; pause it first")
    steps = tuple(located.step for located in request.steps)
    sequence = tuple(located.first for located in request.steps)
    beyond = upload_trouble(flight, steps, sequence, view, settings)
    if beyond:
        return flight, denied(f"Mission denied: {beyond}")
    return flight, ACCEPTED
