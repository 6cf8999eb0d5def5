"""Synthetic flights of the report tests as experiments."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gcs.analysis.record import FlightMeta
from gcs.experiments.flight import ExperimentFlight, experiment_flight
from gcs.experiments.plan import Experiment
from tests.doubles import recorded_flights


@pytest.fixture(scope="session")
def step_flight() -> Callable[..., ExperimentFlight]:
    """A step of 0.25 m along y followed by a swing that decays or grows."""

    def fly(experiment: Experiment, runs_away: bool = False) -> ExperimentFlight:
        def error(t: np.ndarray) -> np.ndarray:
            after = np.clip(t - 0.4, 0.0, None)
            e = np.zeros((len(t), 3))
            growth = 1.5 if runs_away else -1.5
            e[:, 1] = 0.05 * np.sin(6.0 * after) * np.exp(growth * after) * (after > 0.0)
            return e

        made = recorded_flights.flight(7.0, recorded_flights.half_sine_step(0.25, 0.78), error)
        meta = FlightMeta(
            mission=experiment.case, law=experiment.law, vehicle=experiment.vehicle, outcome="completed"
        )
        return experiment_flight(made.telemetry(), experiment, meta)

    return fly
