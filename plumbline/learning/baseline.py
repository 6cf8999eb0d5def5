"""A control law as a policy: the baseline with which a learner is compared."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from autopilot.control.actuators.disturbance_observer import nominal_in_flight, observe
from autopilot.control.actuators.mixer import mix
from autopilot.control.actuators.rotor_model import Actuation, queue_rows, steady_actuation
from autopilot.control.actuators.rotor_model import advance as actuate
from autopilot.control.drag import UNKNOWN_FRAME_SHARE
from autopilot.control.laws.interface import law_of
from autopilot.control.records import Cable, Reference
from autopilot.geometry.linear import E1
from autopilot.vehicle.parameters import DEFAULT_LAW
from gcs.errors import GcsError
from plumbline.learning.actions import Mixing, write_equivalent_action
from plumbline.learning.env import LoadEnv
from plumbline.learning.records import ACCELERATION
from plumbline.learning.vector import LoadVectorEnv

Array = NDArray[np.float32]


class LawPolicy:
    """The actions of a law in environments whose actions are `rotors` or `ctbr`.

    In flight a law commands at every tick of the autopilot; here its action is held for a step. With
    `action="rotors"` and a `rate_hz` of 250, the rate of the autopilot, both are the same.
    """

    def __init__(self, env: Any, law: str = DEFAULT_LAW) -> None:
        inner = env.unwrapped
        if not isinstance(inner, LoadEnv | LoadVectorEnv):
            raise GcsError("env: must be an environment of plumbline")
        self._scenario, self._episodes = inner.scenario, inner.episodes
        if self._scenario.task.action.kind == ACCELERATION:
            raise GcsError("action = 'acceleration'; must be rotors or ctbr for a law to do it")
        self._setup = self._scenario.setup_of(law)
        self._single = isinstance(inner, LoadEnv)
        self._pilots: list[_LawPilot | None] = [None] * self._episodes.count

    def predict(self, observation: Array, *_: Any, **__: Any) -> tuple[Array, None]:
        """The actions for the present states of the environments, and None, as in Stable-Baselines3. The
        observation is not used."""
        actions = np.zeros((self._episodes.count, self._scenario.task.observation_model.actions), np.float32)
        for i in range(self._episodes.count):
            if self._episodes.is_at_start(i) or self._pilots[i] is None:
                self._pilots[i] = _LawPilot(self._setup, self._episodes.mixing)
            pilot = self._pilots[i]
            assert pilot is not None
            state = self._episodes.state(i)
            mixed = pilot.step(state, self._episodes, i, self._scenario.ticks)
            write_equivalent_action(mixed, state, self._scenario.task.action, pilot.mixing, actions[i])
        return (actions[0] if self._single else actions), None


class _LawPilot:
    """A law that flies one episode."""

    def __init__(self, setup: Any, mixing: Mixing) -> None:
        self._setup, self.mixing = setup, mixing
        vehicle = setup.vehicle
        weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
        self._actuation: Actuation = steady_actuation(weight, queue_rows(setup.actuation))
        self._observed = nominal_in_flight(vehicle)
        self._memory: Any = None

    def step(self, state: Any, episodes: Any, i: int, ticks: int) -> Any:
        """The law's command to the rotors now; the law assumes that it is held for a step."""
        setup = self._setup
        law, vehicle, actuation = setup.law, setup.vehicle, self._actuation
        kernels = law_of(law).kernels
        reference = Reference(episodes.jet(i, setup.preview_s), E1)
        if self._memory is None:
            self._memory = kernels.start(law, state, reference.jet[0], reference.jet[1])
        cable = Cable(vehicle.cable_length, 0.0, 0.0)
        self._memory, command = kernels.load_position(
            law, self._memory, state, reference, actuation, self._observed, cable
        )
        mixed = mix(
            command.thrust, command.moment, vehicle, setup.limited, self.mixing.table, self.mixing.rotors
        )
        for _ in range(ticks):
            self._observed = observe(
                self._observed,
                state,
                1.0,
                actuation.thrust,
                actuation.moment,
                setup.observer,
                setup.drag,
                vehicle,
                UNKNOWN_FRAME_SHARE,
            )
            actuation = actuate(actuation, mixed.achieved_thrust, mixed.achieved_moment, setup.actuation)
        self._actuation = actuation
        return mixed
