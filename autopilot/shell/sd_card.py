"""A directory as the card that clients read and write by FILE_TRANSFER_PROTOCOL."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
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
    """A card kept in a directory, which it makes. Nothing outside it can be reached, not by links either."""

    def __init__(self, root: Path, limits: Limits | None = None) -> None:
        root.mkdir(parents=True, exist_ok=True)
        self._root = root.resolve()
        self._limits = limits or Limits()
        self._used = self._count()[1]  # bytes, at least: what is taken away counts until a file is made

    def entries(self, path: files.Path) -> list[Entry]:
        with _as_file_errors(), os.scandir(self._at(path)) as found:
            entries = []
            for one in found:
                if one.is_symlink():
                    continue
                status = one.stat(follow_symlinks=False)
                size = 0 if one.is_dir() else status.st_size
                entries.append(Entry(one.name, size, one.is_dir(), int(status.st_mtime)))
        return sorted(entries)

    def size(self, path: files.Path) -> int:
        with _as_file_errors():
            return self._file(path).stat().st_size

    def read(self, path: files.Path, offset: int, size: int) -> bytes:
        with _as_file_errors(), self._file(path).open("rb") as file:
            file.seek(offset)
            return file.read(size)

    def create(self, path: files.Path) -> None:
        with _as_file_errors():
            self._one_more()
            self._at(path).open("wb").close()

    def write(self, path: files.Path, offset: int, data: bytes) -> None:
        with _as_file_errors():
            self._room(path, offset + len(data))
            with self._file(path).open("r+b") as file:
                file.seek(offset)
                file.write(data)

    def truncate(self, path: files.Path, size: int) -> None:
        with _as_file_errors():
            self._room(path, size)
            os.truncate(self._file(path), size)

    def remove(self, path: files.Path) -> None:
        with _as_file_errors():
            self._file(path).unlink()

    def rename(self, old: files.Path, new: files.Path) -> None:
        with _as_file_errors():
            target = self._at(new)
            if target.exists():
                raise FileError(Trouble.EXISTS)
            self._at(old).rename(target)

    def make_folder(self, path: files.Path) -> None:
        with _as_file_errors():
            self._one_more()
            self._at(path).mkdir()

    def remove_folder(self, path: files.Path) -> None:
        with _as_file_errors():
            self._at(path).rmdir()

    def append(self, path: files.Path, data: bytes) -> None:
        """Write behind the end of a file, which is made if there is none; OSError as the system says."""
        try:
            place = self._at(path)
        except FileError:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP)) from None
        place.parent.mkdir(parents=True, exist_ok=True)
        with place.open("ab") as file:
            file.write(data)

    def make_room(self, folder: files.Path, ending: str, most_bytes: int) -> None:
        """Take away the first files of a folder, by name, until the rest is no more than that."""
        try:
            place = self._at(folder)
        except FileError:
            return
        found = sorted(file for file in place.glob("*" + ending) if file.is_file()) if place.is_dir() else []
        size = sum(file.stat().st_size for file in found)
        for file in found:
            if size <= most_bytes:
                return
            size -= file.stat().st_size
            file.unlink()

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

    def _room(self, path: files.Path, size: int) -> None:
        grown = size - self._file(path).stat().st_size
        if grown <= 0:
            return
        if size > self._limits.file_bytes or self._used + grown > self._limits.total_bytes:
            raise FileError(Trouble.FAIL_ERRNO, errno.ENOSPC)
        self._used += grown

    def _one_more(self) -> None:
        count, self._used = self._count()
        if count >= self._limits.files:
            raise FileError(Trouble.FAIL_ERRNO, errno.ENOSPC)

    def _count(self) -> tuple[int, int]:
        """Files and folders on the card, and bytes in them."""
        found = [place.lstat() for place in self._root.rglob("*")]
        return len(found), sum(status.st_size for status in found)
