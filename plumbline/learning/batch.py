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
from autopilot.core.tick import CoreConstants, Seen, any_law
from autopilot.estimation.inbox import new_inbox
from autopilot.estimation.records import History, new_history
from autopilot.geometry.entry import entry_of
from autopilot.geometry.packed import pack, unpack, width
from autopilot.guidance.layout import COLUMNS
from autopilot.trajectory.signals import Jet
from autopilot.vehicle.layout import MOST
from autopilot.vehicle.rotors import allocate
from gcs.sweep.kernel import Code, code_of_autopilot, code_of_world
from plumbline.learning.actions import Mixing
from plumbline.learning.beginning import (
    V_LOAD,
    V_QUAD,
    X_LOAD,
    X_QUAD,
    Beginning,
    beginning_of,
    depends_on_chance,
    hover_forces,
)
from plumbline.learning.records import (
    FEATURES,
    Actions,
    Batch,
    Episode,
    Observations,
    Senses,
)
from plumbline.learning.scenario import Draw, Scenario
from plumbline.learning.step import LAW_EVERY, jet_at, run_some, true_state
from sitl.plant.records import PlantState
from sitl.world import Floats, World

Numbers = NDArray[np.int64]
_LEAST_SHARE = 2000  # ticks per thread from which on another thread is worthwhile


