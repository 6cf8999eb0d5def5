"""Many environments in one: `gymnasium.make_vec`. One call of machine code steps all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from gcs.errors import GcsError
from plumbline.arguments import items, whole_number
from plumbline.learning.batch import Episodes
from plumbline.learning.options import options_of
from plumbline.learning.ready import compile_step
from plumbline.learning.rendering import Renderer, checked_render_mode, render_metadata
from plumbline.learning.scenario import Scenario
from plumbline.learning.scene import Frame
from plumbline.learning.spaces import action_space, checked_actions, observation_space
from plumbline.learning.step import CRASHED, ENDED

Array = NDArray[np.float32]
Flags = NDArray[np.bool_]
Stepped = tuple[Array, NDArray[np.float64], Flags, Flags, dict[str, Any]]


class LoadVectorEnv(VectorEnv[Array, Array, NDArray[Any]]):
    """`num_envs` environments, each bit-identical to a `LoadEnv` with the same seed.

    `autoreset_mode` is one of `gymnasium.vector.AutoresetMode`, or its value. `threads`: how many threads
    share the work; by default one per core, or fewer if there is little work. The other options are those of
    `plumbline.learning.options.EnvOptions`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        self.num_envs = num_envs = whole_number("num_envs", num_envs, 1)
        if max_episode_steps is not None:
            max_episode_steps = whole_number("max_episode_steps", max_episode_steps, 1)
        if threads is not None:
            threads = whole_number("threads", threads, 1)
        self.render_mode = checked_render_mode(render_mode)
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.scenario = Scenario(options_of(options))
        rate_hz = self.scenario.options.rate_hz
        self.metadata = {**render_metadata(rate_hz), "autoreset_mode": self.autoreset_mode}
        compile_step(self.scenario)
        self.episodes = Episodes(self.scenario, num_envs, threads)
        self._renderer = Renderer(self.episodes, render_mode)
        self.single_action_space = action_space(self.scenario)
        self.single_observation_space = observation_space(self.scenario)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._shape = (num_envs, self.scenario.task.observation_model.actions)
        self._max_steps = max_episode_steps
        self._steps = np.zeros(num_envs, np.int64)
        self._is_over = np.zeros(num_envs, np.bool_)  # episodes that have ended and were not reset yet
        self._has_begun = False  # all environments have been reset
        self._generators: list[np.random.Generator | None] = [None] * num_envs

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Begin new episodes, in all environments or in those that `options["reset_mask"]` marks; returns the
        observations of all. A mask that marks none leaves all of them as they are.

        `seed`: a seed for each environment, or that of the first; those of the others count up from it.
        `ResetNeeded` (gymnasium.error) if the mask leaves out an environment that was never reset.
        """
        seeds = self._seeds(seed)
        chosen = np.arange(self.num_envs)
        if options is not None and "reset_mask" in options:
            chosen = np.flatnonzero(_checked(options["reset_mask"], self.num_envs))
        if not self._has_begun and len(chosen) < self.num_envs:
            raise ResetNeeded(
                "reset_mask leaves out environments that were never reset; first reset all of them"
            )
        for i in chosen.tolist():
            if seeds[i] is not None or self._generators[i] is None:
                self._generators[i] = np_random(seeds[i])[0]
        self._start(chosen)
        self._has_begun = True
        return self.episodes.observations.copy(), {}

    def step(self, actions: Array) -> Stepped:
        """Observations, rewards, which episodes crashed, which reached the end of their path or their time
        limit, and what `autoreset_mode` adds. `ResetNeeded` (gymnasium.error) before the first `reset`."""
        if not self._has_begun:
            raise ResetNeeded("step() needs an episode; call reset() first")
        episodes, next_step = self.episodes, self.autoreset_mode == AutoresetMode.NEXT_STEP
        if self.autoreset_mode == AutoresetMode.DISABLED and self._is_over.any():
            raise GcsError("an episode is over; reset it with options={'reset_mask': ...}")
        was_over = self._is_over.copy()
        actions = checked_actions("actions", actions, self._shape)
        episodes.step(actions, np.flatnonzero(~was_over) if was_over.any() else None)
        self._steps += 1
        rewards = np.where(was_over, 0.0, episodes.rewards)
        crashed = (episodes.ends == CRASHED) & ~was_over
        ended = (episodes.ends == ENDED) & ~was_over
        if self._max_steps is not None:
            ended |= (self._steps >= self._max_steps) & ~was_over
        if next_step and was_over.any():
            self._start(np.flatnonzero(was_over))
        self._is_over = crashed | ended
        infos: dict[str, Any] = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._is_over.any():
            over = np.flatnonzero(self._is_over)
            for i in over.tolist():
                final = {"final_obs": episodes.observations[i].copy(), "final_info": {}}
                infos = self._add_info(infos, final, i)
            self._start(over)
        return episodes.observations.copy(), rewards, crashed, ended, infos

    def render(self) -> tuple[Frame, ...] | None:
        """A picture (height, width, 3) of the present state of each environment, which it leaves
        unchanged."""
        return self._renderer.frames()

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads."""
        self.episodes.close()

    def _start(self, chosen: NDArray[np.intp]) -> None:
        numbers = chosen.tolist()
        draws = []
        for i in numbers:
            rng = self._generators[i]
            assert rng is not None, "reset comes before step"
            draws.append(self.scenario.draw(rng))
        self.episodes.start(numbers, draws)
        self._steps[chosen] = 0
        self._is_over[chosen] = False

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        count = self.num_envs
        if seed is None:
            return [None] * count
        if isinstance(seed, int | np.integer):
            first = whole_number("seed", seed, 0)
            return [first + i for i in range(count)]
        seeds = items("seed", seed, f"a whole number, 0 or more, or a list of {count} of them")
        if len(seeds) != count:
            raise GcsError(f"seed: {len(seeds)} seeds; must be {count}")
        return [None if one is None else whole_number(f"seed[{i}]", one, 0) for i, one in enumerate(seeds)]


def _autoreset_mode(given: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(given)
    except ValueError:
        known = ", ".join(repr(mode.value) for mode in AutoresetMode)
        raise GcsError(f"autoreset_mode = {given!r}; must be one of {known}") from None


def _checked(mask: Any, count: int) -> Flags:
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (count,):
        raise GcsError(f"reset_mask: must be an array of {count} booleans")
    return mask
