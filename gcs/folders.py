"""Folders that commands and scripts write into."""

from __future__ import annotations

import os
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path

from gcs.errors import GcsError

SUMMARY_FILE, PAGE_FILE = "summary.json", "report.html"
TLOG_FILE, PLAN_FILE, RESULTS_FILE = "flight.tlog", "plan.json", "results.json"
# of these three one lies in every folder that holds the results of one thing
_HOLDS = {TLOG_FILE: "a flight", PLAN_FILE: "a sweep", RESULTS_FILE: "the thesis's experiments"}


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


def keep_others(path: Path, kind: str, written: Iterable[str] = ()) -> None:
    """A folder holds the results of one thing: GcsError if this one holds those of another `kind`, by name of
    the file that tells, or before it holds ours a file under a name that is `written`."""
    for mark, what in _HOLDS.items():
        if mark != kind and (path / mark).exists():
            raise GcsError(f"--out {path}: holds {what}; name another")
    if (path / kind).exists():
        return
    for name in written:
        if (path / name).exists():
            raise GcsError(f"--out {path}: holds a {name} that is not of {_HOLDS[kind]}; name another")
