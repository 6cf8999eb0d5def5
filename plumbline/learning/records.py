"""What the compiled step of an environment reads and writes.

Numbers of an episode are a row of `Batch`, a row for each environment; what all environments share stands
once. SI, world ENU, body FLU.
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

ROTORS, RATES, ACCELERATION = range(3)  # what an action means
ACTIONS = {"rotors": ROTORS, "ctbr": RATES, "acceleration": ACCELERATION}
FEATURES = 24  # of the observation, without past and preview


class ActionModel(NamedTuple):
    """What numbers between -1 and 1 ask of the vehicle, as the autopilot believes it to be."""

    kind: int  # ROTORS, RATES or ACCELERATION
    vehicle: Vehicle
    limited: float  # 1.0: the rotors have limits
    weight: float  # N, of vehicle and load
    least: float  # N, that a rotor of strength 1 can be asked for
    most: float  # N
    strength: float  # of all rotors together
    rates: Vec3  # rad/s, greatest that can be asked for, body
    rate_gain: Vec3  # 1/s, of the loop that follows them
    accel: Vec3  # m/s^2, greatest of the load
    gains: ThesisGains  # of the cascade whose load attitude mode follows an acceleration
    filters: ThesisFilters


class ViewModel(NamedTuple):
    """What an observation is made of."""

    actions: int  # numbers of an action
    past: int  # how many earlier steps are shown
    ahead: int  # how many instants of the reference to come are shown
    ahead_s: float  # time between these


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
    sight: ViewModel
    reward: Reward
    ticks: int  # of a step
    reach: float  # m, from the reference; further away is a crash
    settle: int  # ticks for which the simulator flies before an episode, so that the estimate is found


class Episode(NamedTuple):
    """Where an environment is in its episode."""

    begin: int  # row of the reference at its first tick
    tick: int


class Senses(NamedTuple):
    """The memory of each environment's estimator, as in `autopilot.core.tick.CoreRows`."""

    estimator: Floats
    pilot: Floats
    seen: Floats
    commands: Floats
    history: History
    inbox: Floats
    constants: Row
    winch: Row
    stretch: Row
    none: Floats  # no setpoints: (1, 21)
    law: Any  # of no law in particular, as `autopilot.core.tick.any_law` makes it
    wire: Row


class Batch(NamedTuple):
    """The memory of all environments; the first axis counts them, but for what they share (`mixer`, `hover`,
    `task`, `reference`). `world` to `rotor_table` are as in `WorldRows`."""

    world: Floats
    model: Floats
    seed: Ints
    clock: Ints
    fate: Floats
    errors: Floats
    queue: Floats
    commands: Floats
    ring: Ints
    rotors: Floats
    rotor_table: Floats
    mixed: Floats  # as `CoreRows.rotors`: forces
    mixer: Floats  # (rotors + 1, 8) as `CoreRows.table`
    hover: Floats  # (MOST,) N: force of each rotor that holds vehicle and load
    episode: Floats  # Episode
    action: Floats  # (n, MOST) of the last step
    law: Floats  # ThesisMemory
    past: Floats  # (n, past, FEATURES + MOST), newest first
    task: Row  # TaskModel
    reference: Floats  # (ticks, 21) where the load is to be
    senses: Any  # Senses; None: the truth is observed
    code: Code  # of the ticks of world and autopilot


Actions = NDArray[np.float32]
Observations = NDArray[np.float32]
