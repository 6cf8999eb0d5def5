"""Folders that commands and scripts write into."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path

from gcs.errors import GcsError


def fresh_folder(name: str) -> Path:
    """`flights/NAME-TIME`, made now and nobody else's: of two that begin in one second the later has `-2`."""
    parent, stem = Path("flights"), f"{name}-{datetime.now():%Y%m%d-%H%M%S}"
    make_folder(parent, str(parent))
    folder, ordinal = parent / stem, 1
    while True:
        try:
            folder.mkdir()
        except FileExistsError:
            ordinal += 1
            folder = parent / f"{stem}-{ordinal}"
        else:
            return folder


def make_folder(path: Path, told: str) -> None:
    """Make a folder, with those above it, unless it is there.

    GcsError, which calls it `told`, if it cannot be made or nothing can be written into it.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        if not os.access(path, os.W_OK):
            raise PermissionError(13, "Permission denied")
    except OSError as error:
        raise GcsError(f"{told}: {error.strerror}") from None
