"""One environment: `gymnasium.make`."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from plumbline.arguments import whole_number
from plumbline.learning.batch import Episodes
from plumbline.learning.options import EnvOptions, options_of
from plumbline.learning.ready import compile_step
from plumbline.learning.rendering import Renderer, checked_render_mode, render_metadata
from plumbline.learning.scenario import Scenario
from plumbline.learning.scene import Frame
from plumbline.learning.spaces import action_space, checked_actions, observation_space
from plumbline.learning.step import CRASHED, ENDED

Array = NDArray[np.float32]


class LoadEnv(gymnasium.Env[Array, Array]):
    """A vehicle that carries a load on a cable, in one episode at a time.

    Its options are those of `plumbline.learning.options.EnvOptions`. Observation, action and reward are
    described in docs/learning.md.
    """

    metadata: dict[str, Any] = render_metadata(EnvOptions.rate_hz)  # of each environment: with its own rate

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        self.render_mode = checked_render_mode(render_mode)
        self.scenario = Scenario(options_of(options))
        self.metadata = render_metadata(self.scenario.options.rate_hz)
        compile_step(self.scenario)
        self.episodes = Episodes(self.scenario, 1, threads=1)
        self._renderer = Renderer(self.episodes, render_mode)
        self.action_space = action_space(self.scenario)
        self.observation_space = observation_space(self.scenario)
        self._shape = (self.scenario.task.observation_model.actions,)
        self._has_begun = False  # it has been reset

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin a new episode and return its first observation; the same seed gives the same episode."""
        super().reset(seed=None if seed is None else whole_number("seed", seed, 0))
        self.episodes.start([0], [self.scenario.draw(self.np_random)])
        self._has_begun = True
        return self.episodes.observations[0].copy(), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Observation, reward, whether it crashed, whether the path has ended, and an empty dictionary.
        `ResetNeeded` (gymnasium.error) before the first `reset`."""
        if not self._has_begun:
            raise ResetNeeded("step() needs an episode; call reset() first")
        self.episodes.step(checked_actions("action", action, self._shape)[None])
        end = int(self.episodes.ends[0])
        reward = float(self.episodes.rewards[0])
        return self.episodes.observations[0].copy(), reward, end == CRASHED, end == ENDED, {}

    def render(self) -> Frame | None:
        """(height, width, 3) a picture of the present state, which it leaves unchanged."""
        frames = self._renderer.frames()
        return None if frames is None else frames[0]

    def close(self) -> None:
        """Release what the environment holds."""
        self.episodes.close()
