"""docs/laws.md: its laws fly unchanged, and its tables are complete."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import plumbline
from autopilot.own.law import MODES
from missions.model import Delay, Land, Mission, Takeoff
from plumbline import laws

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "laws.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
SHORT = Mission("short", "Short", "", (), (Takeoff(0.5), Delay(1.0), Land()))


def block_with(words: str) -> str:
    (found,) = [block for block in BLOCKS if words in block]
    return found


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", ["Pid", "Upright"])
def test_a_law_of_the_page_flies(name: str) -> None:
    Path("page.py").write_text(block_with(f"class {name}"), encoding="utf-8")
    flight = plumbline.fly(SHORT, law=f"page.py:{name}", quiet=True)
    assert (flight.outcome, flight.summary["law"]) == ("completed", name)


def test_every_mode_and_field_is_named() -> None:
    for mode in MODES:
        assert f"`{mode}(self, memory, now)`" in PAGE
    told = set(re.findall(r"`(?:\w+)?\.?(\w+)`", PAGE))
    for name in laws.Now._fields:
        record = laws.Now.__annotations__[name]
        kind = getattr(laws, str(record), None)
        assert name in PAGE
        for field in getattr(kind, "_fields", ()):
            assert field in told, f"{name}.{field}"


def test_what_the_page_says_of_case_b() -> None:
    errors_mm = re.findall(r"by ([\d.]+) mm", PAGE)
    examples = ("plumbline.examples.geometric:Geometric", "plumbline.examples.load_pid:LoadPid")
    for law, error_mm in zip(examples, errors_mm, strict=True):
        flight = plumbline.fly("case-b", law=law, quiet=True)
        digits = len(error_mm.partition(".")[2])
        assert error_mm == f"{1e3 * flight.summary['load_error_max_m']:.{digits}f}"
