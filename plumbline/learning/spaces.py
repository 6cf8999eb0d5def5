"""The spaces of an environment."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from plumbline.learning.scenario import Scenario

Array = NDArray[np.float32]
_FURTHEST = 1e6  # beyond what the plant takes for a motion at all (m, m/s, rad/s)


def action_space(scenario: Scenario) -> Space[Array]:
    """Numbers between -1 and 1: see `plumbline.learning.actions`."""
    return Box(-1.0, 1.0, (scenario.task.sight.actions,), np.float32)


def observation_space(scenario: Scenario) -> Space[Array]:
    """See `plumbline.learning.observations`."""
    return Box(-_FURTHEST, _FURTHEST, (scenario.size,), np.float32)
