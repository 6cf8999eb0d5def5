"""Rotor forces from thrust and moment: the inverse of (2-13) within the rotors' limits, by fixed priorities,
for any number of rotors at any positions.

| symbol         | code name       | frame | unit | equation |
|----------------|-----------------|-------|------|----------|
| F_i            | rotors[FORCE]   | B     | N    | (2-13)   |
| u_i = F_i / s_i |                | B     | N    | of a rotor of strength 1 |
| f              | thrust          | B     | N    | (2-13)   |
| M              | moment          | B     | N m  | (2-13)   |
| l              | vehicle.arm     |       | m    | (2-13)   |
| c = d/b        | torque_ratio    |       | m    | (2-13)   |
| x_i, y_i, c_i  | table           |       | l, l, c | position and drag torque of a rotor |

    f = sum F_i     M_x = l sum y_i F_i     M_y = -l sum x_i F_i     M_z = c sum c_i F_i

`vehicle.rotors.allocate` prepares, outside the loop, four columns over the usable rotors. The columns for
thrust, roll and pitch each leave the other two unchanged and need the smallest forces (the pseudo-inverse of
these three rows; their effect on yaw is accounted for). The column for yaw is the part of the row c_i that
the other three do not affect. Without limits, the sum of the four is the least-squares inverse of all four
rows. For the plus quadrotor of (2-13) they are 1/4, -+1/2, +-1/2 and -+1/4.

Within limits low <= u_i <= high the priorities are met one after the other, by moving along these columns,
each as far as the rotors allow (`_room`):

1. roll and pitch, first together: shortened to what is possible with some thrust; then each by itself towards
   its demand, as far as the rotors still allow;
2. thrust: limited to what is possible beside them; yaw is moved to make room;
3. yaw: limited to what is left.

A demand that is not a number counts as zero and sets the bit of every rotor in `saturated`.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control.records import Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import Vec3
from autopilot.vehicle.layout import MOST
from autopilot.vehicle.rotors import LIFT_BY, PITCH, PITCH_BY, ROLL, ROLL_BY, STRENGTH, YAW, YAW_BY

Array = NDArray[np.float64]

# rows of the rotors' memory, one column per rotor
FORCE, EFFORT, ALONG, EXPECTED, MISSED, GIVES, TOLD = range(7)
_LEAST = 1e-9  # N: a bound on less than this is rounding


class MixerResult(NamedTuple):
    """The part of a demand that the rotors carry out; their forces are in the row FORCE."""

    saturated: int  # bit i: the plain inverse of (2-13) asked rotor i+1 for more or less than it can give
    thrust_done: float  # N
    moment_done: Vec3  # N m, body


def new_rotors() -> Array:
    """The memory of rotors that stand still."""
    return np.zeros((7, MOST))


@kernel
def clamp(value: float, low: float, high: float) -> float:
    """value, or the nearer end of low ... high."""
    return min(high, max(low, value))


@kernel
def _room(rotors: Array, table: Array, beside: int, low: float, high: float) -> tuple[float, float]:
    """Least and greatest s for which some m keeps EFFORT + s ALONG + m times the column `beside` (STRENGTH:
    none) of every rotor in low ... high.

    Each rotor gives two bounds w s + v m <= b; each two bounds whose v differ in sign give one of s alone,
    and so does each bound in which m does not occur.
    """
    count = table.shape[0] - 1
    free = 0.0 if beside == STRENGTH else 1.0
    least, greatest = -np.inf, np.inf
    for i in range(2 * count):
        sign, rotor = (1.0, i) if i < count else (-1.0, i - count)
        v = sign * free * table[rotor, beside]
        if v < 0.0:
            continue
        w = sign * rotors[ALONG, rotor]
        b = (high if i < count else -low) - sign * rotors[EFFORT, rotor]
        if v == 0.0:
            end = b / if_above(abs(w), _LEAST, w, 1.0)
            least = max(least, if_above(-w, _LEAST, end, -np.inf))
            greatest = min(greatest, if_above(w, _LEAST, end, np.inf))
            continue
        for j in range(2 * count):
            sign, rotor = (1.0, j) if j < count else (-1.0, j - count)
            other = sign * table[rotor, beside]
            if other < 0.0:
                bound = (high if j < count else -low) - sign * rotors[EFFORT, rotor]
                slope = v * sign * rotors[ALONG, rotor] - other * w
                bound = v * bound - other * b
                end = bound / if_above(abs(slope), _LEAST, slope, 1.0)
                least = max(least, if_above(-slope, _LEAST, end, -np.inf))
                greatest = min(greatest, if_above(slope, _LEAST, end, np.inf))
    return least, greatest


@kernel
def _blend(
    rotors: Array, table: Array, row: int, thrust: float, roll: float, pitch: float, yaw: float
) -> None:
    """Write the sum of the columns, each times its amount, into a row."""
    for i in range(table.shape[0] - 1):
        level = thrust * table[i, LIFT_BY] + yaw * table[i, YAW_BY]
        rotors[row, i] = level + roll * table[i, ROLL_BY] + pitch * table[i, PITCH_BY]


@kernel
def _turns(table: Array, thrust: float, roll: float, pitch: float) -> float:
    """The effect on yaw of these amounts of the columns for thrust, roll and pitch."""
    last = table.shape[0] - 1
    lift, roll_by, pitch_by = table[last, LIFT_BY], table[last, ROLL_BY], table[last, PITCH_BY]
    turns: float = thrust * lift + roll * roll_by + pitch * pitch_by
    return turns


@kernel
def _fit(
    rotors: Array, table: Array, thrust: float, roll: float, pitch: float, yaw: float, low: float, high: float
) -> None:
    """Write the efforts within their limits, by priority, into the row EFFORT."""
    _blend(rotors, table, EFFORT, 0.0, 0.0, 0.0, 0.0)
    _blend(rotors, table, ALONG, 0.0, roll, pitch, 0.0)
    share = clamp(_room(rotors, table, LIFT_BY, low, high)[1], 0.0, 1.0)
    if share < 1.0:
        rest_roll, rest_pitch = (1.0 - share) * roll, (1.0 - share) * pitch
        roll, pitch = share * roll, share * pitch
        _blend(rotors, table, EFFORT, 0.0, roll, pitch, 0.0)
        _blend(rotors, table, ALONG, 0.0, rest_roll, 0.0, 0.0)
        roll = roll + rest_roll * clamp(_room(rotors, table, LIFT_BY, low, high)[1], 0.0, 1.0)
        _blend(rotors, table, EFFORT, 0.0, roll, pitch, 0.0)
        _blend(rotors, table, ALONG, 0.0, 0.0, rest_pitch, 0.0)
        pitch = pitch + rest_pitch * clamp(_room(rotors, table, LIFT_BY, low, high)[1], 0.0, 1.0)
    _blend(rotors, table, EFFORT, 0.0, roll, pitch, 0.0)
    _blend(rotors, table, ALONG, 1.0, 0.0, 0.0, 0.0)
    least, greatest = _room(rotors, table, YAW_BY, low, high)
    thrust = clamp(thrust, least, greatest)
    _blend(rotors, table, EFFORT, thrust, roll, pitch, 0.0)
    _blend(rotors, table, ALONG, 0.0, 0.0, 0.0, 1.0)
    least, greatest = _room(rotors, table, STRENGTH, low, high)
    yaw = clamp(yaw - _turns(table, thrust, roll, pitch), least, greatest)
    _blend(rotors, table, EFFORT, thrust, roll, pitch, yaw)
    for i in range(table.shape[0] - 1):
        # removes rounding only
        rotors[EFFORT, i] = clamp(rotors[EFFORT, i], low, high)


@kernel
def mix(
    thrust: float, moment: Vec3, vehicle: Vehicle, limited: float, table: Array, rotors: Array
) -> MixerResult:
    """Put the forces for the demanded thrust (N) and moment (N m, body) into the row FORCE. With
    limited = 0.0 no limits apply."""
    valid = isfinite(thrust) and isfinite(moment[0]) and isfinite(moment[1]) and isfinite(moment[2])
    if not valid:
        thrust = 0.0
        moment = (0.0, 0.0, 0.0)
    low, high = vehicle.rotor_min, vehicle.rotor_max
    count = table.shape[0] - 1
    roll, pitch, yaw = moment[0] / vehicle.arm, moment[1] / vehicle.arm, moment[2] / vehicle.torque_ratio
    _blend(rotors, table, EFFORT, thrust, roll, pitch, yaw - _turns(table, thrust, roll, pitch))
    saturated = 0
    for i in range(count):
        effort = rotors[EFFORT, i]
        if limited != 0.0 and table[i, STRENGTH] > 0.0 and (low > effort or high < effort):
            saturated |= 1 << i
    if not valid:
        saturated = (1 << count) - 1
    if saturated != 0 and limited != 0.0:
        _fit(rotors, table, thrust, roll, pitch, yaw, low, high)
    for i in range(count):
        rotors[FORCE, i] = table[i, STRENGTH] * rotors[EFFORT, i]
    thrust_done, moment_done = thrust_and_moment(rotors, vehicle, table)
    return MixerResult(saturated, thrust_done, moment_done)


@kernel
def thrust_and_moment(rotors: Array, vehicle: Vehicle, table: Array) -> tuple[float, Vec3]:
    """(2-13): thrust (N) and moment (N m, body frame) of the forces in the row FORCE."""
    f = x = y = z = 0.0
    for i in range(table.shape[0] - 1):
        force = rotors[FORCE, i]
        f = f + force
        x = x + table[i, ROLL] * force
        y = y + table[i, PITCH] * force
        z = z + table[i, YAW] * force
    return f, (vehicle.arm * x, vehicle.arm * y, vehicle.torque_ratio * z)


@kernel
def spread(force: float, table: Array, rotors: Array) -> MixerResult:
    """The same force (N) from every usable rotor, whatever their positions."""
    total = 0.0
    for i in range(table.shape[0] - 1):
        rotors[FORCE, i] = force if table[i, STRENGTH] > 0.0 else 0.0
        total = total + rotors[FORCE, i]
    return MixerResult(0, total, (0.0, 0.0, 0.0))
