"""The shipped vehicles."""

from __future__ import annotations

import pytest

from sitl.plant.records import Truth
from sitl.vehicles.truth import load_truth


@pytest.fixture(scope="session")
def bebop() -> Truth:
    return load_truth("bebop")


@pytest.fixture(scope="session")
def thesis() -> Truth:
    return load_truth("thesis")
