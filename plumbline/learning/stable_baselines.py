"""The environments for Stable-Baselines3, which has its own interface for many environments."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

from gcs.errors import GcsError
from plumbline.learning.vector import LoadVectorEnv


class SB3VecEnv(VecEnv):  # type: ignore[misc]
    """The environments of a `LoadVectorEnv`, with the interface of Stable-Baselines3.

        SB3VecEnv(gymnasium.make_vec("plumbline/Hover-v0", 64, autoreset_mode="SameStep"))

    Their autoreset mode must be SAME_STEP, because Stable-Baselines3 expects it.
    """

    def __init__(self, envs: Any) -> None:
        inner = envs.unwrapped
        if not isinstance(inner, LoadVectorEnv) or inner.autoreset_mode != AutoresetMode.SAME_STEP:
            raise GcsError("envs: must be those of gymnasium.make_vec with autoreset_mode='SameStep'")
        self.envs = inner
        self._actions: Any = None
        super().__init__(inner.num_envs, inner.single_observation_space, inner.single_action_space)
        self.metadata["render_fps"] = inner.metadata["render_fps"]  # for videos

    def reset(self) -> Any:
        """The first observations."""
        seeds = self._seeds if any(seed is not None for seed in self._seeds) else None
        self._reset_seeds()
        return self.envs.reset(seed=seeds)[0]

    def step_async(self, actions: Any) -> None:
        """Store the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Step with the stored actions: observations, rewards, which episodes have ended, and their infos."""
        observations, rewards, crashed, ended, infos = self.envs.step(self._actions)
        done = crashed | ended
        episode_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done).tolist():
            episode_infos[i]["terminal_observation"] = infos["final_obs"][i]
            episode_infos[i]["TimeLimit.truncated"] = bool(ended[i] and not crashed[i])
        return observations, rewards.astype(np.float32), done, episode_infos

    def get_images(self) -> Sequence[Any]:
        """A picture of each environment; Stable-Baselines3 joins them in one, for `render` and for videos."""
        return self.envs.render() or [None] * self.num_envs

    def close(self) -> None:
        """End the threads."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute, which is the same for all environments."""
        return [getattr(self.envs, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """No attribute can be set: always an `Error`."""
        raise GcsError(f"{attr_name}: the environments are made with their options, and keep them")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of all environments together; its result is repeated for each."""
        return [getattr(self.envs, method_name)(*args, **kwargs)] * len(self._chosen(indices))

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No environment is wrapped."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: int | Iterable[int] | None) -> Sequence[int]:
        return list(self._get_indices(indices))
