"""Legs: what load or vehicle is asked to do from one moment to the next, each a function of the time in it.

A leg is data. The supervisor strings legs together; the flight core asks the present one for its setpoint.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from autopilot.control.records import Jet
from autopilot.geometry.linear import ZERO, Vec3, add, norm, scale, sub
from autopilot.wire.dialect import plumbline as mavlink
from missions.signals import SignalTable, evaluate
from missions.swing import swing
from missions.transfer import transfer, transfer_duration

QUAD_ATTITUDE = mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE
LOAD_ATTITUDE = mavlink.PLUMBLINE_CONTROL_LOAD_ATTITUDE
LOAD_POSITION = mavlink.PLUMBLINE_CONTROL_LOAD_POSITION
QUAD_POSITION = mavlink.PLUMBLINE_CONTROL_QUAD_POSITION


def _rest(position: Vec3) -> Jet:
    return (position, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO)


@dataclass(frozen=True, slots=True)
class Hold:
    """Stay at a point for `duration_s` (infinite: until told otherwise)."""

    position: Vec3
    duration_s: float = inf
    control_mode: int = LOAD_POSITION

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        return _rest(self.position)


@dataclass(frozen=True, slots=True)
class Transfer:
    """From rest to rest along a straight line."""

    begin: Vec3
    end: Vec3
    duration_s: float
    control_mode: int = LOAD_POSITION

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        return transfer(self.begin, self.end, self.duration_s, t)


@dataclass(frozen=True, slots=True)
class Creep:
    """Along a straight line at constant speed, without end: until something is touched or pulled taut."""

    begin: Vec3
    velocity: Vec3
    control_mode: int
    duration_s: float = inf

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        return (add(self.begin, scale(t, self.velocity)), self.velocity, ZERO, ZERO, ZERO, ZERO, ZERO)


@dataclass(frozen=True, slots=True)
class Run:
    """The signals of a mission, from where the load hung when they began."""

    anchor: Vec3
    table: SignalTable
    duration_s: float
    control_mode: int = LOAD_POSITION

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        x, v, a, j, s, c, p = evaluate(self.table, t)
        return (add(self.anchor, x), v, a, j, s, c, p)


@dataclass(frozen=True, slots=True)
class Swing:
    """An attitude of vehicle or load swung out and back. Only the height of `anchor` is held meanwhile."""

    anchor: Vec3
    tilt_north_rad: float
    tilt_east_rad: float
    duration_s: float
    control_mode: int

    def jet(self, t: float) -> Jet:
        """The anchor at rest: of its position the height alone is tracked."""
        return _rest(self.anchor)

    def upward(self, t: float) -> Vec3:
        """Unit vector, ENU: the thrust axis asked for, or the direction from load to vehicle."""
        return swing(self.tilt_north_rad, self.tilt_east_rad, self.duration_s, t)[0]


Leg = Hold | Transfer | Creep | Run | Swing


def transfer_leg(begin: Vec3, end: Vec3, speed: float, accel: float, control_mode: int) -> Transfer:
    """A transfer whose peak speed and acceleration stay within the limits given."""
    distance = norm(sub(end, begin))
    return Transfer(begin, end, transfer_duration(distance, speed, accel), control_mode)
