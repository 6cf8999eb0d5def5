"""What the accelerometer tells of the load's mass and of the wind, rotors believed to be known.

| symbol | code name | frame | unit | equation |
|---|---|---|---|---|
| x_Q'' | a_quad | I | m/s^2 | accelerometer |
| f | thrust | B | N | `actuation` |
| D | air | I | N | drag of the vehicle, by belief |
| r | rest | I | N | m_Q (x_Q'' + g e_3) - f R e_3 - D |
| w | pull | | m/s^2 | L q'.q' - q . (x_Q'' + g e_3) |
| m_L | load_mass | | kg | (r . q) / w |
| P | push | I | N | r - (r . q) q |

r is all that acts on the vehicle besides weight, rotors and drag in still air: the pull T q of the cable
and the wind's push. Across the cable it is the push alone. Along it the push is taken for none, so that r .
q = T; and the load, on a cable that turns as a pendulum whose pivot moves with x_Q'', has x_L'' + g e_3 =
-w q whatever its mass, hence T = m_L w. The mass is the least-squares fit of T to w with exponential
forgetting. It is learned while the load hangs free: cable taut, load higher than where it lay while the
cable was slack. The push is learned while the vehicle is off the ground.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from autopilot.control.load_motion import Drag, air_force
from autopilot.control.records import State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add, axpy, column, dot, norm, scale, sub

# m: so much higher than where it stood or lay is in the air
_OFF_GROUND = 0.03
# share of the vehicle's weight that the ground carries while the vehicle counts as standing
_STANDING = 0.2
_CONTACT_TIME = 0.02  # s, in which the ground's force is believed
# of the nominal mass of the load
_LEAST_MASS = 0.25
_GREATEST_MASS = 4.0


class ObserverConstants(NamedTuple):
    """Shares of a period in the memory of mass and push, and the most the push is believed to be."""

    mass: float
    push: float
    contact: float
    greatest_push: float  # N


class Observed(NamedTuple):
    """What is believed of the load and of the air."""

    load_mass: float  # kg
    push: Vec3  # N, world, on the vehicle
    correlation: float  # of T and w, N m/s^2
    square: float  # of w, m^2/s^4
    support: float  # N, what holds the vehicle up besides its rotors while the cable is slack
    load_ground: float  # m, height at which the load lay


def observer_constants(
    mass_time: float, push_time: float, greatest_push: float, period: float
) -> ObserverConstants:
    """For memories that fade with these time constants (s); 0 learns nothing."""

    def share(time: float) -> float:
        return min(1.0, period / time) if time > 0.0 else 0.0

    return ObserverConstants(share(mass_time), share(push_time), share(_CONTACT_TIME), greatest_push)


@kernel
def nominal(vehicle: Vehicle) -> Observed:
    """Nothing observed: the load's mass as told, still air, standing on the ground, the load at home."""
    g = vehicle.gravity
    return Observed(vehicle.load_mass, ZERO, vehicle.load_mass * g * g, g * g, vehicle.quad_mass * g, 0.0)


def aloft(vehicle: Vehicle) -> Observed:
    """As `nominal`, but vehicle and load are off the ground, wherever they are."""
    return nominal(vehicle)._replace(support=0.0, load_ground=-inf)


@kernel
def standing(observed: Observed, vehicle: Vehicle) -> bool:
    """Whether the ground holds the vehicle."""
    return observed.support > _STANDING * vehicle.quad_mass * vehicle.gravity


@kernel
def lying(observed: Observed, state: State) -> bool:
    """Whether the load is no higher than where it lay while the cable was slack."""
    return not state.x_load[2] > observed.load_ground + _OFF_GROUND


@kernel
def loaded(vehicle: Vehicle, load_mass: float) -> Vehicle:
    """The vehicle with a load of this mass."""
    return Vehicle(
        vehicle.quad_mass,
        load_mass,
        vehicle.cable_length,
        vehicle.inertia,
        vehicle.gravity,
        vehicle.arm,
        vehicle.torque_ratio,
        vehicle.rotor_min,
        vehicle.rotor_max,
    )


@kernel
def observe(
    observed: Observed,
    state: State,
    taut: float,
    thrust: float,
    constants: ObserverConstants,
    drag: Drag,
    vehicle: Vehicle,
) -> Observed:
    """The belief a period later; `thrust`, N, is what the rotors give now, `vehicle` the nominal one."""
    q, a = state.q_cable, state.a_quad
    load_mass, push = observed.load_mass, observed.push
    correlation, square = observed.correlation, observed.square
    support, load_ground = observed.support, observed.load_ground
    if not taut > 0.0:
        load_ground = state.x_load[2]

    felt: Vec3 = (a[0], a[1], a[2] + vehicle.gravity)
    known = axpy(thrust, column(state.R, 2), air_force(state.v_quad, drag))
    rest = sub(scale(vehicle.quad_mass, felt), known)
    support += constants.contact * ((0.0 if taut > 0.0 else rest[2]) - support)
    if taut > 0.0:
        tension = dot(rest, q)
        pull = vehicle.cable_length * dot(state.q_cable_dot, state.q_cable_dot) - dot(q, felt)
        rest = axpy(-tension, q, rest)
        if not lying(observed, state) and pull > 0.0:
            correlation += constants.mass * (tension * pull - correlation)
            square += constants.mass * (pull * pull - square)
            found = correlation / square
            load_mass = min(_GREATEST_MASS * vehicle.load_mass, max(_LEAST_MASS * vehicle.load_mass, found))
    else:
        # up and down it cannot be told from the ground
        rest = (rest[0], rest[1], 0.0)
    if not support > _STANDING * vehicle.quad_mass * vehicle.gravity:
        push = add(push, scale(constants.push, sub(rest, push)))
        size = norm(push)
        if size > constants.greatest_push:
            push = scale(constants.greatest_push / size, push)
    return Observed(load_mass, push, correlation, square, support, load_ground)
