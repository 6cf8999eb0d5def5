"""Ground stations that connect by TCP: each connection is a separate link, which ends with it."""

from __future__ import annotations

import socket
from contextlib import suppress

from autopilot.onboard.onboard import Onboard
from autopilot.services.records import Link
from autopilot.shell.options import Address
from autopilot.wire.codec import decodable_length

_MAX_READ_BYTES = 2048  # bytes from a client, before it is another's turn
_MAX_BACKLOG_BYTES = 262_144  # bytes that a client has not taken; beyond that it is stuck and is disconnected
MAX_CLIENTS = 16  # a new client replaces the one silent longest, if its silence has lasted this long:
SILENCE_US = 5_000_000  # a ground station sends a heartbeat every second


class _Client:
    """One connection: the received part of a frame, and the bytes that could not be sent yet."""

    def __init__(self, sock: socket.socket, now_us: int) -> None:
        self.socket = sock
        self.received_us = now_us
        self.received = b""
        self.unsent = b""

    def receive(self) -> bytes | None:
        """Whole frames that arrived; None at the end of the connection."""
        try:
            read = self.socket.recv(_MAX_READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            return None
        if not read:
            return None
        self.received += read
        end = decodable_length(self.received)
        frames, self.received = self.received[:end], self.received[end:]
        return frames

    def send(self, frames: bytes) -> bool:
        """Send, or keep what the client does not take yet; False if it is stuck or gone."""
        self.unsent += frames
        try:
            self.unsent = self.unsent[self.socket.send(self.unsent) :]
        except BlockingIOError:
            pass
        except OSError:
            return False
        return len(self.unsent) <= _MAX_BACKLOG_BYTES


class TcpServer:
    """Listens, serves any number of clients, and never waits for one."""

    def __init__(self, address: Address) -> None:
        """Raises OSError if the address cannot be used."""
        family = socket.getaddrinfo(*address, type=socket.SOCK_STREAM)[0][0]
        self._listener = socket.create_server(address, family=family)
        self._listener.setblocking(False)
        self._clients: dict[Link, _Client] = {}
        self._number = 0

    def receive(self, onboard: Onboard) -> tuple[bytes, Link] | None:
        """Accept a new connection; return the frames of one client, and of another at the next call."""
        self._accept(onboard)
        for link, client in list(self._clients.items()):
            frames = client.receive()
            if frames is None:
                self._disconnect(link, onboard)
            elif frames:
                client.received_us = onboard.now_us
                self._clients[link] = self._clients.pop(link)  # after the others
                return frames, link
        return None

    def send(self, link: Link, frames: bytes, onboard: Onboard) -> None:
        """Send frames to one client; no effect if it is gone."""
        client = self._clients.get(link)
        if client is not None and not client.send(frames):
            self._disconnect(link, onboard)

    def links(self) -> tuple[Link, ...]:
        """The connections."""
        return tuple(self._clients)

    def join(self, onboard: Onboard) -> None:
        """Serve the existing connections from now on."""
        for link in self._clients:
            onboard.add_link(link)

    def close(self) -> None:
        """End all connections."""
        self._listener.close()
        for client in self._clients.values():
            client.socket.close()

    def _accept(self, onboard: Onboard) -> None:
        with suppress(OSError):  # no new connection
            sock, _ = self._listener.accept()
            if len(self._clients) >= MAX_CLIENTS:
                most_silent = min(self._clients, key=lambda link: self._clients[link].received_us)
                if onboard.now_us - self._clients[most_silent].received_us < SILENCE_US:
                    sock.close()
                    return
                self._disconnect(most_silent, onboard)
            sock.setblocking(False)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._number += 1
            link: Link = ("tcp", self._number)
            self._clients[link] = _Client(sock, onboard.now_us)
            onboard.add_link(link)

    def _disconnect(self, link: Link, onboard: Onboard) -> None:
        self._clients.pop(link).socket.close()
        onboard.endpoint.remove_link(link)
