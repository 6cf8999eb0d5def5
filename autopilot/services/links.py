"""One link to clients: its streams, its sequence counters, and the messages that wait to be sent."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from autopilot.geometry.packed import Row
from autopilot.services.identity import AUTOPILOT_COMPONENT, DIALECT_COMPONENT
from autopilot.services.records import Source
from autopilot.services.stream_frames import StreamFrames
from autopilot.services.streams import Streams
from autopilot.wire.codec import FrameWriter, split_frames
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import Sign

DATAGRAM_BYTES = 1400  # below the MTU of any common network, with headers

SignerOf = Callable[[int], Sign | None]  # the signer of the frames of a link, by its number

Outgoing = tuple[Source, Any]  # sender and message


class LinkState:
    """The endpoint's data of a link; a new link begins with a HEARTBEAT."""

    __slots__ = (
        "announced",
        "frames",
        "last_received_us",
        "number",
        "queue",
        "signer",
        "streams",
        "writers",
    )

    def __init__(
        self,
        defaults: Mapping[int, int],
        now_us: int,
        number: int,
        signer: SignerOf,
        system: int,
        home: Home,
    ) -> None:
        self.number = number  # in the signatures
        self.signer = signer
        self.last_received_us = now_us
        self.streams = Streams(defaults, now_us)
        self.writers: dict[Source, FrameWriter] = {}
        own, dialect = self.writer((system, AUTOPILOT_COMPONENT)), self.writer((system, DIALECT_COMPONENT))
        self.frames = StreamFrames(own, dialect, home)
        self.queue: list[Outgoing] = []  # answers
        # streamed messages to be sent out of turn, in their order
        self.announced: dict[int, None] = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: None}

    def frame(self, source: Source, message: Any) -> bytes:
        """The next frame of a source on this link."""
        return self.writer(source).frame(message, self.signer(self.number))

    def writer(self, source: Source) -> FrameWriter:
        """The writer of the frames of a source on this link."""
        writer = self.writers.get(source)
        if writer is None:
            writer = self.writers[source] = FrameWriter(*source)
        return writer

    def datagrams(self, outgoing: Iterable[Outgoing | int], instant: Row) -> list[bytes]:
        """Frames in their order, as many in a datagram as fit. A number is a set of streams of `instant` as
        in `StreamFrames`; a link that signs must not have any."""
        sign, writers = self.signer(self.number), self.writers
        pieces: list[bytes] = []
        for item in outgoing:
            if isinstance(item, int):
                pieces.append(self.frames.frames(item, instant))
            else:
                source, message = item
                pieces.append((writers.get(source) or self.writer(source)).frame(message, sign))
        joined = b"".join(pieces)
        return [joined] if 0 < len(joined) <= DATAGRAM_BYTES else _packed_datagrams(split_frames(joined))


def _packed_datagrams(frames: Iterable[bytes]) -> list[bytes]:
    """Datagrams of these frames in their order, as many in each as fit."""
    datagrams: list[bytes] = []
    together: list[bytes] = []
    size = 0
    for frame in frames:
        size += len(frame)
        if size > DATAGRAM_BYTES:
            datagrams.append(b"".join(together))
            together, size = [], len(frame)
        together.append(frame)
    if together:
        datagrams.append(b"".join(together))
    return datagrams
