"""How long a mission should take: for progress bars and for the time at which a flight is given up."""

from __future__ import annotations

import math

from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    Mission,
    ReturnHome,
    Signals,
    Speed,
    Step,
    Takeoff,
    Waypoint,
)
from missions.transfer import transfer_duration

# what a vehicle does when nobody set it otherwise (MIS_SPEED, MIS_ACCEL, MIS_LIFT_SPEED, MIS_TAUT_SPEED)
SPEED_M_S = 1.5
ACCELERATION_M_S2 = 1.5
LIFT_M_S = 0.8
TAUTEN_S = 7.0  # rising over the load until a cable of about a metre is taut
SET_DOWN_S = 7.0  # landing beside the load, and rotors off
SETTLE_S = 0.3  # between two steps

Place = tuple[float, float, float]


def expected_duration_s(mission: Mission) -> float:
    """Duration of the flight in s, from the start of the rotors to their stop, for a vehicle as delivered."""
    place: Place = (0.0, 0.0, 0.0)
    speed = SPEED_M_S
    total = 0.0
    for step in mission.steps:
        if isinstance(step, Speed):
            speed = step.speed_m_s
            continue
        seconds, place = _step(step, place, speed)
        total += seconds + SETTLE_S
    return total


def _step(step: Step, place: Place, speed: float) -> tuple[float, Place]:
    """(duration, where the load is afterwards)."""
    east, north, altitude = place
    if isinstance(step, Takeoff):
        lift = transfer_duration(abs(step.altitude_m - altitude), LIFT_M_S, ACCELERATION_M_S2)
        return TAUTEN_S + lift, (east, north, step.altitude_m)
    if isinstance(step, Land):
        return transfer_duration(altitude, LIFT_M_S, ACCELERATION_M_S2) + SET_DOWN_S, (east, north, 0.0)
    if isinstance(step, Waypoint):
        target = (step.east_m, step.north_m, step.altitude_m)
        return _carry(place, target, speed) + step.hold_s, target
    if isinstance(step, ReturnHome):
        target = (0.0, 0.0, altitude)
        return _carry(place, target, speed), target
    if isinstance(step, Delay | Signals | AttitudeRun):
        return step.duration_s, place
    return 0.0, place


def _carry(start: Place, end: Place, speed: float) -> float:
    return transfer_duration(math.dist(start, end), speed, ACCELERATION_M_S2)
