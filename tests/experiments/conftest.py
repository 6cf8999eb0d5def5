"""Synthetic flights of the report tests, dressed as experiments."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from gcs.analysis.record import FlightMeta
from gcs.experiments.flown import Flown, flown_of
from gcs.experiments.plan import Experiment


def _load(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def synthetic() -> ModuleType:
    """tests/report/conftest.py: flights made of the dialect's own messages."""
    return _load("synthetic_flights", Path(__file__).parents[1] / "report" / "conftest.py")


@pytest.fixture(scope="session")
def tolerances() -> ModuleType:
    return _load("experiment_tolerances", Path(__file__).with_name("tolerances.py"))


@pytest.fixture(scope="session")
def step_flight(synthetic: ModuleType) -> Callable[..., Flown]:
    """A step of 0.25 m along y with a swing that dies out behind it, or runs away."""

    def fly(experiment: Experiment, runs_away: bool = False) -> Flown:
        def error(t: np.ndarray) -> np.ndarray:
            after = np.clip(t - 0.4, 0.0, None)
            e = np.zeros((len(t), 3))
            growth = 1.5 if runs_away else -1.5
            e[:, 1] = 0.05 * np.sin(6.0 * after) * np.exp(growth * after) * (after > 0.0)
            return e

        made = synthetic.flight(7.0, synthetic.half_sine_step(0.25, 0.78), error)
        meta = FlightMeta(
            mission=experiment.case, law=experiment.law, vehicle=experiment.vehicle, outcome="completed"
        )
        return flown_of(made.telemetry(), experiment, meta)

    return fly
