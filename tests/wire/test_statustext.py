"""Texts in chunks, and what remains of them if chunks are lost, late or doubled."""

from __future__ import annotations

from typing import Any

import pytest

from autopilot.wire.statustext import CHUNK, GAP, TextReader, TextWriter

LONG = "".join(chr(ord("a") + i % 26) for i in range(3 * CHUNK + 7))
PIECES = [LONG[start : start + CHUNK] for start in range(0, len(LONG), CHUNK)]


def arrived(*numbers: int, text: str = LONG) -> list[Any]:
    """The chunks with these numbers, as they are read from the wire."""
    messages = TextWriter().messages(4, text)
    return [messages[number] for number in numbers]


def read(*numbers: int, reader: TextReader | None = None) -> list[str | None]:
    reader = reader or TextReader()
    return [reader.read(message) for message in arrived(*numbers)]


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ((0, 1, 2, 3), LONG),
        ((0, 2, 1, 3), LONG),
        ((0, 0, 1, 1, 2, 3), LONG),
        ((0, 3), PIECES[0] + GAP + PIECES[3]),
        ((1, 3), GAP + PIECES[1] + GAP + PIECES[3]),
        ((3,), GAP + PIECES[3]),
    ],
)
def test_the_last_chunk_ends_the_text(numbers: tuple[int, ...], text: str) -> None:
    assert read(*numbers) == [*[None] * (len(numbers) - 1), text]


@pytest.mark.parametrize("text", ["x" * CHUNK, "x" * (3 * CHUNK), "x" * (CHUNK + 1), "short"])
def test_any_text_comes_back(text: str) -> None:
    reader, count = TextReader(), len(TextWriter().messages(4, text))
    *before, last = (reader.read(message) for message in arrived(*range(count), text=text))
    assert (set(before) <= {None}, last) == (True, text)


def test_a_sender_that_begins_to_count_again_is_not_joined_to_its_past() -> None:
    reader = TextReader()
    assert read(0, 1, reader=reader) == [None, None]
    other = arrived(0, 1, text="Z" * (CHUNK + 3))
    assert [reader.read(message) for message in other] == [None, "Z" * (CHUNK + 3)]