class Episodes:
    """`count` episodes of a scenario. `ends`, `rewards` and `observations` are those of the last step."""

    def __init__(self, scenario: Scenario, count: int, threads: int | None = None) -> None:
        self.scenario = scenario
        self.count = count
        self.rewards = np.zeros(count)
        self.ends = np.zeros(count, np.int64)
        self.observations: Observations = np.zeros((count, scenario.size), np.float32)
        self._all = np.arange(count)
        self._actions = np.zeros((count, scenario.task.sight.actions), np.float32)
        self._nowhere = np.zeros((1, 3))
        self._batch = self._memory()
        self._alike: Beginning | None = None  # of all episodes, if they differ only in position and velocity
        if not depends_on_chance(scenario):
            self._alike = beginning_of(scenario, scenario.draw(np.random.default_rng(0)))
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        work = count * scenario.ticks * (10 if scenario.estimated else 1)
        self._threads = max(1, min(cores, work // _LEAST_SHARE)) if threads is None else threads
        self._pool = ThreadPoolExecutor(self._threads - 1) if self._threads > 1 else None
        self._run = entry_of(run_some, *self._job(self._all[:0], False, self._nowhere, self._nowhere))

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    # ---- steps

    def step(self, actions: Actions, chosen: Numbers | None = None) -> None:
        """Step all episodes, or those that are `chosen`, with their actions (count, size)."""
        self._actions[:] = actions
        shares = np.array_split(self._all if chosen is None else chosen, self._threads)
        self._share([self._job(share, False, self._nowhere, self._nowhere) for share in shares])

    def _job(self, chosen: Numbers, begins: bool, places: Floats, velocities: Floats) -> tuple[Any, ...]:
        return (
            self._batch,
            chosen,
            begins,
            places,
            velocities,
            self._actions,
            self.observations,
            self.rewards,
            self.ends,
        )

    def _share(self, jobs: Sequence[tuple[Any, ...]]) -> None:
        """Call machine code once for each job, the last one in this thread."""
        futures = [] if self._pool is None else [self._pool.submit(self._run, *job) for job in jobs[:-1]]
        self._run(*jobs[-1])
        for future in futures:
            future.result()

    # ---- beginnings

    def begin(self, chosen: Sequence[int], draws: Sequence[Draw]) -> None:
        """Begin an episode in each chosen environment; its first observation is in `observations`."""
        jets = self.scenario.reference[[draw.begin for draw in draws]]
        velocities = np.ascontiguousarray(jets[:, 3:6])
        places = jets[:, :3] + np.array([draw.offset for draw in draws])
        lead_s = self.scenario.task.settle * self.scenario.tick_us * 1e-6
        begins = places - lead_s * velocities
        if self._alike:
            self._lay_out(chosen, draws, begins, velocities)
        else:
            for k in range(len(chosen)):
                one = slice(k, k + 1)
                self._lay_out(chosen[one], draws[one], begins[one], velocities[one])
        shares = self._threads if self.scenario.estimated else 1
        splits = [np.array_split(rows, shares) for rows in (np.asarray(chosen), places, velocities)]
        self._share([self._job(own, True, *where) for own, *where in zip(*splits, strict=True)])

    def _lay_out(
        self, chosen: Sequence[int], draws: Sequence[Draw], places: Floats, velocities: Floats
    ) -> None:
        """Fill the memory of episodes that begin alike: load and vehicle move together, cable vertical."""
        made = self._alike or beginning_of(self.scenario, draws[0])
        batch, rows, waiting, at = self._batch, made.rows, len(made.commands), np.asarray(chosen)
        batch.world[at] = made.world
        batch.world[at, X_LOAD] = places
        batch.world[at, X_QUAD] = places
        batch.world[at, X_QUAD.stop - 1] += made.cable_length
        batch.world[at, V_LOAD] = velocities
        batch.world[at, V_QUAD] = velocities
        batch.model[at], batch.fate[at], batch.errors[at] = rows.model, rows.fate, rows.errors
        batch.clock[at] = made.clock
        batch.seed[at, 0] = [draw.seed for draw in draws]
        batch.ring[at] = 0, waiting
        batch.commands[at, :waiting] = made.commands
        batch.rotors[at], batch.rotor_table[at] = rows.rotors, rows.rotor_table
        batch.action[at] = 0.0
        batch.episode[at] = 0.0
        batch.episode[at, 0] = [draw.begin for draw in draws]  # the first field of Episode
        batch.past[at] = 0.0
        if self.scenario.estimated:
            for i in chosen:
                self._forget(i)

    def _forget(self, i: int) -> None:
        senses = self._batch.senses
        for name in ("estimator", "pilot", "seen", "commands"):
            getattr(senses, name)[i] = getattr(self._blank, name)
        for row, blank in zip(senses.history, new_history(), strict=True):
            row[i] = blank

    # ---- memory

    def _memory(self) -> Batch:
        scenario, n = self.scenario, self.count
        room, capacity = scenario.roomiest()
        rows = scenario.world(scenario.draw(np.random.default_rng(0)))[0]
        senses, autopilot = None, 0
        if scenario.estimated:
            core = FlightCore(scenario.cell.setup)
            senses = self._senses(core, rows.queue.shape[0] * capacity + len(rows.rotor_table))
            autopilot = code_of_autopilot(core.rows, senses.law)
        return Batch(
            world=np.zeros((n, width(World))),
            model=np.zeros((n, len(rows.model))),
            seed=np.zeros((n, 1), np.int64),
            clock=np.zeros((n, *rows.clock.shape), np.int64),
            fate=np.zeros((n, *rows.fate.shape)),
            errors=np.zeros((n, *rows.errors.shape)),
            queue=np.zeros((n, rows.queue.shape[0], capacity, rows.queue.shape[2])),
            commands=np.zeros((n, room, rows.commands.shape[1])),
            ring=np.zeros((n, 2), np.int64),
            rotors=np.zeros((n, *rows.rotors.shape)),
            rotor_table=np.zeros((n, *rows.rotor_table.shape)),
            mixed=np.repeat(new_rotors()[None], n, axis=0),
            mixer=allocate(scenario.cell.setup.layout),
            hover=hover_forces(scenario, scenario.task.action.weight),
            episode=np.zeros((n, width(Episode))),
            action=np.zeros((n, MOST)),
            law=np.zeros((n, width(ThesisMemory))),
            past=np.zeros((n, scenario.options.history, FEATURES + MOST)),
            task=scenario.row,
            reference=scenario.reference,
            senses=senses,
            code=Code(code_of_world(rows), autopilot),
        )

    def _senses(self, core: FlightCore, readings: int) -> Senses:
        """The memory of the estimators before the first reading, for an autopilot whose law runs every second
        tick."""
        n = self.count
        pilot = core.pilot
        weight = self.scenario.task.action.weight
        core.rows.commands[:, 0] = weight
        pack(pilot._replace(thrust=weight, observed=pilot.observed._replace(support=0.0)), core.rows.pilot, 0)
        constants = unpack(CoreConstants, core.rows.constants, 0)
        pack(constants._replace(control_every=LAW_EVERY), core.rows.constants, 0)
        self._blank = core.rows
        inbox = new_inbox(readings)

        def many(row: NDArray[Any]) -> NDArray[Any]:
            return np.repeat(row[None], n, axis=0)

        return Senses(
            estimator=many(core.rows.estimator),
            pilot=many(core.rows.pilot),
            seen=many(core.rows.seen),
            commands=many(core.rows.commands),
            history=History._make(many(part) for part in new_history()),
            inbox=many(inbox),
            constants=core.rows.constants,
            winch=core.rows.winch,
            stretch=core.rows.stretch,
            none=np.zeros((1, COLUMNS)),
            law=any_law(core.law_rows),
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
            return unpack(Seen, self._batch.senses.seen[i], 0).state
        return true_state(self.plant(i))

    def begins(self, i: int) -> bool:
        """Whether an episode has not been stepped yet."""
        return unpack(Episode, self._batch.episode[i], 0).tick == 0

    def jet(self, i: int, ahead_s: float = 0.0) -> Jet:
        """Desired position of the load, with six derivatives, `ahead_s` seconds from now."""
        episode = unpack(Episode, self._batch.episode[i], 0)
        later = round(ahead_s * 1e6 / self.scenario.tick_us)
        return jet_at(self.scenario.reference, episode.begin + episode.tick + later)
