"""Missions, vehicles and sensor profiles made in Python, as files that the programs read.

A file is kept in the user's cache directory under a hash of its content, so that the same content has the
same path: a report finds its vehicle again, the command that a report names flies it again, and an
interrupted sweep recognises its inputs.
"""

from __future__ import annotations

import hashlib
import re
import tempfile
from os import PathLike
from pathlib import Path
from typing import Protocol

from gcs.errors import GcsError
from plumbline.arguments import INPUTS, name_or_file, shown_value


class Savable(Protocol):
    """A mission, a vehicle or a sensor profile."""

    def save(self, path: str | PathLike[str]) -> None:
        """Write its file."""


def name_or_path(argument: str, given: str | PathLike[str] | Savable) -> str:
    """A given name or path, unchanged; for an object made in Python the path of its file, which is named
    after the object, or after the argument if the object has no name."""
    if isinstance(given, str | PathLike):
        return name_or_file(argument, given)
    kind = argument.capitalize()
    if not hasattr(given, "save") or kind not in (one.__name__ for one in type(given).__mro__):
        raise GcsError(
            f"{argument} = {shown_value(given)}; must be a name, the path of a file, or a plumbline.{kind}"
        )
    name = getattr(given, "name", "") or argument
    INPUTS.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=INPUTS) as temporary:
        file = Path(temporary) / "new"
        given.save(file)
        cached = INPUTS / hashlib.sha256(file.read_bytes()).hexdigest()[:16]
        cached.mkdir(exist_ok=True)
        path = cached / (re.sub(r"[^\w-]", "-", name)[:64] + ".toml")
        file.replace(path)  # atomic, even if another process does the same at this moment
    return str(path)
