"""A directory as the card that clients read and write by FILE_TRANSFER_PROTOCOL."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import takewhile
from pathlib import Path

from autopilot.services import files
from autopilot.services.files import Entry, ErrorCode, FileError, Limits

_ERROR_CODES = {
    errno.ENOENT: ErrorCode.NOT_FOUND,
    errno.EEXIST: ErrorCode.EXISTS,
    errno.EACCES: ErrorCode.PROTECTED,
    errno.EPERM: ErrorCode.PROTECTED,
    errno.EROFS: ErrorCode.PROTECTED,
    errno.EFBIG: ErrorCode.FAIL,
}


@contextmanager
def _as_file_errors() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        code = error.errno or errno.EIO
        file_error = _ERROR_CODES.get(code, ErrorCode.FAIL_ERRNO)
        raise FileError(file_error, code if file_error is ErrorCode.FAIL_ERRNO else 0) from None


class DirectoryCard:
    """A card kept in a directory, which it creates. Nothing outside can be reached, not even by links."""

    def __init__(self, root: Path, limits: Limits | None = None) -> None:
        root.mkdir(parents=True, exist_ok=True)
        self._root = root.resolve()
        self._limits = limits or Limits()
        self._entry_count, self._used_bytes = self._measure()  # files and folders, and bytes in the files

    def entries(self, path: files.Path, first: int = 0, max_count: int | None = None) -> list[Entry]:
        target = self._resolve(path)
        with _as_file_errors(), os.scandir(target) as listing:
            named = sorted((one.name, one) for one in listing if not one.is_symlink())
        entries = []
        for name, one in named[first : None if max_count is None else first + max_count]:
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
            target = self._resolve(path)
            before = target.stat().st_size if target.is_file() else None
            if before is None:
                self._check_new_entry(path)
            target.open("wb").close()
            self._entry_count += before is None
            self._used_bytes -= before or 0

    def write(self, path: files.Path, offset: int, data: bytes) -> None:
        with _as_file_errors():
            growth = max(0, self._growth(path, offset + len(data)))
            with self._file(path).open("r+b") as file:
                file.seek(offset)
                file.write(data)
            self._used_bytes += growth

    def truncate(self, path: files.Path, size: int) -> None:
        with _as_file_errors():
            growth = self._growth(path, size)
            os.truncate(self._file(path), size)
            self._used_bytes += growth

    def remove(self, path: files.Path) -> None:
        with _as_file_errors():
            target = self._file(path)
            size = target.stat().st_size
            target.unlink()
            self._count_removal(size)

    def rename(self, old: files.Path, new: files.Path) -> None:
        with _as_file_errors():
            source, target = self._resolve(old), self._resolve(new)
            if target.exists():
                raise FileError(ErrorCode.EXISTS)
            deeper = len(new) > len(old) and source.is_dir()
            self._limits.check_depth(len(new) + (self._depth_below(source) if deeper else 0))
            source.rename(target)

    def make_folder(self, path: files.Path) -> None:
        with _as_file_errors():
            self._check_new_entry(path)
            self._resolve(path).mkdir()
            self._entry_count += 1

    def remove_folder(self, path: files.Path) -> None:
        with _as_file_errors():
            self._resolve(path).rmdir()
            self._count_removal(0)

    def append(self, path: files.Path, data: bytes) -> None:
        """Append to a file, which is created if it does not exist; raises the system's OSError."""
        try:
            target = self._resolve(path)
        except FileError:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP)) from None
        new = [*takewhile(lambda one: not one.exists(), (target, *target.parents))]
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("ab") as file:
            self._entry_count += len(new)
            file.write(data)
            self._used_bytes += len(data)

    def remove_oldest(self, folder: files.Path, ending: str, max_bytes: int) -> None:
        """Remove the first files of a folder, by name, until the rest has at most `max_bytes`."""
        try:
            folder_path = self._resolve(folder)
        except FileError:
            return
        files_found = (
            sorted(file for file in folder_path.glob("*" + ending) if file.is_file())
            if folder_path.is_dir()
            else []
        )
        size = sum(file.stat().st_size for file in files_found)
        for file in files_found:
            if size <= max_bytes:
                return
            removed_bytes = file.stat().st_size
            file.unlink()
            size -= removed_bytes
            self._count_removal(removed_bytes)

    def _file(self, path: files.Path) -> Path:
        target = self._resolve(path)
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, "a folder")
        return target

    def _resolve(self, path: files.Path) -> Path:
        """The place of a path; none of its names may be a link."""
        target = self._root
        for name in path:
            target = target / name
            if target.is_symlink():
                raise FileError(ErrorCode.NOT_FOUND)
        return target

    def _growth(self, path: files.Path, size: int) -> int:
        """Bytes by which a file of this size exceeds the present one; FileError if they do not fit."""
        growth = size - self._file(path).stat().st_size
        too_large = size > self._limits.file_bytes or self._used_bytes + growth > self._limits.total_bytes
        if growth > 0 and too_large:
            raise FileError(ErrorCode.FAIL_ERRNO, errno.ENOSPC)
        return growth

    def _check_new_entry(self, path: files.Path) -> None:
        self._limits.check_depth(len(path))
        if self._entry_count >= self._limits.files:
            raise FileError(ErrorCode.FAIL_ERRNO, errno.ENOSPC)

    def _count_removal(self, size: int) -> None:
        self._entry_count -= 1
        self._used_bytes -= size

    def _measure(self) -> tuple[int, int]:
        """Files and folders on the card, and bytes in the files."""
        count = size = 0
        for _, one in _walk(self._root):
            count += 1
            size += 0 if one.is_dir(follow_symlinks=False) else one.stat(follow_symlinks=False).st_size
        return count, size

    def _depth_below(self, folder: Path) -> int:
        """Number of levels inside a folder."""
        return max((depth for depth, _ in _walk(folder)), default=0)


def _walk(folder: Path) -> Iterator[tuple[int, os.DirEntry[str]]]:
    """Everything in a folder and its subfolders with its depth, 1 for what lies directly in the folder.

    Entries that vanish meanwhile, or whose paths are too long for the system, are skipped.
    """
    pending = [(1, str(folder))]
    while pending:
        depth, folder_path = pending.pop()
        with suppress(OSError), os.scandir(folder_path) as entries:
            for one in entries:
                yield depth, one
                if one.is_dir(follow_symlinks=False):
                    pending.append((depth + 1, one.path))
