"""A mission on disk: what was written is read; anything else gives a reason and no mission."""

from __future__ import annotations

import math
import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.services.mission_store import CorruptMission, StoredMission, deserialise, serialise
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import WireItem

HOME = Home()
CAMERA = WireItem(2, 2000, 0, 1, math.nan, -0.0, 0.5, math.inf, 2**31 - 1, -(2**31), math.nan)


@pytest.mark.parametrize("count", [0, 1, 100])
def test_round_trip(items, count):
    sent = items(count) if count else ()
    read = deserialise(serialise(sent), HOME)
    assert isinstance(read, StoredMission)
    assert read.items == sent


def test_bits_of_nan_survive():
    data = serialise((CAMERA,))
    read = deserialise(data, HOME)
    assert isinstance(read, StoredMission)
    assert serialise(read.items) == data


@given(st.data())
def test_any_damage_is_noticed(data):
    whole = serialise((CAMERA,) * 3)
    place = data.draw(st.integers(0, len(whole) - 1))
    bit = data.draw(st.integers(0, 7))
    damaged = bytearray(whole)
    damaged[place] ^= 1 << bit
    assert isinstance(deserialise(bytes(damaged), HOME), CorruptMission)


@given(st.binary(max_size=200))
def test_any_bytes_are_a_value(data):
    assert isinstance(deserialise(data, HOME), CorruptMission)


def test_every_cut_is_noticed(items):
    whole = serialise(items(2))
    for end in range(len(whole)):
        assert isinstance(deserialise(whole[:end], HOME), CorruptMission)


def test_reasons_can_be_read(items):
    whole = serialise(items(2))

    def reason(body: bytes) -> str:
        read = deserialise(body + struct.pack("<I", zlib.crc32(body)), HOME)
        assert isinstance(read, CorruptMission)
        return read.reason

    assert "version 9" in reason(whole[:4] + b"\x09\x00" + whole[6:-4])
    assert "length" in reason(whole[:6] + b"\x03\x00" + whole[8:-4])
    unflyable = serialise((CAMERA._replace(command=84),))
    assert "84" in reason(unflyable[:-4])
