"""A cable that is attached to the vehicle away from its centre of mass.

| symbol | code | frame, unit | |
|---|---|---|---|
| rho | attachment | body, m | from the centre of mass |
| x_A | | world, m | x_Q + R rho |
| q_b | q_body | body | R^T q, from x_A to the load |
| n | | body, m | rho x q_b, so that the pull T q exerts the moment T n on the vehicle |
| mu | effective_mass | kg | 1 / mu = 1/m_L + 1/m_Q + n . J^-1 n |

`autopilot.geometry.rigid_body` has x_A' and x_A''. With rho = 0 nothing here is added: the equations are, to
the bit, those of a cable at the centre of mass.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, add, apply, apply_transposed, cross, dot, is_zero, sub
from autopilot.geometry.rigid_body import arm_accel, arm_velocity
from autopilot.geometry.so3 import rotation_from_quat
from sitl.plant.records import Motion, Truth


@kernel
def is_off_centre(truth: Truth) -> bool:
    """Whether the cable is attached away from the centre of mass."""
    return not is_zero(truth.attachment)


@kernel
def attachment_offset(R: Mat3, truth: Truth) -> Vec3:
    """x_A - x_Q."""
    return apply(R, truth.attachment)


@kernel
def attachment_velocity(R: Mat3, omega: Vec3, truth: Truth) -> Vec3:
    """x_A' - x_Q'."""
    return arm_velocity(R, omega, truth.attachment)


@kernel
def attachment_accel(R: Mat3, omega: Vec3, omega_dot: Vec3, truth: Truth) -> Vec3:
    """x_A'' - x_Q''."""
    return apply(R, arm_accel(omega, omega_dot, truth.attachment))


@kernel
def moment_arm(q_cable: Vec3, R: Mat3, truth: Truth) -> Vec3:
    """n: the torque on the vehicle per newton of pull."""
    return cross(truth.attachment, apply_transposed(R, q_cable))


@kernel
def inverse_inertia_times(torque: Vec3, truth: Truth) -> Vec3:
    """J^-1 torque."""
    J = truth.inertia
    return (torque[0] / J[0], torque[1] / J[1], torque[2] / J[2])


@kernel
def effective_mass(q_cable: Vec3, R: Mat3, truth: Truth) -> float:
    """mu, the effective mass of vehicle and load along q."""
    if not is_off_centre(truth):
        return truth.load_mass * truth.quad_mass / (truth.load_mass + truth.quad_mass)
    n = moment_arm(q_cable, R, truth)
    return 1.0 / (1.0 / truth.load_mass + 1.0 / truth.quad_mass + dot(n, inverse_inertia_times(n, truth)))


@kernel
def attachment_position(x_quad: Vec3, R: Mat3, truth: Truth) -> Vec3:
    """x_A."""
    return add(x_quad, attachment_offset(R, truth)) if is_off_centre(truth) else x_quad


@kernel
def cable_and_rate(motion: Motion, truth: Truth) -> tuple[Vec3, Vec3]:
    """c = x_L - x_A and c'."""
    if not is_off_centre(truth):
        return motion.separation, motion.separation_dot
    R = rotation_from_quat(motion.quat)
    return (
        sub(motion.separation, attachment_offset(R, truth)),
        sub(motion.separation_dot, attachment_velocity(R, motion.omega, truth)),
    )
