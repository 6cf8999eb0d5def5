"""A motion that several tests follow; it takes a while to integrate."""

from __future__ import annotations

import pytest

from tests.doubles.motion import Motion


@pytest.fixture(scope="session")
def motion() -> Motion:
    return Motion(20.0)
