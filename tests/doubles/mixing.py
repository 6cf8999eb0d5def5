"""The mixer with its forces in its result."""

from __future__ import annotations

from typing import Any, NamedTuple

from autopilot.control.actuators import mixer
from autopilot.control.records import Vehicle
from autopilot.geometry.linear import Vec3
from autopilot.vehicle.layout import PLUS, Layout
from autopilot.vehicle.rotors import mixer_table


class Mixed(NamedTuple):
    """A `MixerResult`, and the force of each rotor in N."""

    forces: tuple[float, ...]
    saturated: int
    achieved_thrust: float
    achieved_moment: Vec3


def mix(
    thrust: float,
    moment: Vec3,
    vehicle: Vehicle,
    limited: float,
    layout: Layout = PLUS,
    lost: int = 0,
    room: Any = mixer,
) -> Mixed:
    """The forces commanded to the rotors of a vehicle, see `autopilot.control.actuators.mixer.mix`; by the
    functions of `room`, the mixer or a copy of it."""
    rotors = room.new_rotors()
    result = room.mix(thrust, moment, vehicle, limited, mixer_table(layout, lost), rotors)
    x, y, z = result.achieved_moment
    done = (float(x), float(y), float(z))
    return Mixed(
        tuple(rotors[room.FORCE, : len(layout)].tolist()),
        result.saturated,
        float(result.achieved_thrust),
        done,
    )
