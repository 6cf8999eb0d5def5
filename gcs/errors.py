"""The known errors of the ground station, and their exit codes."""

from __future__ import annotations

import errno
import os
from typing import TYPE_CHECKING

from missions.errors import Error

if TYPE_CHECKING:
    from missions.toml_files import FileError

EXIT_DONE = 0
EXIT_ERROR = 1  # a known error, reported in one line
EXIT_USAGE = 2  # the command line, or a file that it names, is wrong
EXIT_NOT_MET = 3  # flown, but the mission was not completed
EXIT_REQUIRED = 4  # a requirement of --require was not met
EXIT_INTERRUPTED = 130  # stopped: by Ctrl-C, or another signal (`gcs.shell.stopping.stop_exit_code`)


class GcsError(Error):
    """A known error with the exit code of a command that ends by it."""

    exit_code = EXIT_ERROR


def from_clone(extra: str) -> str:
    """The arguments of `pip install` for an optional extra: from the clone, because PyPI's `plumbline` is
    another project."""
    return f"-e '.[{extra}]' in the clone of Plumbline"


class InputError(GcsError):
    """The command line names something that does not exist, or an invalid value or file."""

    exit_code = EXIT_USAGE


class NoVehicleError(GcsError):
    """No vehicle answered, or it stopped answering."""


class NotInTimeError(GcsError):
    """The vehicle answers, but what is waited for has not happened within the time limit."""


class StoppedError(GcsError):
    """The user stopped the command before it had a result."""

    exit_code = EXIT_INTERRUPTED


class RefusedError(GcsError):
    """The vehicle refused a request."""


def input_error(error: FileError) -> GcsError:
    """The error for a problem with a file that the command line names, or with its name."""
    return InputError(*error.problems)


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_DISK = (*_FULL, errno.EIO, errno.EROFS)


def disk_problem(error: BaseException | None) -> str:
    """The file, if known, and the reason, if the error is a failure of the disk; else empty."""
    if not isinstance(error, OSError) or error.errno not in _DISK:
        return ""
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{reason(error).lower()}"


def reason(error: OSError) -> str:
    """The reason in the system's words, which libraries (Arrow) wrap into their own sentences."""
    return os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)


def write_error(error: OSError, target: object, kind: str = "folder", option: str = "--out") -> GcsError:
    """The error that `target` cannot be written: a GcsError if the disk is full, else an InputError. The text
    asks for another folder (or other `kind`), `option` an option if there is one."""
    other = f"name another {kind}{f' by {option}' if option else ''}"
    if error.errno in _FULL:
        return GcsError(f"{target}: {reason(error)}; free some space, or {other}")
    return InputError(f"{target}: {reason(error)}; {other}")
