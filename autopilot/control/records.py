"""The records that the laws take and return: NamedTuples, because kernels can take and return those.

SI units, world ENU, body FLU. A field whose name states no frame is in the world frame.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3
from autopilot.geometry.packed import with_field

# Position and its first to sixth time derivatives, world frame: m, m/s, ... m/s^6
Jet = tuple[Vec3, Vec3, Vec3, Vec3, Vec3, Vec3, Vec3]


class Vehicle(NamedTuple):
    """The vehicle as the autopilot assumes it (Table 4-1). Assumptions: principal axes are the body axes, the
    cable is massless and inextensible. The laws assume that it is attached at the centre of mass;
    `autopilot.core.attachment` accounts for any other `attachment`."""

    quad_mass: float  # m_Q, kg, without the load
    load_mass: float  # m_L, kg
    cable_length: float  # L, m
    inertia: Vec3  # diagonal of J, kg m^2, body
    gravity: float  # g, m/s^2
    arm: float  # l, m, from the centre of mass to a rotor
    torque_ratio: float  # c = d/b, m: drag torque for each newton of thrust
    rotor_min: float  # N, one rotor
    rotor_max: float  # N, one rotor; inf if unlimited
    thrust_per_force: float = (
        4.0  # thrust when the first rotor of strength 1 reaches a force, divided by that force
    )
    moment_per_force: float = (
        2.0  # the same for a moment about a level axis, divided by that force times `arm`
    )
    attachment: Vec3 = (0.0, 0.0, 0.0)  # m, of the cable, from the centre of mass, body


class Cable(NamedTuple):
    """The cable at this tick, as set by the winch."""

    length: float  # L, m, from vehicle to load; infinite if the load is not tied to the vehicle
    rate: float = 0.0  # L', m/s
    accel: float = 0.0  # L'', m/s^2


class State(NamedTuple):
    """State passed to the control laws: the motion while the cable is taut (2-19)."""

    x_load: Vec3  # x_L, m
    v_load: Vec3  # m/s
    q_cable: Vec3  # q, unit vector from the vehicle to the load
    q_cable_dot: Vec3  # 1/s, orthogonal to q_cable
    x_quad: Vec3  # x_Q, m
    v_quad: Vec3  # m/s
    R: Mat3  # body to world
    omega_body: Vec3  # Omega, rad/s, body
    a_quad: Vec3 = (0.0, 0.0, 0.0)  # x_Q'', m/s^2, from the accelerometer


class Reference(NamedTuple):
    """Where the load (or, in the vehicle position law, the vehicle) is to be, and its heading."""

    jet: Jet  # desired position and its six derivatives
    b1_d: Vec3  # desired heading, unit vector, not parallel to the thrust axis
    b1_d_dot: Vec3 = (0.0, 0.0, 0.0)  # 1/s
    b1_d_ddot: Vec3 = (0.0, 0.0, 0.0)  # 1/s^2


class HeadingReference(NamedTuple):
    """The desired heading: b_1d of (3-29), level, with two derivatives."""

    b1_d: Vec3
    b1_d_dot: Vec3  # 1/s
    b1_d_ddot: Vec3  # 1/s^2


class Command(NamedTuple):
    """What goes to the mixer, and the errors it was made from. Errors that a flight mode does not control are
    zero, as is a Psi that it does not define."""

    thrust: float  # f, N, along the thrust axis
    moment: Vec3  # M, N m, body
    e_x: Vec3  # m
    e_v: Vec3  # m/s
    e_q: Vec3  # (3-10)
    e_q_dot: Vec3  # 1/s, (3-11)
    e_R: Vec3  # (3-3), body
    e_Omega: Vec3  # rad/s, (3-6), body
    psi_R: float  # (3-1), 0 ... 2
    psi_q: float  # (3-8), 0 ... 2
    q_c: Vec3  # the commanded cable direction: computed (3-42) or desired
    R_c: Mat3  # the commanded attitude: computed (3-27) or desired


@kernel
def with_cable_length(vehicle: Vehicle, length: float) -> Vehicle:
    """The vehicle with a cable of this length (m)."""
    return with_field(vehicle, "cable_length", length)
