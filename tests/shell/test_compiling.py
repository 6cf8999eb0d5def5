"""What a program compiles before it flies is announced, also what no part of the flight software lists."""

from __future__ import annotations

from pathlib import Path

import numba
import pytest

from autopilot.shell.compiling import COMPILING_MORE_TEXT, COMPILING_TEXT, Compilation, Part
from sitl.sensors.files import load_profile
from sitl.warmup import ALL_SENSORS
from sitl.world import fitted_sensors


def part(mark: str) -> Part:
    return Part(f"the {mark}", "nothing", (), Path(__file__), mark, 1.0)


@pytest.fixture(autouse=True)
def nothing_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")


def compile_something() -> None:
    numba.njit(lambda x: x + 1.0)(1.0)


def test_missing_parts_are_announced_at_once_and_marked_when_everything_is_compiled() -> None:
    said: list[str] = []
    parts = part("one"), part("other")
    parts[0].mark_done()
    compilation = Compilation(parts, said.append)
    assert (said, compilation.was_needed, parts[1].ready) == ([COMPILING_TEXT], True, False)
    compile_something()
    compilation.done()
    assert said == [COMPILING_TEXT] and parts[1].ready


def test_machine_code_that_cannot_be_kept_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    said: list[str] = []
    Compilation((part("one"),), said.append)
    where = tmp_path / "file" / "plumbline" / "kernels"
    assert said[0] == COMPILING_TEXT
    assert said[1].startswith(
        f"{where}: Not a directory; the machine code cannot be kept there; to keep it, "
    )


def test_a_kernel_that_no_part_has_is_announced_once_and_only_before_the_flight() -> None:
    said: list[str] = []
    ready = part("ready")
    ready.mark_done()
    compilation = Compilation((ready,), said.append)
    assert (said, compilation.was_needed) == ([], False)
    compile_something()
    compile_something()
    assert said == [COMPILING_MORE_TEXT]
    compilation.done()
    quiet = Compilation((ready,), said.append)
    quiet.done()
    compile_something()
    assert said == [COMPILING_MORE_TEXT]


def test_the_simulator_is_compiled_with_every_sensor() -> None:
    profiles = [fitted_sensors(load_profile(name)) for name in ALL_SENSORS]
    assert all(any(table is not None for table in same) for same in zip(*profiles, strict=True))
