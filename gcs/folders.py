"""Folders that commands and scripts write into."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from gcs.errors import InputError, reason, write_error

SUMMARY_FILE, PAGE_FILE = "summary.json", "report.html"
TLOG_FILE, PLAN_FILE, RESULTS_FILE = "flight.tlog", "plan.json", "results.json"
SENSOR_LOG, SENSORS_FOLDER = "sensors.log", "sensors"  # log of a simulator, and the tables made of it
REPEATS_FOLDER = "flights"  # in a sweep's folder: flights that were flown again, each with a report
LOCK_FILE = ".lock"  # of a folder of results; stays there, empty
FLIGHT_WRITER = "a flight or capture is in progress, or a report is being written,"  # of a flight's folder
# every folder of results contains exactly one of these three files, which identifies its kind
_CONTENTS = {TLOG_FILE: "a flight", PLAN_FILE: "a sweep", RESULTS_FILE: "the thesis's experiments"}


def fresh_folder(name: str) -> Path:
    """Create `flights/NAME-TIME`, which no other process uses. If it exists, because another flight began in
    the same second, `-2` (or the next free number) is appended."""
    parent, stem = Path("flights"), f"{name}-{datetime.now():%Y%m%d-%H%M%S}"
    make_folder(parent)
    folder, ordinal = parent / stem, 1
    while True:
        try:
            folder.mkdir()
        except FileExistsError:
            ordinal += 1
            folder = parent / f"{stem}-{ordinal}"
        else:
            return folder


def make_folder(path: Path, shown_path: Path | None = None) -> None:
    """Create a folder and its parents, unless it exists.

    GcsError, which names it or `shown_path`, if it cannot be created or nothing can be written into it.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        if not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise write_error(error, shown_path or path) from None


@contextmanager
def reserved(path: Path, other_writer: str = FLIGHT_WRITER) -> Iterator[None]:
    """Lock a folder or a single file against other writers; InputError if another process holds the lock, or
    if the folder cannot be written. `other_writer` says for the error what the other process does.

    The lock ends with the process, however that ends. A file is locked by another one beside it, which is
    deleted again.
    """
    from filelock import FileLock, Timeout

    is_folder = path.is_dir()
    lock_path = path / LOCK_FILE if is_folder else path.with_name(f".{path.name}{LOCK_FILE}")
    lock = FileLock(lock_path)
    try:
        lock.acquire(blocking=False)
    except Timeout:
        raise InputError(
            f"{path}: {other_writer} there; wait until it has ended, or name another "
            f"{'folder' if is_folder else 'file'} by --out"
        ) from None
    except OSError as error:
        raise write_error(error, path) from None
    try:
        yield
    finally:
        if not is_folder:
            lock_path.unlink(missing_ok=True)
        lock.release()


def check_writable(path: Path, is_folder: bool, shown_name: str) -> None:
    """InputError, which names the path as `shown_name`, unless the file, or files in the folder, can be
    written.

    Writing is tried, because permissions are not sufficient (/proc); what is created for it is removed.
    """
    try:
        if is_folder or not path.parent.is_dir():
            _try_folder(path if is_folder else path.parent)
        else:
            _try_file(path)
    except OSError as error:
        kind = "folder" if is_folder else "file in a folder"
        raise InputError(f"{shown_name}: {reason(error)}; name a {kind} that can be written") from None


def _try_folder(path: Path) -> None:
    """Create and remove a folder in the nearest existing folder."""
    existing = next(one for one in (path, *path.absolute().parents) if one.exists())
    if not existing.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
    Path(tempfile.mkdtemp(dir=existing)).rmdir()


def _try_file(path: Path) -> None:
    """Open the file without changing its content; a pipe is not opened, as that may wait for its reader."""
    is_new = not path.exists()
    if not (is_new or path.is_file()):
        return
    path.open("ab").close()
    if is_new:
        path.unlink()


def check_no_other_results(path: Path, kind: str, written: Iterable[str] = ()) -> None:
    """InputError if a folder contains results of another kind than `kind` (the name of the identifying file)
    or, if it contains none of this kind yet, a file with one of the names in `written`."""
    for kind_file, what in _CONTENTS.items():
        if kind_file != kind and (path / kind_file).exists():
            raise InputError(f"{path}: holds {what}; name another folder by --out")
    if (path / kind).exists():
        return
    for name in written:
        if (path / name).exists():
            raise InputError(
                f"{path}: holds a {name} that is not of {_CONTENTS[kind]}; name another folder by --out"
            )
