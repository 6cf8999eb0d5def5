"""What each step of a mission is to fly."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite

from autopilot.geometry.linear import Vec3, norm, sub
from autopilot.guidance.legs import (
    LOAD_ATTITUDE,
    LOAD_POSITION,
    QUAD_ATTITUDE,
    Hold,
    Leg,
    PathStretch,
    SignalRun,
    Swing,
    reel_leg,
)
from autopilot.supervisor.motion import AT_REST, cable_length_at, carry, lift
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, Phase
from autopilot.trajectory.shaping import ShapedSignals, unshaped_signals
from autopilot.trajectory.timeline import MIN_REEL_M, RELEASE_S, MissionState, state_after
from autopilot.trajectory.waypoint_path import PathSegment
from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    LoadPath,
    Release,
    ReturnHome,
    Signals,
    Speed,
    Step,
    SwitchFence,
    Takeoff,
    Trajectory,
    Waypoint,
    Winch,
)

NEAR_START = 0.3  # m from the beginning of a path through waypoints, within which the path is still flown


def destination(step: Step, here: Vec3, flight: Flight) -> Vec3:
    """Where a step ends that begins with load or vehicle at rest at `here`."""
    there = state_after(step, MissionState(here), flight.area.home).expected
    assert there is not None, "from a known place"
    return there


def step_legs(step: Step, here: Vec3, flight: Flight, settings: Settings) -> tuple[Leg, ...]:
    """The legs of a mission step that begins with the load at rest at `here`."""
    match step:
        case Takeoff():
            up = destination(step, here, flight)
            return (lift(here, up, settings.motion.lift_speed_m_s, settings),)
        case Waypoint(hold_s=hold):
            there = destination(step, here, flight)
            path = prepared_path(flight, flight.mission.step)
            go: Leg
            if (
                isinstance(path, PathSegment)
                and path.begin_s == 0.0
                and norm(sub(here, path.start)) < NEAR_START
            ):
                fade = min(settings.min_move_s, float(path.table[-1, 1]))
                go = PathStretch(path, sub(here, path.start), fade)
            else:
                go = carry(here, there, flight.mission.speed_m_s, settings, _min_duration_s(flight))
            return (go, Hold(there, max(hold - hold_reduction_s(flight), 0.0))) if hold > 0.0 else (go,)
        case Delay(duration_s=duration):
            return (Hold(here, max(duration - hold_reduction_s(flight), 0.0)),)
        case ReturnHome():
            there = destination(step, here, flight)
            return (carry(here, there, flight.mission.speed_m_s, settings, _min_duration_s(flight)),)
        case Signals() | Trajectory():
            return (SignalRun(here, _signals_of(flight, flight.mission.step) or unshaped_signals(step)),)
        case AttitudeRun(
            controlled=controlled, tilt_north_rad=north, tilt_east_rad=east, duration_s=duration
        ):
            mode = QUAD_ATTITUDE if controlled == "vehicle" else LOAD_ATTITUDE
            return (Swing(here, north, east, duration, mode),)
        case Speed() | SwitchFence():
            return (Hold(here, 0.0),)
        case Release():
            return (Hold(here, RELEASE_S),)
        case Winch(speed_m_s=speed):
            target_m = (
                settings.cable_length_m if flight.cable.reel_target_m is None else flight.cable.reel_target_m
            )
            length = cable_length_at(flight, here, settings)
            if abs(target_m - length) < MIN_REEL_M:
                return (Hold(here, 0.0),)
            return (
                reel_leg(
                    here, length, target_m, speed or settings.winch.speed_m_s, settings.winch.accel_m_s2
                ),
            )
        case Land():
            return ()
    raise AssertionError(step)


def following_legs(flight: Flight, settings: Settings) -> tuple[Leg, ...]:
    """The legs of the step after the present one, where it begins at rest where this one ends."""
    step = flight.mission.plan.next_step(flight.mission.step) if flight.mission.active else None
    if step is None or flight.phase not in (Phase.LIFT, Phase.MISSION):
        return ()
    last = flight.legs[-1] if flight.legs else None
    if last is None or last.control_mode != LOAD_POSITION or not isfinite(last.duration_s):
        return ()
    end = last.jet(last.duration_s)
    next_step = flight.mission.plan.steps[step]
    if norm(end[1]) > AT_REST or not isinstance(next_step, Waypoint | Delay | ReturnHome | LoadPath):
        return ()
    return step_legs(next_step, end[0], replace(flight, mission=replace(flight.mission, step=step)), settings)


def prepared_path(flight: Flight, step: int) -> ShapedSignals | PathSegment | None:
    """The path that was prepared for a step of the plan; None if there is none."""
    paths = flight.mission.plan.prepared.paths
    return paths[step] if 0 <= step < len(paths) else None


def _signals_of(flight: Flight, step: int) -> ShapedSignals | None:
    """The shaped signals that were prepared for a step of the plan; None for any other step."""
    prepared = prepared_path(flight, step)
    return prepared if isinstance(prepared, ShapedSignals) else None


def hold_reduction_s(flight: Flight) -> float:
    """Time (s) that the signals before and after the present step take from its hold: to come to rest, and to
    lead in."""
    plan, step = flight.mission.plan, flight.mission.step
    following = plan.next_step(step)
    before = _signals_of(flight, step - 1) if step - 1 not in plan.loops else None
    after = _signals_of(flight, following) if following is not None else None
    return (before.tail_s if before else 0.0) + (after.lead_s if after else 0.0)


def _min_duration_s(flight: Flight) -> float:
    """Least duration (s) of the transfer of the present step within the limits of rotors, cable and tilt."""
    min_durations_s = flight.mission.plan.prepared.min_durations_s
    return min_durations_s[flight.mission.step] if flight.mission.step < len(min_durations_s) else 0.0
