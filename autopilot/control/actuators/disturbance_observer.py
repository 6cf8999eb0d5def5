"""The load's mass and the wind, estimated from the accelerometer; the rotors' output is assumed to be known.

| symbol | code name | frame | unit | equation |
|---|---|---|---|---|
| x_Q'' | a_quad | I | m/s^2 | accelerometer |
| f | thrust | B | N | `actuation` |
| D | air | I | N | assumed drag of the vehicle |
| r | residual | I | N | m_Q (x_Q'' + g e_3) - f R e_3 - D |
| w | pull | | m/s^2 | L q'.q' - q . (x_Q'' + g e_3) |
| e | direction | I | | in which the wind does not push, `autopilot.control.drag.air_free_direction` |
| T | tension | | N | (r . e) / (q . e) |
| m_L | load_mass | | kg | T / w |
| P | push | I | N | p + k s |
| p | steady_push | I | N | r - T q - k s, averaged |
| s | shape_drag | I | N | drag of the shape `shape` |
| k | factor | | | of s, beyond the assumed drag |
| c | prompt_push | I | N | as p, averaged over a shorter time where noise slows p |

r is all that acts on the vehicle besides weight, rotors and drag in still air: the pull T q of the cable
and the wind's push. The drag of the rotors acts in their plane and that of the frame along the wind, which is
level; the estimator learns how they share the push, and hence the direction e in which there is none, so that
r . e = T q . e. (It would be wrong to assume instead that the push acts across the cable: a vehicle that
leans into a wind whose push is a third of the weight would then seem to carry half its load. With the rotors'
axis for e, one with drag of its frame that leans by 50 deg would seem to carry four times its load.)
The cable turns as a pendulum whose pivot moves with x_Q'', so that x_L'' + g e_3 = -w q whatever the mass of
the load, hence T = m_L w. The mass is the least-squares fit of T to w with exponential forgetting. It is
learned while the load hangs free: cable taut, load higher than where it lay while the cable was slack. The
push is learned while the vehicle is off the ground. The part of the push that follows the speed while the
load hangs free is drag: k is the least-squares fit of the push to drag of the assumed shape, both taken as
differences from their means over some seconds. This part is known without the delay with which the rest is
learned.

Noise of the accelerometer slows p, so that it does not shake the vehicle. A gust would then be learned too
late. So a second average c is never slowed, and p follows it wherever they differ by more than noise can
explain: a first-order filter that takes the share a of each sample leaves the part sqrt(a / (2 - a)) of white
noise.

`torque_observer` estimates the torque on the vehicle besides that of rotors and cable.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

from autopilot.control.actuators.torque_observer import (
    NO_TORQUE,
    TorqueConstants,
    TorqueEstimate,
    deviation_from_mean,
    held,
    later_weight,
    observe_torque,
    torque_constants,
    without_compensation,
)
from autopilot.control.drag import GUST_RANDOM_WALK, Drag, air_free_direction, drag_force
from autopilot.control.records import State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add, axpy, column, dot, norm, scale, sub
from autopilot.geometry.packed import with_field
from autopilot.geometry.s2 import force_along_cable

# m: a load this much higher than where it lay is in the air; a vehicle this much higher than where it stood
# touches the ground nowhere
_OFF_GROUND, _VEHICLE_OFF_GROUND = 0.03, 0.3
# share of the vehicle's weight that the ground carries when the vehicle begins to stand. With a delay beyond
# _PROMPT_DELAY (s) it then stands until the ground carries less than the smaller share, or it has risen by
# _OFF_GROUND: otherwise the law would answer to rotations that the ground prevents, and turn it over.
_ON_GROUND_SHARE, _STANDING_SHARE, _PROMPT_DELAY = 0.2, 0.03, 0.1
_CONTACT_TIME = 0.02  # s, time constant of the estimate of the ground's force
# cosine of 10 deg: a vehicle that leans more does not stand; a gust may carry it as the ground does
_STANDING_COSINE = 0.985
# s, time constant that smooths the estimator's wind on the load: the commanded direction of the cable jumps
# with this wind, and a reading corrects it by more than the wind has changed
_AIR_TIME = 0.15
# drag is learned from motion faster than this, m/s; the greatest factor on its shape
_DRAG_SPEED, _MAX_FACTOR = 0.2, 50.0
# 1/s, linear drag divided by the mass: the shape where no drag is assumed
_DEFAULT_DRAG_RATE = 0.05
# m/s^2, standard deviation of an accelerometer sample up to which, in still air, the push is learned as
# fast as configured
_QUIET_ACCEL_STD = 0.02
# of the weight: a smaller push may be nothing but noise
_PUSH_NOISE_SHARE = 0.03
# standard deviations of its noise by which the push may differ from the promptly learned one
_PUSH_SIGMAS = 4.0
# of the nominal mass of the load
_MIN_MASS_RATIO = 0.25
_MAX_MASS_RATIO = 4.0


class ObserverConstants(NamedTuple):
    """Shares of one period in the fading averages of mass, push and drag, and bounds of the estimates."""

    mass: float
    push: float
    drag: float
    contact: float
    standing_share: float  # of the vehicle's weight: less from the ground, and it no longer stands
    air: float
    gust_noise: float  # m/s^2 / N: noise that the gusts of a wind outweigh, for each newton of its push
    push_noise: float  # N, push that may be nothing but noise
    prompt: float  # as `push`, which noise slows
    prompt_noise: float  # kg, noise of the promptly learned push divided by that of the accelerometer
    max_lag: float  # N, by which the push may differ from the promptly learned one
    max_push: float  # N
    shape: Drag
    min_factor: float
    torque: TorqueConstants


class DisturbanceEstimate(NamedTuple):
    """What is estimated of the load and of the air."""

    load_mass: float  # kg
    push: Vec3  # N, world, on the vehicle
    mass_correlation: float  # of T and w, N m/s^2
    mass_square: float  # of w, m^2/s^4
    ground_force: float  # N, upward force on the vehicle besides that of its rotors while the cable is slack
    load_ground_height: float  # m, height at which the load lay
    vehicle_ground_height: float  # m, height at which the vehicle stood
    stands: float  # 1 while the ground holds the vehicle, else 0
    steady_push: Vec3  # N, the part of the push that does not follow the speed
    prompt_push: Vec3  # N, the same, learned as fast as configured
    drag: Drag  # learned drag, beyond the assumed drag
    drag_weight: float  # of what the two means have learned; 1: they are complete
    mean_shape_drag: Vec3  # N, times the weight
    mean_residual: Vec3  # N, times the weight
    drag_correlation: float  # of s and r, N^2
    drag_square: float  # of s, N^2
    load_air_accel: Vec3  # m/s^2, world, acceleration of the load by the air besides its drag
    load_drag: float  # 1/s, divided by the load's mass
    torque: TorqueEstimate  # on the vehicle besides that of rotors and cable


def averaging_share(period: float, time: float) -> float:
    """Share of a new value in an average that fades with this time constant (s); 0 learns nothing."""
    return min(1.0, period / time) if time > 0.0 else 0.0


def observer_constants(
    mass_time: float,
    push_time: float,
    drag_time: float,
    torque_time: float,
    max_push: float,
    period: float,
    delay: float,
    drag: Drag,
    vehicle: Vehicle,
) -> ObserverConstants:
    """For averages that fade with these time constants (s); 0 learns nothing. `delay` (s) is the assumed one
    of commands and estimate, `drag` the assumed drag."""

    def share(time: float) -> float:
        return averaging_share(period, time)

    has_drag = max(drag.linear, drag.quadratic) > 0.0
    return ObserverConstants(
        share(mass_time),
        share(push_time),
        share(drag_time),
        share(_CONTACT_TIME),
        _STANDING_SHARE if delay > _PROMPT_DELAY else _ON_GROUND_SHARE,
        share(_AIR_TIME),
        GUST_RANDOM_WALK * push_time / (sqrt(period) * vehicle.quad_mass),
        _PUSH_NOISE_SHARE * (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity,
        share(push_time),
        vehicle.quad_mass * sqrt(share(push_time) / (2.0 - share(push_time))),
        0.0,
        max_push,
        drag if has_drag else Drag(_DEFAULT_DRAG_RATE * vehicle.quad_mass, 0.0),
        -1.0 if has_drag else 0.0,
        torque_constants(share(torque_time), share(drag_time), period, vehicle),
    )


@kernel
def slowed_by_noise(
    constants: ObserverConstants, observed: DisturbanceEstimate, accel_var: float
) -> ObserverConstants:
    """The constants by which the push is learned more slowly if the accelerometer is noisy against the gusts,
    unless it differs from the promptly learned one by more than this noise.

    `accel_var`, (m/s^2)^2, is the variance of a sample. The filter of a push that wanders by w sqrt(t) and is
    measured every T seconds with noise of standard deviation s has the time constant s sqrt(T) / w.
    """
    quiet = _QUIET_ACCEL_STD + constants.gust_noise * max(
        0.0, norm(observed.steady_push) - constants.push_noise
    )
    slowed = with_field(constants, "push", constants.push / max(1.0, sqrt(accel_var) / quiet))
    return with_field(slowed, "max_lag", _PUSH_SIGMAS * constants.prompt_noise * sqrt(accel_var))


@kernel
def with_wind_on_load(
    observed: DisturbanceEstimate, gust: Vec3, drag: float, constants: ObserverConstants
) -> DisturbanceEstimate:
    """With the estimator's `gust`, acceleration of the load besides its drag (m/s^2), and `drag` (1/s)."""
    smoothed = axpy(constants.air, sub(gust, observed.load_air_accel), observed.load_air_accel)
    return with_field(with_field(observed, "load_air_accel", smoothed), "load_drag", drag)


