"""Streams written in machine code, compared with those that the general writer makes of the same instant."""

from __future__ import annotations

import math
from collections import Counter
from types import SimpleNamespace
from typing import Any, get_type_hints

import numpy as np
import pytest

from autopilot.geometry.packed import unpack, width
from autopilot.services.endpoint import VehicleEndpoint
from autopilot.services.identity import AUTOPILOT_COMPONENT, DIALECT_COMPONENT, Identity
from autopilot.services.instant import Instant
from autopilot.services.links import DATAGRAM_BYTES
from autopilot.services.records import Verdict
from autopilot.services.stream_frames import BITS, StreamFrames
from autopilot.services.telemetry import STREAMS
from autopilot.vehicle.layout import MAX_ROTORS, MIN_ROTORS
from autopilot.wire.codec import FrameWriter, decode, split_frames
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import Signing
from tests.services.conftest import make_table

HOME = Home(-33.5, 179.9999, 120.0)  # beside the date line
ALL = sum(BITS.values())
KINDS = [get_type_hints(Instant)[name] for name in Instant._fields]
ROTORS = sum(width(kind) for kind in KINDS[: Instant._fields.index("rotors")])


def row_of(rng: np.random.Generator, hostile: bool) -> Any:
    """A packed instant; `hostile`: also with numbers beyond float32, infinite ones and NaN."""
    row = rng.normal(size=width(Instant))
    if hostile:
        row *= 10.0 ** rng.integers(-50, 60, size=len(row))
        row[rng.random(len(row)) < 0.05] = math.inf
        row[rng.random(len(row)) < 0.05] = -math.inf
        row[rng.random(len(row)) < 0.05] = math.nan
        row[rng.random(len(row)) < 0.1] = 0.0
    at = 0
    for kind in KINDS:
        if kind in (int, bool):
            row[at] = rng.integers(0, 200) if kind is int else rng.integers(0, 2)
        at += width(kind)
    row[0] = rng.integers(0, 2**50)
    row[ROTORS] = rng.integers(MIN_ROTORS, MAX_ROTORS + 1)
    return row


def made_one_by_one(streams: int, said: Instant, writers: dict[int, FrameWriter]) -> bytes:
    snapshot: Any = SimpleNamespace(**said._asdict(), home=HOME)
    frames = []
    for key, bit in BITS.items():
        if streams & bit:
            writer = writers[STREAMS[key].component]
            frames += [writer.frame(message) for message in STREAMS[key].build(snapshot, Identity())]
    return b"".join(frames)


def numbers(datagram: bytes) -> list[tuple[int, int, int, list[Any]]]:
    """(sequence, component, id, fields) of each frame, NaN as a word: the sign of a NaN does not count."""
    received, junk = decode(datagram)
    assert junk == 0
    found = []
    for one in received:
        message = one.message
        fields = (getattr(message, name) for name in message.fieldnames)
        values = [value for field in fields for value in (field if isinstance(field, list) else [field])]
        said = ["NaN" if isinstance(value, float) and math.isnan(value) else value for value in values]
        found.append((one.sequence, one.component, one.id, said))
    return found


@pytest.mark.parametrize("hostile", [False, True])
def test_frames_are_those_of_the_general_writer(hostile: bool) -> None:
    rng = np.random.default_rng(1)
    own, dialect = FrameWriter(7, AUTOPILOT_COMPONENT), FrameWriter(7, DIALECT_COMPONENT)
    link = StreamFrames(own, dialect, HOME)
    writers = {component: FrameWriter(7, component) for component in (AUTOPILOT_COMPONENT, DIALECT_COMPONENT)}
    for _ in range(600):
        row, streams = row_of(rng, hostile), int(rng.integers(1, ALL + 1))
        made, expected = link.frames(streams, row), made_one_by_one(streams, unpack(Instant, row, 0), writers)
        if hostile:
            assert numbers(made) == numbers(expected)
        else:
            assert made == expected


def test_they_stand_in_the_order_of_the_streams() -> None:
    assert [key for key in STREAMS if key in BITS] == list(BITS)
    assert list(BITS.values()) == [1 << i for i in range(len(BITS))]


class _Heard:
    """An endpoint with one link and given instants, and what a ground station receives from it."""

    def __init__(self, by_kernel: bool, snap: Any, signing: Signing | None = None) -> None:
        self.endpoint = VehicleEndpoint(Identity(), Home(), make_table(), signing=signing)
        self.endpoint.add_link("gcs")
        self.by_kernel, self.snap = by_kernel, snap
        self.row = row_of(np.random.default_rng(5), False)
        self.row[0] = 0.0

    def ask(self, message_id: int, interval_us: int, now_us: int) -> None:
        numbers = (float(message_id), float(interval_us), *(0.0,) * 5)
        asked = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, *numbers)
        frame = FrameWriter(255, 190).frame(asked)
        self.endpoint.receive(frame, "gcs", now_us, lambda _: Verdict(mavlink.MAV_RESULT_ACCEPTED))

    def poll(self, now_us: int) -> list[bytes]:
        row = self.row.copy()
        row[0] = now_us
        known = unpack(Instant, row, 0)._asdict()
        known.pop("accel_quad")
        snapshot = self.snap(**known)
        snapshot.instant = row if self.by_kernel else None
        return [datagram for _, datagram in self.endpoint.poll(lambda: snapshot, now_us)]


def test_a_link_hears_the_same_by_either_way(snap: Any) -> None:
    """With rates that change on the way, answers between the streams, and full datagrams."""
    said = []
    for by_kernel in (False, True):
        heard = _Heard(by_kernel, snap)
        datagrams: list[list[bytes]] = []
        for tick in range(600):
            if tick == 100:
                for key in BITS:
                    heard.ask(key, 8000, tick * 4000)
            if tick == 300:
                for key in STREAMS:
                    heard.ask(key, 4000, tick * 4000)
            datagrams.append(heard.poll(tick * 4000))
        said.append(datagrams)
    assert said[0] == said[1]
    assert max(len(datagram) for tick in said[1] for datagram in tick) <= DATAGRAM_BYTES
    assert max(map(len, said[1])) > 1  # full datagrams
    heard_of = Counter(one.id for tick in said[1] for datagram in tick for one in decode(datagram)[0])
    assert all(heard_of[key] > 300 for key in BITS)


def test_a_signed_link_signs_them(snap: Any) -> None:
    heard = _Heard(True, snap, Signing(bytes(32), 1))
    frames = [frame for datagram in heard.poll(0) for frame in split_frames(datagram)]
    ids = {one.id for frame in frames for one in decode(frame)[0]}
    assert ids > set(BITS)
    assert all(frame[2] == 1 for frame in frames)  # the flag of a signed frame
