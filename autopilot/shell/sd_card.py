"""A directory as the card that clients read and write by FILE_TRANSFER_PROTOCOL."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import takewhile
from pathlib import Path

from autopilot.services import files
from autopilot.services.files import Entry, FileError, Limits, Trouble

_TROUBLES = {
    errno.ENOENT: Trouble.NOT_FOUND,
    errno.EEXIST: Trouble.EXISTS,
    errno.EACCES: Trouble.PROTECTED,
    errno.EPERM: Trouble.PROTECTED,
    errno.EROFS: Trouble.PROTECTED,
    errno.EFBIG: Trouble.FAIL,
}


@contextmanager
def _as_file_errors() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        code = error.errno or errno.EIO
        trouble = _TROUBLES.get(code, Trouble.FAIL_ERRNO)
        raise FileError(trouble, code if trouble is Trouble.FAIL_ERRNO else 0) from None


class DirectoryCard:
    """A card kept in a directory, which it creates. Nothing outside can be reached, not even by links."""

    def __init__(self, root: Path, limits: Limits | None = None) -> None:
        root.mkdir(parents=True, exist_ok=True)
        self._root = root.resolve()
        self._limits = limits or Limits()
        self._held, self._used = self._count()  # files and folders, and bytes in the files

    def entries(self, path: files.Path, first: int = 0, most: int | None = None) -> list[Entry]:
        place = self._at(path)
        with _as_file_errors(), os.scandir(place) as found:
            named = sorted((one.name, one) for one in found if not one.is_symlink())
        entries = []
        for name, one in named[first : None if most is None else first + most]:
            with suppress(OSError):  # gone meanwhile
                status = one.stat(follow_symlinks=False)
                size = 0 if one.is_dir() else status.st_size
                entries.append(Entry(name, size, one.is_dir(), int(status.st_mtime)))
        return entries

    def size(self, path: files.Path) -> int:
        with _as_file_errors():
            return self._file(path).stat().st_size

    def read(self, path: files.Path, offset: int, size: int) -> bytes:
        with _as_file_errors(), self._file(path).open("rb") as file:
            file.seek(offset)
            return file.read(size)

    def create(self, path: files.Path) -> None:
        with _as_file_errors():
            place = self._at(path)
            before = place.stat().st_size if place.is_file() else None
            if before is None:
                self._one_more(path)
            place.open("wb").close()
            self._held += before is None
            self._used -= before or 0

    def write(self, path: files.Path, offset: int, data: bytes) -> None:
        with _as_file_errors():
            grown = max(0, self._room(path, offset + len(data)))
            with self._file(path).open("r+b") as file:
                file.seek(offset)
                file.write(data)
            self._used += grown

    def truncate(self, path: files.Path, size: int) -> None:
        with _as_file_errors():
            grown = self._room(path, size)
            os.truncate(self._file(path), size)
            self._used += grown

    def remove(self, path: files.Path) -> None:
        with _as_file_errors():
            place = self._file(path)
            size = place.stat().st_size
            place.unlink()
            self._gone(size)

    def rename(self, old: files.Path, new: files.Path) -> None:
        with _as_file_errors():
            source, target = self._at(old), self._at(new)
            if target.exists():
                raise FileError(Trouble.EXISTS)
            deeper = len(new) > len(old) and source.is_dir()
            self._limits.check_depth(len(new) + (self._height(source) if deeper else 0))
            source.rename(target)

    def make_folder(self, path: files.Path) -> None:
        with _as_file_errors():
            self._one_more(path)
            self._at(path).mkdir()
            self._held += 1

    def remove_folder(self, path: files.Path) -> None:
        with _as_file_errors():
            self._at(path).rmdir()
            self._gone(0)

    def append(self, path: files.Path, data: bytes) -> None:
        """Append to a file, which is created if it does not exist; raises the system's OSError."""
        try:
            place = self._at(path)
        except FileError:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP)) from None
        new = [*takewhile(lambda one: not one.exists(), (place, *place.parents))]
        place.parent.mkdir(parents=True, exist_ok=True)
        with place.open("ab") as file:
            self._held += len(new)
            file.write(data)
            self._used += len(data)

    def make_room(self, folder: files.Path, ending: str, most_bytes: int) -> None:
        """Remove the first files of a folder, by name, until the rest has at most `most_bytes`."""
        try:
            place = self._at(folder)
        except FileError:
            return
        found = sorted(file for file in place.glob("*" + ending) if file.is_file()) if place.is_dir() else []
        size = sum(file.stat().st_size for file in found)
        for file in found:
            if size <= most_bytes:
                return
            taken = file.stat().st_size
            file.unlink()
            size -= taken
            self._gone(taken)

    def _file(self, path: files.Path) -> Path:
        place = self._at(path)
        if place.is_dir():
            raise IsADirectoryError(errno.EISDIR, "a folder")
        return place

    def _at(self, path: files.Path) -> Path:
        """The place of a path; none of its names may be a link."""
        place = self._root
        for name in path:
            place = place / name
            if place.is_symlink():
                raise FileError(Trouble.NOT_FOUND)
        return place

    def _room(self, path: files.Path, size: int) -> int:
        """Bytes by which a file of this size exceeds the present one; FileError if they do not fit."""
        grown = size - self._file(path).stat().st_size
        too_large = size > self._limits.file_bytes or self._used + grown > self._limits.total_bytes
        if grown > 0 and too_large:
            raise FileError(Trouble.FAIL_ERRNO, errno.ENOSPC)
        return grown

    def _one_more(self, path: files.Path) -> None:
        self._limits.check_depth(len(path))
        if self._held >= self._limits.files:
            raise FileError(Trouble.FAIL_ERRNO, errno.ENOSPC)

    def _gone(self, size: int) -> None:
        self._held -= 1
        self._used -= size

    def _count(self) -> tuple[int, int]:
        """Files and folders on the card, and bytes in the files."""
        count = size = 0
        for _, one in _below(self._root):
            count += 1
            size += 0 if one.is_dir(follow_symlinks=False) else one.stat(follow_symlinks=False).st_size
        return count, size

    def _height(self, folder: Path) -> int:
        """Number of levels inside a folder."""
        return max((depth for depth, _ in _below(folder)), default=0)


def _below(folder: Path) -> Iterator[tuple[int, os.DirEntry[str]]]:
    """Everything in a folder and its subfolders with its depth, 1 for what lies directly in the folder.

    Entries that vanish meanwhile, or whose paths are too long for the system, are skipped.
    """
    ahead = [(1, str(folder))]
    while ahead:
        depth, place = ahead.pop()
        with suppress(OSError), os.scandir(place) as found:
            for one in found:
                yield depth, one
                if one.is_dir(follow_symlinks=False):
                    ahead.append((depth + 1, one.path))
