"""The torque on the vehicle besides that of rotors and cable: from rotor discs that tilt in the air, a cable
that is attached elsewhere than assumed, rotors that are not alike.

| symbol | code name | frame | unit | equation |
|---|---|---|---|---|
| J, Omega, M | inertia, omega_body, moment | B | | Table 4-1, (2-34), `actuation` |
| d | external_torque | B | N m | J Omega' + Omega x J Omega - M |
| u | | B | m/s | R^T x_Q' |
| s | cross_flow | B | m/s | (u_y, -u_x, 0) |
| k | factor | | N s | k s is the part of d that follows s |
| p | steady | B | N m | d - k s |

A rotor disc that tilts backward turns the vehicle through its stiff blades, and its drag through the lever
to the centre of mass, both about the level axis across the flow. k is the least-squares fit of d to s, both
taken as differences from their means over some seconds; this part is known without delay. The rest, p, is
learned with a delay. Both are learned only in the air, while the load hangs free or the cable is slack: the
ground turns a vehicle that touches it, and a load that the ground carries turns it by an unknown pull. The
estimate would attribute this to the air.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.records import State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add, apply_transposed, axpy, cross, dot, scale, sub, times
from autopilot.geometry.packed import with_field

# of the moment that the rotors can exert: bound of the estimate
MAX_TORQUE_SHARE = 0.3
# k is learned from motion faster than this, m/s
_FLOW_SPEED = 0.2


class TorqueConstants(NamedTuple):
    """Shares of one period in the fading averages for p and k, and bounds."""

    steady: float
    factor: float
    limit: Vec3  # N m, about each axis of the body
    period: float  # s


class TorqueEstimate(NamedTuple):
    """The estimate of d."""

    total: Vec3  # k s + p, N m
    steady: Vec3
    weight: float  # of what the two means have learned; 1: they are complete
    mean_cross_flow: Vec3  # m/s, times the weight
    mean_torque: Vec3  # N m, times the weight
    correlation: float  # of s and d, N m^2/s
    square: float  # of s, m^2/s^2
    omega_body: Vec3  # rad/s, a period ago


NO_TORQUE = TorqueEstimate(ZERO, ZERO, 0.0, ZERO, ZERO, 0.0, 0.0, ZERO)
_MIN_WEIGHT = 1e-9  # where nothing is learned, the means and their weight are zero


def torque_constants(
    steady_share: float, factor_share: float, period: float, vehicle: Vehicle
) -> TorqueConstants:
    """With bounds from the vehicle's rotors; `period` in s. A steady share of 0 learns nothing."""
    force = vehicle.rotor_max - vehicle.rotor_min
    level = MAX_TORQUE_SHARE * 0.5 * vehicle.moment_per_force * vehicle.arm * force
    yaw = MAX_TORQUE_SHARE * 0.5 * vehicle.thrust_per_force * vehicle.torque_ratio * force
    learned = factor_share if steady_share > 0.0 else 0.0
    return TorqueConstants(steady_share, learned, (level, level, yaw), period)


@kernel
def without_compensation(torque: TorqueEstimate, state: State) -> TorqueEstimate:
    """The estimate a period later, while the vehicle stands on the ground: kept, but not compensated."""
    return held(with_field(torque, "total", ZERO), state)


@kernel
def held(torque: TorqueEstimate, state: State) -> TorqueEstimate:
    """The estimate a period later, while nothing can be learned."""
    return with_field(torque, "omega_body", state.omega_body)


@kernel
def later_weight(weight: float, share: float) -> float:
    """The weight of a fading average that began at zero, one value later: the share that is not the zero."""
    return weight + share * (1.0 - weight)


@kernel
def deviation_from_mean(value: Vec3, weighted_mean: Vec3, weight: float) -> Vec3:
    """What a value differs by from the mean of the values so far. A mean that begins at zero and is not
    divided by its weight would take what is constant, such as the push of the wind, for a deviation."""
    return axpy(-1.0 / max(weight, _MIN_WEIGHT), weighted_mean, value)


@kernel
def _clamped(value: float, limit: float) -> float:
    return min(limit, max(-limit, value))


@kernel
def observe_torque(
    torque: TorqueEstimate, state: State, moment: Vec3, constants: TorqueConstants, vehicle: Vehicle
) -> TorqueEstimate:
    """The estimate a period later, in the air; `moment`, N m: of rotors and cable now."""
    J, W = vehicle.inertia, state.omega_body
    turning = scale(1.0 / constants.period, times(J, sub(W, torque.omega_body)))
    external_torque = sub(add(turning, cross(W, times(J, W))), moment)
    u = apply_transposed(state.R, state.v_quad)
    cross_flow: Vec3 = (u[1], -u[0], 0.0)
    weight = later_weight(torque.weight, constants.factor)
    mean_cross_flow = axpy(constants.factor, sub(cross_flow, torque.mean_cross_flow), torque.mean_cross_flow)
    mean_torque = axpy(constants.factor, sub(external_torque, torque.mean_torque), torque.mean_torque)
    deviation = deviation_from_mean(cross_flow, mean_cross_flow, weight)
    correlation = torque.correlation + constants.factor * (
        dot(deviation, deviation_from_mean(external_torque, mean_torque, weight)) - torque.correlation
    )
    square = torque.square + constants.factor * (dot(deviation, deviation) - torque.square)
    factor = correlation / (square + _FLOW_SPEED * _FLOW_SPEED)
    residual = axpy(-factor, cross_flow, external_torque)
    steady = axpy(constants.steady, sub(residual, torque.steady), torque.steady)
    total, limit = axpy(factor, cross_flow, steady), constants.limit
    return TorqueEstimate(
        (_clamped(total[0], limit[0]), _clamped(total[1], limit[1]), _clamped(total[2], limit[2])),
        (_clamped(steady[0], limit[0]), _clamped(steady[1], limit[1]), _clamped(steady[2], limit[2])),
        weight,
        mean_cross_flow,
        mean_torque,
        correlation,
        square,
        W,
    )
