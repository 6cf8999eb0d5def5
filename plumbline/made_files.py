"""What is made in Python, as the file that the programs read.

It is kept in the user's cache directory under a hash of its content, so that the same thing is the same path:
a report finds its vehicle again, the command that a report names flies it again, and a sweep that was
interrupted knows that it is the same.
"""

from __future__ import annotations

import hashlib
import re
import tempfile
from os import PathLike
from pathlib import Path
from typing import Protocol

from platformdirs import user_cache_path

from gcs.errors import GcsError


class Savable(Protocol):
    """A mission, a vehicle or a sensor profile."""

    def save(self, path: str | PathLike[str]) -> None:
        """Write its file."""


def name_or_path(given: str | PathLike[str] | Savable, name: str) -> str:
    """A name or a path as it was given; of a thing made in Python the path of its file, which is called
    `name`."""
    if isinstance(given, str | PathLike):
        return str(given)
    if not hasattr(given, "save"):
        raise GcsError(f"{given!r}: must be a name, the path of a file, or one made by plumbline")
    folder = user_cache_path("plumbline") / "inputs"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as beside:
        new = Path(beside) / "new"
        given.save(new)
        kept = folder / hashlib.sha256(new.read_bytes()).hexdigest()[:16]
        kept.mkdir(exist_ok=True)
        path = kept / (re.sub(r"[^\w-]", "-", name)[:64] + ".toml")
        new.replace(path)  # whole, whoever else does the same at this moment
    return str(path)
