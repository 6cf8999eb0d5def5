"""Names, numbers and own parameters of the control laws, read from their files without loading them.

A law is one file of `autopilot/control/laws`. It contains `LAW = Law(name="...", number=..., ...)` and, if it
has its own parameters, `PARAMETERS` as text in the format of `parameters.toml`. Code that only needs names
(help texts, the range of CTL_LAW, the documentation) reads these lines, and neither imports nor compiles a
law.
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

_LAW = re.compile(r'^LAW = Law\(\s*name="(\w+)",\s*number=(\d+),', re.MULTILINE)
_PARAMETERS = re.compile(r'^PARAMETERS = """\\?\n(.*?)^"""', re.MULTILINE | re.DOTALL)


class LawFile(NamedTuple):
    """What a law's file states about the law."""

    name: str
    number: int  # of CTL_LAW
    parameters: dict[str, Any]  # as parsed from the format of `parameters.toml`


@cache
def law_files() -> tuple[LawFile, ...]:
    """All laws in the order of their numbers. Raises ValueError if these do not count from 0 without gaps."""
    found = []
    for entry in (files("autopilot") / "control" / "laws").iterdir():
        if not entry.name.endswith(".py"):
            continue
        text = entry.read_text(encoding="utf-8")
        law, parameter_text = _LAW.search(text), _PARAMETERS.search(text)
        if law is not None:
            parameters = tomllib.loads(parameter_text.group(1)) if parameter_text is not None else {}
            found.append(LawFile(law.group(1), int(law.group(2)), parameters))
    found.sort(key=lambda law: law.number)
    if [law.number for law in found] != list(range(len(found))):
        numbers = ", ".join(f"{law.name} {law.number}" for law in found)
        raise ValueError(f"autopilot/control/laws: numbers of laws are {numbers}; must count from 0")
    return tuple(found)
