"""The sockets towards ground stations: a flood must not stop the clock, and each link has a turn."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest

from autopilot.services.endpoint import MAX_GARBAGE_BYTES, VehicleEndpoint
from autopilot.services.identity import Identity
from autopilot.services.records import Verdict
from autopilot.shell.ground import AutopilotError, GroundStations, listen
from autopilot.shell.options import StopRequest
from autopilot.shell.storage_worker import StorageWorker
from autopilot.shell.tcp_server import MAX_CLIENTS, SILENCE_US, TcpServer
from autopilot.wire import codec
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.parameter_table import ParameterTable
from gcs.shell.link import LOOPBACK, free_port

SLOW_S = 1e-3  # for one message: more than a tick has for all
HEARS_S = 0.1  # within which a datagram arrives
MOST_TICKS = 50  # until a datagram that had to wait for a later tick is sent
MOST_READ = 2048  # bytes read at a time, from a datagram or a TCP client
MOST_PACKED = 1400  # bytes of messages sent together, which a network does not divide
LONGEST = 65_507  # bytes that a datagram can have


def test_a_port_that_is_taken_is_told_in_words_with_the_way_out() -> None:
    with socket.create_server((LOOPBACK, 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(AutopilotError) as error:
            listen((LOOPBACK, port))
    told = f"cannot listen on TCP {LOOPBACK}:{port}: address already in use; is another autopilot running? "
    assert str(error.value) == told + "choose another with --tcp"


def pings(first: int, count: int) -> bytes:
    writer = FrameWriter(255, 190)
    return b"".join(writer.frame(m.MAVLink_ping_message(0, seq, 0, 0)) for seq in range(first, first + count))


class Watch:
    """A clock that moves only while a datagram is handled."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def perf_counter(self) -> float:
        return self.now_s


class Slow:
    """An onboard software that is slow with each datagram."""

    def __init__(self, watch: Watch) -> None:
        self.now_us = 0
        self._watch = watch
        self.heard: list[tuple[Any, list[int]]] = []
        self.links: list[Any] = []
        self.said: list[tuple[Any, bytes]] = []
        self.endpoint = SimpleNamespace(remove_link=self.links.remove)

    def add_link(self, link: Any, program: bool = False) -> None:
        self.links.append(link)

    def receive_ground(self, datagram: bytes, link: Any, program: bool = False) -> list[Any]:
        self._watch.now_s += SLOW_S
        self.heard.append((link, [received.message.seq for received in decode(datagram)[0]]))
        return []

    def ground_datagrams(self) -> list[tuple[Any, bytes]]:
        said, self.said = self.said, []
        return said


class Ground:
    """Sockets of an autopilot for two ground stations and TCP."""

    def __init__(self, tcp: TcpServer, address: tuple[str, int], watch: Watch) -> None:
        self.onboard: Any = Slow(watch)
        self.address = address
        self.peers = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
        for peer in self.peers:
            peer.bind((LOOPBACK, 0))
            peer.settimeout(HEARS_S)
        stations = tuple(peer.getsockname() for peer in self.peers)
        self.stations = GroundStations(stations, (), tcp, StorageWorker(threaded=False))
        self.stations.join(self.onboard)
        self.onboard.said = [((i, address), b"hello") for i, address in enumerate(stations)]
        self.theirs = [self.address_towards(peer) for peer in self.peers]

    def address_towards(self, peer: socket.socket) -> tuple[str, int]:
        """The address from which a peer hears us; what a tick has no time for is sent by a later one."""
        for _ in range(MOST_TICKS):
            self.exchange()
            with suppress(TimeoutError):
                address: tuple[str, int] = peer.recvfrom(100)[1]
                return address
        raise AssertionError(f"nothing was heard in {MOST_TICKS} ticks")

    def exchange(self) -> None:
        self.stations.exchange(self.onboard, lambda events: None, StopRequest())

    def connect(self) -> socket.socket:
        """A TCP client, accepted or refused."""
        client = socket.create_connection(self.address, 5.0)
        self.exchange()
        return client

    @property
    def heard(self) -> list[int]:
        return [seq for _, seqs in self.onboard.heard for seq in seqs]


@pytest.fixture
def ground(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], Ground]]:
    made: list[Ground] = []
    watch = Watch()
    monkeypatch.setattr(time, "perf_counter", watch.perf_counter)

    def make() -> Ground:
        address = (LOOPBACK, free_port())
        made.append(Ground(listen(address), address, watch))
        return made[-1]

    yield make
    for one in made:
        one.stations.close()
        for peer in one.peers:
            peer.close()


def test_a_datagram_of_many_messages_is_handed_over_tick_by_tick(ground: Callable[[], Ground]) -> None:
    autopilot = ground()
    autopilot.peers[0].sendto(pings(0, 40), autopilot.theirs[0])
    autopilot.exchange()
    assert autopilot.heard == [0], "the time is over with it"
    for _ in range(39):
        autopilot.exchange()
    assert autopilot.heard == list(range(40))


