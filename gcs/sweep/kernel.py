"""A stretch of flight in one call of machine code: world, estimator, law and mixer, tick after tick.

It ends where the supervisor may have something to decide: at a tick given beforehand, or at the first at
which `autopilot.supervisor.advance.advance` could see more than the time going by. There Python runs that
tick, with the very functions that fly.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from autopilot.control.load_motion import air_force
from autopilot.control.records import Reference, State
from autopilot.estimation.records import EstimatorState, EstimatorTuning, History, ImuReading
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import E1, Vec3, add, axpy, column, dot, norm, scale, sub
from autopilot.geometry.so3 import rotation_from_quat, tilt_angle
from autopilot.supervisor.watches.cable_pull import PULLED
from autopilot.supervisor.watches.cable_pull import SLACK as SLACK_SHARE
from autopilot.supervisor.watches.slack import LEAST_GAP
from autopilot.supervisor.watches.tautening import ASTRAY
from gcs.sweep.link import LinkModel, estimate, settled, wire_forces
from gcs.sweep.pilot import Pilot, PilotModel, air_tick, ground_tick
from gcs.sweep.world import Buffers, Floats, World, WorldModel, tick
from sitl.plant.records import PlantState

# what is flown
GROUND, CARRYING, SLACK = 0, 1, 2
# what else ends a stretch
NOTHING, TAUT, LOAD_DOWN, VEHICLE_DOWN = 0, 1, 2, 3


class Autopilot(NamedTuple):
    """What the autopilot carries from tick to tick, of `flight_core.FlightState`, and its last IMU frame."""

    estimator: EstimatorState
    inertial: ImuReading
    pilot: Pilot


class AutopilotModel(NamedTuple):
    """What is constant over a flight."""

    link: LinkModel
    tuning: EstimatorTuning
    pilot: PilotModel
    control_every: int
    sensor_age_s: float
    tilt_rad: float


class Stretch(NamedTuple):
    """What is flown and what ends it."""

    flown: int  # GROUND, CARRYING or SLACK
    stop_tick: int
    watch: int
    level: float  # m: of the watch
    still_speed: float  # m/s: of VEHICLE_DOWN
    still: bool  # the supervisor has already noted that the thing is down
    error_limit: float  # m: of the load's position; infinite where it is not tracked
    hangs: bool  # the load should hang on the cable
    taut_length: float  # m, from load to vehicle
    load_weight: float  # N
    counts: bool  # the figures of the flight are taken here


class Figures(NamedTuple):
    """Of the mission, tick by tick, from the true state."""

    error_max: float  # m, from where the mission asks the load to be
    error_square: float  # m^2, summed
    samples: float
    tracking_max: float  # m, from the path that is flown
    psi_R_max: float
    psi_q_max: float
    saturated: float  # ticks
    ticks: float
    tension_min: float  # N
    tension_max: float
    estimator_error_max: float  # m
    rotor_min: float  # N
    rotor_max: float


NO_FIGURES = Figures(
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, float("inf"), 0.0, 0.0, float("inf"), -float("inf")
)


@kernel
def control_state(state: EstimatorState) -> State:
    """As `autopilot.estimation.filter.control_state`."""
    vehicle, load, debt = state.vehicle, state.load, state.aids.debt
    return State(
        sub(load.x_load, debt),
        load.v_load,
        load.q_cable,
        load.q_cable_dot,
        sub(vehicle.x_quad, debt),
        vehicle.v_quad,
        rotation_from_quat(vehicle.quat_wxyz),
        vehicle.omega_body,
        vehicle.accel_quad,
    )


@kernel
def vector(row: Floats, first: int) -> Vec3:
    """Three numbers of a row."""
    return (row[first], row[first + 1], row[first + 2])


@kernel
def reference_of(row: Floats) -> Reference:
    """A row of 21 numbers as the reference of a law: position and six derivatives; nose to the east."""
    return Reference(
        (
            vector(row, 0),
            vector(row, 3),
            vector(row, 6),
            vector(row, 9),
            vector(row, 12),
            vector(row, 15),
            vector(row, 18),
        ),
        E1,
    )


@kernel
def felt_pull(pilot: Pilot, state: State, model: PilotModel) -> float:
    """Pull of the cable on the vehicle (N); as `flight_core.felt_pull`."""
    vehicle, a = model.vehicle, state.a_quad
    felt = (a[0], a[1], a[2] + vehicle.gravity)
    known = axpy(pilot.actuation.thrust, column(state.R, 2), air_force(state.v_quad, model.drag))
    known = add(known, pilot.observed.push)
    return dot(sub(scale(vehicle.quad_mass, felt), known), state.q_cable)


@kernel
def may_decide(
    estimator: EstimatorState,
    state: State,
    pilot: Pilot,
    target: Vec3,
    model: AutopilotModel,
    at: Stretch,
) -> bool:
    """Whether the supervisor could do anything at this tick but let the time go by."""
    finite = (
        isfinite(norm(state.x_quad))
        and isfinite(norm(state.v_quad))
        and isfinite(norm(state.x_load))
        and isfinite(norm(state.v_load))
    )
    tilt = tilt_angle(state.R)
    if not finite or not tilt <= model.tilt_rad or not settled(estimator, model.sensor_age_s):
        return True
    if not norm(sub(state.x_load, target)) <= at.error_limit:
        return True
    taut = estimator.load.taut > 0.0
    pulled = felt_pull(pilot, state, model.pilot) / at.load_weight
    if at.hangs:
        gap = at.taut_length - norm(sub(state.x_quad, state.x_load))
        if not taut or (gap > LEAST_GAP and pulled < SLACK_SHARE):
            return True
    if at.watch == TAUT:
        beside = (state.x_load[0] - target[0], state.x_load[1] - target[1], 0.0)
        if target[2] > at.level or not norm(beside) <= ASTRAY:
            return True
        return (pulled > PULLED and taut) != at.still
    if at.watch == LOAD_DOWN:
        return (state.x_load[2] - target[2] > at.level) != at.still
    if at.watch == VEHICLE_DOWN:
        down = state.x_quad[2] - target[2] > at.level and abs(state.v_quad[2]) < at.still_speed
        return down != at.still
    return False


@kernel
def counted(
    f: Figures, plant: PlantState, estimator: EstimatorState, pilot: Pilot, target: Vec3, asked: Vec3
) -> Figures:
    """The figures with those of this tick; `asked` is where the mission asks the load to be, `target` where
    the autopilot does."""
    error = norm(sub(plant.x_load, asked))
    force = plant.rotor_force
    return Figures(
        max(f.error_max, error),
        f.error_square + error * error,
        f.samples + 1.0,
        max(f.tracking_max, norm(sub(plant.x_load, target))),
        max(f.psi_R_max, pilot.command.psi_R),
        max(f.psi_q_max, pilot.command.psi_q),
        f.saturated + (1.0 if pilot.mixed.saturated != 0 else 0.0),
        f.ticks + 1.0,
        min(f.tension_min, plant.tension),
        max(f.tension_max, plant.tension),
        max(f.estimator_error_max, norm(sub(plant.x_load, estimator.load.x_load))),
        min(f.rotor_min, force[0], force[1], force[2], force[3]),
        max(f.rotor_max, force[0], force[1], force[2], force[3]),
    )


@kernel
def _trace(trace: Floats, world: World) -> None:
    if world.tick < trace.shape[0]:
        row, plant = trace[world.tick], world.plant
        for i in range(3):
            row[i] = plant.x_load[i]
            row[3 + i] = plant.x_quad[i]
        for i in range(4):
            row[6 + i] = plant.quat_wxyz[i]
            row[10 + i] = plant.rotor_force[i]


@kernel
def fly_stretch(
    world: World,
    onboard: Autopilot,
    figures: Figures,
    decided: bool,
    stretch: Stretch,
    targets: Floats,
    references: Floats,
    asked: Floats,
    world_model: WorldModel,
    buffers: Buffers,
    history: History,
    model: AutopilotModel,
    trace: Floats,
) -> tuple[World, Autopilot, Figures]:
    """Fly until the supervisor is to be asked: then the tick is estimated, but not controlled.

    `decided`: the present tick is controlled already. `targets` and `references` (ticks, 21) hold what load
    or vehicle is asked for now and what the law is told, from the present tick on. `trace` (ticks, 14)
    receives the true state, as long as it lasts.
    """
    estimator, inertial, pilot = onboard.estimator, onboard.inertial, onboard.pilot
    first = world.tick
    if decided:
        world = tick(world, wire_forces(pilot.mixed.forces), world_model, buffers)
    while True:
        _trace(trace, world)
        dt = 0.0 if world.tick == 0 else world_model.tick_us * 1e-6
        estimator, inertial = estimate(
            estimator,
            history,
            inertial,
            world.now_us,
            buffers,
            model.link,
            model.tuning,
            dt,
            pilot.actuation.thrust,
        )
        if world.tick >= stretch.stop_tick:
            break
        if world.tick % model.control_every == 0:
            state, taut = control_state(estimator), estimator.load.taut
            if stretch.flown == GROUND:
                pilot = ground_tick(pilot, state, taut, model.pilot)
            else:
                at = world.tick - first
                target = vector(targets[at], 0)
                if may_decide(estimator, state, pilot, target, model, stretch):
                    break
                reference = reference_of(references[at])
                pilot = air_tick(pilot, state, taut, reference, stretch.flown == CARRYING, model.pilot)
                if stretch.counts:
                    figures = counted(figures, world.plant, estimator, pilot, target, vector(asked[at], 0))
        world = tick(world, wire_forces(pilot.mixed.forces), world_model, buffers)
    return world, Autopilot(estimator, inertial, pilot), figures
