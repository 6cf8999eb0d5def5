"""STATUSTEXT: one line for the operator, cut into chunks of 50 bytes if it is longer, and joined again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from autopilot.wire.dialect import plumbline as mavlink

GAP = "..."  # in place of chunks that were lost
CHUNK = 50  # STATUSTEXT.text
_LAST_ID = 0xFFFF
_MAX_CHUNKS = 256  # STATUSTEXT.chunk_seq is a byte
_MAX_LISTED = 8  # numbers in one text


def listed(numbers: Sequence[int]) -> str:
    """The first of the numbers, for a text."""
    more = " ..." if len(numbers) > _MAX_LISTED else ""
    return ", ".join(map(str, numbers[:_MAX_LISTED])) + more


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
    """Joins the chunks of texts. A missing chunk is replaced by GAP unless it comes late."""

    def __init__(self) -> None:
        # of the texts that are to be continued, by their number; None: has not come
        self._chunks: dict[int, list[str | None]] = {}

    def read(self, message: Any) -> str | None:
        """The text that a STATUSTEXT is or completes; None: it is to be continued."""
        if not message.id:
            return str(message.text)
        if self.begins_text(message):
            self._chunks[message.id] = []
        chunks, seq = self._chunks[message.id], message.chunk_seq
        chunks += [None] * (seq + 1 - len(chunks))
        chunks[seq] = message.text
        if len(message.text.encode()) == CHUNK:
            return None
        text = self.unfinished(message.id)
        del self._chunks[message.id]
        return text

    def begins_text(self, message: Any) -> bool:
        """Whether a STATUSTEXT belongs to none of the texts that are to be continued.

        A sender that was restarted counts its texts from 1 again.
        """
        chunks = self._chunks.get(message.id, [])
        return (
            not message.id or not chunks or (message.chunk_seq == 0 and chunks[0] not in (None, message.text))
        )

    def unfinished(self, number: int) -> str:
        """What has come of a text that is to be continued."""
        chunks = self._chunks[number]
        pieces = [GAP if chunk is None else chunk for chunk in chunks]
        return "".join(
            piece for i, piece in enumerate(pieces) if chunks[i] is not None or i == 0 or chunks[i - 1]
        )