def test_messages_of_a_tick_are_packed_into_few_datagrams(ground: Callable[[], Ground]) -> None:
    autopilot = ground()
    messages = [pings(seq, 1) for seq in range(100)]
    for link in ((0, autopilot.peers[0].getsockname()), (1, autopilot.peers[1].getsockname())):
        autopilot.onboard.said += [(link, message) for message in messages]
    for _ in range(MOST_TICKS):
        autopilot.exchange()
    for peer in autopilot.peers:
        heard = []
        with suppress(TimeoutError):
            while True:
                heard.append(peer.recv(LONGEST))
        assert b"".join(heard) == b"".join(messages), "in their order"
        assert max(map(len, heard)) <= MOST_PACKED
        assert len(heard) == -(-len(b"".join(messages)) // MOST_PACKED) < 5


def test_what_is_no_message_is_passed_over_and_what_follows_is_heard(ground: Callable[[], Ground]) -> None:
    autopilot = ground()
    for datagram in (b"\xfd" * 1500, pings(7, 1)):
        autopilot.peers[0].sendto(datagram, autopilot.theirs[0])
    for _ in range(2):
        autopilot.exchange()
    assert autopilot.heard == [7]


def test_what_is_behind_2_kb_of_a_datagram_is_not_heard(ground: Callable[[], Ground]) -> None:
    autopilot = ground()
    for datagram in (pings(0, 1000), pings(5000, 1)):
        autopilot.peers[0].sendto(datagram, autopilot.theirs[0])
    while 5000 not in autopilot.heard:
        autopilot.exchange()
    *first, _ = autopilot.heard
    assert first == list(range(len(first)))
    assert len(pings(0, len(first))) <= MOST_READ < len(pings(0, len(first) + 1))


def test_a_client_by_tcp_is_read_2_kb_at_a_time(ground: Callable[[], Ground]) -> None:
    autopilot = ground()
    address = (LOOPBACK, free_port())
    server = listen(address)
    said, taken = pings(0, 1000), []
    with socket.create_connection(address, 5.0) as client:
        client.sendall(said)
        while len(b"".join(taken)) < len(said):
            arrived = server.receive(autopilot.onboard)
            if arrived is not None:
                taken.append(arrived[0])
                assert len(b"".join(taken)) <= len(taken) * MOST_READ
    assert b"".join(taken) == said
    server.close()


class Searching:
    """An onboard software that is only its endpoint; it counts the checksums computed of what it receives."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_us, self.checksums = 0, 0
        self.endpoint = VehicleEndpoint(Identity(), Home(), ParameterTable([]))
        checksum = codec.mcrf4xx

        def counted(*arguments: Any) -> int:
            self.checksums += 1
            return checksum(*arguments)

        monkeypatch.setattr(codec, "mcrf4xx", counted)

    def receive_ground(self, datagram: bytes, link: Any, program: bool = False) -> list[Any]:
        return list(self.endpoint.receive(datagram, link, self.now_us, self.refuse, program))

    def refuse(self, request: object) -> Verdict:
        return Verdict(m.MAV_RESULT_DENIED, "")

    def ground_datagrams(self) -> list[tuple[Any, bytes]]:
        return []


def test_a_whole_datagram_of_begins_of_frames_is_soon_given_up(
    ground: Callable[[], Ground], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each 0xFE may begin a frame, whose checksum is then computed: twice for each."""
    autopilot = ground()
    searching: Any = Searching(monkeypatch)
    autopilot.onboard = searching
    autopilot.peers[0].sendto(b"\xfe" * LONGEST, autopilot.theirs[0])
    autopilot.exchange()
    assert 0 < searching.checksums <= 2 * (MAX_GARBAGE_BYTES + 1)
    searching.checksums = 0
    searching.receive_ground(b"\xfe" * LONGEST, "ground")
    assert 0 < searching.checksums <= 2 * (MAX_GARBAGE_BYTES + 1), "nor where it comes in one piece"


def test_a_flood_by_one_way_leaves_the_others_their_turn(ground: Callable[[], Ground]) -> None:
    autopilot = ground()
    client = autopilot.connect()
    for _ in range(50):
        autopilot.peers[0].sendto(pings(0, 30), autopilot.theirs[0])
    client.sendall(pings(100, 2000))
    autopilot.peers[1].sendto(pings(5000, 1), autopilot.theirs[1])
    autopilot.exchange()
    assert autopilot.heard == [0, 5000, 100]
    client.close()


def test_clients_by_tcp_are_bounded_and_the_most_silent_makes_room(ground: Callable[[], Ground]) -> None:
    autopilot = ground()
    clients = [autopilot.connect() for _ in range(MAX_CLIENTS)]
    refused = autopilot.connect()
    assert refused.recv(100) == b"", "closed"
    assert len(autopilot.onboard.links) == 2 + MAX_CLIENTS
    autopilot.onboard.now_us += SILENCE_US
    for number, client in enumerate(clients[1:]):
        client.sendall(pings(number, 1))
        autopilot.exchange()
    late = autopilot.connect()
    assert clients[0].recv(100) == b""
    late.sendall(pings(999, 1))
    for _ in range(2 * MAX_CLIENTS):
        autopilot.exchange()
    assert sorted(autopilot.heard) == [*range(MAX_CLIENTS - 1), 999]
    assert len(autopilot.onboard.links) == 2 + MAX_CLIENTS
    for client in (*clients, refused, late):
        client.close()


def test_much_that_has_waited_is_sent_tick_by_tick(
    ground: Callable[[], Ground], monkeypatch: pytest.MonkeyPatch
) -> None:
    autopilot = ground()
    looks = count(0.0, 1e-4)
    monkeypatch.setattr(time, "perf_counter", lambda: next(looks))  # each datagram takes 0.1 ms
    link = (0, autopilot.peers[0].getsockname())
    # too long to be packed together
    autopilot.onboard.said = [(link, bytes((number,)) * (MOST_PACKED // 2 + 1)) for number in range(50)]
    autopilot.peers[0].settimeout(0.0)
    received, most = b"", 0
    for _ in range(10):
        autopilot.exchange()
        before = len(received)
        with suppress(BlockingIOError):
            while True:
                received += autopilot.peers[0].recv(1)
        most = max(most, len(received) - before)
    assert received == bytes(range(50))
    assert most <= 10
