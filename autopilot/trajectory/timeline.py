"""Where each step of a mission begins and ends, and how long it takes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import dist

from autopilot.geometry.linear import ZERO, Vec3, add
from autopilot.trajectory.signals import evaluate, signal_table
from autopilot.trajectory.transfer import transfer_duration
from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    Mission,
    Release,
    ReturnHome,
    Signals,
    Speed,
    Step,
    Takeoff,
    Waypoint,
    Winch,
)

# Estimates, for progress bars and time-outs only: from arming until the cable is taut, and from the load's
# touch-down until the rotors stop. Lift and lowering go at this speed or the mission's, whichever is less.
TAUTEN_S = 10.0
SET_DOWN_S = 10.0
VERTICAL_SPEED_M_S = 0.8
REEL_M_S = 0.3  # of a winch as delivered
RELEASE_S = 2.0  # held when the load is released
# of transfers, for a vehicle as delivered (MIS_SPEED, MIS_ACCEL)
SPEED_M_S, ACCEL_M_S2 = 1.5, 1.5


@dataclass(frozen=True, slots=True)
class Leg:
    """A step with the load's setpoint at its two ends (m, ENU from home), and its expected duration.

    `transfer_s` is the part of the duration in which the load travels from rest to rest; 0 if it does not.
    """

    item: int
    step: Step
    begin: Vec3
    end: Vec3
    transfer_s: float
    duration_s: float


def legs(mission: Mission, speed: float, accel: float) -> Iterator[Leg]:
    """The steps in order. Transfers peak at `speed` (m/s, until the mission sets one) and `accel` (m/s^2).

    Attitude runs leave the setpoint where it was.
    """
    here = ZERO
    for item, step in enumerate(mission.steps):
        end, moving, waiting, pace = here, 0.0, 0.0, speed
        match step:
            case Takeoff():
                end = (here[0], here[1], step.altitude_m)
                waiting, pace = TAUTEN_S, min(speed, VERTICAL_SPEED_M_S)
            case Waypoint():
                end, waiting = (step.east_m, step.north_m, step.altitude_m), step.hold_s
            case ReturnHome():
                end = (0.0, 0.0, here[2])
            case Land():
                end = (here[0], here[1], 0.0)
                waiting, pace = SET_DOWN_S, min(speed, VERTICAL_SPEED_M_S)
            case Speed():
                speed = step.speed_m_s
            case Winch():
                end = (here[0], here[1], here[2] - step.length_m)
                pace = min(speed, step.speed_m_s or REEL_M_S)
            case Release():
                waiting = RELEASE_S
            case Delay() | AttitudeRun():
                waiting = step.duration_s
            case Signals():
                waiting = step.duration_s
                end = add(here, evaluate(signal_table(step.terms), step.duration_s)[0])
        if not isinstance(step, Signals):
            moving = transfer_duration(dist(here, end), pace, accel)
        yield Leg(item, step, here, end, moving, moving + waiting)
        here = end


def expected_duration_s(mission: Mission, speed: float = SPEED_M_S, accel: float = ACCEL_M_S2) -> float:
    """Expected seconds from arming to the end of the mission: the sum over its legs."""
    return sum(leg.duration_s for leg in legs(mission, speed, accel))
