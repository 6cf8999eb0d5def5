"""Folders that commands and scripts write into."""

from __future__ import annotations

import os
from pathlib import Path

from gcs.errors import GcsError


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
