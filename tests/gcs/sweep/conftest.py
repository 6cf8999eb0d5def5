"""A short mission, and the plan of a small sweep of it."""

from __future__ import annotations

from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest

from gcs.sweep.plan import SweepPlan, Varied

SHORT = """
title = "Up, aside and down"
description = "A mission for tests."

[[items]]
type = "takeoff"
altitude_m = 1.0

[[items]]
type = "waypoint"
east_m = 0.4
north_m = 0.0
altitude_m = 1.0

[[items]]
type = "land"
"""


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> str:
    path: Path = tmp_path_factory.mktemp("missions") / "short.toml"
    path.write_text(SHORT, encoding="utf-8")
    return str(path)


@pytest.fixture(scope="session")
def delivery(tmp_path_factory: pytest.TempPathFactory) -> str:
    path: Path = tmp_path_factory.mktemp("missions") / "delivery.toml"
    land = '[[items]]\ntype = "land"\n'
    path.write_text(SHORT.replace(land, '[[items]]\ntype = "release"\n\n' + land), encoding="utf-8")
    return str(path)


@pytest.fixture
def plan(short: str) -> SweepPlan:
    """Six flights, of which those with the long delay are lost."""
    delays = Varied("SIM_ACT_DELAY_MS", (0.0, 4.0, 60.0), True)
    return SweepPlan(short, "bebop", "lab", ("thesis",), (1, 2), (delays,), ())


class AtOnce(Executor):
    """Flies where it is called."""

    def submit(self, function: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        future.set_result(function(*arguments, **named))
        return future
