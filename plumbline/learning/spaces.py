"""The spaces of an environment."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from gcs.errors import GcsError
from plumbline.arguments import shown_value
from plumbline.learning.scenario import Scenario

Array = NDArray[np.float32]
_LIMIT = 1e6  # beyond every motion that the plant accepts (m, m/s, rad/s)


def action_space(scenario: Scenario) -> Space[Array]:
    """Numbers between -1 and 1: see `plumbline.learning.actions`."""
    return Box(-1.0, 1.0, (scenario.task.observation_model.actions,), np.float32)


def observation_space(scenario: Scenario) -> Space[Array]:
    """See `plumbline.learning.observations`."""
    return Box(-_LIMIT, _LIMIT, (scenario.size,), np.float32)


def checked_actions(name: str, given: Any, shape: tuple[int, ...]) -> Array:
    """The numbers of an action, or of one action for each environment. Numbers outside the space are allowed;
    the step clips them. `Error` if the shape is another one, or if a number is not finite."""
    try:
        found = np.asarray(given, np.float32)
    except (TypeError, ValueError):
        raise GcsError(f"{name} = {shown_value(given)}; must be {shape} numbers from -1 to 1") from None
    if found.shape != shape:
        raise GcsError(f"{name} of shape {found.shape}; must be {shape}")
    if not np.isfinite(found).all():
        if found.ndim > 1:
            row = int(np.flatnonzero(~np.isfinite(found).all(axis=1))[0])
            name, found = f"{name}[{row}]", found[row]
        raise GcsError(f"{name} = {shown_value(found.tolist())}; must be finite numbers from -1 to 1")
    return found
