"""What the tests share: an eighth-order derivative, and shipped missions with one value changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from missions.fileformat import load_mission
from missions.model import Mission, Signals

Differentiate = Callable[[Callable[[float], object], float], np.ndarray]
# central difference of eighth order: coefficient of f(t + k h) - f(t - k h), k = 1 ... 4
_WEIGHTS = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)


@pytest.fixture(scope="session")
def differentiate() -> Differentiate:
    """d/dt of a function of time with array-like values; its relative error is (2.5 ms * omega)^8 / 600."""

    def derivative(function: Callable[[float], object], t: float) -> np.ndarray:
        h = 0.0025
        ahead = [np.asarray(function(t + k * h)) for k in range(1, 5)]
        behind = [np.asarray(function(t - k * h)) for k in range(1, 5)]
        return sum(w * (a - b) for w, a, b in zip(_WEIGHTS, ahead, behind, strict=True)) / h

    return derivative


@pytest.fixture(scope="session")
def with_amplitude() -> Callable[[str, str, float], Mission]:
    """A shipped mission with another amplitude along one axis."""

    def changed(name: str, axis: str, amplitude_m: float) -> Mission:
        mission = load_mission(name)
        steps = [
            replace(
                step,
                terms=tuple(replace(t, amplitude_m=amplitude_m) if t.axis == axis else t for t in step.terms),
            )
            if isinstance(step, Signals)
            else step
            for step in mission.steps
        ]
        return replace(mission, steps=tuple(steps))

    return changed
