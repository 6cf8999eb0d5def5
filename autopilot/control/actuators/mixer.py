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

`vehicle.rotors.mixer_table` prepares, outside the loop, four columns over the usable rotors. The columns for
thrust, roll and pitch each leave the other two unchanged and need the smallest forces (the pseudo-inverse of
these three rows; their effect on yaw is accounted for). The column for yaw is the part of the row c_i that
the other three do not affect. Without limits, the sum of the four is the least-squares inverse of all four
rows. For the plus quadrotor of (2-13) they are 1/4, -+1/2, +-1/2 and -+1/4.

Within limits low <= u_i <= high the priorities are met one after the other, by moving along these columns,
each as far as the rotors allow (`_feasible_range`):

1. roll and pitch, first together: shortened to what is possible with some thrust, no greater than what is
   demanded or the weight of vehicle and load; then each by itself towards its demand, as far as the rotors
   still allow. With any thrust, moments that go from limit to limit would give half of the greatest thrust on
   average, which lifts the vehicle;
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
from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.vehicle.rotors import FROM_PITCH, FROM_ROLL, FROM_THRUST, FROM_YAW, PITCH, ROLL, STRENGTH, YAW

Array = NDArray[np.float64]

# rows of the rotors' memory, one column per rotor
FORCE, EFFORT, DIRECTION, EXPECTED_FORCE, MISSED_COUNT, ASSUMED_FORCE, REPORTED_SPEED = range(7)
LOST_COUNT = 3  # reported speeds in a row, each too low, from which on a rotor counts as lost
_ROUNDING = 1e-9  # N: a bound on less than this is rounding


class MixerResult(NamedTuple):
    """The part of a demand that the rotors carry out; their forces are in the row FORCE."""

    saturated: int  # bit i: the plain inverse of (2-13) asked rotor i+1 for more or less than it can give
    achieved_thrust: float  # N
    achieved_moment: Vec3  # N m, body


def new_rotors() -> Array:
    """The memory of rotors that stand still."""
    return np.zeros((7, MAX_ROTORS))


@kernel
def clamp(value: float, low: float, high: float) -> float:
    """value, or the nearer end of low ... high."""
    return min(high, max(low, value))


@kernel
def _feasible_range(
    rotors: Array, table: Array, free_column: int, low: float, high: float
) -> tuple[float, float]:
    """Lowest and highest s for which some m keeps EFFORT + s DIRECTION + m times the column `free_column`
    (STRENGTH: none) of every rotor in low ... high.

    Each rotor gives two bounds w s + v m <= b; each two bounds whose v differ in sign give one of s alone,
    and so does each bound in which m does not occur.
    """
    count = table.shape[0] - 1
    free = 0.0 if free_column == STRENGTH else 1.0
    lowest, highest = -np.inf, np.inf
    for i in range(2 * count):
        sign, rotor = (1.0, i) if i < count else (-1.0, i - count)
        v = sign * free * table[rotor, free_column]
        if v < 0.0:
            continue
        w = sign * rotors[DIRECTION, rotor]
        b = (high if i < count else -low) - sign * rotors[EFFORT, rotor]
        if v == 0.0:
            end = b / if_above(abs(w), _ROUNDING, w, 1.0)
            lowest = max(lowest, if_above(-w, _ROUNDING, end, -np.inf))
            highest = min(highest, if_above(w, _ROUNDING, end, np.inf))
            continue
        for j in range(2 * count):
            sign, rotor = (1.0, j) if j < count else (-1.0, j - count)
            other = sign * table[rotor, free_column]
            if other < 0.0:
                bound = (high if j < count else -low) - sign * rotors[EFFORT, rotor]
                slope = v * sign * rotors[DIRECTION, rotor] - other * w
                bound = v * bound - other * b
                end = bound / if_above(abs(slope), _ROUNDING, slope, 1.0)
                lowest = max(lowest, if_above(-slope, _ROUNDING, end, -np.inf))
                highest = min(highest, if_above(slope, _ROUNDING, end, np.inf))
    return lowest, highest


@kernel
def _combine_columns(
    rotors: Array, table: Array, row: int, thrust: float, roll: float, pitch: float, yaw: float
) -> None:
    """Write the sum of the columns, each times its amount, into a row."""
    for i in range(table.shape[0] - 1):
        level = thrust * table[i, FROM_THRUST] + yaw * table[i, FROM_YAW]
        rotors[row, i] = level + roll * table[i, FROM_ROLL] + pitch * table[i, FROM_PITCH]


@kernel
def _yaw_effect(table: Array, thrust: float, roll: float, pitch: float) -> float:
    """The effect on yaw of these amounts of the columns for thrust, roll and pitch."""
    last = table.shape[0] - 1
    lift, roll_by, pitch_by = table[last, FROM_THRUST], table[last, FROM_ROLL], table[last, FROM_PITCH]
    turns: float = thrust * lift + roll * roll_by + pitch * pitch_by
    return turns


