"""A flight that was found in progress: once the sensors determine all positions, the load is held, or the
vehicle lands beside a load that lies on the ground."""

from __future__ import annotations

from dataclasses import replace

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import LevelHold
from autopilot.supervisor.motion import damping_leg
from autopilot.supervisor.phase_legs import TOUCH_HEIGHT
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import WARNING, Event, Flight, View, leg_time_s
from autopilot.supervisor.watches.failsafe import give_up_flight
from autopilot.supervisor.watches.watch_result import WatchResult

TRACKED_S = 0.2  # until the velocities are known from a tracker
RECEIVED_S = 2.0  # until attitude and heading are known from a receiver
MAX_RECOVERY_S = 4.0  # time within which the sensors must determine all that
SLACK_SHARE = 0.965  # of the cable's length: a load that is nearer does not hang on it
# of the load's weight: with a thrust this far below the total weight no load was carried
SUSPENDED_SHARE = 0.5
STOP_GAIN = 4.0  # 1/s: deceleration per vertical speed of the level vehicle
STOP_ACCEL = 2.0  # m/s^2, limit of that deceleration
MIN_UPRIGHT = 0.7  # cosine of the greatest tilt for which the thrust compensates
HOLDING_TEXT = "Restarted in flight: holding"
LANDING_TEXT = "Restarted in flight: landing"


def watch_recovery(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Hold the load, or land, once the sensors determine the state; give up if they do not."""
    if not flight.legs or not isinstance(flight.legs[0], LevelHold):
        return WatchResult(flight)
    t = leg_time_s(flight, view.now_us)
    if view.estimate_problems and t >= MAX_RECOVERY_S:
        return give_up_flight(flight, f"restarted in flight, {view.estimate_problems[0]}")
    if view.estimate_problems or t < TRACKED_S:
        return WatchResult(flight)
    if view.height_std > 0.0 and t < RECEIVED_S:
        return WatchResult(_with_braking_thrust(flight, flight.legs[0], view, settings))
    distance = norm(sub(view.x_quad, view.x_load))
    suspended = view.taut or flight.cable.released
    if not suspended and distance > SLACK_SHARE * settings.cable_length_m and t < MAX_RECOVERY_S:
        return WatchResult(flight)  # whether the load hangs can be decided when its speed is known
    if not suspended and view.x_load[2] < TOUCH_HEIGHT:
        return WatchResult(flight, Event.LOAD_DOWN, ((WARNING, LANDING_TEXT),))
    length = distance if view.taut else settings.cable_length_m
    flight = replace(flight, cable=replace(flight.cable, taut_length_m=length))
    if not view.taut or flight.cable.released:
        return WatchResult(flight, Event.HOLD, ((WARNING, HOLDING_TEXT),))
    # beneath a vehicle that was kept level the load swings: a hold that begins at rest would stop the swing
    # abruptly, which requires more force than the rotors have
    damping = damping_leg(flight.legs[0], view, settings, ends_step=False)
    flight = replace(flight, legs=(damping,), leg_start_us=view.now_us)
    return WatchResult(flight, None, ((WARNING, HOLDING_TEXT),))


def _with_braking_thrust(flight: Flight, leg: LevelHold, view: View, settings: Settings) -> Flight:
    """The flight with a thrust that stops climbing or sinking, because the last commanded thrust may have
    been for the beginning of a climb. A thrust that cannot have carried the load stays as it is: the load
    then lies on the ground, and what is assumed about it may be wrong."""
    weight = min_thrust = settings.weight_n - (settings.load_weight_n if flight.cable.released else 0.0)
    min_thrust -= SUSPENDED_SHARE * settings.load_weight_n
    if leg.thrust_n < min_thrust:
        return flight
    accel = min(STOP_ACCEL, max(-STOP_ACCEL, -STOP_GAIN * view.v_quad[2]))
    thrust = weight * (1.0 + accel / settings.gravity_m_s2) / max(view.attitude[2][2], MIN_UPRIGHT)
    return replace(flight, legs=(LevelHold(max(thrust, min_thrust)),))
