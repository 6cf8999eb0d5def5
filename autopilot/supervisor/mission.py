"""The course of a mission: what begins with a step, and what follows the last leg of a phase."""

from __future__ import annotations

from dataclasses import replace

from autopilot.geometry.linear import norm
from autopilot.guidance.legs import Calm, Hold, Leg, Pass, Swing
from autopilot.supervisor.guide import lost
from autopilot.supervisor.heading import heading_of_step
from autopilot.supervisor.machine import begin_legs, happen, must_happen
from autopilot.supervisor.motion import AT_REST, as_flown, calm, length_at, stop, swings
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CRITICAL,
    INFO,
    Event,
    Flight,
    Guide,
    MissionPlan,
    Phase,
    Report,
    Selected,
    View,
    off_mission,
)
from autopilot.supervisor.step_legs import borrowed, destination, following_legs, made, step_legs
from autopilot.trajectory.timeline import MissionState, state_after
from autopilot.trajectory.waypoint_path import Passage
from missions.model import AttitudeRun, Land, Release, ReturnHome, Speed, Step, Takeoff, Waypoint, Winch

SETTLE_S = 3.0  # hold after an attitude run
LIFTED = 0.5
RELEASED_TEXT = "Load released"


def with_plan(flight: Flight, plan: MissionPlan) -> Flight:
    """The flight with another mission, rewound."""
    flight = replace(flight, mission=replace(flight.mission, plan=plan))
    return at_step(flight, 0, done=False)


def at_step(flight: Flight, step: int, done: bool) -> Flight:
    """The flight with another step of the mission as the present one, not begun yet."""
    return replace(
        flight,
        mission=replace(flight.mission, step=step, step_anchor=None, done=done),
        cable=replace(flight.cable, reel_to_m=None),
    )


def step_event(flight: Flight) -> Event:
    """The event that begins the present step while the mission is flown."""
    step = flight.mission.plan.steps[flight.mission.step]
    return Event.LAND_STEP if isinstance(step, Land) else Event.STEP


def begin_step(flight: Flight, event: Event, view: View, settings: Settings) -> Flight:
    """The flight on its present mission step, which the event begins or resumes."""
    step = flight.mission.plan.steps[flight.mission.step]
    if isinstance(step, Speed):
        flight = replace(flight, mission=replace(flight.mission, speed_m_s=step.speed_m_s))
    if isinstance(step, Land):
        return must_happen(flight, event, view, settings)
    if isinstance(step, Winch) and flight.cable.reel_to_m is None:
        here = stop(flight, view, settings)[1]
        hanging = MissionState(here, cable_m=length_at(flight, here, settings))
        reel_to = state_after(step, hanging).cable_m
        flight = replace(flight, cable=replace(flight.cable, reel_to_m=reel_to))
    if isinstance(step, Release) and not flight.cable.released:
        flight = replace(flight, cable=replace(flight.cable, released=True, slack_since_us=-1), legs=())
    if flight.mission.step_anchor is None and not (flight.legs and swings(flight.legs[0])):
        anchor = stop(flight, view, settings)[1]
        flight = replace(flight, mission=replace(flight.mission, step_anchor=anchor))
    return must_happen(flight, event, view, settings)


