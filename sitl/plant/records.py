"""The records of the plant: the true vehicle and its state.

World ENU with z = 0 the ground, body FLU, SI. Flags are floats (1.0 yes, 0.0 no): kernels take floats only.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.so3 import Quat


class Air(NamedTuple):
    """Effects of moving air on the rotors, and of the rotors' wake on load and cable; see `air` and `wake`.
    An effect whose parameter is 0 is left out."""

    density: float = 1.225  # kg/m^3
    rotor_radius: float = 0.0  # m
    rotor_drag: float = 0.0  # 1/s, induced drag of a rotor for each newton of its thrust, times g
    rotor_flap: float = 0.0  # rad/(m/s), backward tilt of a disc that moves through the air
    blade_stiffness: float = 0.0  # N m/rad, moment of a tilted disc at its hub
    ground_effect: float = 0.0  # 1: the formula of Cheeseman and Bennett
    downwash: float = 0.0  # 1: the velocity of momentum theory
    cable_diameter: float = 0.0  # m


class Drive(NamedTuple):
    """Effects between a command and a rotor's force, see `drive`. By default there are none."""

    thrust_curve: float = 0.0  # quadratic share of the force in the throttle, 0 ... 1
    known_curve: float = 0.0  # the same as assumed where forces are converted to throttle
    esc_steps: float = 0.0  # throttle values above zero; 0: continuous
    speed_controlled: float = 0.0  # 1: the speed is held while the voltage allows; 0: it falls with it
    battery: float = 0.0  # 1: there is one, which discharges
    cells: float = 1.0
    capacity_as: float = 1.0  # A s
    resistance: float = 0.0  # ohm
    hover_w: float = 0.0  # W, in hover without the load
    charge: float = 1.0  # share of the capacity at the beginning


class ChainModel(NamedTuple):
    """The cable of links, and the load as a rotating body."""

    links: int  # 0: the cable is the massless one of `sitl.plant.rates`
    mass: float  # kg/m
    drag_coefficient: float  # of a cylinder across the flow; its diameter is `Truth.air.cable_diameter`
    stiffness: float  # N, tension per strain (EA)
    damping: float  # N s, tension per rate of strain
    hook: float  # m, height of the cable's end above the load's centre, load body
    gyration: float  # m, radius of gyration of the load across its upright axis; 0: a point, without hook
    gyration_upright: float  # m, about the upright axis
    pressure: float  # m, how far forward of the load's centre its drag acts
    spin_drag: float  # N m/(rad/s)^2, moment -spin_drag |Omega| Omega on the load


MASSLESS = ChainModel(0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Truth(NamedTuple):
    """The true vehicle, which is simulated and may differ from the one that the autopilot assumes.

    Drag of vehicle and load: force -(linear + quadratic |v|) v at the velocity v relative to the air.
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
    gear_height: float  # m, centre of mass above the ground when the vehicle stands
    gear_spread: float  # m, the four feet stand at (+-spread, +-spread)
    rotor_reach: float  # m, centre of mass to blade tip; a vehicle that fell over lies on the tips
    rotor_height: float  # m, rotor plane above the centre of mass
    load_radius: float  # m, height of the load's centre when it rests on the ground
    contact_frequency: float  # rad/s
    contact_damping: float  # damping ratio
    friction: float  # Coulomb coefficient
    slip_rate: float  # 1/s, rate at which friction below the Coulomb limit brakes a slide
    attachment: Vec3 = ZERO  # m, of the cable, from the centre of mass, body
    imu_position: Vec3 = ZERO  # m, of the inertial unit, from the centre of mass, body
    antenna_position: Vec3 = ZERO  # m, of the receiver's antenna
    air: Air = Air()
    drive: Drive = Drive()
    supply: float = 1.0  # voltage of the battery, relative to that of a full one without current
    reel_rate: float = 0.0  # m/s, growth rate of `cable_length` at the beginning of a step
    reel_accel: float = 0.0  # m/s^2, constant along a step
    chain: ChainModel = MASSLESS  # a cable of links and a load that rotates, `sitl.plant.chain`


class PlantState(NamedTuple):
    """The state of vehicle, cable and load at one instant, and what else the sensors need. The
    forces of the rotors are in `sitl.plant.rotors.RotorRows`.

    While the cable is slack `q_cable` still points from its attachment to the load; the distance is then
    below the cable length. `accel_quad` is the second derivative of `x_quad` (an accelerometer at the centre
    of mass measures R^T (accel_quad + g e3)), at the end of the last step, with the forces that act there.
    The snap of a cable that comes taut is an impulse: it appears in the velocities, not in `accel_quad`.
    """

    x_load: Vec3  # m
    v_load: Vec3  # m/s
    q_cable: Vec3  # unit vector, attachment to load
    q_cable_dot: Vec3  # 1/s
    x_quad: Vec3  # m, centre of mass
    v_quad: Vec3  # m/s
    quat_wxyz: Quat  # body to world
    omega_body: Vec3  # rad/s
    taut: float
    slack_events: float  # how often the cable went slack so far
    vehicle_on_ground: float
    load_on_ground: float
    accel_quad: Vec3  # m/s^2, world
    tension: float  # N, 0 while slack
    diverged: float  # 1.0: left the domain of the model; the state is held as it was before
    snap_speed: float  # m/s, greatest with which the cable came taut in the last step; 0: it did not
    omega_dot_body: Vec3  # rad/s^2, at the end of the last step, as `accel_quad`


class Motion(NamedTuple):
    """The integrated quantities; also their rates of change, field by field.

    `length` and `length_dot`, which the winch determines, are known beforehand; they are integrated too, so
    that every stage of a step has them.

    Vehicle and load are represented by the load and the vector from vehicle to load, `separation = x_load -
    x_quad`, in both modes. This is a linear change of the coordinates (x_L, q) of (2-30)-(2-35): it leaves a
    Runge-Kutta step unchanged, and linear momentum is conserved to rounding. `separation` is the
    cable's vector where the cable is attached at the centre of mass (`attachment.cable_and_rate`).
    """

    x_load: Vec3
    v_load: Vec3
    separation: Vec3
    separation_dot: Vec3
    quat: Quat
    omega: Vec3
    length: float  # m, of the cable
    length_dot: float  # m/s


class Rates(NamedTuple):
    """The rate of change of a `Motion` and the forces computed with it."""

    motion: Motion
    accel_quad: Vec3  # m/s^2, of the centre of mass
    tension: float  # N; while taut it may be negative: the cable would have to push
    quad_normal: float  # N, sum of the ground's normal forces on the vehicle
    load_normal: float  # N
