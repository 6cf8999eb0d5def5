"""Touchdown, first of the load and then of the vehicle."""

from __future__ import annotations

from dataclasses import replace
from math import inf

from autopilot.guidance.legs import LOAD_POSITION, Creep
from autopilot.supervisor.mission import RELEASED_TEXT
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    INFO,
    Event,
    Flight,
    Phase,
    View,
    has_lasted,
    is_placing,
    leg_time_s,
    with_condition,
    without_load,
)
from autopilot.supervisor.watches.cable_pull import SLACK_PULL_SHARE, cable_pull_share
from autopilot.supervisor.watches.watch_result import WatchResult
from autopilot.trajectory.slack_cable import TOUCH_SPEED

LOAD_DEPTH, VEHICLE_DEPTH = 0.05, 0.15  # m by which the setpoint must be below a load or vehicle that stopped
# m, ten seconds of sinking: then only the ground can hold the vehicle up, however it trembles
ON_GROUND_DEPTH = 2.0
STILL_SPEED, STILL_US = 0.05, 200_000
# m and us: a vehicle that trembles stands if its height varies by no more for so long; one that leans against
# the wind as it touches down would otherwise be turned over by it
STOPPED_RANGE, STOPPED_US = 0.02, 500_000


def watch_touchdown(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Set the vehicle down when the load lies on the ground; disarm when the vehicle stands."""
    if flight.phase not in (Phase.LOWER, Phase.SET_DOWN):
        return WatchResult(flight)
    flight = _note_touchdown(flight, view, settings)
    still = has_lasted(flight.condition_since_us, STILL_US, view.now_us)
    if not still and not has_lasted(flight.stopped_since_us, STOPPED_US, view.now_us):
        return WatchResult(flight)
    if is_placing(flight):
        texts = (INFO, "Load on the ground"), (INFO, RELEASED_TEXT)
        return WatchResult(replace(without_load(flight), legs=()), Event.LOAD_PLACED, texts)
    if flight.phase == Phase.LOWER and not flight.cable.released:
        return WatchResult(flight, Event.LOAD_DOWN, ((INFO, "Load on the ground"),))
    return _landed(flight)


def _landed(flight: Flight) -> WatchResult:
    """The vehicle stands on the ground: a mission in progress has reached its landing item, and ends with it,
    whatever follows."""
    mission = flight.mission
    reached: tuple[int, ...] = ()
    if mission.active:
        item = mission.plan.sequence[mission.step]
        mission, reached = replace(mission, final_item=item), (item,)
    text = (INFO, "Landed, disarmed")
    return WatchResult(replace(flight, mission=mission), Event.VEHICLE_DOWN, (text,), reached)


def _note_touchdown(flight: Flight, view: View, settings: Settings) -> Flight:
    """Note since when the load or vehicle that is set down no longer follows its sinking setpoint.

    A load that still sinks lags behind the setpoint by the distance that it sinks in the lag of the law.
    Once the cable is slack, the velocity of the load is no evidence.
    """
    leg = flight.legs[0]
    if not isinstance(leg, Creep):
        return with_condition(flight, False, view.now_us)
    target = leg.jet(leg_time_s(flight, view.now_us))[0][2]
    if leg.control_mode != LOAD_POSITION:
        return _note_stopped_vehicle(flight, view.x_quad[2] - target, view)
    down = view.x_load[2] - target > LOAD_DEPTH + settings.ramp_lag_s * TOUCH_SPEED
    # while readings are missing, the pull shows that the load is down
    down = down or (bool(view.estimate_problems) and cable_pull_share(view, settings) < SLACK_PULL_SHARE)
    return with_condition(flight, down, view.now_us)


def _note_stopped_vehicle(flight: Flight, depth: float, view: View) -> Flight:
    """The same of the vehicle, whose setpoint is `depth` (m) below it.

    It must stand still as well, because a gust may hold it up. But on the ground a loop with a long delay,
    or that of a vehicle that leans against the wind, may not come to rest: then a height that stays about the
    same, or a setpoint far below, suffices.
    """
    stopped = depth > VEHICLE_DEPTH
    down = stopped and (depth > ON_GROUND_DEPTH or abs(view.v_quad[2]) < STILL_SPEED)
    flight = with_condition(flight, down, view.now_us)
    if not stopped:
        if flight.stopped_since_us < 0:
            return flight
        return replace(flight, stopped_height=inf, stopped_since_us=-1)
    height = view.x_quad[2]
    if abs(height - flight.stopped_height) <= STOPPED_RANGE:
        return flight
    return replace(flight, stopped_height=height, stopped_since_us=view.now_us)
