"""A step of many environments in one call of machine code: ticks of the world, each preceded by the action.

`sitl.world.world_tick` advances the world, including rounding and sensors, as in every flight. If the
estimate is observed, the readings go through the autopilot's own estimator, in ticks of
`autopilot.core.tick.fly_tick` in which the law does not run. Both are the same machine code as in a flight,
so that there is little to compile.
"""

from __future__ import annotations

from typing import Any

from autopilot.control.actuators.mixer import MixerResult, mix
from autopilot.control.actuators.rotor_model import Actuation
from autopilot.control.actuators.rotor_model import advance as actuate
from autopilot.control.records import Reference, State
from autopilot.control.thesis_cascade import ThesisMemory, load_position, start
from autopilot.core.tick import ControlMemory, CoreConstants, CoreRows, EstimateSummary
from autopilot.estimation.records import History
from autopilot.geometry.kernel import kernel, nogil_kernel
from autopilot.geometry.linear import E1, ZERO, Vec3, norm, scale, sub
from autopilot.geometry.packed import pack, unpack, with_field
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.trajectory.signals import Jet
from gcs.sweep.kernel import Code, call_fly_tick, call_world_tick
from gcs.sweep.wire import Wire, deliver_readings, put_forces
from plumbline.learning.actions import Mixing, apply_action, clipped
from plumbline.learning.observations import write_observation
from plumbline.learning.records import Actions, Batch, Episode, EstimatorRows, Observations, Reward, TaskModel
from sitl.plant.records import PlantState
from sitl.world import World, WorldModel, WorldRows

FLYING, CRASHED, ENDED = 0, 1, 2
LAW_EVERY = 2  # ticks; only the odd ones are flown, in which only the estimator runs
_ODD = 1


@kernel
def _world(batch: Batch, i: int) -> WorldRows:
    return WorldRows(
        batch.world[i],
        batch.model[i],
        batch.seed[i],
        batch.clock[i],
        batch.delivery[i],
        batch.errors[i],
        batch.queue[i],
        batch.commands[i],
        batch.ring[i],
        batch.rotors[i],
        batch.rotor_table[i],
    )


@kernel
def _core(estimators: EstimatorRows, i: int, mixing: Mixing) -> CoreRows:
    h = estimators.history
    history = History(
        h.ring[i],
        h.covariance[i],
        h.error[i],
        h.columns[i],
        h.jacobian[i],
        h.gain[i],
        h.scalars[i],
        h.consistency[i],
    )
    return CoreRows(
        estimators.estimator[i],
        estimators.control[i],
        estimators.summary[i],
        estimators.commands[i],
        history,
        estimators.inbox[i],
        estimators.constants,
        estimators.winch,
        estimators.stretch,
        estimators.none,
        estimators.none,
        mixing.rotors,
        mixing.table,
    )


@kernel
def _mixing(batch: Batch, i: int) -> Mixing:
    return Mixing(batch.mixer, batch.mixed[i], batch.hover)


@kernel
def true_state(plant: PlantState) -> State:
    """The true state in the form in which a law receives it."""
    return State(
        plant.x_load,
        plant.v_load,
        plant.q_cable,
        plant.q_cable_dot,
        plant.x_quad,
        plant.v_quad,
        rotation_from_quat(plant.quat_wxyz),
        plant.omega_body,
        plant.accel_quad,
    )


@kernel
def _observed_state(estimators: Any, plant: PlantState, i: int) -> State:
    """The observed state: the true or the estimated one."""
    if estimators is None:
        return true_state(plant)
    return unpack(EstimateSummary, estimators.summary[i], 0).state


@kernel
def _vector(reference: Any, row: int, first: int) -> Vec3:
    return (reference[row, first], reference[row, first + 1], reference[row, first + 2])


@kernel
def jet_at(reference: Any, row: int) -> Jet:
    """The reference at a row of its table, or at the last row if the table is shorter."""
    at = min(row, reference.shape[0] - 1)
    return (
        _vector(reference, at, 0),
        _vector(reference, at, 3),
        _vector(reference, at, 6),
        _vector(reference, at, 9),
        _vector(reference, at, 12),
        _vector(reference, at, 15),
        _vector(reference, at, 18),
    )


@kernel
def _update_actuation(estimators: EstimatorRows, i: int, mixed: MixerResult) -> None:
    """Update the rotors' thrust and moment that the estimator assumes after a command."""
    constants = unpack(CoreConstants, estimators.constants, 0)
    control = unpack(ControlMemory, estimators.control[i], 0)
    actuation = Actuation(estimators.commands[i], control.thrust, control.moment)
    actuation = actuate(actuation, mixed.achieved_thrust, mixed.achieved_moment, constants.actuation)
    control = with_field(with_field(control, "thrust", actuation.thrust), "moment", actuation.moment)
    pack(control, estimators.control[i], 0)


@kernel
def _tick(
    estimators: Any, code: Code, i: int, rows: WorldRows, mixed: MixerResult, mixing: Mixing
) -> PlantState:
    """Advance the world, and the estimate of it, by one tick; returns the true state."""
    put_forces(mixing.rotors, mixing.table, rows)
    if estimators is not None:
        _update_actuation(estimators, i, mixed)
    call_world_tick(code, rows, False, 0.0, None)
    if estimators is not None:
        now = unpack(World, rows.world, 0)
        readings = deliver_readings(rows, now.now_us, unpack(Wire, estimators.wire, 0), estimators.inbox[i])
        dt = unpack(WorldModel, rows.model, 0).tick_us * 1e-6
        call_fly_tick(
            code, _core(estimators, i, mixing), estimators.law, readings, now.now_us, _ODD, dt, False
        )
    return unpack(World, rows.world, 0).plant