@kernel
def nominal_on_ground(vehicle: Vehicle) -> DisturbanceEstimate:
    """Nothing observed: the configured mass of the load, still air, vehicle on the ground, load at home."""
    g = vehicle.gravity
    return DisturbanceEstimate(
        vehicle.load_mass,
        ZERO,
        vehicle.load_mass * g * g,
        g * g,
        vehicle.quad_mass * g,
        0.0,
        0.0,
        1.0,
        ZERO,
        ZERO,
        Drag(0.0, 0.0),
        0.0,
        ZERO,
        ZERO,
        0.0,
        0.0,
        ZERO,
        0.0,
        NO_TORQUE,
    )


def nominal_in_flight(vehicle: Vehicle) -> DisturbanceEstimate:
    """As `nominal_on_ground`, but vehicle and load are off the ground, wherever they are."""
    return nominal_on_ground(vehicle)._replace(
        ground_force=0.0, load_ground_height=-inf, vehicle_ground_height=-inf, stands=0.0
    )


@kernel
def vehicle_on_ground(observed: DisturbanceEstimate) -> bool:
    """Whether the ground holds the vehicle."""
    return observed.stands > 0.0


@kernel
def load_on_ground(observed: DisturbanceEstimate, state: State) -> bool:
    """Whether the load is no higher than where it lay while the cable was slack."""
    return not state.x_load[2] > observed.load_ground_height + _OFF_GROUND


