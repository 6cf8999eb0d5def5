"""The impact of a cable that comes taut: perfectly inelastic along the cable (5-2-1).

| symbol | code name | unit | |
|---|---|---|---|
| q | q_cable | | unit vector from vehicle to load |
| v_c | speed | m/s | closing speed: q . (x_L' - x_Q') minus the rate at which the winch lets out |
| m_Q, m_L | quad_mass, load_mass | kg | |

Linear momentum is conserved and the ends stop separating: x_L' loses m_Q / (m_Q + m_L) v_c along q, x_Q'
gains m_L / (m_Q + m_L) v_c. The impulse of the snap is mu v_c, mu = m_Q m_L / (m_Q + m_L); energy is lost.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import axpy, dot, norm, scale
from autopilot.geometry.so3 import rotation_from_quat
from sitl.plant.attachment import (
    cable_and_rate,
    effective_mass,
    inverse_inertia_times,
    is_off_centre,
    moment_arm,
)
from sitl.plant.records import Motion, Truth


@kernel
def at_cable_length(motion: Motion, truth: Truth) -> Motion:
    """Vehicle and load at the distance of the cable length, separating along the cable at the winch's rate.

    Centre of mass and momenta are unchanged. After a taut step this removes the integrator's drift; at the
    instant at which a slack cable comes taut it is the perfectly inelastic impact.
    """
    cable, cable_dot = cable_and_rate(motion, truth)
    length = norm(cable)
    q_cable = scale(1.0 / length, cable)
    share = truth.quad_mass / (truth.quad_mass + truth.load_mass)
    excess = length - motion.length
    speed = dot(q_cable, cable_dot) - motion.length_dot
    if is_off_centre(truth):
        R = rotation_from_quat(motion.quat)
        impulse = effective_mass(q_cable, R, truth) * speed
        relative_impulse = impulse * (1.0 / truth.load_mass + 1.0 / truth.quad_mass)
        return Motion(
            axpy(-share * excess, q_cable, motion.x_load),
            axpy(-impulse / truth.load_mass, q_cable, motion.v_load),
            axpy(-excess, q_cable, motion.separation),
            axpy(-relative_impulse, q_cable, motion.separation_dot),
            motion.quat,
            axpy(impulse, inverse_inertia_times(moment_arm(q_cable, R, truth), truth), motion.omega),
            motion.length,
            motion.length_dot,
        )
    return Motion(
        axpy(-share * excess, q_cable, motion.x_load),
        axpy(-share * speed, q_cable, motion.v_load),
        scale(motion.length, q_cable),
        axpy(-speed, q_cable, cable_dot),
        motion.quat,
        motion.omega,
        motion.length,
        motion.length_dot,
    )
