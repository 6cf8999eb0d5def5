"""STATUSTEXT: one line for the operator, cut into chunks of 50 bytes if it is longer, and joined again."""

from __future__ import annotations

from typing import Any

from autopilot.wire.dialect import plumbline as mavlink

CHUNK = 50  # STATUSTEXT.text
_LAST_ID = 0xFFFF
_MAX_CHUNKS = 256  # STATUSTEXT.chunk_seq is a byte


class TextWriter:
    """Makes the messages of a text; the chunks of one text have the same number."""

    def __init__(self) -> None:
        self._id = 0

    def messages(self, severity: int, text: str) -> list[mavlink.MAVLink_statustext_message]:
        """The messages that carry `text`; characters that are not ASCII become question marks."""
        line = " ".join(text.split()).encode("ascii", errors="replace")[: CHUNK * _MAX_CHUNKS]
        if len(line) <= CHUNK:
            return [mavlink.MAVLink_statustext_message(severity, line)]
        self._id = self._id % _LAST_ID + 1
        # a full last chunk needs an empty one after it, since a NUL ends the text
        starts = range(0, min(len(line) + 1, CHUNK * _MAX_CHUNKS), CHUNK)
        return [
            mavlink.MAVLink_statustext_message(severity, line[start : start + CHUNK], self._id, number)
            for number, start in enumerate(starts)
        ]


class TextReader:
    """Joins the chunks of texts; those that arrive out of order are left out."""

    def __init__(self) -> None:
        self._chunks: dict[int, list[str]] = {}  # of the texts that are not complete, by their number

    def read(self, message: Any) -> str | None:
        """The text that a STATUSTEXT is or completes; None: it is to be continued."""
        text: str = message.text
        if not message.id:
            return text
        chunks = self._chunks.setdefault(message.id, [])
        if message.chunk_seq == len(chunks):
            chunks.append(text)
        if len(text.encode()) == CHUNK:
            return None
        del self._chunks[message.id]
        return "".join(chunks)
