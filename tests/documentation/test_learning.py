"""The code of docs/learning.md runs unchanged, and its tables are complete."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest

from plumbline.learning.options import EnvOptions
from plumbline.learning.records import ACTIONS, Reward

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "learning.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
ROWS = set(re.findall(r"^\| ([^|]*) \|", TEXT, re.MULTILINE))
NAMES = {name for row in ROWS for name in re.findall(r"`\"?(\w+)\"?`", row)}


@pytest.mark.parametrize("block", BLOCKS, ids=range(len(BLOCKS)))
def test_a_block_runs(block: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(block, "docs/learning.md", "exec"), {"__name__": "__main__"})


def test_every_option_action_and_weight_is_told() -> None:
    assert {field.name for field in fields(EnvOptions)} <= NAMES
    assert set(ACTIONS) <= NAMES and set(Reward._fields) <= NAMES


@pytest.mark.parametrize(("name", "default"), Reward()._asdict().items(), ids=Reward._fields)
def test_a_weight_has_its_default(name: str, default: float) -> None:
    assert re.search(rf"^\| `{name}` \| {default:g}( |$)", TEXT, re.MULTILINE)
