"""Machine code and plain Python agree to the bit: the same flight with the compiler switched off."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from typing import Any

from tests.doubles.craft import Craft
from tests.doubles.plain_python import in_plain_python

TICKS = 150


def fingerprint() -> str:
    """Hash of all answers and of the estimator's state after a short run; the vehicle is armed and rises."""
    craft = Craft(sensors="lab", seed=5, watched=True)
    for _ in range(40):
        craft.tick()
    craft.command(400, 1.0, 21196.0)
    craft.command(22, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0)
    for _ in range(TICKS):
        craft.tick()
    digest = hashlib.sha256(b"".join(craft.answers))
    for value in numbers(craft.estimate):
        digest.update(struct.pack("<d", value))
    return digest.hexdigest()


def numbers(record: Any) -> Iterator[float]:
    """All numbers of nested tuples, in order."""
    if isinstance(record, tuple):
        for item in record:
            yield from numbers(item)
    else:
        yield float(record)


def test_compiled_and_interpreted_flights_are_bit_equal() -> None:
    assert in_plain_python(fingerprint) == fingerprint()
