"""Rotor forces from thrust and moment: the inverse of (2-13) within true limits, by stated priority.

| symbol         | code name    | frame | unit | equation |
|----------------|--------------|-------|------|----------|
| F_1 .. F_4     | forces       | B     | N    | (2-13)   |
| f              | thrust       | B     | N    | (2-13)   |
| M              | moment       | B     | N m  | (2-13)   |
| l              | vehicle.arm  |       | m    | (2-13)   |
| c = d/b        | torque_ratio |       | m    | (2-13)   |

    f = F1 + F2 + F3 + F4     M_x = l (F4 - F2)     M_y = l (F1 - F3)     M_z = c (-F1 + F2 - F3 + F4)

In a plus frame roll belongs to the pair (2, 4) and pitch to the pair (1, 3). With s24, s13 the mean forces of
the pairs: F4, F2 = s24 +- M_x / 2l, F1, F3 = s13 +- M_y / 2l, f = 2 (s13 + s24), M_z = 2c (s24 - s13). So the
priorities are met one after the other, each exactly, with no search:

1. roll and pitch: each is possible alone and both together whenever its difference of forces fits between the
   limits; what does not fit is cut, the other axis is not touched;
2. thrust: cut to what the two pairs can give beside their differences (the collective is moved to make room);
3. yaw: cut to what is left. At an end of the thrust's range nothing is left, and yaw takes what it gets.

A demand that is no number counts as zero and sets every bit of `saturated`.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from autopilot.control.records import Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3

Rotors = tuple[float, float, float, float]
ALL_ROTORS = 15


class MixerResult(NamedTuple):
    """Forces for the rotors, and what of the demand they carry out."""

    forces: Rotors  # N, rotors 1 to 4
    saturated: int  # bit i: the plain inverse of (2-13) asked rotor i+1 for more or less than it can give
    thrust_done: float  # N
    moment_done: Vec3  # N m, body


@kernel
def thrust_and_moment(forces: Rotors, vehicle: Vehicle) -> tuple[float, Vec3]:
    """(2-13): what four rotor forces (N) do to the body: thrust in N, moment in N m, body frame."""
    F1, F2, F3, F4 = forces
    moment: Vec3 = (
        vehicle.arm * (F4 - F2),
        vehicle.arm * (F1 - F3),
        vehicle.torque_ratio * (-F1 + F2 - F3 + F4),
    )
    return F1 + F2 + F3 + F4, moment


@kernel
def clamp(value: float, low: float, high: float) -> float:
    """value, or the nearer end of low ... high."""
    return min(high, max(low, value))


@kernel
def mix(thrust: float, moment: Vec3, vehicle: Vehicle, limited: float) -> MixerResult:
    """Forces for the demanded thrust (N) and moment (N m, body). limited = 0.0 lets any demand through."""
    valid = isfinite(thrust) and isfinite(moment[0]) and isfinite(moment[1]) and isfinite(moment[2])
    if not valid:
        thrust = 0.0
        moment = (0.0, 0.0, 0.0)
    low = vehicle.rotor_min
    high = vehicle.rotor_max

    roll = moment[0] / (2.0 * vehicle.arm)
    pitch = moment[1] / (2.0 * vehicle.arm)
    mean = 0.25 * thrust
    yaw = moment[2] / (4.0 * vehicle.torque_ratio)
    F1 = mean - yaw + pitch
    F2 = mean + yaw - roll
    F3 = mean - yaw - pitch
    F4 = mean + yaw + roll

    saturated = 0
    if limited != 0.0:
        if low > F1 or high < F1:
            saturated += 1
        if low > F2 or high < F2:
            saturated += 2
        if low > F3 or high < F3:
            saturated += 4
        if low > F4 or high < F4:
            saturated += 8
    if not valid:
        saturated = ALL_ROTORS

    if saturated != 0 and limited != 0.0:
        half_range = 0.5 * (high - low)
        roll = clamp(roll, -half_range, half_range)
        pitch = clamp(pitch, -half_range, half_range)
        low_24, high_24 = low + abs(roll), high - abs(roll)
        low_13, high_13 = low + abs(pitch), high - abs(pitch)
        mean = clamp(mean, 0.5 * (low_13 + low_24), 0.5 * (high_13 + high_24))
        yaw = clamp(yaw, max(low_24 - mean, mean - high_13), min(high_24 - mean, mean - low_13))
        # the outer clamp takes off no more than rounding
        F1 = clamp(mean - yaw + pitch, low, high)
        F2 = clamp(mean + yaw - roll, low, high)
        F3 = clamp(mean - yaw - pitch, low, high)
        F4 = clamp(mean + yaw + roll, low, high)

    forces = (F1, F2, F3, F4)
    thrust_done, moment_done = thrust_and_moment(forces, vehicle)
    return MixerResult(forces, saturated, thrust_done, moment_done)
