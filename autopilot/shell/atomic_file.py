"""Files that exist whole or not at all, whenever the process or the machine dies.

A file is written beside the old one, brought to the disk, and replaces it atomically; then the directory is
brought to the disk, so that the new name outlives a power failure. Texts end with the checksum of what
precedes: a lost bit on a disk could otherwise turn a number or a key into another.
"""

from __future__ import annotations

import os
import zlib
from contextlib import suppress
from pathlib import Path

_MARK = b"# crc32 "


class DamagedError(ValueError):
    """The file is not what was written."""


def seal(text: str) -> bytes:
    """The bytes of a text with its checksum as the last line, a comment in parameter files."""
    body = text.encode()
    return body + _MARK + _checksum_text(body)


def unseal(data: bytes) -> str:
    """The text that was sealed; DamagedError for anything else."""
    body, mark, check = data.rpartition(_MARK)
    if not mark:
        raise DamagedError("it has no checksum")
    if check != _checksum_text(body):
        raise DamagedError("its checksum is wrong")
    return body.decode()


def _checksum_text(body: bytes) -> bytes:
    return b"%08x\n" % zlib.crc32(body)


def write_atomically(path: Path, data: bytes, private: bool = False) -> None:
    """Replace a file by this content; OSError leaves the old one. `private`: readable by this user only."""
    new = path.with_name(f".{path.name}.new")  # a hidden name, no file of the user's
    new.unlink(missing_ok=True)  # it may be readable by others
    descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600 if private else 0o666)
    try:
        try:
            remaining = memoryview(data)
            while remaining:
                remaining = remaining[os.write(descriptor, remaining) :]
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        new.replace(path)
    except OSError:
        with suppress(OSError):
            new.unlink()
        raise
    _sync_directory(path.parent)


def remove(path: Path) -> None:
    """Remove a file permanently if it exists."""
    path.unlink(missing_ok=True)
    _sync_directory(path.parent)


def keep_copy(path: Path) -> Path:
    """Copy a damaged file, which may be repairable, to an unused name; return the new name."""
    copy = path.with_suffix(".corrupt")
    number = 1
    while copy.exists():
        number += 1
        copy = path.with_suffix(f".corrupt{number}")
    write_atomically(copy, path.read_bytes(), private=True)
    return copy


def _sync_directory(directory: Path) -> None:
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
