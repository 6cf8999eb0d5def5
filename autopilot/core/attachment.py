"""A cable that is attached away from the vehicle's centre of mass, as VEH_ATT_ tells.

Estimator and laws go on thinking of a cable at the place of the vehicle: what tells where the vehicle is, is
made to tell where the cable is attached, and that is what is then known, flown and told as its place. What
the cable's pull does to the attitude is what the rotors' moments are chosen to undo.

| symbol | code | frame, unit | |
|---|---|---|---|
| rho | attachment | body, m | from the centre of mass |
| f | thrust | B, N | that the rotors are believed to give |
| T | tension | N | mu (L q'.q' - q . f R e_3 / m_Q), (2-31) |
| M_T | | body, N m | rho x R^T T q |

Left out: what the attitude's acceleration adds to that of the attachment, rho Omega' (0.1 m/s^2 for 1 cm and
10 rad/s^2), which the inertial unit does not feel, and what the turning vehicle adds to mu. The plant has
both.
"""

from __future__ import annotations

from autopilot.control.records import State, Vehicle
from autopilot.estimation.inbox import FIX, HEIGHT, KIND, POSE, READING
from autopilot.estimation.records import Array, EstimatorState, GnssReading, PoseReading
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import Vec3, add, apply, apply_transposed, column, cross, dot, scale
from autopilot.geometry.packed import pack, unpack, with_field
from autopilot.geometry.so3 import rotation_from_quat


@kernel
def off_centre(vehicle: Vehicle) -> bool:
    """Whether the cable is believed to be attached away from the centre of mass."""
    rho = vehicle.attachment
    return rho[0] != 0.0 or rho[1] != 0.0 or rho[2] != 0.0


@kernel
def tell_attachment(inbox: Array, count: int, estimator: EstimatorState, attachment: Vec3) -> None:
    """Let the readings of the vehicle's place, in the inbox, be of where the cable is attached."""
    omega = estimator.vehicle.omega_body
    arm = apply(rotation_from_quat(estimator.vehicle.quat_wxyz), attachment)
    beside = apply(rotation_from_quat(estimator.vehicle.quat_wxyz), cross(omega, attachment))
    for i in range(count):
        if inbox[i, KIND] == POSE:
            pose = unpack(PoseReading, inbox[i], READING)
            R = rotation_from_quat(pose.quat_wxyz)
            pose = with_field(pose, "x_quad", add(pose.x_quad, apply(R, attachment)))
            pose = with_field(pose, "v_quad", add(pose.v_quad, apply(R, cross(omega, attachment))))
            pack(pose, inbox[i], READING)
        elif inbox[i, KIND] == FIX:
            fix = unpack(GnssReading, inbox[i], READING)
            fix = with_field(fix, "position", add(fix.position, arm))
            pack(with_field(fix, "velocity", add(fix.velocity, beside)), inbox[i], READING)
        elif inbox[i, KIND] == HEIGHT:
            inbox[i, READING] += arm[2]


@kernel
def cable_moment(state: State, thrust: float, load_mass: float, length: float, vehicle: Vehicle) -> Vec3:
    """M_T of a taut cable, that carries a load of this mass (kg) and is so long (m)."""
    reduced_mass = load_mass * vehicle.quad_mass / (load_mass + vehicle.quad_mass)
    q = state.q_cable
    lifted = thrust / vehicle.quad_mass * dot(q, column(state.R, 2))
    tension = reduced_mass * (length * dot(state.q_cable_dot, state.q_cable_dot) - lifted)
    pull = scale(if_above(tension, 0.0, tension, 0.0), q)
    return cross(vehicle.attachment, apply_transposed(state.R, pull))
