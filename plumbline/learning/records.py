"""The data that the compiled step of an environment reads and writes.

`Batch` has a row for each environment, with the numbers of its episode; data that all environments share is
stored once. SI, world ENU, body FLU.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control.records import Vehicle
from autopilot.control.thesis_cascade import ThesisFilters, ThesisGains
from autopilot.estimation.records import History
from autopilot.geometry.linear import Vec3
from autopilot.geometry.packed import Row
from gcs.sweep.kernel import Code
from sitl.world import Floats, Ints

ROTORS, RATES, ACCELERATION = range(3)  # kinds of actions
ACTIONS = {"rotors": ROTORS, "ctbr": RATES, "acceleration": ACCELERATION}
FEATURES = 24  # numbers of an observation without actions, past and preview


class ActionModel(NamedTuple):
    """What numbers between -1 and 1 command, for the vehicle that the autopilot assumes."""

    kind: int  # ROTORS, RATES or ACCELERATION
    vehicle: Vehicle
    limited: float  # 1.0: the rotors have limits
    weight: float  # N, of vehicle and load
    min_force: float  # N, smallest force that can be commanded of a rotor of strength 1
    max_force: float  # N, greatest
    strength: float  # of all rotors together
    rates: Vec3  # rad/s, greatest that can be commanded, body
    rate_gain: Vec3  # 1/s, of the loop that tracks them
    accel: Vec3  # m/s^2, greatest of the load that can be commanded
    gains: ThesisGains  # of the cascade whose load attitude mode tracks an acceleration
    filters: ThesisFilters


class ObservationModel(NamedTuple):
    """What an observation contains."""

    actions: int  # numbers of an action
    past: int  # number of earlier steps
    ahead: int  # number of future instants of the reference
    ahead_s: float  # time between these instants


class Reward(NamedTuple):
    """Weights of the reward: docs/learning.md has the formula."""

    alive: float = 0.5
    position: float = 1.0
    width: float = 0.3  # m, error at which half of the reward for the position is left
    velocity: float = 0.05  # s/m
    swing: float = 0.05  # s
    spin: float = 0.02  # s/rad
    change: float = 0.05  # of the action between two steps
    crash: float = 10.0


class TaskModel(NamedTuple):
    """The numbers that all environments of a batch share."""

    action: ActionModel
    observation_model: ObservationModel
    reward: Reward
    ticks: int  # of a step
    reach: float  # m, from the reference; further away is a crash
    settle: int  # ticks for which the simulator flies before an episode, so that the estimate converges


class Episode(NamedTuple):
    """How far an environment is in its episode."""

    first_row: int  # row of the reference at its first tick
    tick: int


class EstimatorRows(NamedTuple):
    """The memory of each environment's estimator, as in `autopilot.core.tick.CoreRows`."""

    estimator: Floats
    control: Floats
    summary: Floats
    commands: Floats
    history: History
    inbox: Floats
    constants: Row
    winch: Row
    stretch: Row
    none: Floats  # no setpoints: (1, 21)
    law: Any  # of no law in particular, as `autopilot.core.tick.placeholder_law` makes it
    wire: Row


class Batch(NamedTuple):
    """The memory of all environments. The first axis is the environment, except in shared data (`mixer`,
    `hover`, `task`, `reference`). `world` to `rotor_table` are as in `WorldRows`."""

    world: Floats
    model: Floats
    seed: Ints
    clock: Ints
    delivery: Floats
    errors: Floats
    queue: Floats
    commands: Floats
    ring: Ints
    rotors: Floats
    rotor_table: Floats
    mixed: Floats  # as `CoreRows.rotors`: forces
    mixer: Floats  # (rotors + 1, 8) as `CoreRows.table`
    hover: Floats  # (MAX_ROTORS,) N: force of each rotor that holds vehicle and load
    episode: Floats  # Episode
    action: Floats  # (n, MAX_ROTORS) of the last step
    law: Floats  # ThesisMemory
    past: Floats  # (n, past, FEATURES + MAX_ROTORS), newest first
    task: Row  # TaskModel
    reference: Floats  # (ticks, 21) desired position of the load and its derivatives
    estimators: Any  # EstimatorRows; None: the truth is observed
    code: Code  # of the ticks of world and autopilot


Actions = NDArray[np.float32]
Observations = NDArray[np.float32]
