"""UDP sockets of the ground station. They send and receive bytes, which other modules interpret."""

from __future__ import annotations

import errno
import re
import secrets
import select
import socket
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Protocol

from gcs.errors import GcsError
from gcs.shell.open_socket import OpenSocket
from gcs.shell.tcp_socket import TcpSocket

DEFAULT_PORT = 14550
API_PORT = 14540
PAGE_PORT = 8090  # TCP, of the live page
LOOPBACK = "127.0.0.1"
ANY_HOST = "0.0.0.0"
_DATAGRAM = 65_535
_CHOSEN_PORTS = range(20_000, 32_000)  # systems choose from 32,768 (Linux) or from 49,152 (others)
_BUFFER = 4 * 1024 * 1024  # bytes: a second of the fast streams, in case a report is being written meanwhile


_ADDRESS = re.compile(r"(?:(udpin|udp|udpout|tcp|tcpout):(//)?)?(?:([^:/]*):)?(\d{1,5})", re.ASCII)


class AddressError(GcsError):
    """A text that is not a valid address."""


@dataclass(frozen=True)
class Address:
    """Where to meet a vehicle: with `listen` we wait there for its messages, otherwise we send first, or with
    `tcp` connect to it."""

    host: str
    port: int
    listen: bool = True
    tcp: bool = False
    system: int | None = None  # id of the vehicle among several; None: the one that is heard first
    signing_key: bytes | None = field(default=None, repr=False)  # key with which messages are signed

    def __str__(self) -> str:
        scheme = "tcp:" if self.tcp else "" if self.listen else "udpout:"
        return f"{scheme}{self.host}:{self.port}"

    @property
    def link(self) -> str:
        """The address for texts, with the protocol."""
        return f"TCP {self.host}:{self.port}" if self.tcp else f"UDP {self}"


SITL_TRUTH = Address(LOOPBACK, 14560)  # where sitl sends the truth by default


def parse_address(text: str) -> Address:
    """`14550`, `HOST:PORT`, `udpin:HOST:PORT` (wait there), `udpout:HOST:PORT` (send first), or
    `tcp:HOST:PORT`.

    As other programs write it: `udp:` is `udpin:`, `tcpout:` is `tcp:`, and `//` may follow; `udpin://:PORT`
    are all interfaces.
    """
    match = _ADDRESS.fullmatch(text)
    scheme, slashes, host, port = match.groups() if match else (None, None, None, "0")
    listen, tcp = scheme in (None, "udpin", "udp"), scheme in ("tcp", "tcpout")
    if host == "" and slashes and listen:
        host = ANY_HOST
    if host == "" or not 0 < int(port) < 65536:
        forms = "PORT, HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT or tcp:HOST:PORT"
        raise AddressError(f"address {text!r}; must be {forms}, with a port of 1 ... 65535")
    return Address(host or LOOPBACK, int(port), listen, tcp)


def free_port(count: int = 1, among: range = _CHOSEN_PORTS) -> int:
    """The first of `count` consecutive ports on the loopback interface that neither UDP nor TCP uses now.

    Systems do not give these ports to sockets that ask for any, so that the port is still free when the
    program for which it is meant opens it. GcsError if none is free.
    """
    first = secrets.choice(among)
    for port in chain(range(first, among.stop), range(among.start, first)):
        if all(_is_free(port + i) for i in range(count)):
            return port
    raise GcsError(f"all ports of {LOOPBACK} from {among[0]} to {among[-1]} are in use")


def _is_free(port: int) -> bool:
    try:
        with socket.create_server((LOOPBACK, port)), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            udp.bind((LOOPBACK, port))
    except OSError:
        return False
    return True


class UdpSocket(OpenSocket):
    """One socket; answers go to the sender of the last datagram."""

    def __init__(self, host: str = LOOPBACK, port: int = 0, peer: tuple[str, int] | None = None) -> None:
        self._peer = peer
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise GcsError(_bind_problem(host, port, error)) from None
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        self._timeout_s = 0.0  # receive timeout of the socket

    @property
    def address(self) -> str:
        """HOST:PORT, as options of other programs take it."""
        host, port = self._socket.getsockname()[:2]
        return f"{host}:{port}"

    def drain(self) -> list[bytes]:
        """All datagrams that have arrived, without waiting."""
        found = self.drain_with_senders()
        if found:
            self._peer = found[-1][1]
        return [datagram for datagram, _ in found]

    def drain_with_senders(self) -> list[tuple[bytes, tuple[str, int]]]:
        """As `drain`, each datagram with the address of its sender, and without changing the peer."""
        found: list[tuple[bytes, tuple[str, int]]] = []
        while True:
            try:
                found.append(self._socket.recvfrom(_DATAGRAM, socket.MSG_DONTWAIT))
            except ConnectionError:
                continue
            except BlockingIOError:
                return found

    def wait(self, timeout_s: float) -> list[bytes]:
        """The next datagram, if one arrives within the time; takes one system call, with `select` three."""
        if timeout_s != self._timeout_s:
            self._timeout_s = timeout_s
            seconds = int(timeout_s)
            value = struct.pack("ll", seconds, round((timeout_s - seconds) * 1e6))
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, value)
        try:
            datagram, self._peer = self._socket.recvfrom(_DATAGRAM)
        except (ConnectionError, BlockingIOError):
            return []
        return [datagram]

    def set_peer(self, peer: tuple[str, int]) -> None:
        """Send to this address from now on."""
        self._peer = peer

    def send(self, datagram: bytes) -> None:
        """Send to the peer; does nothing if there is none yet or it does not listen."""
        if self._peer is not None:
            self.send_to(datagram, self._peer)

    def send_to(self, datagram: bytes, peer: tuple[str, int]) -> None:
        """Send to that address; does nothing if no program listens there."""
        try:
            self._socket.sendto(datagram, socket.MSG_DONTWAIT, peer)
        except (ConnectionError, BlockingIOError):
            return  # UDP: the protocols above repeat what was lost
        except OSError as error:
            raise GcsError(f"UDP to {peer[0]}:{peer[1]}: {error.strerror}") from None


VehicleLink = UdpSocket | TcpSocket


def open_address(address: Address) -> VehicleLink:
    """The socket for this address of a vehicle."""
    if address.tcp:
        return TcpSocket(address.host, address.port)
    if address.listen:
        return UdpSocket(address.host, address.port)
    try:
        host = socket.gethostbyname(address.host)
    except OSError as error:
        raise GcsError(f"host {address.host!r}: {error.strerror or error}") from None
    return UdpSocket(ANY_HOST if not host.startswith("127.") else LOOPBACK, 0, peer=(host, address.port))


class Readable(Protocol):
    """A socket, or an object that has one."""

    def fileno(self) -> int:
        """Its file descriptor."""


def wait(sockets: Sequence[Readable], timeout_s: float) -> None:
    """Wait until one of them has a datagram, or the time has passed."""
    select.select(sockets, [], [], max(timeout_s, 0.0))


def monotonic_us() -> int:
    """The wall clock (monotonic) of everything that does not run in lockstep."""
    return time.monotonic_ns() // 1000


def unix_us() -> int:
    """Time since 1970, for log records."""
    return time.time_ns() // 1000


def _bind_problem(host: str, port: int, error: OSError | OverflowError) -> str:
    where = f"UDP {host}:{port}"
    if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
        other = 14540 if port != 14540 else DEFAULT_PORT
        return (
            f"{where} is in use by another program (a ground station?); "
            f"close it or choose another port, e.g. --connect {other}"
        )
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return f"{where} cannot be opened: {reason}; choose another with --connect HOST:PORT"
