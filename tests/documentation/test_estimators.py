"""docs/estimators.md and docs/planners.md: their examples fly, and their tables are complete."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import plumbline
from missions.model import Delay, Land, Mission, Takeoff, Waypoint
from plumbline import estimators, planners

ROOT = Path(__file__).resolve().parents[2]
PAGE, PLANNERS = ((ROOT / "docs" / name).read_text("utf-8") for name in ("estimators.md", "planners.md"))
SHORT = Mission("short", "Short", "", (), (Takeoff(0.5), Delay(1.0), Land()))
CORNER = (Takeoff(1.0), Waypoint(1.0, 0.0, 1.0), Waypoint(1.0, 1.0, 1.0, 0.5), Land())


def written(page: str, words: str, name: str) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    (found,) = [block for block in blocks if words in block]
    Path(name).write_text(found, encoding="utf-8")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_the_estimator_of_the_page_flies() -> None:
    written(PAGE, "class Plain", "plain.py")
    flight = plumbline.fly(SHORT, estimator="plain.py:Plain", quiet=True)
    assert (flight.outcome, flight.summary["estimator"]) == ("completed", "Plain")
    assert 0.0 < flight.summary["filter_error_max_m"] < flight.summary["estimator_error_max_m"]


def test_the_planner_of_the_page_flies() -> None:
    written(PLANNERS, "class Line", "line.py")
    mission = Mission("corner", "Corner", "", (), CORNER)
    flight = plumbline.fly(mission, planner="line.py:Line", quiet=True)
    assert (flight.outcome, flight.summary["planner"]) == ("completed", "Line")


def test_every_field_is_named() -> None:
    told = set(re.findall(r"`(?:\w+)?\.?(\w+)`", PAGE)) | {"new", "time_s"}
    for name in estimators.Sensed._fields:
        kind = getattr(estimators, str(estimators.Sensed.__annotations__[name]), None)
        assert name in PAGE
        for field in getattr(kind, "_fields", ()):
            assert field in told, f"{name}.{field}"
    for field in planners.Route._fields:
        assert f"`{field}`" in PLANNERS


def test_what_the_page_says_of_case_b() -> None:
    (error_mm,) = re.findall(r"by ([\d.]+) mm", PAGE)
    flight = plumbline.fly("case-b", estimator="plumbline.examples.luenberger:Luenberger", quiet=True)
    assert error_mm == f"{1e3 * flight.summary['load_error_max_m']:.1f}"


def test_what_the_page_says_of_square() -> None:
    (error_mm,) = re.findall(r"`square` to ([\d.]+) mm", PLANNERS)
    flight = plumbline.fly("square", planner="plumbline.examples.minimum_snap:MinimumSnap", quiet=True)
    assert error_mm == f"{1e3 * flight.summary['load_error_max_m']:.1f}"
