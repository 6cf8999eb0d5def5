"""A connection by TCP to a vehicle that accepts ground stations so: `autopilot --tcp`."""

from __future__ import annotations

import socket
from contextlib import suppress

from autopilot.wire.codec import decodable_length
from gcs.errors import GcsError
from gcs.shell.open_socket import OpenSocket

_CONNECT_S = 5.0
_READ_BYTES = 65_536


class TcpSocket(OpenSocket):
    """Has the methods of a `UdpSocket`; a datagram is here what has arrived of whole frames.

    When the vehicle closes the connection, it is silent from then on.
    """

    def __init__(self, host: str, port: int) -> None:
        self._peer = (host, port)
        self._received = b""
        try:
            self._socket = socket.create_connection(self._peer, timeout=_CONNECT_S)
        except OSError as error:
            raise GcsError(
                f"TCP {host}:{port} cannot be connected to: {error.strerror or error}; "
                f"does the vehicle listen there (autopilot --tcp {port})?"
            ) from None
        self._socket.settimeout(None)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def drain(self) -> list[bytes]:
        """All whole frames that have arrived, without waiting."""
        return [datagram for datagram, _ in self.drain_with_senders()]

    def drain_with_senders(self) -> list[tuple[bytes, tuple[str, int]]]:
        """As `drain`, with the address of the vehicle."""
        try:
            while read := self._socket.recv(_READ_BYTES, socket.MSG_DONTWAIT):
                self._received += read
            self._end()
        except BlockingIOError:
            pass
        except OSError:
            self._end()
        end = decodable_length(self._received)
        frames, self._received = self._received[:end], self._received[end:]
        return [(frames, self._peer)] if frames else []

    def _end(self) -> None:
        """Replace the connection, which has ended, by a socket on which nothing arrives."""
        self._socket.close()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def set_peer(self, peer: tuple[str, int]) -> None:
        """A connection has one peer."""

    def send(self, datagram: bytes) -> None:
        """Send to the vehicle; does nothing if the connection has ended."""
        with suppress(OSError):  # the next read notices the end
            self._socket.sendall(datagram)

    def send_to(self, datagram: bytes, peer: tuple[str, int]) -> None:
        """As `send`."""
        self.send(datagram)
