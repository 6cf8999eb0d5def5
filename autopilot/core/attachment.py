"""A cable that is attached away from the vehicle's centre of mass, by the parameters VEH_ATT_.

Estimator and laws assume a cable attached at the vehicle's position. Therefore the readings of this position
and of the direction to the load are shifted to the point of attachment, and that point is estimated, flown
and reported as the vehicle's position. The moment of the cable's pull is compensated by the rotors' moments.

| symbol | code | frame, unit | |
|---|---|---|---|
| rho | attachment | body, m | from the centre of mass |
| f | thrust | B, N | assumed of the rotors |
| T | tension | N | mu (L q'.q' - q . f R e_3 / m_Q), (2-31) |
| M_T | | body, N m | rho x R^T T q |

Left out are the acceleration of the attachment by the angular acceleration, rho Omega' (0.1 m/s^2 for 1 cm
and 10 rad/s^2), which the inertial unit does not measure, and the effect of the turning vehicle on mu. The
plant has both.
"""

from __future__ import annotations

from math import sqrt

from autopilot.control.records import State, Vehicle
from autopilot.estimation.inbox import DIRECTION, FIX, HEIGHT, KIND, POSE, READING
from autopilot.estimation.records import Array, DirectionReading, EstimatorState, GnssReading, PoseReading
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import (
    Vec3,
    add,
    apply,
    apply_transposed,
    column,
    cross,
    dot,
    is_zero,
    norm,
    scale,
    sub,
)
from autopilot.geometry.packed import pack, unpack, with_field
from autopilot.geometry.rigid_body import arm_velocity
from autopilot.geometry.so3 import rotation_from_quat


@kernel
def off_centre(vehicle: Vehicle) -> bool:
    """Whether the cable is assumed to be attached away from the centre of mass."""
    return not is_zero(vehicle.attachment)


@kernel
def direction_from_attachment(seen: Vec3, distance: float, attachment: Vec3) -> Vec3:
    """The direction (body, as long as `seen`) from the attachment to a load at this `distance` (m) from it,
    which is `seen` from the centre of mass: at s seen, with |s seen - rho| = distance.

    A direction that is zero is unchanged, and so is one to a load that is nearer than the centre of mass: a
    line of sight may pass by all points at that distance.
    """
    seen2, along = dot(seen, seen), dot(seen, attachment)
    beyond = distance * distance - dot(attachment, attachment)
    if not (beyond > 0.0 and seen2 > 0.0):
        return seen
    s = (along + sqrt(along * along + seen2 * beyond)) / seen2
    return scale(sqrt(seen2) / distance, sub(scale(s, seen), attachment))


@kernel
def shift_to_attachment(inbox: Array, count: int, estimator: EstimatorState, attachment: Vec3) -> None:
    """Shift the readings of the vehicle's position and velocity and of the direction to the load, in the
    inbox, to the cable's attachment."""
    omega = estimator.vehicle.omega_body
    distance = norm(sub(estimator.load.x_load, estimator.vehicle.x_quad))
    arm = apply(rotation_from_quat(estimator.vehicle.quat_wxyz), attachment)
    velocity = arm_velocity(rotation_from_quat(estimator.vehicle.quat_wxyz), omega, attachment)
    for i in range(count):
        if inbox[i, KIND] == POSE:
            pose = unpack(PoseReading, inbox[i], READING)
            R = rotation_from_quat(pose.quat_wxyz)
            pose = with_field(pose, "x_quad", add(pose.x_quad, apply(R, attachment)))
            pose = with_field(pose, "v_quad", add(pose.v_quad, arm_velocity(R, omega, attachment)))
            pack(pose, inbox[i], READING)
        elif inbox[i, KIND] == FIX:
            fix = unpack(GnssReading, inbox[i], READING)
            fix = with_field(fix, "position", add(fix.position, arm))
            pack(with_field(fix, "velocity", add(fix.velocity, velocity)), inbox[i], READING)
        elif inbox[i, KIND] == HEIGHT:
            inbox[i, READING] += arm[2]
        elif inbox[i, KIND] == DIRECTION:
            sight = unpack(DirectionReading, inbox[i], READING)
            direction = direction_from_attachment(sight.direction_body, distance, attachment)
            pack(with_field(sight, "direction_body", direction), inbox[i], READING)


@kernel
def cable_moment(state: State, thrust: float, load_mass: float, length: float, vehicle: Vehicle) -> Vec3:
    """M_T of a taut cable of this length (m), which carries a load of this mass (kg)."""
    reduced_mass = load_mass * vehicle.quad_mass / (load_mass + vehicle.quad_mass)
    q = state.q_cable
    thrust_along_cable = thrust / vehicle.quad_mass * dot(q, column(state.R, 2))
    tension = reduced_mass * (length * dot(state.q_cable_dot, state.q_cable_dot) - thrust_along_cable)
    pull = scale(if_above(tension, 0.0, tension, 0.0), q)
    return cross(vehicle.attachment, apply_transposed(state.R, pull))
