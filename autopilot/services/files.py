"""Files as the services see them: paths that cannot leave their root, and a card that holds bytes.

The card itself belongs to the shell (`autopilot.shell.sd_card` keeps one in a directory); `MemoryCard` is a
card without a disk, for tests and for flights inside one process.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import IntEnum
from errno import ENAMETOOLONG
from typing import NamedTuple, Protocol

Path = tuple[str, ...]  # names from the root downwards; () is the root itself

MAX_NAME_BYTES = 255  # bytes of one name, as on any common disk
LOG_FOLDER: Path = ("log",)  # of the card
LOG_SUFFIX = ".ulg"
LOG_TIME = "%Y-%m-%d_%H-%M-%S"  # the UTC time at which a log begins, with which its name begins
# that time, and the number of a log that has begun in the same second as another
LOG_NAME = re.compile(rf"(\d{{4}}-\d\d-\d\d_\d\d-\d\d-\d\d)(?:_(\d+))?{re.escape(LOG_SUFFIX)}")


class ErrorCode(IntEnum):
    """Why a file operation failed: the error codes of FILE_TRANSFER_PROTOCOL."""

    FAIL = 1
    FAIL_ERRNO = 2
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    EXISTS = 8
    PROTECTED = 9
    NOT_FOUND = 10


class FileError(Exception):
    """A failed operation; `errno` (POSIX) accompanies FAIL_ERRNO."""

    def __init__(self, code: ErrorCode, errno: int = 0) -> None:
        super().__init__(f"{code.name} {errno}" if errno else code.name)
        self.code = code
        self.errno = errno


class Entry(NamedTuple):
    """One name in a folder; `modified_s` counts from 1970."""

    name: str
    size: int
    is_folder: bool
    modified_s: int = 0


def log_begin_s(log: Entry) -> int:
    """When a log began, by its name, s since 1970; for a file with another name, when it was modified."""
    match = LOG_NAME.fullmatch(log.name)
    if match is None:
        return log.modified_s
    try:
        return round(datetime.strptime(match[1], LOG_TIME).replace(tzinfo=UTC).timestamp())
    except ValueError:  # no date
        return log.modified_s


class Card(Protocol):
    """A tree of files. Every method raises FileError if it cannot do what its docstring says."""

    def entries(self, path: Path, first: int = 0, max_count: int | None = None) -> list[Entry]:
        """The contents of a folder, sorted by name: at most `max_count` entries from number `first` on."""

    def size(self, path: Path) -> int:
        """Bytes in a file."""

    def read(self, path: Path, offset: int, size: int) -> bytes:
        """At most `size` bytes; fewer at the end of the file, none after it."""

    def create(self, path: Path) -> None:
        """Create an empty file, in place of an existing one."""

    def write(self, path: Path, offset: int, data: bytes) -> None:
        """Write `data` into an existing file; a hole before it reads as zeros."""

    def truncate(self, path: Path, size: int) -> None:
        """Cut a file, or extend it with zeros."""

    def remove(self, path: Path) -> None:
        """Remove a file."""

    def rename(self, old: Path, new: Path) -> None:
        """Move a file or folder to an unused name."""

    def make_folder(self, path: Path) -> None:
        """Create an empty folder in an existing folder."""

    def remove_folder(self, path: Path) -> None:
        """Remove an empty folder."""


def path_of(text: bytes) -> Path:
    """The path that a client wrote, with '/' between its names; FileError if it is invalid.

    `.` and empty names are ignored; `..` is refused, as are backslashes, control characters, names that are
    too long and text that is not UTF-8.
    """
    try:
        decoded = text.split(b"\0", 1)[0].decode("utf-8")
    except UnicodeDecodeError:
        raise FileError(ErrorCode.NOT_FOUND) from None
    names = tuple(name for name in decoded.split("/") if name not in ("", "."))
    for name in names:
        if name == ".." or len(name.encode()) > MAX_NAME_BYTES or not name.isprintable() or "\\" in name:
            raise FileError(ErrorCode.NOT_FOUND)
    return names


@dataclass(slots=True)
class Limits:
    """What clients may store on a card: bytes in one file, bytes in all, number of files and folders, and
    number of names in a path."""

    file_bytes: int = 64 * 2**20
    total_bytes: int = 1024 * 2**20
    files: int = 1024  # listing them all takes a millisecond
    depth: int = 32

    def check_depth(self, names: int) -> None:
        """Raise FileError for a path with too many names."""
        if names > self.depth:
            raise FileError(ErrorCode.FAIL_ERRNO, ENAMETOOLONG)


class MemoryCard:
    """A card in memory. Folders are stored separately, so that an empty folder can exist."""

    def __init__(self, limits: Limits | None = None) -> None:
        self._limits = limits or Limits()
        self._files: dict[Path, bytearray] = {}
        self._folders: set[Path] = {()}

    def entries(self, path: Path, first: int = 0, max_count: int | None = None) -> list[Entry]:
        if path not in self._folders:
            raise FileError(ErrorCode.NOT_FOUND)
        found = [Entry(file[-1], len(data), False) for file, data in self._files.items() if file[:-1] == path]
        found += [Entry(folder[-1], 0, True) for folder in self._folders if folder and folder[:-1] == path]
        return sorted(found)[first : None if max_count is None else first + max_count]

    def size(self, path: Path) -> int:
        return len(self._file(path))

    def read(self, path: Path, offset: int, size: int) -> bytes:
        return bytes(self._file(path)[offset : offset + size])

    def create(self, path: Path) -> None:
        if path in self._folders:
            raise FileError(ErrorCode.FAIL)
        self._check_parent(path)
        self._check_count(path)
        self._files[path] = bytearray()

    def write(self, path: Path, offset: int, data: bytes) -> None:
        file = self._file(path)
        end = offset + len(data)
        self._check_capacity(file, end)
        file.extend(bytes(max(0, end - len(file))))
        file[offset:end] = data

    def truncate(self, path: Path, size: int) -> None:
        file = self._file(path)
        self._check_capacity(file, size)
        file.extend(bytes(max(0, size - len(file))))
        del file[size:]

    def remove(self, path: Path) -> None:
        self._file(path)
        del self._files[path]

    def rename(self, old: Path, new: Path) -> None:
        if new in self._files or new in self._folders:
            raise FileError(ErrorCode.EXISTS)
        self._check_parent(new)
        if old in self._files:
            self._limits.check_depth(len(new))
            self._files[new] = self._files.pop(old)
            return
        if not old or old not in self._folders:
            raise FileError(ErrorCode.NOT_FOUND)
        if new[: len(old)] == old:
            raise FileError(ErrorCode.FAIL)
        length = len(old)
        inside = [len(path) for path in (*self._files, *self._folders) if path[:length] == old]
        self._limits.check_depth(len(new) + max(inside) - length)
        self._files = {_moved(path, old, new, length): data for path, data in self._files.items()}
        self._folders = {_moved(path, old, new, length) for path in self._folders}

    def make_folder(self, path: Path) -> None:
        if path in self._folders or path in self._files:
            raise FileError(ErrorCode.EXISTS)
        self._check_parent(path)
        self._check_count(path)
        self._folders.add(path)

    def remove_folder(self, path: Path) -> None:
        if not path or path not in self._folders:
            raise FileError(ErrorCode.NOT_FOUND)
        if self.entries(path):
            raise FileError(ErrorCode.FAIL)
        self._folders.remove(path)

    def _file(self, path: Path) -> bytearray:
        if path not in self._files:
            raise FileError(ErrorCode.NOT_FOUND)
        return self._files[path]

    def _check_parent(self, path: Path) -> None:
        if path[:-1] not in self._folders:
            raise FileError(ErrorCode.NOT_FOUND)

    def _check_count(self, path: Path) -> None:
        self._limits.check_depth(len(path))
        if len(self._files) + len(self._folders) > self._limits.files:
            raise FileError(ErrorCode.FAIL)

    def _check_capacity(self, file: bytearray, size: int) -> None:
        growth = size - len(file)
        total = sum(map(len, self._files.values()))
        if growth > 0 and (size > self._limits.file_bytes or total + growth > self._limits.total_bytes):
            raise FileError(ErrorCode.FAIL)


def _moved(path: Path, old: Path, new: Path, length: int) -> Path:
    return new + path[length:] if path[:length] == old else path
