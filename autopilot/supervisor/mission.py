"""The course of a mission: what begins with a step, and what follows the last leg of a phase."""

from __future__ import annotations

from dataclasses import replace

from autopilot.geometry.linear import norm
from autopilot.guidance.legs import LOAD_POSITION, Hold, Leg, LiftWait, PathStretch, Swing, SwingDamping
from autopilot.supervisor.heading import take_reached_aims, with_step_heading_aims
from autopilot.supervisor.machine import start_phase_legs, transition, try_transition
from autopilot.supervisor.motion import (
    AT_REST,
    cable_length_at,
    damping_leg,
    stopping_legs,
    tracks_attitude,
    with_control_modes,
)
from autopilot.supervisor.setpoint_source import is_source_lost
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CRITICAL,
    IN_AIR,
    INFO,
    ActionWhenArmed,
    Event,
    Flight,
    MissionPlan,
    Phase,
    Report,
    SetpointSource,
    View,
    interrupt_mission,
    without_load,
)
from autopilot.supervisor.step_legs import (
    destination,
    following_legs,
    hold_reduction_s,
    prepared_path,
    step_legs,
)
from autopilot.supervisor.watches.slack import NOT_LIFTED_TEXT
from autopilot.trajectory.timeline import MissionState, state_after
from autopilot.trajectory.waypoint_path import PathSegment
from missions.model import (
    AttitudeRun,
    Land,
    PlaceLoad,
    Release,
    ReturnHome,
    Speed,
    Step,
    SwitchFence,
    Takeoff,
    Waypoint,
    Winch,
)

SETTLE_S = 3.0  # hold after an attitude run
MIN_LIFT_SHARE = 0.5
LIFT_PATIENCE_S = 5.0  # in which the pull may still grow to the weight of a load that is heavier than assumed
RELEASED_TEXT = "Load released"


def with_plan(flight: Flight, plan: MissionPlan) -> Flight:
    """The flight with another mission, rewound; without steps there is nothing to wait for."""
    waiting = flight.mission.waiting and bool(plan.steps)
    flight = replace(flight, mission=replace(flight.mission, plan=plan, waiting=waiting))
    if flight.phase in IN_AIR and not waiting:  # this flight did not begin with it
        flight = replace(flight, action_when_armed=ActionWhenArmed.NOTHING)
    return with_current_step(flight, 0)


def with_current_step(flight: Flight, step: int) -> Flight:
    """The flight with another step of the mission as the present one, not begun yet."""
    return replace(
        flight,
        mission=replace(flight.mission, step=step, step_anchor=None, stopped_run=None, final_item=None),
        cable=replace(flight.cable, reel_target_m=None),
    )


def present_item(flight: Flight) -> int:
    """The mission item that is flown; of a complete mission the one that it ended with, and after this flight
    the first, with which the mission begins again."""
    mission, sequence = flight.mission, flight.mission.plan.sequence
    if mission.final_item is not None:
        return mission.final_item
    return sequence[min(mission.step, len(sequence) - 1)] if sequence else 0


def step_event(flight: Flight) -> Event:
    """The event that begins the present step while the mission is flown."""
    return Event.LAND_STEP if is_lowering_step(flight) else Event.STEP


def is_lowering_step(flight: Flight) -> bool:
    """Whether the present step begins with lowering: a landing, or placing a load that is not released."""
    step = flight.mission.plan.steps[flight.mission.step]
    return isinstance(step, Land) or (isinstance(step, PlaceLoad) and not flight.cable.released)


def with_speed(flight: Flight, step: Speed, settings: Settings) -> Flight:
    """The flight with the speed of transfers that the step sets."""
    speed_m_s = settings.motion.speed_m_s if step.speed_m_s is None else step.speed_m_s
    return replace(flight, mission=flight.mission.at_speed(speed_m_s))


def start_step(flight: Flight, event: Event, view: View, settings: Settings) -> Flight:
    """The flight on its present mission step, which the event begins or resumes."""
    step = flight.mission.plan.steps[flight.mission.step]
    if isinstance(step, Speed):
        flight = with_speed(flight, step, settings)
    if isinstance(step, SwitchFence):
        flight = replace(flight, area=flight.area.with_fence_switched(step.on))
    if is_lowering_step(flight):
        return transition(flight, event, view, settings)
    if isinstance(step, Winch) and flight.cable.reel_target_m is None:
        here = stopping_legs(flight, view, settings)[1]
        hanging = MissionState(here, cable_m=cable_length_at(flight, here, settings))
        reel_to = state_after(step, hanging).cable_m
        flight = replace(flight, cable=replace(flight.cable, reel_target_m=reel_to))
    if isinstance(step, Release) and not flight.cable.released:
        flight = replace(without_load(flight), legs=())
    if flight.mission.step_anchor is None and not (flight.legs and tracks_attitude(flight.legs[0])):
        anchor = stopping_legs(flight, view, settings)[1]
        flight = replace(flight, mission=replace(flight.mission, step_anchor=anchor))
    return transition(flight, event, view, settings)