def legs_done(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The flight after the last leg of its phase has ended."""
    leg = flight.legs[0] if flight.legs else None
    if isinstance(leg, Calm) and not leg.ends_step:  # now the phase can begin
        return begin_legs(flight, view, settings), Report()
    if flight.phase == Phase.LIFT and leg is not None and _stays_below(flight, leg, view):
        text = "The load was not lifted: landing"
        return must_happen(off_mission(flight), Event.LAND, view, settings), Report(((CRITICAL, text),))
    if flight.mission.active and flight.phase in (Phase.LIFT, Phase.MISSION):
        return _step_done(flight, view, settings)
    if flight.phase == Phase.LIFT and flight.selected == Selected.OFFBOARD:
        offboard = replace(flight, setpoints=replace(flight.setpoints, guide=Guide.OFFBOARD))
        if not lost(offboard, view.now_us, settings):
            return must_happen(offboard, Event.GUIDE, view, settings), Report()
    after = happen(flight, Event.DONE, view, settings)
    if after is None:  # a phase whose last leg has no end
        legs, here = stop(flight, view, settings)
        return _flying(flight, as_flown(flight, (*legs, Hold(here))), view), Report()
    return after, Report()


def _stays_below(flight: Flight, leg: Leg, view: View) -> bool:
    """Whether a lift that has ended brought the load less than the share `LIFTED` of its way up."""
    begun, asked = leg.jet(0.0)[0][2], leg.jet(leg.duration_s)[0][2]
    return not flight.cable.released and view.x_load[2] - begun < LIFTED * (asked - begun)


def _step_done(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The flight after its present mission step: on the next step, or at the end of the mission."""
    plan, number = flight.mission.plan, flight.mission.step
    step = plan.steps[number]
    if flight.phase == Phase.LIFT and not isinstance(step, Takeoff):  # lifted although no step requested it
        flight = heading_of_step(flight, view, settings)
        return begin_step(flight, step_event(flight), view, settings), Report()
    after = plan.after(number)
    following = None if after is None else plan.steps[after]
    leg = flight.legs[0] if flight.legs else None
    if isinstance(leg, Swing) and not isinstance(following, AttitudeRun):
        return _flying(flight, (calm(leg, view, settings, ends_step=True),), view), Report()
    if isinstance(leg, Calm):
        legs, here = stop(flight, view, settings)
        return _flying(flight, (*legs, Hold(here, SETTLE_S)), view), Report()
    reached = (plan.sequence[number],)
    flight = at_step(flight, number + 1 if after is None else after, done=flight.mission.done)
    if following is None:
        event, text = Event.DONE, "Mission complete, holding"
        if isinstance(step, ReturnHome):  # as the last step it ends on the ground, like a return by mode
            event, text = Event.LAND, "Mission complete, landing"
        rewound = replace(flight, mission=replace(flight.mission, active=False, done=True, step=0))
        return must_happen(rewound, event, view, settings), Report(((INFO, text),), reached)
    flight = heading_of_step(flight, view, settings)
    return _next_step(flight, leg, following, view, settings), Report((), reached)


def _next_step(flight: Flight, leg: Leg | None, step: Step, view: View, settings: Settings) -> Flight:
    """The flight on the step after the one that ended with `leg`, without a stop where possible."""
    ahead = made(flight, flight.mission.step)
    if isinstance(leg, Pass) and isinstance(ahead, Passage) and ahead.table is leg.path.table:
        # past the waypoint without a stop; the clock continues from the end of the stretch
        assert isinstance(step, Waypoint)
        legs: tuple[Leg, ...] = (replace(leg, path=ahead),)
        if step.hold_s > 0.0:
            there = destination(step, leg.path.start, flight)
            legs += (Hold(there, max(step.hold_s - borrowed(flight), 0.0)),)
        passed = flight.leg_start_us + round(leg.duration_s * 1e6)
        gone = replace(flight, legs=as_flown(flight, legs), leg_start_us=passed)
        return replace(gone, following=following_legs(gone, settings))
    if isinstance(leg, Swing):
        # the next run begins with the present motion; only the height remains that of the first run
        here = (view.x_load[0], view.x_load[1], leg.anchor[2])
        legs = step_legs(step, here, flight, settings)
        flight = replace(flight, mission=replace(flight.mission, step_anchor=here))
        return _flying(flight, legs, view)
    return _on_time(begin_step(flight, step_event(flight), view, settings), flight, leg)


def _on_time(begun: Flight, before: Flight, leg: Leg | None) -> Flight:
    """The flight on a step that began when the previous step ended, possibly between two ticks, so that the
    clock of the mission loses no time between steps."""
    if leg is None or not begun.legs or isinstance(begun.legs[0], Calm):
        return begun
    if norm(leg.jet(leg.duration_s)[1]) > AT_REST:  # its remaining motion is stopped from now on
        return begun
    return replace(begun, leg_start_us=before.leg_start_us + round(leg.duration_s * 1e6))


def _flying(flight: Flight, legs: tuple[Leg, ...], view: View) -> Flight:
    """The flight in the same phase on other legs, from now on."""
    return replace(flight, legs=legs, leg_start_us=view.now_us)
