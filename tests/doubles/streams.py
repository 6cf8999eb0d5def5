"""The messages that a telemetry stream sends of a snapshot."""

from __future__ import annotations

from typing import Any

from autopilot.services.identity import Identity
from autopilot.services.snapshot import Snapshot
from autopilot.services.telemetry import STREAMS
from autopilot.wire.codec import FrameWriter, decode


def sent(snapshot: Snapshot, message_id: int) -> list[Any]:
    """The messages of one stream, written and read."""
    writer = FrameWriter(1, 1)
    received, junk = decode(
        b"".join(writer.frame(one) for one in STREAMS[message_id].build(snapshot, Identity()))
    )
    assert junk == 0
    return [r.message for r in received]