@kernel
def with_extra_weight(
    observed: DisturbanceEstimate, extra_mass: float, vehicle: Vehicle
) -> DisturbanceEstimate:
    """The estimate with the weight of a mass (kg) of the vehicle that is not assumed, as a push."""
    weight = extra_mass * vehicle.gravity
    return with_field(observed, "push", add(observed.push, (0.0, 0.0, -weight)))


@kernel
def with_extra_load(
    observed: DisturbanceEstimate, extra_mass: float, vehicle: Vehicle
) -> DisturbanceEstimate:
    """The estimate with a mass (kg) of the vehicle that is not assumed as part of the load: in the pull, on
    which it is learned, it is the same."""
    least, greatest = _MIN_MASS_RATIO * vehicle.load_mass, _MAX_MASS_RATIO * vehicle.load_mass
    load_mass = min(greatest, max(least, vehicle.load_mass + extra_mass))
    observed = with_field(observed, "load_mass", load_mass)
    return with_field(observed, "mass_correlation", load_mass * observed.mass_square)


@kernel
def with_load_mass(vehicle: Vehicle, load_mass: float) -> Vehicle:
    """The vehicle with a load of this mass."""
    return with_field(vehicle, "load_mass", load_mass)


@kernel
def part_along_cable(force: Vec3, q: Vec3, direction: Vec3) -> float:
    """The cable's part of a force on the vehicle, N along q; the rest acts across `direction`."""
    return force_along_cable(dot(force, direction), q, direction)


