"""The interface between a custom control law and the compiled tick: a row of numbers, and functions at
addresses.

The tick writes what the law is given (`Now`) to the front of the row, calls the function of the present mode
with the row's address, and reads the command of the law (`Asked`) from the place behind `Now`. The rest of
the row belongs to the law. The tick is therefore compiled only once for all custom laws.

World ENU, body FLU, SI.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from autopilot.control.records import Cable, Reference, State
from autopilot.geometry.addresses import call_at, numbers_at
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import IDENTITY, Mat3, Vec3
from autopilot.geometry.magnitude import is_bounded, is_bounded_vector
from autopilot.geometry.packed import pack, unpack, width
from autopilot.geometry.so3 import is_rotation

# kinds of command
WRENCH, FORCE, ATTITUDE, RATES = 0, 1, 2, 3


class Believed(NamedTuple):
    """The vehicle, its load and the air as the autopilot assumes them, from its parameters and from what it
    has observed in this flight."""

    quad_mass: float  # m_Q, kg, without the load
    load_mass: float  # m_L, kg, estimated from the cable's pull
    inertia: Vec3  # diagonal of J, kg m^2, body
    gravity: float  # g, m/s^2
    push: Vec3  # N, world: force of the wind on the vehicle, besides drag in still air
    rotor_thrust: float  # N: what the rotors give at this tick
    rotor_moment: Vec3  # N m, body
    load_lies: bool  # the load is on the ground
    stands: bool  # the vehicle is on the ground


class Held(NamedTuple):
    """The setpoints of the two attitude modes; in the other modes the present direction and attitude."""

    q_d: Vec3  # load_attitude: direction of the cable from vehicle to load, unit vector, world
    pull: float  # N, of the cable, in load_attitude
    R_d: Mat3  # quad_attitude: body to world
    thrust: float  # N, in quad_attitude


class Now(NamedTuple):
    """What a law is given at a tick."""

    begins: bool  # the first tick of this mode
    time_s: float  # since the mode began
    period_s: float  # from tick to tick
    state: State  # the estimate
    reference: Reference  # the setpoint: of the load in load_position, of the vehicle in quad_position
    held: Held  # the setpoints of the attitude modes
    cable: Cable  # length, rate and acceleration, as set by the winch
    believed: Believed


class Asked(NamedTuple):
    """The command of a law, by its kind: thrust and moment (WRENCH), a force (FORCE), attitude and thrust
    (ATTITUDE), or body rates and thrust (RATES)."""

    kind: int
    thrust: float  # N, along the thrust axis
    vector: Vec3  # moment N m, body; or force N, world; or rate rad/s, body
    attitude: Mat3


class Link(NamedTuple):
    """Addresses; the law does not define a mode whose function is 0."""

    row: int
    alarm: int  # called if the law's command is not valid
    load_position: int
    quad_position: int
    load_attitude: int
    quad_attitude: int


UNLINKED = Link(0, 0, 0, 0, 0, 0)
UNSET_COMMAND = Asked(WRENCH, nan, (nan, nan, nan), IDENTITY)
COMMAND_OFFSET = width(Now)  # place of `Asked` in the row
LAW_OFFSET = COMMAND_OFFSET + width(Asked)  # from here on the row belongs to the law


@kernel
def is_valid(command: Asked) -> bool:
    """Whether the kind is a known one, no number is too large or none, and a commanded attitude is a
    rotation."""
    if not (WRENCH <= command.kind <= RATES):
        return False
    if not (is_bounded(command.thrust) and is_bounded_vector(command.vector)):
        return False
    return command.kind != ATTITUDE or is_rotation(command.attitude)


@kernel
def call_law(function: int, address: int, now: Now) -> Asked:
    """The command of the C function `void f(double *)` at an address, called with the address of a row."""
    row = numbers_at(address, LAW_OFFSET)
    pack(now, row, 0)
    pack(UNSET_COMMAND, row, COMMAND_OFFSET)
    call_at(function, address)
    return unpack(Asked, row, COMMAND_OFFSET)
