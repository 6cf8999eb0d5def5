"""Four rotors: limits, first-order lag, and the forces and moments of (2-13)."""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import Vec3
from sitl.plant.records import Rotors, Truth


@kernel
def _clamp(force: float, low: float, high: float) -> float:
    # a comparison with nan is false: a command that is no number gives the lower limit
    return if_above(force, low, if_above(high, force, force, high), low)


@kernel
def limited(command: Rotors, truth: Truth) -> Rotors:
    """The command in N as far as each rotor can follow it at all."""
    low, high, share = truth.rotor_min, truth.rotor_max, truth.rotor_share
    return (
        share[0] * _clamp(command[0], low, high),
        share[1] * _clamp(command[1], low, high),
        share[2] * _clamp(command[2], low, high),
        share[3] * _clamp(command[3], low, high),
    )


@kernel
def decay(x: float) -> float:
    """exp(-x) for x >= 0 from sums and products alone, so that every back end gives the same bits.

    Halve x until the Taylor series to the thirteenth power is exact to rounding, then square as often.
    """
    if x > 700.0:
        return 0.0
    halvings = 0
    while x > 0.25:
        x *= 0.5
        halvings += 1
    series = 1.0
    for n in range(13, 0, -1):
        series = 1.0 - x * series / n
    for _ in range(halvings):
        series *= series
    return series


@kernel
def approach(force: Rotors, command: Rotors, remainder: float) -> Rotors:
    """Rotor forces when `remainder` of the way from `force` to `command` is left."""
    return (
        command[0] + remainder * (force[0] - command[0]),
        command[1] + remainder * (force[1] - command[1]),
        command[2] + remainder * (force[2] - command[2]),
        command[3] + remainder * (force[3] - command[3]),
    )


@kernel
def thrust_and_moment(force: Rotors, truth: Truth) -> tuple[float, Vec3]:
    """Total thrust f in N and moment M in N m, body frame, plus configuration (2-13)."""
    thrust = force[0] + force[1] + force[2] + force[3]
    return thrust, (
        truth.arm * (force[3] - force[1]),
        truth.arm * (force[0] - force[2]),
        truth.torque_ratio * (-force[0] + force[1] - force[2] + force[3]),
    )