def after_last_leg(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The flight after the last leg of its phase has ended."""
    leg = flight.legs[0] if flight.legs else None
    if isinstance(leg, SwingDamping) and not leg.ends_step:  # now the phase can begin
        return start_phase_legs(flight, view, settings), Report()
    if flight.phase == Phase.LIFT and leg is not None and _has_lift_failed(flight, leg, view):
        if not isinstance(leg, LiftWait):
            start, end = leg.jet(0.0)[0], leg.jet(leg.duration_s)[0]
            return _with_legs(
                flight, (LiftWait(end, LIFT_PATIENCE_S, LOAD_POSITION, start[2]),), view
            ), Report()
        landing = transition(interrupt_mission(flight), Event.LAND, view, settings)
        return landing, Report(((CRITICAL, NOT_LIFTED_TEXT),))
    if flight.mission.active and flight.phase in (Phase.LIFT, Phase.MISSION):
        return _after_step(flight, view, settings)
    if flight.phase == Phase.LIFT and flight.action_when_armed == ActionWhenArmed.OFFBOARD:
        offboard = replace(flight, setpoints=replace(flight.setpoints, source=SetpointSource.OFFBOARD))
        if not is_source_lost(offboard, view.now_us, settings):
            return transition(offboard, Event.GUIDE, view, settings), Report()
    after = try_transition(flight, Event.DONE, view, settings)
    if after is None:  # a phase whose last leg has no end
        legs, here = stopping_legs(flight, view, settings)
        return _with_legs(flight, with_control_modes(flight, (*legs, Hold(here))), view), Report()
    return after, Report()


def _has_lift_failed(flight: Flight, leg: Leg, view: View) -> bool:
    """Whether a lift that has ended brought the load less than the share `MIN_LIFT_SHARE` of its way up."""
    start_height = leg.start_height_m if isinstance(leg, LiftWait) else leg.jet(0.0)[0][2]
    end_height = leg.jet(leg.duration_s)[0][2]
    return not flight.cable.released and view.x_load[2] - start_height < MIN_LIFT_SHARE * (
        end_height - start_height
    )


def _after_step(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The flight after its present mission step: on the next step, or at the end of the mission."""
    plan, number = flight.mission.plan, flight.mission.step
    step = plan.steps[number]
    if flight.phase == Phase.LIFT and not isinstance(step, Takeoff):  # lifted although no step requested it
        flight, aimed = take_reached_aims(with_step_heading_aims(flight, view, settings))
        return start_step(flight, step_event(flight), view, settings), Report((), aimed)
    after = plan.next_step(number)
    next_step = None if after is None else plan.steps[after]
    leg = flight.legs[0] if flight.legs else None
    if isinstance(leg, Swing) and not isinstance(next_step, AttitudeRun):
        return _with_legs(flight, (damping_leg(leg, view, settings, ends_step=True),), view), Report()
    if isinstance(leg, SwingDamping):
        legs, here = stopping_legs(flight, view, settings)
        return _with_legs(flight, (*legs, Hold(here, SETTLE_S)), view), Report()
    if next_step is None and isinstance(step, ReturnHome):  # ends on the ground, like a return by mode
        landing = transition(flight, Event.LAND_STEP, view, settings)
        return landing, Report(((INFO, "Home reached, landing"),))
    reached = (plan.sequence[number],) if _ends_item(plan, number, after) else ()
    flight = with_current_step(flight, 0 if after is None else after)
    if next_step is None:
        ended = replace(flight.mission, active=False, final_item=plan.sequence[number])
        flight = replace(flight, mission=ended)
        text = "Mission complete, holding"
        return transition(flight, Event.DONE, view, settings), Report(((INFO, text),), reached)
    flight, aimed = take_reached_aims(with_step_heading_aims(flight, view, settings))
    return _next_step(flight, leg, next_step, view, settings), Report((), reached + aimed)


def _ends_item(plan: MissionPlan, step: int, following: int | None) -> bool:
    """Whether the item of a step is flown: the step that follows is of another item, or a jump leads back to
    the first step of this one."""
    item = plan.sequence[step]
    if following is None or plan.sequence[following] != item:
        return True
    return plan.steps[following] == plan.steps[plan.sequence.index(item)]


def _next_step(flight: Flight, leg: Leg | None, step: Step, view: View, settings: Settings) -> Flight:
    """The flight on the step after the one that ended with `leg`, without a stop where possible."""
    next_path = prepared_path(flight, flight.mission.step)
    if (
        isinstance(leg, PathStretch)
        and isinstance(next_path, PathSegment)
        and next_path.table is leg.path.table
        and next_path.begin_s == leg.path.end_s  # a loop leads back
    ):
        # past the waypoint without a stop; the clock continues from the end of the stretch
        assert isinstance(step, Waypoint)
        legs: tuple[Leg, ...] = (replace(leg, path=next_path),)
        if step.hold_s > 0.0:
            there = destination(step, leg.path.start, flight)
            legs += (Hold(there, max(step.hold_s - hold_reduction_s(flight), 0.0)),)
        passed_us = flight.leg_start_us + round(leg.duration_s * 1e6)
        continued = replace(flight, legs=with_control_modes(flight, legs), leg_start_us=passed_us)
        return replace(continued, following=following_legs(continued, settings))
    if isinstance(leg, Swing):
        # the next run begins with the present motion; only the height remains that of the first run
        here = (view.x_load[0], view.x_load[1], leg.anchor[2])
        legs = step_legs(step, here, flight, settings)
        flight = replace(flight, mission=replace(flight.mission, step_anchor=here))
        return _with_legs(flight, legs, view)
    return _started_at_leg_end(start_step(flight, step_event(flight), view, settings), flight, leg)


def _started_at_leg_end(started: Flight, before: Flight, leg: Leg | None) -> Flight:
    """The flight on a step that began when the previous step ended, possibly between two ticks, so that the
    clock of the mission loses no time between steps."""
    if leg is None or not started.legs or isinstance(started.legs[0], SwingDamping):
        return started
    if norm(leg.jet(leg.duration_s)[1]) > AT_REST:  # its remaining motion is stopped from now on
        return started
    return replace(started, leg_start_us=before.leg_start_us + round(leg.duration_s * 1e6))


def _with_legs(flight: Flight, legs: tuple[Leg, ...], view: View) -> Flight:
    """The flight in the same phase on other legs, from now on."""
    return replace(flight, legs=legs, leg_start_us=view.now_us)
