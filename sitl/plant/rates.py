"""The equations of motion, taut and slack, (2-30)-(2-35) with drag and ground.

| symbol | code | frame, unit | equation |
|---|---|---|---|
| x_L, v_L | x_load, v_load | world, m, m/s | (2-30) |
| c = L q | cable | world, m | (2-32) |
| R | R | body to world | (2-34) |
| Omega | omega | body, rad/s | (2-35) |
| f, M | thrust, moment | N; body, N m | (2-13) |
| T | tension | N | below |
| mu | effective_mass | kg | m_L m_Q / (m_L + m_Q) |

Let F_L and F_Q be all forces on load and vehicle except that of the cable. Then m_L x_L'' = F_L - T q and
m_Q x_Q'' = F_Q + T q, and |x_L - x_Q| = L requires T = mu (q . (F_L/m_L - F_Q/m_Q) + L |q'|^2 - L''), which
without drag, ground and winch is (2-31) and (2-33). A slack cable has T = 0. In the cable vector c = L q the
two last terms are (c'.c' - L'^2) / L - L''.

A cable that is attached at rho from the vehicle's centre of mass (`attachment`) exerts the moment T n on it,
with n = rho x R^T q, and x_A'' = x_Q'' + R (Omega' x rho + Omega x (Omega x rho)). With alpha, which is
Omega' without the cable, and since q . R (J^-1 n x rho) = n . J^-1 n,

    T = mu (q . (F_L/m_L - F_Q/m_Q - R (alpha x rho + Omega x (Omega x rho))) + (c'.c' - L'^2) / L - L'')
    1/mu = 1/m_L + 1/m_Q + n . J^-1 n

Assumed: cable massless, inextensible; the load is a point. The effects of air and ground on the rotors, and
of the rotors on load and cable, are in `air`, `wake` and `cable_drag`; each is skipped while its
parameter is 0.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    Vec3,
    add,
    apply,
    apply_transposed,
    axpy,
    column,
    cross,
    dot,
    norm,
    scale,
    sub,
)
from autopilot.geometry.rigid_body import angular_accel
from autopilot.geometry.so3 import quat_derivative, quat_normalise, rotation_from_quat
from sitl.plant.air import has_rotor_air_effects, rotor_air_wrench
from sitl.plant.attachment import (
    attachment_accel,
    attachment_offset,
    attachment_velocity,
    effective_mass,
    inverse_inertia_times,
    is_off_centre,
    moment_arm,
)
from sitl.plant.cable_drag import NO_DRAG, drag_of_cable
from sitl.plant.contact import load_force, quad_wrench
from sitl.plant.records import Motion, Rates, Truth
from sitl.plant.rotors import RotorRows, Wrench
from sitl.plant.wake import wake_at, wake_of


@kernel
def drag_force(v: Vec3, wind: Vec3, linear: float, quadratic: float) -> Vec3:
    """Drag in N of a body that moves at v in air that moves at `wind`, world frame."""
    v_air = sub(v, wind)
    return scale(-(linear + quadratic * norm(v_air)), v_air)


@kernel
def rates(
    motion: Motion, wrench: Wrench, rotors: RotorRows, stage: int, truth: Truth, wind: Vec3, taut: float
) -> Rates:
    """Time derivative of `motion` under the `wrench` of the rotors and the wind (world, m/s); the force of
    each rotor is in row `stage`."""
    R = rotation_from_quat(quat_normalise(motion.quat))
    Omega = motion.omega
    v_quad = sub(motion.v_load, motion.separation_dot)
    x_quad = sub(motion.x_load, motion.separation)
    cable, cable_dot = motion.separation, motion.separation_dot
    off_centre = is_off_centre(truth)
    if off_centre:
        cable = sub(cable, attachment_offset(R, truth))
        cable_dot = sub(cable_dot, attachment_velocity(R, Omega, truth))
    thrust, moment = wrench.thrust, wrench.moment

    ground_quad, ground_moment = quad_wrench(x_quad, v_quad, R, Omega, truth)
    a_quad = add(
        scale(thrust, column(R, 2)),
        add(drag_force(v_quad, wind, truth.quad_drag, truth.quad_drag_quadratic), ground_quad),
    )
    if has_rotor_air_effects(truth):
        air_wrench = rotor_air_wrench(rotors, stage, x_quad, v_quad, R, Omega, wind, truth)
        a_quad = add(a_quad, apply(R, air_wrench.force))
        moment = add(moment, air_wrench.moment)
    air_at_load, on_cable = wind, NO_DRAG
    if truth.air.downwash > 0.0 or truth.air.cable_diameter > 0.0:
        wake = wake_of(rotors, stage, x_quad, v_quad, R, wind, truth)
        if truth.air.downwash > 0.0:
            air_at_load = add(wind, wake_at(motion.x_load, wake, rotors, stage, truth))
        if taut > 0.0 and truth.air.cable_diameter > 0.0:
            on_cable = drag_of_cable(motion, cable, cable_dot, wind, wake, rotors, stage, truth)
            a_quad = add(a_quad, on_cable.vehicle)
            moment = add(moment, cross(truth.attachment, apply_transposed(R, on_cable.vehicle)))
    ground_load = load_force(motion.x_load, motion.v_load, truth)
    a_load = add(
        drag_force(motion.v_load, air_at_load, truth.load_drag, truth.load_drag_quadratic), ground_load
    )
    if truth.air.cable_diameter > 0.0:
        a_load = add(a_load, on_cable.load)
    a_quad = scale(1.0 / truth.quad_mass, a_quad)
    a_load = scale(1.0 / truth.load_mass, a_load)

    moment = axpy(-truth.spin_drag * norm(Omega), Omega, add(moment, ground_moment))
    alpha = angular_accel(Omega, moment, truth.inertia)

    tension = 0.0
    a_separation = sub(a_load, a_quad)  # without gravity, which is the same for both
    if taut > 0.0:
        length = norm(cable)
        q_cable = scale(1.0 / length, cable)
        centripetal = dot(cable_dot, cable_dot) - motion.length_dot * motion.length_dot
        closing_accel = dot(q_cable, a_separation) + centripetal / length - truth.reel_accel
        if off_centre:
            closing_accel -= dot(q_cable, attachment_accel(R, Omega, alpha, truth))
        tension = effective_mass(q_cable, R, truth) * closing_accel
        a_load = axpy(-tension / truth.load_mass, q_cable, a_load)
        if off_centre:
            alpha = axpy(tension, inverse_inertia_times(moment_arm(q_cable, R, truth), truth), alpha)
            closing_accel = tension * (1.0 / truth.load_mass + 1.0 / truth.quad_mass)
        a_separation = axpy(-closing_accel, q_cable, a_separation)

    falling = (a_load[0], a_load[1], a_load[2] - truth.gravity)
    return Rates(
        Motion(
            motion.v_load,
            falling,
            motion.separation_dot,
            a_separation,
            quat_derivative(motion.quat, Omega),
            alpha,
            motion.length_dot,
            truth.reel_accel,
        ),
        sub(falling, a_separation),
        tension,
        ground_quad[2],
        ground_load[2],
    )
