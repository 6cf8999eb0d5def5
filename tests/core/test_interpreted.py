"""Machine code and plain Python agree to the bit: the same flight with the compiler switched off."""

from __future__ import annotations

import hashlib
import os
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.doubles.craft import Craft

TICKS = 150
SCRIPT = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
from tests.core.test_interpreted import fingerprint
print(fingerprint())
"""


def fingerprint() -> str:
    """Of all answers and of the estimator's state after a short run; the vehicle is armed and rises."""
    craft = Craft(sensors="lab", seed=5)
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
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    assert done.stdout.strip() == fingerprint()
