"""Circles by request."""

from __future__ import annotations

import math
from dataclasses import replace

from autopilot.geometry.linear import Vec3, add, sub
from autopilot.guidance.setpoint_follower import NEVER_US, Circle
from autopilot.services.requests import Orbit
from autopilot.supervisor.heading import with_look_at_aim
from autopilot.supervisor.motion import commanded_motion
from autopilot.supervisor.requests.guided import start_guided
from autopilot.supervisor.requests.limits import MAX_DISTANCE_M, MIN_ALTITUDE_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import CARRYING, Flight, SetpointSource, View, fence_problem
from missions.model import LookAt

MIN_RADIUS_M = 0.2
DEFAULT_RADIUS_M = 2.0  # or more, so that the speed takes at most half of MIS_ACCEL inwards
MIN_CIRCLE_SPEED_M_S = 0.05
RAMP_SHARE = 4.0  # a circle begins with a quarter of MIS_ACCEL along it
CIRCLE_POINTS = 72
_SPEED_DIGITS = 9
MAX_CIRCLE_S = 1e9


def orbit(flight: Flight, request: Orbit, view: View, settings: Settings) -> Decision:
    """Fly a circle with the load."""
    if flight.phase not in CARRYING:
        return flight, wrong_phase(flight, "Orbit")
    here = commanded_motion(flight, view, settings)[0]
    flown = flight.setpoints.circle if flight.is_circling else None
    around = here if flown is None else flown.centre
    centre: Vec3 = (
        around[0] if request.east_m is None else request.east_m,
        around[1] if request.north_m is None else request.north_m,
        here[2] if request.altitude_m is None else request.altitude_m,
    )
    speed = _speed(flight, flown) if request.speed_m_s is None else request.speed_m_s
    signed_radius = _radius(speed, flown, settings) if request.radius_m is None else request.radius_m
    radius = abs(signed_radius)
    reason = _circle_problem(flight, centre, radius, speed, settings)
    if reason:
        return flight, denied(f"Orbit denied: {reason}")
    from_centre = sub(here, centre)
    phase = (
        math.atan2(from_centre[1], from_centre[0])
        if math.hypot(from_centre[0], from_centre[1]) > 0.0
        else 0.0
    )
    rate, ramp_s = -speed / signed_radius, RAMP_SHARE * abs(speed) / settings.motion.accel_m_s2
    ends_us = NEVER_US
    if request.turns is not None:
        turning_s = min(2.0 * math.pi * request.turns / abs(rate) + 0.5 * ramp_s, MAX_CIRCLE_S)
        ends_us = view.now_us + round(1e6 * turning_s)
    circle = Circle(centre, radius, rate, phase, view.now_us, ramp_s, ends_us)
    circling = replace(flight, setpoints=replace(flight.setpoints, circle=circle))
    circling, verdict = start_guided(circling, SetpointSource.ORBIT, "Orbit", view, settings)
    if verdict.result == ACCEPTED.result and request.faces_centre is not None:
        look_at = LookAt(centre[0], centre[1]) if request.faces_centre else LookAt(None, None)
        circling = with_look_at_aim(circling, look_at, view, settings)
    return circling, verdict


def _speed(flight: Flight, flown: Circle | None) -> float:
    """The speed for a request that names none: that of the circle being flown, or of transfers."""
    # rounded: a speed at its limit must not exceed it by the last bit
    return flight.mission.speed_m_s if flown is None else round(flown.radius * abs(flown.rate), _SPEED_DIGITS)


def _radius(speed: float, flown: Circle | None, settings: Settings) -> float:
    """The radius for a request that names none, with the direction as its sign."""
    if flown is not None:
        return -math.copysign(flown.radius, flown.rate)
    return max(DEFAULT_RADIUS_M, 2.0 * speed * speed / settings.motion.accel_m_s2)


def _circle_problem(flight: Flight, centre: Vec3, radius: float, speed: float, settings: Settings) -> str:
    """Why a circle cannot be flown, or an empty string."""
    if not MIN_RADIUS_M <= radius <= MAX_DISTANCE_M:
        return f"radius {radius:g} m; must be {MIN_RADIUS_M:g} ... {MAX_DISTANCE_M:g} m"
    if not all(abs(value) <= MAX_DISTANCE_M for value in centre):
        return f"centre more than {MAX_DISTANCE_M:g} m from home"
    if centre[2] < MIN_ALTITUDE_M:
        return f"load height {centre[2]:.2f} m, min {MIN_ALTITUDE_M} m"
    if not MIN_CIRCLE_SPEED_M_S <= abs(speed) <= settings.setpoints.max_speed_m_s:
        limits = f"{MIN_CIRCLE_SPEED_M_S:g} ... {settings.setpoints.max_speed_m_s:g} m/s"
        return f"speed {speed:.2f} m/s; must be {limits}"
    centripetal = speed * speed / radius
    if centripetal > settings.motion.accel_m_s2:
        return f"{centripetal:.1f} m/s^2 inwards exceeds MIS_ACCEL {settings.motion.accel_m_s2:g}"
    for k in range(CIRCLE_POINTS):
        angle = 2.0 * math.pi * k / CIRCLE_POINTS
        there = add(centre, (radius * math.cos(angle), radius * math.sin(angle), 0.0))
        problem = fence_problem(flight, there, settings)
        if problem:
            return problem
    return ""
