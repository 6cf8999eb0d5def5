"""The torque on the vehicle besides that of rotors and cable: from rotor discs that tilt in the air, a cable
that is attached elsewhere than assumed, rotors that are not alike.

| symbol | code name | frame | unit | equation |
|---|---|---|---|---|
| J, Omega, M | inertia, omega_body, moment | B | | Table 4-1, (2-34), `actuation` |
| d | felt | B | N m | J Omega' + Omega x J Omega - M |
| u | | B | m/s | R^T x_Q' |
| s | swept | B | m/s | (u_y, -u_x, 0) |
| k | factor | | N s | k s is the part of d that follows s |
| p | steady | B | N m | d - k s |

A rotor disc that tilts backward turns the vehicle through its stiff blades, and its drag through the lever
to the centre of mass, both about the level axis across the flow. k is the least-squares fit of d to s, both
taken as differences from their means over some seconds; this part is known without delay. The rest, p, is
learned with a delay. Both are learned only while the load hangs free: the ground turns a vehicle that touches
it, and the estimate would attribute this to the air.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.records import State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add, apply_transposed, axpy, cross, dot, scale, sub, times
from autopilot.geometry.packed import with_field

# of the moment that the rotors can exert: bound of the estimate
GREATEST_TORQUE = 0.3
# k is learned from motion faster than this, m/s
_SWEPT_SPEED = 0.2


class TorqueConstants(NamedTuple):
    """Shares of one period in the fading averages for p and k, and bounds."""

    steady: float
    factor: float
    greatest: Vec3  # N m, about each axis of the body
    period: float  # s


class Torque(NamedTuple):
    """The estimate of d."""

    now: Vec3  # k s + p, N m
    steady: Vec3
    mean_swept: Vec3  # m/s
    mean_felt: Vec3  # N m
    together: float  # of s and d, N m^2/s
    alone: float  # of s, m^2/s^2
    omega_body: Vec3  # rad/s, a period ago


NO_TORQUE = Torque(ZERO, ZERO, ZERO, ZERO, 0.0, 0.0, ZERO)


def torque_constants(
    steady_share: float, factor_share: float, period: float, vehicle: Vehicle
) -> TorqueConstants:
    """With bounds from the vehicle's rotors; `period` in s. A steady share of 0 learns nothing."""
    force = vehicle.rotor_max - vehicle.rotor_min
    level = GREATEST_TORQUE * 0.5 * vehicle.level * vehicle.arm * force
    yaw = GREATEST_TORQUE * 0.5 * vehicle.lift * vehicle.torque_ratio * force
    learned = factor_share if steady_share > 0.0 else 0.0
    return TorqueConstants(steady_share, learned, (level, level, yaw), period)


@kernel
def unheeded(torque: Torque, state: State) -> Torque:
    """The estimate a period later, while the load does not hang free: kept, but not compensated."""
    return with_field(with_field(torque, "now", ZERO), "omega_body", state.omega_body)


@kernel
def _within(value: float, greatest: float) -> float:
    return min(greatest, max(-greatest, value))


@kernel
def observe_torque(
    torque: Torque, state: State, moment: Vec3, constants: TorqueConstants, vehicle: Vehicle
) -> Torque:
    """The estimate a period later, while the load hangs free; `moment`, N m: of rotors and cable now."""
    J, W = vehicle.inertia, state.omega_body
    turning = scale(1.0 / constants.period, times(J, sub(W, torque.omega_body)))
    felt = sub(add(turning, cross(W, times(J, W))), moment)
    u = apply_transposed(state.R, state.v_quad)
    swept: Vec3 = (u[1], -u[0], 0.0)
    mean_swept = axpy(constants.factor, sub(swept, torque.mean_swept), torque.mean_swept)
    mean_felt = axpy(constants.factor, sub(felt, torque.mean_felt), torque.mean_felt)
    moving = sub(swept, mean_swept)
    together = torque.together + constants.factor * (dot(moving, sub(felt, mean_felt)) - torque.together)
    alone = torque.alone + constants.factor * (dot(moving, moving) - torque.alone)
    factor = together / (alone + _SWEPT_SPEED * _SWEPT_SPEED)
    rest = axpy(-factor, swept, felt)
    steady = axpy(constants.steady, sub(rest, torque.steady), torque.steady)
    now, greatest = axpy(factor, swept, steady), constants.greatest
    return Torque(
        (_within(now[0], greatest[0]), _within(now[1], greatest[1]), _within(now[2], greatest[2])),
        (_within(steady[0], greatest[0]), _within(steady[1], greatest[1]), _within(steady[2], greatest[2])),
        mean_swept,
        mean_felt,
        together,
        alone,
        W,
    )
