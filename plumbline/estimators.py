"""The names with which a custom estimator is written: see `docs/estimators.md`.

World ENU, body FLU, SI.
"""

from __future__ import annotations

from autopilot.control.records import Cable, State
from autopilot.estimation.estimator_exchange import (
    DirectionSample,
    Driven,
    Estimate,
    FieldSample,
    FixSample,
    HeightSample,
    InertialSample,
    LoadSample,
    PoseSample,
    Sensed,
)
from autopilot.own.compiled import kernel
from autopilot.own.estimates import estimated, no_estimate
from autopilot.own.loaded_class import Parameter

__all__ = [
    "Cable",
    "DirectionSample",
    "Driven",
    "Estimate",
    "FieldSample",
    "FixSample",
    "HeightSample",
    "InertialSample",
    "LoadSample",
    "Parameter",
    "PoseSample",
    "Sensed",
    "State",
    "estimated",
    "kernel",
    "no_estimate",
]