@kernel
def _reward(state: State, jet: Jet, change: float, crashed: bool, weights: Reward) -> float:
    error = norm(sub(state.x_load, jet[0]))
    relative = error / weights.width
    reward = (
        weights.alive
        + weights.position / (1.0 + relative * relative)
        - weights.velocity * norm(sub(state.v_load, jet[1]))
        - weights.swing * norm(state.q_cable_dot)
        - weights.spin * norm(state.omega_body)
        - weights.change * change
    )
    return reward - weights.crash if crashed else reward


@kernel
def _observe(batch: Batch, i: int, task: TaskModel, episode: Episode, out: Observations) -> None:
    plant = unpack(World, batch.world[i], 0).plant
    jet = jet_at(batch.reference, episode.first_row + episode.tick)
    write_observation(
        _observed_state(batch.estimators, plant, i),
        jet,
        batch.action[i],
        batch.past[i],
        task.observation_model,
        out[i],
    )


@kernel
def _step_one(
    batch: Batch, i: int, task: TaskModel, actions: Actions, out: Observations, rewards: Any, ends: Any
) -> None:
    rows = _world(batch, i)
    episode = unpack(Episode, batch.episode[i], 0)
    action, mixing, change = batch.action[i], _mixing(batch, i), 0.0
    for k in range(task.observation_model.actions):
        number = clipped(float(actions[i, k]))
        change += (number - action[k]) * (number - action[k])
        action[k] = number
    memory = unpack(ThesisMemory, batch.law[i], 0)
    plant = unpack(World, rows.world, 0).plant
    crashed, tick = False, 0
    while tick < task.ticks and not crashed:
        memory, mixed = apply_action(
            action, _observed_state(batch.estimators, plant, i), memory, task.action, mixing
        )
        plant = _tick(batch.estimators, batch.code, i, rows, mixed, mixing)
        down = plant.vehicle_on_ground > 0.0 or plant.load_on_ground > 0.0
        crashed = down or plant.diverged > 0.0
        tick += 1
    pack(memory, batch.law[i], 0)
    state = true_state(plant)
    tick = episode.tick + task.ticks
    jet = jet_at(batch.reference, episode.first_row + tick)
    crashed = crashed or not norm(sub(plant.x_load, jet[0])) < task.reach or state.R[2][2] < 0.0
    rewards[i] = _reward(state, jet, change, crashed, task.reward)
    rows_left = batch.reference.shape[0] - episode.first_row - tick
    ends[i] = CRASHED if crashed else ENDED if rows_left <= 0 and batch.reference.shape[0] > 1 else FLYING
    episode = Episode(episode.first_row, tick)
    pack(episode, batch.episode[i], 0)
    _observe(batch, i, task, episode, out)


@kernel
def _fly_until_settled(
    estimators: Any, batch: Batch, i: int, task: TaskModel, end: Vec3, velocity: Vec3
) -> None:
    """Fly so that the load arrives at `end` with `velocity`, while the estimate converges."""
    if estimators is None:
        return
    rows, model, mixing = _world(batch, i), task.action, _mixing(batch, i)
    tick_s = unpack(WorldModel, rows.model, 0).tick_us * 1e-6
    plant = unpack(World, rows.world, 0).plant
    memory = start(true_state(plant), plant.x_load, velocity)
    for tick in range(task.settle):
        left_s = (task.settle - tick) * tick_s
        x_d = sub(end, scale(left_s, velocity))
        reference = Reference((x_d, velocity, ZERO, ZERO, ZERO, ZERO, ZERO), E1)
        memory, command = load_position(
            memory, true_state(plant), reference, model.gains, model.filters, model.vehicle
        )
        mixed = mix(command.thrust, command.moment, model.vehicle, model.limited, mixing.table, mixing.rotors)
        plant = _tick(estimators, batch.code, i, rows, mixed, mixing)


@kernel
def _start_one(batch: Batch, i: int, task: TaskModel, end: Vec3, velocity: Vec3, out: Observations) -> None:
    _fly_until_settled(batch.estimators, batch, i, task, end, velocity)
    plant = unpack(World, batch.world[i], 0).plant
    pack(start(_observed_state(batch.estimators, plant, i), plant.x_load, plant.v_load), batch.law[i], 0)
    _observe(batch, i, task, unpack(Episode, batch.episode[i], 0), out)


@nogil_kernel
def step_or_start(
    batch: Batch,
    chosen: Any,
    starting: bool,
    places: Any,
    velocities: Any,
    actions: Actions,
    out: Observations,
    rewards: Any,
    ends: Any,
) -> None:
    """Step the environments `chosen`, or begin an episode in each of them, whose world has already been
    made.

    A step applies `actions` (n, size), and writes observations (n, size), rewards (n,) and `ends`: FLYING,
    CRASHED, or ENDED at the end of the path. A beginning writes the observations; if the estimate is
    observed, the simulator first flies until the load arrives at `places` (k, 3), one for each chosen
    environment, with `velocities` (k, 3). One function does both because it takes long to compile.
    """
    task = unpack(TaskModel, batch.task, 0)
    for k in range(chosen.shape[0]):
        i = chosen[k]
        if starting:
            end = (places[k, 0], places[k, 1], places[k, 2])
            velocity = (velocities[k, 0], velocities[k, 1], velocities[k, 2])
            _start_one(batch, i, task, end, velocity, out)
        else:
            _step_one(batch, i, task, actions, out, rewards, ends)
