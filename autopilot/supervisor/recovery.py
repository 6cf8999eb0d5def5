"""A flight that is found under way: the autopilot has started anew while the rotors obey what it asked for.

The rotors keep the thrust that was asked for last while the gyroscope keeps the vehicle level, until
`watches.recovery` finds that the sensors have told where vehicle and load are. Then the swing that the load
has taken up beneath the level vehicle is calmed, and the load held.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from autopilot.guidance.legs import Steady
from autopilot.supervisor.machine import must_happen
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Event, Flight, Text, View
from autopilot.supervisor.table import TRANSITIONS
from autopilot.supervisor.watches.failsafe import given_up


@dataclass(frozen=True, slots=True)
class Found:
    """What rotors, winch and gripper do when the autopilot starts."""

    thrust_n: float  # that was asked for last
    reeled_m: float  # by which the winch has lengthened the cable
    released: bool


def take_up(flight: Flight, found: Found, view: View, settings: Settings) -> Flight:
    """The flight as it is found."""
    motion, cable = settings.motion, replace(flight.cable, released=found.released)
    if found.reeled_m != 0.0:
        cable = replace(cable, length_m=settings.cable_length_m + found.reeled_m)
    mission = replace(
        flight.mission, speed_m_s=motion.speed_m_s, takeoff_altitude_m=motion.takeoff_altitude_m
    )
    flight = must_happen(replace(flight, cable=cable, mission=mission), Event.FOUND, view, settings)
    return replace(flight, legs=(Steady(found.thrust_n),), leg_start_us=view.now_us, following=())


def broken_off(flight: Flight, why: str, view: View, settings: Settings) -> tuple[Flight, tuple[Text, ...]]:
    """The flight that nobody has controlled for a while, its rotors stopped, and the texts about it."""
    if (flight.phase, Event.FAIL) not in TRANSITIONS:
        return flight, ()
    ended = given_up(flight, why)
    return must_happen(ended.flight, Event.FAIL, view, settings), ended.texts
