"""Where a custom control law and the compiled tick meet: a row of numbers, and functions at addresses.

The tick writes what the law is given (`Now`) to the front of the row, calls the function of the present mode
with the row's address, and reads what it asks for (`Asked`) from behind it. What lies behind that is the
law's own. So the tick is compiled once, whatever law is flown.

World ENU, body FLU, SI.
"""

from __future__ import annotations

from math import isfinite, nan
from typing import NamedTuple

from autopilot.control.records import Cable, Reference, State
from autopilot.geometry.addresses import call_at, numbers_at
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import IDENTITY, Mat3, Vec3
from autopilot.geometry.packed import pack, unpack, width

# what a law asks for
WRENCH, FORCE, ATTITUDE, RATES = 0, 1, 2, 3


class Believed(NamedTuple):
    """What the autopilot believes of the vehicle, its load and the air, by its parameters and by what it has
    observed in this flight."""

    quad_mass: float  # m_Q, kg, without the load
    load_mass: float  # m_L, kg, as the cable's pull tells it
    inertia: Vec3  # diagonal of J, kg m^2, body
    gravity: float  # g, m/s^2
    push: Vec3  # N, world: what the wind does to the vehicle, besides drag in still air
    rotor_thrust: float  # N: what the rotors give at this tick
    rotor_moment: Vec3  # N m, body
    load_lies: bool  # the load is on the ground
    stands: bool  # the vehicle is


class Held(NamedTuple):
    """What the two attitude modes are to hold; in the other modes what is there."""

    q_d: Vec3  # load_attitude: direction of the cable from vehicle to load, unit vector, world
    pull: float  # N, of the cable meanwhile
    R_d: Mat3  # quad_attitude: body to world
    thrust: float  # N, meanwhile


class Now(NamedTuple):
    """What a law is given at a tick."""

    begins: bool  # the first tick of this mode
    time_s: float  # since the mode began
    period_s: float  # from tick to tick
    state: State  # the estimate
    reference: Reference  # what is asked for: of the load in load_position, of the vehicle in quad_position
    held: Held  # what is asked for in the attitude modes
    cable: Cable  # length, rate and acceleration, as the winch has it
    believed: Believed


class Asked(NamedTuple):
    """What a law asks for, by its kind: thrust and moment (WRENCH), a force (FORCE), attitude and thrust
    (ATTITUDE), or body rates and thrust (RATES)."""

    kind: int
    thrust: float  # N, along the thrust axis
    vector: Vec3  # moment N m, body; or force N, world; or rate rad/s, body
    attitude: Mat3


class Link(NamedTuple):
    """Addresses; a mode whose function is 0 is not the law's."""

    desk: int
    alarm: int  # called where what the law asks for is no number
    load_position: int
    quad_position: int
    load_attitude: int
    quad_attitude: int


UNLINKED = Link(0, 0, 0, 0, 0, 0)
UNASKED = Asked(WRENCH, nan, (nan, nan, nan), IDENTITY)
ASKED = width(Now)  # where it lies on the desk
OWN = ASKED + width(Asked)  # what lies from here on is the law's


@kernel
def is_sound(asked: Asked) -> bool:
    """Whether all of it are numbers."""
    v, R = asked.vector, asked.attitude
    rows = R[0][0] + R[0][1] + R[0][2] + R[1][0] + R[1][1] + R[1][2] + R[2][0] + R[2][1] + R[2][2]
    return WRENCH <= asked.kind <= RATES and isfinite(asked.thrust + v[0] + v[1] + v[2] + rows)


@kernel
def ask(function: int, address: int, now: Now) -> Asked:
    """What the C function `void f(double *)` at an address asks for, given the address of a desk."""
    desk = numbers_at(address, OWN)
    pack(now, desk, 0)
    pack(UNASKED, desk, ASKED)
    call_at(function, address)
    return unpack(Asked, desk, ASKED)
