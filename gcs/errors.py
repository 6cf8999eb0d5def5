"""What can go wrong at the ground station, and the exit code that says so."""

from __future__ import annotations

import errno
import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from missions.toml_files import FileError

EXIT_DONE = 0
EXIT_ERROR = 1  # a known error, told in one line
EXIT_USAGE = 2  # the command line is wrong, or a file that it names
EXIT_NOT_MET = 3  # flown, but the mission was not completed
EXIT_REQUIRED = 4  # a requirement of --require was not met
EXIT_INTERRUPTED = 130  # stopped by Ctrl-C, as shells count it


class GcsError(Exception):
    """A known error. Its text is the one line that a person reads; `lines` has one for each mistake."""

    exit_code = EXIT_ERROR

    def __init__(self, *lines: str) -> None:
        super().__init__("; ".join(lines))
        self.lines = lines


def from_clone(extra: str) -> str:
    """What pip is to install where only some need it: from the clone, as PyPI's `plumbline` is another
    project."""
    return f"-e '.[{extra}]' in the clone of Plumbline"


class InputError(GcsError):
    """The command line names something that there is not, or a value or a file that cannot be."""

    exit_code = EXIT_USAGE


class NoVehicleError(GcsError):
    """Nobody answered, or somebody stopped answering."""


class StoppedError(GcsError):
    """Somebody stopped it before there was anything to show."""

    exit_code = EXIT_INTERRUPTED


class RefusedError(GcsError):
    """The vehicle answered no."""


def input_error(error: FileError) -> GcsError:
    """What is wrong with a file that the command line names, or with the name."""
    return InputError(*error.problems)


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_DISK = (*_FULL, errno.EIO, errno.EROFS)


def disk_trouble(error: BaseException | None) -> str:
    """What the disk did not take, and why, if that is what the error says; else nothing."""
    if not isinstance(error, OSError) or error.errno not in _DISK:
        return ""
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{reason(error).lower()}"


def reason(error: OSError) -> str:
    """Why, in the system's words; libraries (Arrow) wrap them into sentences of their own."""
    return os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)


def not_written(error: OSError, told: object, kind: str = "folder", by: str = "--out") -> GcsError:
    """That `told` cannot be written: with a full disk a known error, else wrong input, as another folder (or
    other `kind`) is to be named, `by` an option if there is one."""
    other = f"name another {kind}{f' by {by}' if by else ''}"
    if error.errno in _FULL:
        return GcsError(f"{told}: {reason(error)}; free some space, or {other}")
    return InputError(f"{told}: {reason(error)}; {other}")
