"""The pipe between `gcs fly` and the process that serves its page.

The flight sends the datagrams that it receives, in messages that are dropped if the page falls behind:
nothing ever waits for a page. The page sends how many readers it has and what they request of the vehicle.
"""

from __future__ import annotations

import json
import socket
import struct
import sys
from typing import Any, NamedTuple

VEHICLE, TRUTH, EVENT, COMMAND = b"V", b"T", b"E", b"C"
_BUFFER = 8 * 1024 * 1024  # bytes; the system may grant less
_MAX_MESSAGE = 70_000  # bytes of one message
_MAX_BODY = 60_000  # bytes of datagrams in one message
_HEADER = struct.Struct("<cq")
# both kinds preserve message boundaries; SOCK_SEQPACKET, where available, also shows that the pipe was closed
_KIND = socket.SOCK_SEQPACKET if sys.platform == "linux" else socket.SOCK_DGRAM


class FeedMessage(NamedTuple):
    """One message: its kind, its time on the vehicle's clock (us), and its contents."""

    kind: bytes
    time_us: int
    body: bytes

    @property
    def event(self) -> dict[str, Any]:
        """The record that an EVENT contains."""
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

    def send_datagrams(self, kind: bytes, time_us: int, datagrams: list[bytes]) -> None:
        """Send datagrams: joined in one message if they fit, otherwise one message each."""
        body = b"".join(datagrams)
        if len(body) <= _MAX_BODY:
            self._send(kind, time_us, body)
            return
        for datagram in datagrams:
            self._send(kind, time_us, datagram)

    def send_event(self, record: dict[str, Any]) -> None:
        """Send a record, in order with the datagrams and likewise without waiting."""
        self._send(EVENT, 0, json.dumps(record).encode())

    def _send(self, kind: bytes, time_us: int, body: bytes) -> None:
        if not body or self.closed:
            return
        try:
            self._socket.send(_HEADER.pack(kind, time_us) + body)
        except BlockingIOError:
            return
        except OSError:
            self.closed = True

    def read(self, max_count: int = 256) -> list[FeedMessage]:
        """The messages that have arrived, without waiting, but at most `max_count`."""
        messages: list[FeedMessage] = []
        while len(messages) < max_count and not self.closed:
            try:
                message = self._socket.recv(_MAX_MESSAGE)
            except BlockingIOError:
                break
            except OSError:
                message = b""
            if len(message) < _HEADER.size:
                self.closed = True
                break
            kind, time_us = _HEADER.unpack_from(message)
            messages.append(FeedMessage(kind, time_us, message[_HEADER.size :]))
        return messages

    def close(self) -> None:
        self._socket.close()


def feed_pipe() -> tuple[FeedEnd, socket.socket]:
    """The end for this process, and the one for a child process."""
    parent_end, child_end = socket.socketpair(socket.AF_UNIX, _KIND)
    return FeedEnd(parent_end), child_end


def inherited_feed(descriptor: int) -> FeedEnd:
    """The end that was inherited from the parent process."""
    return FeedEnd(socket.socket(fileno=descriptor))
