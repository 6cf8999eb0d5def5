"""The equations of motion, taut and slack, (2-30)-(2-35) with drag and ground.

| symbol | code | frame, unit | equation |
|---|---|---|---|
| x_L, v_L | x_load, v_load | world, m, m/s | (2-30) |
| L q | cable | world, m | (2-32) |
| R | R | body to world | (2-34) |
| Omega | omega | body, rad/s | (2-35) |
| f, M | thrust, moment | N; body, N m | (2-13) |
| T | tension | N | below |
| mu | reduced_mass | kg | m_L m_Q / (m_L + m_Q) |

Let F_L and F_Q be all forces on load and vehicle but that of the cable. Then m_L x_L'' = F_L - T q and
m_Q x_Q'' = F_Q + T q, and |x_L - x_Q| = L asks for T = mu (q . (F_L/m_L - F_Q/m_Q) + L |q'|^2 - L''), which
without drag, ground and winch is (2-31) and (2-33). Slack is the same with T = 0. In the cable vector c = L q
the two last terms are (c'.c' - L'^2) / L - L''.

Assumed: cable massless, inextensible, attached at the vehicle's centre of mass; the load is a point.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, axpy, column, cross, dot, norm, scale, sub, times
from autopilot.geometry.so3 import quat_derivative, quat_normalise, rotation_from_quat
from sitl.plant.contact import load_force, quad_wrench
from sitl.plant.records import Motion, Rates, Rotors, Truth
from sitl.plant.rotors import thrust_and_moment


@kernel
def drag_force(v: Vec3, wind: Vec3, linear: float, quadratic: float) -> Vec3:
    """Drag in N of a body that moves at v in air that moves at `wind`, world frame."""
    v_air = sub(v, wind)
    return scale(-(linear + quadratic * norm(v_air)), v_air)


@kernel
def rates(motion: Motion, rotor_force: Rotors, truth: Truth, wind: Vec3, taut: float) -> Rates:
    """Time derivative of `motion` under the given rotor forces and wind (world, m/s)."""
    R = rotation_from_quat(quat_normalise(motion.quat))
    Omega = motion.omega
    v_quad = sub(motion.v_load, motion.cable_dot)
    thrust, moment = thrust_and_moment(rotor_force, truth)

    ground_quad, ground_moment = quad_wrench(sub(motion.x_load, motion.cable), v_quad, R, Omega, truth)
    a_quad = add(
        scale(thrust, column(R, 2)),
        add(drag_force(v_quad, wind, truth.quad_drag, truth.quad_drag_quadratic), ground_quad),
    )
    a_quad = scale(1.0 / truth.quad_mass, a_quad)
    ground_load = load_force(motion.x_load, motion.v_load, truth)
    a_load = add(drag_force(motion.v_load, wind, truth.load_drag, truth.load_drag_quadratic), ground_load)
    a_load = scale(1.0 / truth.load_mass, a_load)

    tension = 0.0
    a_cable = sub(a_load, a_quad)  # gravity, the same for both, is not in it
    if taut > 0.0:
        length = norm(motion.cable)
        q_cable = scale(1.0 / length, motion.cable)
        reduced_mass = truth.load_mass * truth.quad_mass / (truth.load_mass + truth.quad_mass)
        turning = dot(motion.cable_dot, motion.cable_dot) - motion.length_dot * motion.length_dot
        pull = dot(q_cable, a_cable) + turning / length - truth.reel_accel
        tension = reduced_mass * pull
        a_load = axpy(-tension / truth.load_mass, q_cable, a_load)
        a_cable = axpy(-pull, q_cable, a_cable)

    J = truth.inertia
    moment = axpy(-truth.spin_drag * norm(Omega), Omega, add(moment, ground_moment))
    moment = sub(moment, cross(Omega, times(J, Omega)))
    return Rates(
        Motion(
            motion.v_load,
            (a_load[0], a_load[1], a_load[2] - truth.gravity),
            motion.cable_dot,
            a_cable,
            quat_derivative(motion.quat, Omega),
            (moment[0] / J[0], moment[1] / J[1], moment[2] / J[2]),
            motion.length_dot,
            truth.reel_accel,
        ),
        tension,
        ground_quad[2],
        ground_load[2],
    )