@kernel
def observe(
    observed: DisturbanceEstimate,
    state: State,
    taut: float,
    thrust: float,
    moment: Vec3,
    constants: ObserverConstants,
    drag: Drag,
    vehicle: Vehicle,
    frame_share: float,
) -> DisturbanceEstimate:
    """The estimates a period later. `thrust`, N, is what the rotors give now, `moment`, N m, that of rotors
    and cable; `vehicle` is the nominal one, `frame_share` the estimator's k of
    `autopilot.estimation.cable_pull`."""
    q, a = state.q_cable, state.a_quad
    load_mass, steady_push, learned = observed.load_mass, observed.steady_push, observed.drag
    prompt_push = observed.prompt_push
    drag_weight = observed.drag_weight
    mean_shape_drag, mean_residual = observed.mean_shape_drag, observed.mean_residual
    drag_correlation, drag_square = observed.drag_correlation, observed.drag_square
    mass_correlation, mass_square = observed.mass_correlation, observed.mass_square
    ground_force, load_ground_height = observed.ground_force, observed.load_ground_height
    if not taut > 0.0:
        load_ground_height = state.x_load[2]

    specific_force: Vec3 = (a[0], a[1], a[2] + vehicle.gravity)
    known = axpy(thrust, column(state.R, 2), drag_force(state.v_quad, drag))
    residual = sub(scale(vehicle.quad_mass, specific_force), known)
    shape = constants.shape
    shape_drag = drag_force(state.v_quad, shape)
    may_stand = not taut > 0.0 and state.R[2][2] > _STANDING_COSINE
    ground_force += constants.contact * ((residual[2] if may_stand else 0.0) - ground_force)
    if taut > 0.0:
        direction = air_free_direction(column(state.R, 2), frame_share)
        tension = part_along_cable(residual, q, direction)
        pull = vehicle.cable_length * dot(state.q_cable_dot, state.q_cable_dot) - dot(q, specific_force)
        residual = axpy(-tension, q, residual)
        shape_drag = axpy(-part_along_cable(shape_drag, q, direction), q, shape_drag)
        if not load_on_ground(observed, state) and pull > 0.0:
            mass_correlation += constants.mass * (tension * pull - mass_correlation)
            mass_square += constants.mass * (pull * pull - mass_square)
            ratio = mass_correlation / mass_square
            load_mass = min(
                _MAX_MASS_RATIO * vehicle.load_mass, max(_MIN_MASS_RATIO * vehicle.load_mass, ratio)
            )
    else:
        # the vertical part cannot be distinguished from the ground's force
        residual, shape_drag = (residual[0], residual[1], 0.0), (shape_drag[0], shape_drag[1], 0.0)
    factor = learned.linear / shape.linear if shape.linear > 0.0 else learned.quadratic / shape.quadratic
    # only where neither vehicle nor load can touch the ground: its forces are no drag
    suspended = taut > 0.0 and not load_on_ground(observed, state)
    if suspended:
        mean_shape_drag = axpy(constants.drag, sub(shape_drag, mean_shape_drag), mean_shape_drag)
        mean_residual = axpy(constants.drag, sub(residual, mean_residual), mean_residual)
        drag_weight = later_weight(drag_weight, constants.drag)
        deviation = deviation_from_mean(shape_drag, mean_shape_drag, drag_weight)
        residual_deviation = deviation_from_mean(residual, mean_residual, drag_weight)
        drag_correlation += constants.drag * (dot(deviation, residual_deviation) - drag_correlation)
        drag_square += constants.drag * (dot(deviation, deviation) - drag_square)
        min_drag_force = (shape.linear + shape.quadratic * _DRAG_SPEED) * _DRAG_SPEED
        factor = min(
            _MAX_FACTOR,
            max(constants.min_factor, drag_correlation / (drag_square + min_drag_force * min_drag_force)),
        )
        learned = Drag(factor * shape.linear, factor * shape.quadratic)
    weight = vehicle.quad_mass * vehicle.gravity
    stands = ground_force > _ON_GROUND_SHARE * weight
    vehicle_ground_height = observed.vehicle_ground_height
    if stands:
        vehicle_ground_height = state.x_quad[2]
    elif observed.stands > 0.0:
        is_low = state.x_quad[2] < vehicle_ground_height + _OFF_GROUND
        stands = is_low and ground_force > constants.standing_share * weight
    in_air = state.x_quad[2] > vehicle_ground_height + _VEHICLE_OFF_GROUND
    if suspended or (in_air and not taut > 0.0):
        torque = observe_torque(observed.torque, state, moment, constants.torque, vehicle)
    elif stands:
        torque = without_compensation(observed.torque, state)
    else:
        torque = held(observed.torque, state)
    if not stands:
        now = axpy(-factor, shape_drag, residual)
        steady_push = axpy(constants.push, sub(now, steady_push), steady_push)
        prompt_push = axpy(constants.prompt, sub(now, prompt_push), prompt_push)
        lag = sub(prompt_push, steady_push)
        if norm(lag) > constants.max_lag:
            steady_push = axpy(-constants.max_lag / norm(lag), lag, prompt_push)
        size = norm(steady_push)
        if size > constants.max_push:
            steady_push = scale(constants.max_push / size, steady_push)
    return DisturbanceEstimate(
        load_mass,
        axpy(factor, shape_drag, steady_push),
        mass_correlation,
        mass_square,
        ground_force,
        load_ground_height,
        vehicle_ground_height,
        1.0 if stands else 0.0,
        steady_push,
        prompt_push,
        learned,
        drag_weight,
        mean_shape_drag,
        mean_residual,
        drag_correlation,
        drag_square,
        observed.load_air_accel,
        observed.load_drag,
        torque,
    )
