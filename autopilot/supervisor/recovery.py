"""A flight that is found in progress: the autopilot was restarted while the rotors obey its last commands.

The rotors keep the last commanded thrust, and the gyroscope keeps the vehicle level, until `watches.recovery`
finds that the sensors determine the positions of vehicle and load. Then the swing that the load has acquired
beneath the level vehicle is damped, and the load is held.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from autopilot.guidance.legs import LevelHold
from autopilot.supervisor.machine import transition
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Event, Flight, Text, View
from autopilot.supervisor.table import TRANSITIONS
from autopilot.supervisor.watches.failsafe import give_up_flight


@dataclass(frozen=True, slots=True)
class RestartState:
    """The state of rotors, winch and gripper when the autopilot starts."""

    thrust_n: float  # the last one commanded
    reeled_m: float  # length by which the winch has lengthened the cable
    released: bool


def resume_flight(flight: Flight, restart: RestartState, view: View, settings: Settings) -> Flight:
    """The flight that begins with the state found."""
    motion, cable = settings.motion, replace(flight.cable, released=restart.released)
    if restart.reeled_m != 0.0:
        cable = replace(cable, length_m=settings.cable_length_m + restart.reeled_m)
    mission = replace(
        flight.mission, speed_m_s=motion.speed_m_s, takeoff_altitude_m=motion.takeoff_altitude_m
    )
    flight = transition(replace(flight, cable=cable, mission=mission), Event.FOUND_IN_FLIGHT, view, settings)
    return replace(flight, legs=(LevelHold(restart.thrust_n),), leg_start_us=view.now_us, following=())


def abort_flight(flight: Flight, why: str, view: View, settings: Settings) -> tuple[Flight, tuple[Text, ...]]:
    """The flight, given up because it was not controlled for a while, and the texts about it."""
    if (flight.phase, Event.FAIL) not in TRANSITIONS:
        return flight, ()
    ended = give_up_flight(flight, why)
    return transition(ended.flight, Event.FAIL, view, settings), ended.texts
