"""A cable that goes slack in the air: the falling load is caught, and then the phase continues."""

from __future__ import annotations

from dataclasses import replace

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import CatchLoad, Creep, LevelHold
from autopilot.supervisor.phase_legs import TOUCH_HEIGHT
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    CRITICAL,
    INFO,
    WARNING,
    Event,
    Flight,
    Phase,
    View,
    can_fly,
    interrupt_mission,
    leg_time_s,
)
from autopilot.supervisor.watches.cable_pull import PULL_US, SLACK_PULL_SHARE, cable_pull_share
from autopilot.supervisor.watches.watch_result import WatchResult

LIFT_OFF_US = 1_000_000  # time after which a load that is being lifted is off the ground
ON_GROUND_SPEED = 0.3  # m/s; a smaller speed of a fallen load is noise or creep
MAX_FAILED_LIFTS = 3  # after which a load that does not leave the ground is left there
NOT_LIFTED_TEXT = "The load was not lifted: landing"
MIN_FALL_S = 1.0  # of a catch, after which a vehicle that does not move is down
MIN_GAP = 0.005  # m by which the ends must be closer than the taut length for the cable to count as slack
SLACK_US = 20_000  # time for which this must be the case


def watch_slack(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Catch a load that falls freely; begin the phase again when it hangs on the cable."""
    if flight.phase not in CARRYING or flight.cable.released or isinstance(flight.legs[0], LevelHold):
        return WatchResult(flight)
    if not can_fly(flight, settings) and not isinstance(flight.legs[0], CatchLoad):  # it falls anyway
        return WatchResult(flight)
    flight = _note_slack(flight, view, settings)
    if isinstance(flight.legs[0], CatchLoad) and _is_down(flight, view):
        return _after_loss(flight, "The load fell to the ground: landing")
    if flight.cable.slack_since_us < 0:
        return WatchResult(flight)
    lasted_us = view.now_us - flight.cable.slack_since_us
    if not isinstance(flight.legs[0], CatchLoad):
        if lasted_us < SLACK_US:
            return WatchResult(flight)
        lies = not view.load_tracked or _lies(view)
        if flight.phase == Phase.LIFT and lies and flight.cable.failed_lifts < MAX_FAILED_LIFTS:
            return _after_failed_lift(flight)
        if not view.load_tracked:  # nothing shows where it falls
            lost_text = "Cable without pull, load lost: landing"
            return _after_loss(flight, NOT_LIFTED_TEXT if flight.phase == Phase.LIFT else lost_text)
        cable = replace(flight.cable, slack_since_us=-1)
        catch = CatchLoad(view.x_quad, cable.taut_length_m, settings.motion.snap_speed_m_s)
        flight = replace(flight, legs=(catch,), leg_start_us=view.now_us, cable=cable)
        return WatchResult(flight, None, ((WARNING, "Cable slack: falling with the load to catch it"),))
    if lasted_us < PULL_US and not (
        lasted_us >= SLACK_US and cable_pull_share(view, settings) > SLACK_PULL_SHARE
    ):
        return WatchResult(flight)
    return _after_catch(flight)


def _is_down(flight: Flight, view: View) -> bool:
    """Whether the fall of a load that is to be caught has ended on the ground: the load lies there, or the
    vehicle does not fall any more, wherever its load seems to be."""
    has_fallen = leg_time_s(flight, view.now_us) > MIN_FALL_S
    return _lies(view) or (has_fallen and norm(view.v_quad) < ON_GROUND_SPEED)


def _lies(view: View) -> bool:
    """Whether the load seems to lie on the ground."""
    return view.x_load[2] < TOUCH_HEIGHT and norm(view.v_load) < ON_GROUND_SPEED


def _after_loss(flight: Flight, text: str) -> WatchResult:
    """The load does not hang on the cable any more: the vehicle lands without it."""
    flight = replace(interrupt_mission(flight), cable=replace(flight.cable, slack_since_us=-1))
    return WatchResult(flight, Event.LOAD_DOWN, ((CRITICAL, text),))


def _after_failed_lift(flight: Flight) -> WatchResult:
    """The load is still on the ground, because a gust and no load pulled: the cable is pulled taut again."""
    failed_lifts = flight.cable.failed_lifts + 1
    cable = replace(flight.cable, slack_since_us=-1, failed_lifts=failed_lifts)
    text = "Cable slack, the load is not lifted: pulling it taut again"
    return WatchResult(replace(flight, cable=cable), Event.NOT_LIFTED, ((WARNING, text),))


def _after_catch(flight: Flight) -> WatchResult:
    """The load hangs on the cable again; a mission step that slackens the cable twice is not continued."""
    mission = flight.mission
    again = mission.active and flight.cable.slack_step == mission.step
    cable = replace(flight.cable, slack_since_us=-1, slack_step=mission.step if mission.active else -1)
    flight = replace(flight, legs=(), cable=cable)
    if again:
        text = "Cable slack again in this mission item: holding"
        return WatchResult(interrupt_mission(flight), Event.HOLD, ((CRITICAL, text),))
    return WatchResult(flight, Event.CAUGHT, ((INFO, "Load caught"),))


def _note_slack(flight: Flight, view: View, settings: Settings) -> Flight:
    """Note since when the cable is slack although the load should hang on it; while the load is being caught,
    note since when the cable is taut.

    A gust can hide or imitate a pull, and noise of a tracker a gap of a few millimetres: a small gap counts
    only if the pull confirms it. A load that is not tracked has no gap, its cable is taut or slack as the
    estimator says; it is lowered to the ground whether its cable pulls or not.
    """
    if isinstance(flight.legs[0], CatchLoad):
        in_condition = view.taut
    else:
        gap = flight.cable.taut_length_m - norm(sub(view.x_quad, view.x_load))
        has_gap = view.load_tracked and gap > MIN_GAP
        is_slack = not view.taut or (has_gap and cable_pull_share(view, settings) < SLACK_PULL_SHARE)
        lifting = flight.phase == Phase.LIFT and view.now_us - flight.phase_start_us < LIFT_OFF_US
        creeping = isinstance(flight.legs[0], Creep) or not view.load_tracked
        on_ground = lifting or (flight.phase == Phase.LOWER and creeping)
        in_condition = is_slack and not on_ground
    if in_condition == (flight.cable.slack_since_us >= 0):
        return flight
    return replace(flight, cable=replace(flight.cable, slack_since_us=view.now_us if in_condition else -1))
