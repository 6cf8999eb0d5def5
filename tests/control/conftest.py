"""What the control tests share: an independent model, the vehicle of the thesis, the laws as plain Python."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from autopilot.control import height, quad_position, thesis_cascade
from autopilot.control.actuators import mixer
from autopilot.control.records import Vehicle
from tests.control import model as independent
from tests.control import oracle
from tests.control.plain_laws import plain_laws, sources


@pytest.fixture(scope="session")
def bebop() -> Vehicle:
    """The vehicle of Table 4-1."""
    return Vehicle(0.4, 0.1, 0.7, (2.23e-3, 2.99e-3, 4.8e-3), 9.81, 0.126, 0.016, 0.0, 1.96)


@pytest.fixture(scope="session")
def model() -> SimpleNamespace:
    """The independent model and its helpers."""
    functions: tuple[Callable[..., Any], ...] = (
        independent.vec,
        independent.mat,
        independent.hat,
        independent.rodrigues,
        independent.unit,
        independent.random_rotation,
        independent.rates,
        independent.rk4,
        independent.pack,
        independent.state_of,
        oracle.oracle_vehicle,
        oracle.oracle_start,
        oracle.oracle_command,
    )
    return SimpleNamespace(oracle=oracle.ORACLE, **{function.__name__: function for function in functions})


@pytest.fixture(scope="session")
def law_sources() -> dict[str, str]:
    """Source texts, by module, of the laws of the thesis and of all modules that they are made of."""
    return sources(thesis_cascade, height, quad_position, mixer)


@pytest.fixture(scope="session")
def laws(law_sources: dict[str, str]) -> SimpleNamespace:
    """The unaltered laws as plain Python."""
    return plain_laws(law_sources)
