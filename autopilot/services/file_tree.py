"""The vehicle's file tree: a card that clients may write, beside files that are made when they are read.

/fs/microsd/...                    the card, with the flight logs in log/
/@PARAM/param.pck                  all parameters packed (ArduPilot's format)
/@MISSION/mission.dat              the mission in force (ArduPilot's format)
/etc/extras/component_general.json what metadata there is
/etc/extras/parameters.json        names, units, ranges and texts of the parameters
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from autopilot.services.files import Card, Entry, FileError, Path, Trouble, path_of

CARD: Path = ("fs", "microsd")
_NO_INVERSION = 0xFFFFFFFF

# the bytes of a made file, given what stood behind '?' in its name
Maker = Callable[[Mapping[str, str]], bytes]


def checksum(data: bytes, before: int = 0) -> int:
    """CRC-32 as FILE_TRANSFER_PROTOCOL and the component metadata count it: nothing is inverted."""
    return zlib.crc32(data, before ^ _NO_INVERSION) ^ _NO_INVERSION


@dataclass(frozen=True, slots=True)
class OpenFile:
    """A file as a session holds it: made bytes, or a place on the card."""

    path: Path
    made: bytes | None
    writable: bool


class FileTree:
    """All paths that a client can name."""

    def __init__(self, card: Card, made: Mapping[Path, Maker]) -> None:
        self.card = card
        self._made = dict(made)
        self._folders: dict[Path, set[str]] = {}
        for path in (*self._made, (*CARD, "")):
            for depth in range(len(path) - 1):
                self._folders.setdefault(path[:depth], set()).add(path[depth])
        self.protected: Path | None = None  # on the card, being written by the vehicle itself

    def entries(self, text: bytes, first: int = 0, most: int | None = None) -> list[Entry]:
        """What is in a folder, by name: at most so many entries from the first one on."""
        path = path_of(text)
        on_card = _on_card(path)
        if on_card is not None:
            return self.card.entries(on_card, first, most)
        folders = self._folders.get(path, set())
        files = [p for p in self._made if p[:-1] == path]
        if not folders and not files:
            raise FileError(Trouble.NOT_FOUND)
        found = [Entry(name, 0, True) for name in folders]
        found += [Entry(file[-1], len(self._made[file]({})), False) for file in files]
        return sorted(found)[first : None if most is None else first + most]

    def open(self, text: bytes) -> OpenFile:
        """An existing file, to be read."""
        name, _, query = text.partition(b"?")
        path = path_of(name)
        maker = self._made.get(path)
        if maker is not None:
            return OpenFile(path, maker(_query(query)), False)
        path = self._card_path(path_of(text), Trouble.NOT_FOUND)
        self.card.size(path)
        return OpenFile(path, None, False)

    def open_to_write(self, text: bytes, empty: bool) -> OpenFile:
        """A file of the card, made if there is none and emptied if asked."""
        path = self._writable(text)
        if empty or not self._exists(path):
            self.card.create(path)
        return OpenFile(path, None, True)

    def size(self, file: OpenFile) -> int:
        """Bytes in an open file at present."""
        return len(file.made) if file.made is not None else self.card.size(file.path)

    def read(self, file: OpenFile, offset: int, size: int) -> bytes:
        """At most `size` bytes; FileError END_OF_FILE where there are none."""
        if file.made is not None:
            data = file.made[offset : offset + size]
        else:
            data = self.card.read(file.path, offset, size)
        if not data:
            raise FileError(Trouble.END_OF_FILE)
        return data

    def write(self, file: OpenFile, offset: int, data: bytes) -> None:
        """Put data into a file opened to be written."""
        if not file.writable or file.path == self.protected:
            raise FileError(Trouble.PROTECTED)
        self.card.write(file.path, offset, data)

    def truncate(self, text: bytes, size: int) -> None:
        """Cut a file of the card, or fill it up with zeros."""
        self.card.truncate(self._writable(text), size)

    def remove(self, text: bytes) -> None:
        """Take a file off the card."""
        self.card.remove(self._writable(text))

    def rename(self, old: bytes, new: bytes) -> None:
        """Move within the card."""
        self.card.rename(self._writable(old), self._writable(new))

    def make_folder(self, text: bytes) -> None:
        """An empty folder on the card."""
        self.card.make_folder(self._writable(text, Trouble.EXISTS))

    def remove_folder(self, text: bytes) -> None:
        """Take an empty folder off the card."""
        self.card.remove_folder(self._writable(text))

    def _exists(self, path: Path) -> bool:
        try:
            self.card.size(path)
        except FileError:
            return False
        return True

    def _writable(self, text: bytes, at_root: Trouble = Trouble.PROTECTED) -> Path:
        """The path on the card, which is not its root nor what the vehicle writes itself."""
        path = self._card_path(path_of(text), Trouble.PROTECTED)
        if not path:
            raise FileError(at_root)
        if self.protected is not None and self.protected[: len(path)] == path:
            raise FileError(Trouble.PROTECTED)
        return path

    def _card_path(self, path: Path, elsewhere: Trouble) -> Path:
        on_card = _on_card(path)
        if on_card is None:
            raise FileError(elsewhere)
        return on_card


def _on_card(path: Path) -> Path | None:
    return path[len(CARD) :] if path[: len(CARD)] == CARD else None


def _query(text: bytes) -> dict[str, str]:
    """`a=1&b=2` behind a '?'."""
    words = text.split(b"\0", 1)[0].decode("ascii", errors="replace").split("&")
    return {name: value for name, _, value in (word.partition("=") for word in words) if name}
