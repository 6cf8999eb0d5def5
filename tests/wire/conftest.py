"""Random messages of any class of the dialect, and how the two codecs are compared."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from autopilot.wire.dialect import plumbline as mavlink

_INTEGER_BITS = {"int8_t": 8, "int16_t": 16, "int32_t": 32, "int64_t": 64}
_SPECIAL_FLOATS = (0.0, -0.0, 1.0, float("inf"), float("-inf"), float("nan"), 1e-45, 3.4028234663852886e38)


def _number(kind: str, rng: np.random.Generator) -> Any:
    if kind in ("float", "double"):
        if rng.random() < 0.3:
            return float(rng.choice(_SPECIAL_FLOATS))
        value = float(rng.normal() * 10.0 ** rng.integers(-6, 7))
        return struct.unpack("<f", struct.pack("<f", value))[0] if kind == "float" else value
    bits = _INTEGER_BITS.get(kind.removeprefix("u"), 8)
    low, high = (0, 2**bits - 1) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    choice = rng.integers(4)
    if choice < 3:
        return (0, low, high)[int(choice)]
    return low + int.from_bytes(rng.bytes(8), "little") % (high - low + 1)


def _text(length: int, rng: np.random.Generator) -> bytes:
    """Empty, short or as long as the field, without NUL inside; sometimes a NUL at its end."""
    used = (0, int(rng.integers(0, length + 1)), length)[int(rng.integers(3))]
    text = rng.integers(1, 256, used, dtype=np.uint8).tobytes()
    return text + b"\0" if used < length and rng.random() < 0.5 else text


def random_message(message_type: Any, rng: np.random.Generator) -> Any:
    lengths = dict(zip(message_type.ordered_fieldnames, message_type.array_lengths, strict=True))
    values: list[Any] = []
    for name, kind in zip(message_type.fieldnames, message_type.fieldtypes, strict=True):
        if kind == "char":
            values.append(_text(lengths[name], rng))
        elif lengths[name]:
            values.append([_number(kind, rng) for _ in range(lengths[name])])
        else:
            values.append(_number(kind, rng))
    return message_type(*values)


def fields(message: Any) -> dict[str, Any]:
    """Type and fields, floats as their bits: NaN equals NaN, and 0.0 does not equal -0.0."""

    def bits(value: Any) -> Any:
        if isinstance(value, float):
            return struct.pack("<d", value)
        if isinstance(value, list | tuple):
            return [bits(one) for one in value]
        return value

    named = {name: bits(getattr(message, name)) for name in message.get_fieldnames()}
    return {"type": message.get_type(), "id": message.get_msgId(), **named}


@pytest.fixture(scope="session")
def any_message() -> Callable[[Any, np.random.Generator], Any]:
    return random_message


@pytest.fixture(scope="session")
def fields_of() -> Callable[[Any], dict[str, Any]]:
    return fields


@pytest.fixture(scope="session")
def reference() -> Callable[..., Any]:
    """pymavlink's own codec for one sender."""

    def make(system: int = 1, component: int = 25, sequence: int = 0) -> Any:
        codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        codec.seq = sequence
        codec.robust_parsing = True
        return codec

    return make
