"""A wall clock that is set by hours while the autopilot flies: this has no effect."""

from __future__ import annotations

import ast
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

from autopilot.shell.steady_clock import SteadyClock

HOUR_NS = 3600 * 10**9
READS = {"time", "time_ns", "now", "utcnow", "today"}  # of the modules time and datetime


@pytest.mark.parametrize("jump_ns", [-5 * HOUR_NS, 5 * HOUR_NS])
def test_a_clock_that_is_set_forward_or_back_changes_nothing(
    jump_ns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall_ns = time.time_ns()
    clock = SteadyClock()
    before_us = clock.unix_us()
    assert abs(before_us - wall_ns // 1000) < 60_000_000
    monkeypatch.setattr(time, "time_ns", lambda: wall_ns + jump_ns)
    assert 0 <= clock.unix_us() - before_us < 60_000_000


@pytest.mark.parametrize("program", ["autopilot", "sitl"])
def test_nothing_else_reads_the_wall_clock(program: str) -> None:
    """In lockstep, paced and in real time alike: what is not read cannot jump."""
    spec = find_spec(program)
    assert spec is not None
    assert spec.submodule_search_locations is not None
    readers = set()
    for path in Path(spec.submodule_search_locations[0]).rglob("*.py"):
        if path.parent.name == "dialect":  # pymavlink's own classes, which sign nothing here
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            match node:
                case ast.Attribute(value=ast.Name(id="time" | "datetime"), attr=attr) if attr in READS:
                    readers.add(path.name)
                case ast.ImportFrom(module="time"):
                    readers.add(path.name)
    assert readers == ({"steady_clock.py"} if program == "autopilot" else set())
