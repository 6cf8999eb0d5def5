"""Reinforcement learning with the simulator: Gymnasium environments (docs/learning.md).

    import gymnasium, plumbline.learning

    env = gymnasium.make("plumbline/Hover-v0")
    envs = gymnasium.make_vec("plumbline/LoadTracking-v0", num_envs=256)

This module registers them. It needs the extra: pip install -e '.[gym]'.
"""

from __future__ import annotations

from gcs.errors import GcsError, from_clone

try:
    import gymnasium
except ModuleNotFoundError:
    raise GcsError(f"gymnasium is not installed; pip install {from_clone('gym')}") from None

HOVER, LOAD_TRACKING = "plumbline/Hover-v0", "plumbline/LoadTracking-v0"
_STEPS = 500  # of an episode of hovering: 10 s at 50 Hz


def _register() -> None:
    single, vector = "plumbline.learning.env:LoadEnv", "plumbline.learning.vector:LoadVectorEnv"
    gymnasium.register(HOVER, single, max_episode_steps=_STEPS, vector_entry_point=vector)
    gymnasium.register(
        LOAD_TRACKING, single, vector_entry_point=vector, kwargs={"mission": "case-b", "start_m": 0.1}
    )


_register()
