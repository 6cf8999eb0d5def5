"""MAVLink 2 signatures: only senders that know the secret key may command.

A signed frame ends with the number of the link, a time that grows from frame to frame, and the first six
bytes of SHA-256(key, frame, link, time). Times count 10 us since 2015-01-01 UTC.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Callable

from autopilot.wire.dialect import plumbline as mavlink

KEY_BYTES = 32
UNITS_PER_S = 100_000
MAX_TIMESTAMP = 2**48 - 1
_EPOCH_UNIX_US = 1_420_070_400_000_000
_UNIT_US = 10
_SIGNATURE = 13  # bytes: link, time, digest
_DIGEST = 6
_MAGIC, _SIGNED = 0xFD, 0x01
_NEW_STREAM_MAX_LAG = 60 * UNITS_PER_S  # the first time of a sender may be this far behind ours
_MAX_STREAMS = 256

# messages accepted without a signature: they change nothing, and radios cannot sign
ALLOWED_UNSIGNED = frozenset({mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_RADIO_STATUS})

Sign = Callable[[bytes], bytes]


class NoKeyError(ValueError):
    """A text that contains no key."""


def timestamp_of(unix_us: int) -> int:
    """The time of a signature, from a Unix time in us."""
    return min(max((unix_us - _EPOCH_UNIX_US) // _UNIT_US, 0), MAX_TIMESTAMP)


def key_of_text(text: str) -> bytes:
    """The key in a file: 64 hexadecimal digits, or a pass phrase, whose SHA-256 it is (as in MAVProxy)."""
    line = text.strip()
    if not line or "\n" in line:
        raise NoKeyError("must be one line: 64 hexadecimal digits, or a pass phrase")
    if len(line) == 2 * KEY_BYTES:
        try:
            return bytes.fromhex(line)
        except ValueError:
            pass
    return hashlib.sha256(line.encode()).digest()


class Signing:
    """One key with the latest times of all its users."""

    def __init__(self, key: bytes, timestamp: int = 0, floor: int = -1) -> None:
        """Frames signed at the time `floor` or before are not accepted."""
        if len(key) != KEY_BYTES:
            raise ValueError(f"key of {len(key)} bytes; must be {KEY_BYTES}")
        self.key = key
        self.timestamp = timestamp  # no frame of ours had a later one
        self._floor = floor
        self._last_timestamps: dict[
            tuple[int, int, int], int
        ] = {}  # link, system, component: their last time

    def advance(self, timestamp: int) -> None:
        """Take over the time of the clock, so that our times do not lag behind it."""
        self.timestamp = max(self.timestamp, timestamp)

    def signer(self, link_id: int) -> Sign:
        """The function that signs the frames of one link."""

        def sign(frame: bytes) -> bytes:
            self.timestamp = min(self.timestamp + 1, MAX_TIMESTAMP)
            tail = bytes((link_id,)) + self.timestamp.to_bytes(6, "little")
            return frame + tail + self._digest(frame + tail)

        return sign

    def accepts(self, frame: bytes, message_id: int, system: int, component: int) -> bool:
        """Whether to accept a whole frame, whose checksum is correct."""
        if frame[0] != _MAGIC or not frame[2] & _SIGNED:
            return message_id in ALLOWED_UNSIGNED
        body, digest = frame[:-_DIGEST], frame[-_DIGEST:]
        if not hmac.compare_digest(self._digest(body), digest):
            return False
        link_id = frame[-_SIGNATURE]
        timestamp = int.from_bytes(frame[-_SIGNATURE + 1 : -_DIGEST], "little")
        stream = (link_id, system, component)
        last_timestamp = self._last_timestamps.get(
            stream, max(self.timestamp - _NEW_STREAM_MAX_LAG - 1, self._floor)
        )
        if timestamp <= last_timestamp:
            return False  # not later than the sender's last frame
        if stream not in self._last_timestamps and len(self._last_timestamps) >= _MAX_STREAMS:
            return False
        self._last_timestamps[stream] = timestamp
        self.advance(timestamp)
        return True

    def _digest(self, signed: bytes) -> bytes:
        return hashlib.sha256(self.key + signed).digest()[:_DIGEST]
