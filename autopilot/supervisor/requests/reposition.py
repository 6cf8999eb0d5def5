"""Flying to a place by request, and the speed of transfers."""

from __future__ import annotations

import math
from dataclasses import replace

from autopilot.geometry.linear import Vec3, norm, sub
from autopilot.guidance.heading import TurnTo, unwrap_near
from autopilot.guidance.legs import Hold, carry_leg
from autopilot.services.requests import (
    MAX_SPEED_M_S,
    MIN_SPEED_M_S,
    ChangeAltitude,
    ChangeSpeed,
    Reposition,
)
from autopilot.supervisor.heading import with_aim
from autopilot.supervisor.motion import with_control_modes
from autopilot.supervisor.requests.limits import MAX_DISTANCE_M, MIN_ALTITUDE_M
from autopilot.supervisor.requests.modes import hold
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, temporarily_denied, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import CARRYING, Flight, Phase, View, fence_problem
from autopilot.wire.dialect import plumbline as mavlink


def reposition(flight: Flight, request: Reposition, view: View, settings: Settings) -> Decision:
    """Fly to a place, and hold there."""
    if flight.phase not in CARRYING:
        return flight, wrong_phase(flight, "Reposition")
    if flight.phase != Phase.HOLD and not request.change_mode:
        return flight, temporarily_denied("Reposition denied: not holding")
    speed = flight.mission.speed_m_s if request.speed_m_s is None else request.speed_m_s
    if not MIN_SPEED_M_S <= speed <= MAX_SPEED_M_S:
        return flight, denied(
            f"Reposition denied: speed {speed:.2f} m/s; must be {MIN_SPEED_M_S:g} ... {MAX_SPEED_M_S:g} m/s"
        )
    held, verdict = hold(flight, request, view, settings)
    requested = (request.east_m, request.north_m, request.altitude_m)
    if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
        return held, verdict
    hold_leg = held.legs[-1]
    if not isinstance(hold_leg, Hold) and requested != (None, None, None):
        return flight, temporarily_denied("Reposition denied while the load swings: hold first")
    if request.heading_rad is not None:
        held = with_aim(held, TurnTo(unwrap_near(request.heading_rad, held.heading)), view)
    if requested == (None, None, None):
        return held, verdict
    assert isinstance(hold_leg, Hold)
    here = hold_leg.position
    there: Vec3 = (
        here[0] if requested[0] is None else requested[0],
        here[1] if requested[1] is None else requested[1],
        here[2] if requested[2] is None else requested[2],
    )
    if not all(map(math.isfinite, there)):
        return flight, denied("Reposition denied: not a place")
    if max(map(abs, there)) > MAX_DISTANCE_M:
        return flight, denied(f"Reposition denied: more than {MAX_DISTANCE_M:g} m from home")
    if there[2] < MIN_ALTITUDE_M:
        return flight, denied(f"Reposition denied: load height {there[2]:.2f} m, min {MIN_ALTITUDE_M} m")
    problem = fence_problem(flight, there, settings)
    if problem:
        return flight, denied(f"Reposition denied: {problem}")
    if norm(sub(there, here)) == 0.0:
        return held, ACCEPTED
    go = carry_leg(here, there, speed, settings.motion.accel_m_s2, settings.min_move_s)
    legs = with_control_modes(held, (*held.legs[:-1], go, Hold(there)))
    return replace(held, legs=legs, accepts_setpoints=True), ACCEPTED


def change_altitude(flight: Flight, request: ChangeAltitude, view: View, settings: Settings) -> Decision:
    """Fly to another height of the load, and hold there."""
    return reposition(flight, Reposition(None, None, request.altitude_m, True), view, settings)


def change_speed(flight: Flight, request: ChangeSpeed, view: View, settings: Settings) -> Decision:
    """Fly transfers at another speed from now on."""
    speed_m_s = settings.motion.speed_m_s if request.speed_m_s is None else request.speed_m_s
    if not MIN_SPEED_M_S <= speed_m_s <= MAX_SPEED_M_S:
        return flight, denied(
            f"Speed {speed_m_s:.2f} m/s denied; must be {MIN_SPEED_M_S:g} ... {MAX_SPEED_M_S:g} m/s"
        )
    return replace(flight, mission=flight.mission.at_speed(speed_m_s)), ACCEPTED
