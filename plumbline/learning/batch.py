"""Many episodes in parallel: their memory, their beginnings, and steps of all of them in one call."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autopilot.control.actuators.mixer import new_rotors
from autopilot.control.records import State
from autopilot.control.thesis_cascade import ThesisMemory
from autopilot.core.flight_core import FlightCore
from autopilot.core.tick import CoreConstants, EstimateSummary, placeholder_law
from autopilot.estimation.inbox import new_inbox
from autopilot.estimation.records import History, new_history
from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.packed import pack, unpack, width
from autopilot.guidance.jet_table import COLUMNS
from autopilot.trajectory.signals import Jet
from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.vehicle.rotors import mixer_table
from gcs.sweep.kernel import Code, code_of_autopilot, code_of_world
from plumbline.learning.actions import Mixing
from plumbline.learning.initial_world import (
    V_LOAD,
    V_QUAD,
    X_LOAD,
    X_QUAD,
    InitialWorld,
    hover_forces,
    initial_world,
    worlds_differ,
)
from plumbline.learning.records import (
    FEATURES,
    Actions,
    Batch,
    Episode,
    EstimatorRows,
    Observations,
)
from plumbline.learning.scenario import Draw, Scenario
from plumbline.learning.step import LAW_EVERY, jet_at, step_or_start, true_state
from sitl.plant.records import PlantState, Truth
from sitl.plant.rotors import FORCE
from sitl.world import Floats, World, WorldModel

Numbers = NDArray[np.int64]
_MIN_TICKS_PER_THREAD = 2000  # ticks per thread from which on another thread is worthwhile


def _copied(
    scenario: Scenario, count: int, threads: int, attributes: dict[str, Any], memory: Batch
) -> Episodes:
    """Episodes with these attributes, and with a memory that lacks what belongs to a process."""
    episodes = Episodes(scenario, count, threads)
    own = episodes._batch
    vars(episodes).update(attributes, _batch=_with_code_of(memory, own.code, own.estimators))
    return episodes


def _with_code_of(batch: Batch, code: Code, estimators: EstimatorRows | None) -> Batch:
    """The memory with this machine code, and with the law of these estimators, which may hold an address."""
    if estimators is None:
        return batch._replace(code=code)
    return batch._replace(code=code, estimators=batch.estimators._replace(law=estimators.law))


class Episodes:
    """`count` episodes of a scenario. `ends`, `rewards` and `observations` are those of the last step."""

    def __init__(self, scenario: Scenario, count: int, threads: int | None = None) -> None:
        self.scenario = scenario
        self.count = count
        self.rewards = np.zeros(count)
        self.ends = np.zeros(count, np.int64)
        self.observations: Observations = np.zeros((count, scenario.size), np.float32)
        self._all = np.arange(count)
        self._actions = np.zeros((count, scenario.task.observation_model.actions), np.float32)
        self._no_places = np.zeros((1, 3))
        self._batch = self._new_batch()
        self._common_world: InitialWorld | None = (
            None  # of all episodes, if they differ only in position and velocity
        )
        if not worlds_differ(scenario):
            self._common_world = initial_world(scenario, scenario.draw(np.random.default_rng(0)))
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        work = count * scenario.ticks * (10 if scenario.estimated else 1)
        self._threads = max(1, min(cores, work // _MIN_TICKS_PER_THREAD)) if threads is None else threads
        self._pool = ThreadPoolExecutor(self._threads - 1) if self._threads > 1 else None
        self._run = entry_point_of(
            step_or_start, *self._job(self._all[:0], False, self._no_places, self._no_places)
        )

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy, also in another process, goes on where this one is; it has machine code and threads of its
        own."""
        of_process = ("_run", "_pool", "_batch")
        attributes = {name: value for name, value in vars(self).items() if name not in of_process}
        estimators = self._batch.estimators
        memory = _with_code_of(self._batch, Code(0, 0), estimators and estimators._replace(law=None))
        return _copied, (self.scenario, self.count, self._threads, attributes, memory)

    # ---- steps

    def step(self, actions: Actions, chosen: Numbers | None = None) -> None:
        """Step all episodes, or those that are `chosen`, with their actions (count, size)."""
        self._actions[:] = actions
        shares = np.array_split(self._all if chosen is None else chosen, self._threads)
        self._run_jobs([self._job(share, False, self._no_places, self._no_places) for share in shares])

    def _job(self, chosen: Numbers, starting: bool, places: Floats, velocities: Floats) -> tuple[Any, ...]:
        return (
            self._batch,
            chosen,
            starting,
            places,
            velocities,
            self._actions,
            self.observations,
            self.rewards,
            self.ends,
        )

    def _run_jobs(self, jobs: Sequence[tuple[Any, ...]]) -> None:
        """Call machine code once for each job, the last one in this thread."""
        futures = [] if self._pool is None else [self._pool.submit(self._run, *job) for job in jobs[:-1]]
        self._run(*jobs[-1])
        for future in futures:
            future.result()

    # ---- beginnings

    def start(self, chosen: Sequence[int], draws: Sequence[Draw]) -> None:
        """Begin an episode in each chosen environment; its first observation is in `observations`."""
        if not chosen:
            return
        jets = self.scenario.reference[[draw.first_row for draw in draws]]
        velocities = np.ascontiguousarray(jets[:, 3:6])
        places = jets[:, :3] + np.array([draw.offset for draw in draws])
        lead_s = self.scenario.task.settle * self.scenario.tick_us * 1e-6
        start_places = places - lead_s * velocities
        if self._common_world:
            self._fill(chosen, draws, start_places, velocities)
        else:
            for k in range(len(chosen)):
                one = slice(k, k + 1)
                self._fill(chosen[one], draws[one], start_places[one], velocities[one])
        shares = self._threads if self.scenario.estimated else 1
        parts = [np.array_split(rows, shares) for rows in (np.asarray(chosen), places, velocities)]
        self._run_jobs([self._job(some, True, *where) for some, *where in zip(*parts, strict=True)])

    def _fill(self, chosen: Sequence[int], draws: Sequence[Draw], places: Floats, velocities: Floats) -> None:
        """Fill the memory of episodes that begin alike: load and vehicle move together, cable vertical."""
        initial = self._common_world or initial_world(self.scenario, draws[0])
        batch, rows, in_transit, chosen_rows = (
            self._batch,
            initial.rows,
            len(initial.commands),
            np.asarray(chosen),
        )
        batch.world[chosen_rows] = initial.world
        batch.world[chosen_rows, X_LOAD] = places
        batch.world[chosen_rows, X_QUAD] = places
        batch.world[chosen_rows, X_QUAD.stop - 1] += initial.cable_length
        batch.world[chosen_rows, V_LOAD] = velocities
        batch.world[chosen_rows, V_QUAD] = velocities
        batch.model[chosen_rows], batch.delivery[chosen_rows], batch.errors[chosen_rows] = (
            rows.model,
            rows.delivery,
            rows.errors,
        )
        batch.clock[chosen_rows] = initial.clock
        batch.seed[chosen_rows, 0] = [draw.seed for draw in draws]
        batch.ring[chosen_rows] = 0, in_transit
        batch.commands[chosen_rows, :in_transit] = initial.commands
        batch.rotors[chosen_rows], batch.rotor_table[chosen_rows] = rows.rotors, rows.rotor_table
        batch.action[chosen_rows] = 0.0
        batch.episode[chosen_rows] = 0.0
        batch.episode[chosen_rows, 0] = [draw.first_row for draw in draws]  # the first field of Episode
        batch.past[chosen_rows] = 0.0
        if self.scenario.estimated:
            for i in chosen:
                self._reset_estimator(i)

    def _reset_estimator(self, i: int) -> None:
        estimators = self._batch.estimators
        for name in ("estimator", "control", "summary", "commands"):
            getattr(estimators, name)[i] = getattr(self._initial_rows, name)
        for row, blank in zip(estimators.history, new_history(), strict=True):
            row[i] = blank

    # ---- memory

    def _new_batch(self) -> Batch:
        scenario, n = self.scenario, self.count
        command_capacity, capacity = scenario.max_capacities()
        rows = scenario.world(scenario.draw(np.random.default_rng(0)))[0]
        estimators, autopilot = None, 0
        if scenario.estimated:
            core = FlightCore(scenario.cell.setup)
            estimators = self._estimators(core, rows.queue.shape[0] * capacity + len(rows.rotor_table))
            autopilot = code_of_autopilot(core.rows, estimators.law)
        return Batch(
            world=np.zeros((n, width(World))),
            model=np.zeros((n, len(rows.model))),
            seed=np.zeros((n, 1), np.int64),
            clock=np.zeros((n, *rows.clock.shape), np.int64),
            delivery=np.zeros((n, *rows.delivery.shape)),
            errors=np.zeros((n, *rows.errors.shape)),
            queue=np.zeros((n, rows.queue.shape[0], capacity, rows.queue.shape[2])),
            commands=np.zeros((n, command_capacity, rows.commands.shape[1])),
            ring=np.zeros((n, 2), np.int64),
            rotors=np.zeros((n, *rows.rotors.shape)),
            rotor_table=np.zeros((n, *rows.rotor_table.shape)),
            mixed=np.repeat(new_rotors()[None], n, axis=0),
            mixer=mixer_table(scenario.cell.setup.layout),
            hover=hover_forces(scenario, scenario.task.action.weight),
            episode=np.zeros((n, width(Episode))),
            action=np.zeros((n, MAX_ROTORS)),
            law=np.zeros((n, width(ThesisMemory))),
            past=np.zeros((n, scenario.options.history, FEATURES + MAX_ROTORS)),
            task=scenario.row,
            reference=scenario.reference,
            estimators=estimators,
            code=Code(code_of_world(rows), autopilot),
        )

    def _estimators(self, core: FlightCore, readings: int) -> EstimatorRows:
        """The memory of the estimators before the first reading, for an autopilot whose law runs every second
        tick."""
        n = self.count
        weight = self.scenario.task.action.weight
        core.rows.commands[:, 0] = weight
        pack(core.control._replace(thrust=weight), core.rows.control, 0)
        constants = unpack(CoreConstants, core.rows.constants, 0)
        pack(constants._replace(control_every=LAW_EVERY), core.rows.constants, 0)
        self._initial_rows = core.rows
        inbox = new_inbox(readings)

        def repeated(row: NDArray[Any]) -> NDArray[Any]:
            return np.repeat(row[None], n, axis=0)

        return EstimatorRows(
            estimator=repeated(core.rows.estimator),
            control=repeated(core.rows.control),
            summary=repeated(core.rows.summary),
            commands=repeated(core.rows.commands),
            history=History._make(repeated(part) for part in new_history()),
            inbox=repeated(inbox),
            constants=core.rows.constants,
            winch=core.rows.winch,
            stretch=core.rows.stretch,
            none=np.zeros((1, COLUMNS)),
            law=placeholder_law(core.law_rows),
            wire=self.scenario.cell.wire,
        )

    @property
    def mixing(self) -> Mixing:
        """The mixer of one vehicle, with its own memory."""
        return Mixing(self._batch.mixer, new_rotors(), self._batch.hover)

    # ---- what is true

    def plant(self, i: int) -> PlantState:
        """The true state of an episode."""
        return unpack(World, self._batch.world[i], 0).plant

    def state(self, i: int) -> State:
        """The observed state of an episode: the true or the estimated one."""
        if self.scenario.estimated:
            return unpack(EstimateSummary, self._batch.estimators.summary[i], 0).state
        return true_state(self.plant(i))

    def truth(self, i: int) -> Truth:
        """The true vehicle of an episode."""
        return unpack(WorldModel, self._batch.model[i], 0).truth

    def rotor_forces(self, i: int) -> Floats:
        """(MAX_ROTORS,) N: present force of each rotor."""
        forces: Floats = self._batch.rotors[i, FORCE].copy()
        return forces

    def is_at_start(self, i: int) -> bool:
        """Whether an episode has not been stepped yet."""
        return unpack(Episode, self._batch.episode[i], 0).tick == 0

    def elapsed_s(self, i: int) -> float:
        """Time since the beginning of an episode."""
        return unpack(Episode, self._batch.episode[i], 0).tick * self.scenario.tick_us * 1e-6

    def row(self, i: int) -> int:
        """The present row of the reference; beyond its end, the last one holds."""
        episode = unpack(Episode, self._batch.episode[i], 0)
        return episode.first_row + episode.tick

    def jet(self, i: int, ahead_s: float = 0.0) -> Jet:
        """Desired position of the load, with six derivatives, `ahead_s` seconds from now."""
        later = round(ahead_s * 1e6 / self.scenario.tick_us)
        return jet_at(self.scenario.reference, self.row(i) + later)