@kernel
def _feasible_level_moments(
    rotors: Array,
    table: Array,
    thrust: float,
    roll: float,
    pitch: float,
    free_column: int,
    low: float,
    high: float,
) -> tuple[float, float]:
    """The parts of roll and pitch that are possible beside this thrust and any amount of the free column:
    first together, then each by itself."""
    _combine_columns(rotors, table, EFFORT, thrust, 0.0, 0.0, 0.0)
    _combine_columns(rotors, table, DIRECTION, 0.0, roll, pitch, 0.0)
    share = clamp(_feasible_range(rotors, table, free_column, low, high)[1], 0.0, 1.0)
    if share < 1.0:
        rest_roll, rest_pitch = (1.0 - share) * roll, (1.0 - share) * pitch
        roll, pitch = share * roll, share * pitch
        _combine_columns(rotors, table, EFFORT, thrust, roll, pitch, 0.0)
        _combine_columns(rotors, table, DIRECTION, 0.0, rest_roll, 0.0, 0.0)
        roll = roll + rest_roll * clamp(_feasible_range(rotors, table, free_column, low, high)[1], 0.0, 1.0)
        _combine_columns(rotors, table, EFFORT, thrust, roll, pitch, 0.0)
        _combine_columns(rotors, table, DIRECTION, 0.0, 0.0, rest_pitch, 0.0)
        pitch = pitch + rest_pitch * clamp(
            _feasible_range(rotors, table, free_column, low, high)[1], 0.0, 1.0
        )
    return roll, pitch


@kernel
def _feasible_thrusts(
    rotors: Array, table: Array, roll: float, pitch: float, low: float, high: float
) -> tuple[float, float]:
    """The lowest and the highest thrust beside this roll and pitch, with any yaw."""
    _combine_columns(rotors, table, EFFORT, 0.0, roll, pitch, 0.0)
    _combine_columns(rotors, table, DIRECTION, 1.0, 0.0, 0.0, 0.0)
    return _feasible_range(rotors, table, FROM_YAW, low, high)


@kernel
def _fit_by_priority(
    rotors: Array,
    table: Array,
    thrust: float,
    roll: float,
    pitch: float,
    yaw: float,
    weight: float,
    low: float,
    high: float,
) -> None:
    """Write the efforts within their limits, by priority, into the row EFFORT; `weight` (N) is that of
    vehicle and load."""
    roll, pitch = _feasible_level_moments(rotors, table, 0.0, roll, pitch, FROM_THRUST, low, high)
    lowest, highest = _feasible_thrusts(rotors, table, roll, pitch, low, high)
    ceiling = max(thrust, weight)
    if lowest > ceiling and ceiling < _feasible_thrusts(rotors, table, 0.0, 0.0, low, high)[1]:
        roll, pitch = _feasible_level_moments(rotors, table, ceiling, roll, pitch, FROM_YAW, low, high)
        lowest, highest = _feasible_thrusts(rotors, table, roll, pitch, low, high)
    thrust = clamp(thrust, lowest, highest)
    _combine_columns(rotors, table, EFFORT, thrust, roll, pitch, 0.0)
    _combine_columns(rotors, table, DIRECTION, 0.0, 0.0, 0.0, 1.0)
    lowest, highest = _feasible_range(rotors, table, STRENGTH, low, high)
    yaw = clamp(yaw - _yaw_effect(table, thrust, roll, pitch), lowest, highest)
    _combine_columns(rotors, table, EFFORT, thrust, roll, pitch, yaw)
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
    _combine_columns(
        rotors, table, EFFORT, thrust, roll, pitch, yaw - _yaw_effect(table, thrust, roll, pitch)
    )
    saturated = 0
    for i in range(count):
        effort = rotors[EFFORT, i]
        if limited != 0.0 and table[i, STRENGTH] > 0.0 and (low > effort or high < effort):
            saturated |= 1 << i
    if not valid:
        saturated = (1 << count) - 1
    if saturated != 0 and limited != 0.0:
        weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
        _fit_by_priority(rotors, table, thrust, roll, pitch, yaw, weight, low, high)
    for i in range(count):
        rotors[FORCE, i] = table[i, STRENGTH] * rotors[EFFORT, i]
    achieved_thrust, achieved_moment = thrust_and_moment(rotors, vehicle, table)
    return MixerResult(saturated, achieved_thrust, achieved_moment)


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
def equal_forces(force: float, table: Array, rotors: Array) -> MixerResult:
    """The same force (N) from every usable rotor, whatever their positions."""
    total = 0.0
    for i in range(table.shape[0] - 1):
        rotors[FORCE, i] = force if table[i, STRENGTH] > 0.0 else 0.0
        total = total + rotors[FORCE, i]
    return MixerResult(0, total, (0.0, 0.0, 0.0))
