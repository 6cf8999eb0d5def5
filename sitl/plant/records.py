"""What the plant is made of: what is true of the vehicle, and the state it is in.

World ENU with z = 0 the ground, body FLU, SI. Flags are floats (1.0 yes, 0.0 no): kernels take floats only.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat

Rotors = tuple[float, float, float, float]


class Truth(NamedTuple):
    """What really flies, which may differ from what the autopilot believes.

    Drag of vehicle and load: force -(linear + quadratic |v|) v on the velocity v relative to the air.
    Contact: each body rests on springs of the given natural frequency and damping ratio, so the constants
    follow the masses; see `contact`.
    """

    quad_mass: float  # kg
    arm: float  # m, centre of mass to rotor axis
    inertia: Vec3  # kg m^2, diagonal of J
    load_mass: float  # kg
    cable_length: float  # m
    gravity: float  # m/s^2
    rotor_min: float  # N each; -inf: unlimited
    rotor_max: float  # N each; inf: unlimited
    rotor_tau: float  # s, first-order lag of the rotor force; 0: none
    torque_ratio: float  # m, drag torque of a rotor per newton of its thrust
    quad_drag: float  # N/(m/s)
    quad_drag_quadratic: float  # N/(m/s)^2
    spin_drag: float  # N m/(rad/s)^2, moment -spin_drag |Omega| Omega
    load_drag: float  # N/(m/s)
    load_drag_quadratic: float  # N/(m/s)^2
    gear_height: float  # m, centre of mass above the ground as the vehicle stands
    gear_spread: float  # m, the four feet stand at (+-spread, +-spread)
    rotor_reach: float  # m, centre of mass to blade tip: what the vehicle lies on when it is not on its feet
    rotor_height: float  # m, rotor plane above the centre of mass
    load_radius: float  # m, height of the load's centre as it rests on the ground
    contact_frequency: float  # rad/s
    contact_damping: float  # damping ratio
    friction: float  # Coulomb coefficient
    slip_rate: float  # 1/s, rate at which friction below the Coulomb limit brakes a slide
    reel_rate: float = 0.0  # m/s, at which `cable_length` grows at the beginning of a step
    reel_accel: float = 0.0  # m/s^2, constant along a step
    rotor_share: Rotors = (1.0, 1.0, 1.0, 1.0)  # of its command that a rotor gives; 0: it has failed


class PlantState(NamedTuple):
    """The state of vehicle, cable and load at one instant, and what the sensors need of that instant.

    While the cable is slack `q_cable` still points from vehicle to load; the distance is then below the cable
    length. `accel_quad` is the second derivative of `x_quad` (an accelerometer at the centre of mass feels
    R^T (accel_quad + g e3)), at the end of the last step, with the forces that act there. The jerk of a cable
    that comes taut is an impulse: it shows in the velocities and not in `accel_quad`.
    """

    x_load: Vec3  # m
    v_load: Vec3  # m/s
    q_cable: Vec3  # unit vector, vehicle to load
    q_cable_dot: Vec3  # 1/s
    x_quad: Vec3  # m, centre of mass
    v_quad: Vec3  # m/s
    quat_wxyz: Quat  # body to world
    omega_body: Vec3  # rad/s
    rotor_force: Rotors  # N, as they are, not as commanded
    taut: float
    slack_events: float  # how often the cable went slack so far
    vehicle_on_ground: float
    load_on_ground: float
    accel_quad: Vec3  # m/s^2, world
    tension: float  # N, 0 while slack
    diverged: float  # 1.0: left the domain of the model; the state is held as it was before
    snap_speed: float  # m/s, greatest at which the cable came taut in the last step; 0: it did not


class Motion(NamedTuple):
    """What is integrated; also its rate of change, field by field.

    The winch's part, `length` and `length_dot`, is known beforehand; it goes along so that every stage of a
    step has it.

    The pair is written as the load and the cable vector `cable = x_load - x_quad`, in both modes: a linear
    change of the coordinates (x_L, q) of (2-30)-(2-35), under which a Runge-Kutta step is the same step.
    """

    x_load: Vec3
    v_load: Vec3
    cable: Vec3
    cable_dot: Vec3
    quat: Quat
    omega: Vec3
    length: float  # m, of the cable
    length_dot: float  # m/s


class Rates(NamedTuple):
    """The rate of change of a `Motion` and the forces found on the way."""

    motion: Motion
    tension: float  # N; while taut it may be negative: the cable would have to push
    quad_normal: float  # N, sum of the ground's normal forces on the vehicle
    load_normal: float  # N
