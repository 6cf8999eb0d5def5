"""The pipe between `gcs fly` and the process that serves its page.

The flight tells what it hears, by messages that are dropped where the page falls behind: nothing ever waits
for a page. The page tells how many readers it has and what they ask of the vehicle.
"""

from __future__ import annotations

import json
import socket
import struct
import sys
from typing import Any, NamedTuple

VEHICLE, TRUTH, EVENT, COMMAND = b"V", b"T", b"E", b"C"
_BUFFER = 8 * 1024 * 1024  # as much of it as the system grants
_LONGEST = 70_000  # of one message
_LARGEST = 60_000  # bytes of datagrams in one message
_HEAD = struct.Struct("<cq")
# messages keep their borders; where the system has such pipes, their end is seen too
_KIND = socket.SOCK_SEQPACKET if sys.platform == "linux" else socket.SOCK_DGRAM


class Piece(NamedTuple):
    """One message: what kind, at which time of the vehicle (us), and what."""

    kind: bytes
    time_us: int
    body: bytes

    @property
    def event(self) -> dict[str, Any]:
        """The record of an EVENT."""
        record: dict[str, Any] = json.loads(self.body)
        return record


class FeedEnd:
    """One end of the pipe."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._socket.setblocking(False)
        for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
            self._socket.setsockopt(socket.SOL_SOCKET, option, _BUFFER)
        self.closed = False  # by the other side

    def fileno(self) -> int:
        return self._socket.fileno()

    def tell(self, kind: bytes, time_us: int, datagrams: list[bytes]) -> None:
        """Datagrams one behind the other, in as few messages as they fit."""
        body = b"".join(datagrams)
        if len(body) <= _LARGEST:
            self._send(kind, time_us, body)
            return
        for datagram in datagrams:
            self._send(kind, time_us, datagram)

    def tell_event(self, record: dict[str, Any]) -> None:
        """A record; in order with the datagrams, and as little waited for."""
        self._send(EVENT, 0, json.dumps(record).encode())

    def _send(self, kind: bytes, time_us: int, body: bytes) -> None:
        if not body or self.closed:
            return
        try:
            self._socket.send(_HEAD.pack(kind, time_us) + body)
        except BlockingIOError:
            return
        except OSError:
            self.closed = True

    def read(self, most: int = 256) -> list[Piece]:
        """What is there, without waiting; no more than `most` messages."""
        pieces: list[Piece] = []
        while len(pieces) < most and not self.closed:
            try:
                message = self._socket.recv(_LONGEST)
            except BlockingIOError:
                break
            except OSError:
                message = b""
            if len(message) < _HEAD.size:
                self.closed = True
                break
            kind, time_us = _HEAD.unpack_from(message)
            pieces.append(Piece(kind, time_us, message[_HEAD.size :]))
        return pieces

    def close(self) -> None:
        self._socket.close()


def pipe() -> tuple[FeedEnd, socket.socket]:
    """Our end, and the one for a child process."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, _KIND)
    return FeedEnd(ours), theirs


def inherited(descriptor: int) -> FeedEnd:
    """The end that our parent has left us."""
    return FeedEnd(socket.socket(fileno=descriptor))
