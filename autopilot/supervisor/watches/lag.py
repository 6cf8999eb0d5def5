"""A vehicle that is controlled, but too weak for the wind or its path: its path waits for it until it is near
again, and is continued more slowly. If it cannot stay where it should rest, or keep its height, it lands."""

from __future__ import annotations

from dataclasses import replace

from autopilot.guidance.legs import LagWait, Leg, PathResume, SignalRun, Transfer
from autopilot.supervisor.motion import stopped_run_of, stopping_legs, with_control_modes
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import INFO, WARNING, Event, Flight, Phase, View, interrupt_mission
from autopilot.supervisor.watches.failsafe import PathError, off_path_text, path_error
from autopilot.supervisor.watches.watch_result import WatchResult
from autopilot.wire.dialect.plumbline import MAV_SEVERITY_ERROR

RESUME_SHARE = 0.5  # of FS_LOAD_ERR: so near to where it should be, the path is continued
MIN_APPROACH = 0.3  # m/s, below which it does not come nearer any more
SLOWER = 0.7  # factor of the speed of transfers each time that a path has waited
SINKING_S = 5.0  # one that sinks far below its path, and would be at the height of home by then, lands
MIN_SPEED = 1.0  # m/s, below which that speed is not reduced


def watch_lag(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Let the path wait for a vehicle or load that is farther off than FS_LOAD_ERR, hold, or land. A landing
    that has begun continues; one that seems out of control is left to `failsafe`, the way to a taut cable to
    `tautening`."""
    error = path_error(flight, view)
    elsewhere = flight.phase in (Phase.LOWER, Phase.TAUTEN)
    if error is None or elsewhere or flight.out_of_control_since_us >= 0:
        return WatchResult(flight)
    limit_m, comes_nearer = settings.failsafe.load_error_limit_m, error.approach_m_s >= MIN_APPROACH
    if error.distance_m <= limit_m:
        waits = isinstance(flight.legs[0], LagWait)
        if waits and not (comes_nearer and error.distance_m > RESUME_SHARE * limit_m):
            return _flying_on(flight)
        return WatchResult(flight)
    x, v = (view.x_quad, view.v_quad) if flight.cable.released else (view.x_load, view.v_load)
    sinks = error.offset[2] < -limit_m and x[2] + SINKING_S * v[2] < 0.0
    stopping, here = stopping_legs(flight, view, settings)
    if stopping and not sinks:
        return _stopped(flight, error, (*stopping, LagWait(here)), view, settings)
    if comes_nearer and not sinks:
        return WatchResult(flight)
    # from where it is, as it moves
    flight = replace(interrupt_mission(flight), legs=())
    text = f"Failsafe: {off_path_text(error, settings)}, {'sinking, ' * sinks}landing"
    return WatchResult(flight, Event.LAND, ((MAV_SEVERITY_ERROR, text),))


def _stopped(
    flight: Flight, error: PathError, legs: tuple[Leg, ...], view: View, settings: Settings
) -> WatchResult:
    """The flight that comes to rest along its path by `legs`: to wait there, or to hold."""
    text = off_path_text(error, settings)
    if flight.phase in (Phase.HOLD, Phase.GUIDED):
        if flight.phase == Phase.HOLD and not isinstance(flight.legs[0], Transfer):  # it stops already
            return WatchResult(flight)
        return WatchResult(flight, Event.HOLD, ((MAV_SEVERITY_ERROR, f"Failsafe: {text}, holding"),))
    if isinstance(flight.legs[-1], LagWait):
        return WatchResult(flight)
    stopped_run = stopped_run_of(flight, view, settings, legs)
    if stopped_run is None and isinstance(flight.legs[0], SignalRun | PathResume):  # it ends before it stops
        return WatchResult(flight)
    flight = replace(
        flight,
        legs=with_control_modes(flight, legs),
        leg_start_us=view.now_us,
        following=(),
        mission=replace(flight.mission, stopped_run=stopped_run or flight.mission.stopped_run),
    )
    return WatchResult(flight, None, ((WARNING, f"Path waits: {text}"),))


def _flying_on(flight: Flight) -> WatchResult:
    """The flight that continues its path; a transfer more slowly."""
    in_run = flight.phase == Phase.MISSION and flight.mission.stopped_run is not None
    if flight.phase == Phase.LIFT or in_run:
        return WatchResult(flight, Event.CAUGHT_UP, ((INFO, "Near the path again, flying on"),))
    mission = flight.mission
    speed_m_s = min(mission.speed_m_s, max(MIN_SPEED, SLOWER * mission.speed_m_s))
    mission = replace(mission, speed_m_s=speed_m_s, speed_before_waits_m_s=mission.requested_speed_m_s)
    flight = replace(flight, mission=mission)
    text = f"Near the path again, flying on at {speed_m_s:.1f} m/s"
    return WatchResult(flight, Event.CAUGHT_UP, ((INFO, text),))
