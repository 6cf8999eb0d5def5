"""Text files named by the user: read whole, or refused with a reason. Imports nothing of Plumbline."""

from __future__ import annotations

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path

MAX_BYTES = 16 * 2**20  # ten times the largest plan that a vehicle accepts


class TextFileError(ValueError):
    """Why the file cannot be read, without its name."""


def text_of(path: Path) -> str:
    """The text of a file in UTF-8, without the byte order mark (BOM) that some editors put first;
    TextFileError if it is not a text file, is too long, or may have no end."""
    try:
        if path.is_dir():
            raise TextFileError("is a folder; must be a file")
        if path.exists() and not path.is_file():
            raise TextFileError("cannot be read: a device or a pipe, which may have no end")
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise TextFileError(f"cannot be read: more than {MAX_BYTES // 2**20} MiB")
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        utf_16 = error.object.startswith((BOM_UTF16_LE, BOM_UTF16_BE))
        found = (
            "not a text file in UTF-8 but in UTF-16; save it as UTF-8"
            if utf_16
            else f"not a text file in UTF-8 (byte {error.start})"
        )
        raise TextFileError(found) from None
    except FileNotFoundError:
        raise TextFileError("no such file") from None
    except OSError as error:
        raise TextFileError(f"cannot be read: {error.strerror}") from None
