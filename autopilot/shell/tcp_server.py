"""Ground stations that connect by TCP: each connection is a separate link, which ends with it."""

from __future__ import annotations

import socket
from contextlib import suppress

from autopilot.onboard.onboard import Onboard
from autopilot.services.records import Link
from autopilot.shell.options import Address
from autopilot.wire.codec import whole_frames

_LARGEST_READ = 2048  # bytes from a client, before it is another's turn
_LARGEST_BACKLOG = 262_144  # bytes that a client has not taken; beyond that it is stuck and is disconnected
MAX_CLIENTS = 16  # a new client replaces the one silent longest, if its silence has lasted this long:
SILENCE_US = 5_000_000  # a ground station sends a heartbeat every second


class _Client:
    """One connection: the received part of a frame, and the bytes that could not be sent yet."""

    def __init__(self, sock: socket.socket, now_us: int) -> None:
        self.socket = sock
        self.heard_us = now_us
        self.came = b""
        self.waiting = b""

    def take(self) -> bytes | None:
        """Whole frames that arrived; None at the end of the connection."""
        try:
            read = self.socket.recv(_LARGEST_READ)
        except BlockingIOError:
            return b""
        except OSError:
            return None
        if not read:
            return None
        self.came += read
        end = whole_frames(self.came)
        whole, self.came = self.came[:end], self.came[end:]
        return whole

    def give(self, frames: bytes) -> bool:
        """Send, or keep what the client does not take yet; False if it is stuck or gone."""
        self.waiting += frames
        try:
            self.waiting = self.waiting[self.socket.send(self.waiting) :]
        except BlockingIOError:
            pass
        except OSError:
            return False
        return len(self.waiting) <= _LARGEST_BACKLOG


class TcpServer:
    """Listens, serves any number of clients, and never waits for one."""

    def __init__(self, address: Address) -> None:
        """Raises OSError if the address cannot be used."""
        family = socket.getaddrinfo(*address, type=socket.SOCK_STREAM)[0][0]
        self._listener = socket.create_server(address, family=family)
        self._listener.setblocking(False)
        self._clients: dict[Link, _Client] = {}
        self._number = 0

    def take(self, onboard: Onboard) -> tuple[bytes, Link] | None:
        """Accept a new connection; return the frames of one client, and of another at the next call."""
        self._accept(onboard)
        for link, client in list(self._clients.items()):
            frames = client.take()
            if frames is None:
                self._let_go(link, onboard)
            elif frames:
                client.heard_us = onboard.now_us
                self._clients[link] = self._clients.pop(link)  # after the others
                return frames, link
        return None

    def send(self, link: Link, frames: bytes, onboard: Onboard) -> None:
        """Send frames to one client; no effect if it is gone."""
        client = self._clients.get(link)
        if client is not None and not client.give(frames):
            self._let_go(link, onboard)

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
                longest = min(self._clients, key=lambda link: self._clients[link].heard_us)
                if onboard.now_us - self._clients[longest].heard_us < SILENCE_US:
                    sock.close()
                    return
                self._let_go(longest, onboard)
            sock.setblocking(False)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._number += 1
            link: Link = ("tcp", self._number)
            self._clients[link] = _Client(sock, onboard.now_us)
            onboard.add_link(link)

    def _let_go(self, link: Link, onboard: Onboard) -> None:
        self._clients.pop(link).socket.close()
        onboard.endpoint.remove_link(link)
