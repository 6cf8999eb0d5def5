"""docs/control.md and its log name only files and functions that exist."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import autopilot.control

ROOT = Path(__file__).parents[2]
TEXT = "".join(
    (ROOT / page).read_text(encoding="utf-8") for page in ("docs/control.md", "docs/control-log.md")
)
CONTROL = Path(autopilot.control.__path__[0])
FILE = re.compile(r"`(?:python )?([\w/]+\.(?:py|toml))\b[^`]*`")
FUNCTION = re.compile(r"`(\w+)\.(?!py`|toml`)(\w+)(?:\(|`)")


def test_files_that_are_named_exist() -> None:
    names = FILE.findall(TEXT)
    assert len(names) > 15
    # with their path from the root, from the room, or, for a law, by their name
    places = (ROOT, CONTROL, CONTROL / "laws")
    assert not [name for name in names if not any((place / name).is_file() for place in places)]


def test_functions_that_are_named_exist() -> None:
    named = FUNCTION.findall(TEXT)
    assert ("thesis_cascade", "load_position") in named
    for module, name in named:
        assert callable(getattr(import_module(f"{autopilot.control.__name__}.{module}"), name))
