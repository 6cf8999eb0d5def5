"""What the plant is made of: what is true of the vehicle, and the state it is in.

World ENU with z = 0 the ground, body FLU, SI. Flags are floats (1.0 yes, 0.0 no): kernels take floats only.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.so3 import Quat


class Air(NamedTuple):
    """What air in motion does to the rotors, and the rotors' wake to load and cable; see `air` and `wake`. An
    effect whose number is 0 is left out."""

    density: float = 1.225  # kg/m^3
    rotor_radius: float = 0.0  # m
    rotor_drag: float = 0.0  # 1/s, induced drag of a rotor for each newton of its thrust, times g
    rotor_flap: float = 0.0  # rad/(m/s), tilt of a disc against the air that it moves through
    blade_stiffness: float = 0.0  # N m/rad, moment of a tilted disc at its hub
    ground_effect: float = 0.0  # 1: as Cheeseman and Bennett have it
    downwash: float = 0.0  # 1: as momentum theory has it
    cable_diameter: float = 0.0  # m


class Drive(NamedTuple):
    """What lies between a command and a rotor's force, see `drive`. As it stands here: nothing."""

    thrust_curve: float = 0.0  # quadratic share of the force in the throttle, 0 ... 1
    known_curve: float = 0.0  # the same as who makes throttle of forces takes it
    esc_steps: float = 0.0  # values of the throttle between none and all; 0: any
    speed_controlled: float = 0.0  # 1: the speed is held as long as the voltage allows; 0: it falls with it
    battery: float = 0.0  # 1: there is one that can be empty
    cells: float = 1.0
    capacity_as: float = 1.0  # A s
    resistance: float = 0.0  # ohm
    hover_w: float = 0.0  # W, in hover without the load
    charge: float = 1.0  # share of the capacity at the beginning


class ChainModel(NamedTuple):
    """The cable, and how the load hangs at it."""

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
    attachment: Vec3 = ZERO  # m, of the cable, from the centre of mass, body
    air: Air = Air()
    drive: Drive = Drive()
    supply: float = 1.0  # voltage of the battery, of that of a full one without current
    reel_rate: float = 0.0  # m/s, at which `cable_length` grows at the beginning of a step
    reel_accel: float = 0.0  # m/s^2, constant along a step
    chain: ChainModel = MASSLESS  # a cable of links and a load that turns, `sitl.plant.chain`


class PlantState(NamedTuple):
    """The state of vehicle, cable and load at one instant, and what the sensors need of that instant. The
    forces of the rotors are in `sitl.plant.rotors.RotorRows`.

    While the cable is slack `q_cable` still points from its attachment to the load; the distance is then
    below the cable length. `accel_quad` is the second derivative of `x_quad` (an accelerometer at the centre
    of mass feels R^T (accel_quad + g e3)), at the end of the last step, with the forces that act there. The
    jerk of a cable that comes taut is an impulse: it shows in the velocities and not in `accel_quad`.
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
    snap_speed: float  # m/s, greatest at which the cable came taut in the last step; 0: it did not


class Motion(NamedTuple):
    """What is integrated; also its rate of change, field by field.

    The winch's part, `length` and `length_dot`, is known beforehand; it goes along so that every stage of a
    step has it.

    The pair is written as the load and the vector from vehicle to load, `apart = x_load - x_quad`, in both
    modes: a linear change of the coordinates (x_L, q) of (2-30)-(2-35), under which a Runge-Kutta step is the
    same step, and linear momentum stays to rounding. `apart` is the cable's vector where the cable is
    attached at the centre of mass (`attachment.cable_of`).
    """

    x_load: Vec3
    v_load: Vec3
    apart: Vec3
    apart_dot: Vec3
    quat: Quat
    omega: Vec3
    length: float  # m, of the cable
    length_dot: float  # m/s


class Rates(NamedTuple):
    """The rate of change of a `Motion` and the forces found on the way."""

    motion: Motion
    accel_quad: Vec3  # m/s^2, of the centre of mass
    tension: float  # N; while taut it may be negative: the cable would have to push
    quad_normal: float  # N, sum of the ground's normal forces on the vehicle
    load_normal: float  # N
