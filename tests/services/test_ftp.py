"""The file server: every opcode, several clients, repeated and hostile requests; no way out of the card."""

from __future__ import annotations

import itertools
import os
import struct
import subprocess
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.mavftp import MAVFTP

from autopilot.services import ftp
from autopilot.services.file_tree import FileTree, checksum
from autopilot.services.files import Card, ErrorCode, FileError, Limits, MemoryCard, path_of
from autopilot.services.ftp import (
    BURST_PACKETS,
    DATA_BYTES,
    IDLE_US,
    MAX_SESSIONS,
    REPEAT_US,
    FtpService,
    Op,
    Packet,
    packet_of,
    payload_of,
)
from autopilot.services.records import Peer, Send, Verdict
from autopilot.services.virtual_files import mission_pack, parameter_pack
from autopilot.shell.sd_card import DirectoryCard
from autopilot.wire.dialect import plumbline as mavlink

TICK_US = 4000
GCS = Peer("gcs", 255, 190)
OTHER = Peer("gcs", 254, 190)
STRANGER = Peer("elsewhere", 1, 1)
MADE = bytes(range(256)) * 200  # 51,200 bytes: more than one burst


def decide(request: Any) -> Verdict:
    raise AssertionError("files are nobody's decision")


class Client:
    """One client: sends and receives packets."""

    def __init__(self, card: Card, peer: Peer = GCS, service: FtpService | None = None) -> None:
        self.tree = FileTree(card, {("@MADE", "file"): lambda query: MADE})
        self.service = service or FtpService(self.tree)
        self.peer = peer
        self.now_us = 0
        self.seq = 7

    def send(self, packet: Packet) -> list[Packet]:
        message = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, list(payload_of(packet)))
        return self._packets(self.service.receive(message, self.peer, self.now_us, decide))

    def ask(
        self, op: int, data: bytes = b"", session: int = 0, offset: int = 0, size: int | None = None
    ) -> Packet:
        self.seq += 1
        length = len(data) if size is None else size
        replies = self.send(Packet(self.seq, session, op, length, offset=offset, data=data))
        if op == Op.CHECKSUM and not replies:
            replies = next(filter(None, (self.poll() for _ in range(1000))))
        (reply,) = replies
        assert reply.seq == self.seq + 1
        assert reply.request_opcode == op
        return reply

    def good(self, op: int, data: bytes = b"", **more: int) -> Packet:
        reply = self.ask(op, data, **more)
        assert reply.opcode == Op.ACK, reply
        return reply

    def trouble(self, op: int, data: bytes = b"", **more: int) -> int:
        reply = self.ask(op, data, **more)
        assert reply.opcode == Op.NAK, reply
        return reply.data[0]

    def poll(self) -> list[Packet]:
        self.now_us += TICK_US
        return self._packets(self.service.poll(self.now_us))

    def _packets(self, outputs: list[Any]) -> list[Packet]:
        assert all(isinstance(output, Send) and output.link == self.peer.link for output in outputs)
        return [packet_of(bytes(output.message.payload)) for output in outputs]

    def put(self, path: bytes, data: bytes, session: int = 0) -> None:
        self.good(Op.CREATE, path, session=session)
        for place in range(0, len(data), DATA_BYTES):
            self.good(Op.WRITE, data[place : place + DATA_BYTES], session=session, offset=place)
        self.good(Op.TERMINATE, session=session)

    def get(self, path: bytes, session: int = 0) -> bytes:
        (size,) = struct.unpack("<I", self.good(Op.OPEN_RO, path, session=session).data)
        data = b""
        while len(data) < size:
            data += self.good(Op.READ, session=session, offset=len(data), size=DATA_BYTES).data
        assert self.trouble(Op.READ, session=session, offset=size, size=1) == ErrorCode.END_OF_FILE
        self.good(Op.TERMINATE, session=session)
        return data

    def open_sessions(self) -> int:
        """The number of open sessions of all clients: those that another client finds taken."""
        own, self.peer = self.peer, STRANGER
        free = 0
        while self.ask(Op.OPEN_RO, b"@MADE/file", session=free).opcode == Op.ACK:
            free += 1
        self.service.forget(STRANGER.link)
        self.peer = own
        return ftp.MAX_SESSIONS - free

    def names(self, path: bytes) -> list[str]:
        names: list[str] = []
        while True:
            reply = self.ask(Op.LIST, path, offset=len(names))
            if reply.opcode == Op.NAK:
                assert reply.data == bytes((ErrorCode.END_OF_FILE,))
                return names
            names += reply.data.decode().rstrip("\0").split("\0")


@pytest.fixture(params=["memory", "disk"])
def card(request: pytest.FixtureRequest, tmp_path: Path) -> Card:
    limits = Limits(file_bytes=100_000, total_bytes=150_000, files=64)
    return MemoryCard(limits) if request.param == "memory" else DirectoryCard(tmp_path / "card", limits)


@pytest.fixture
def client(card: Card) -> Client:
    return Client(card)


def test_what_is_written_is_read_back(client: Client) -> None:
    data = os.urandom(3 * DATA_BYTES + 17)
    client.put(b"/fs/microsd/a.bin\0", data)
    assert client.get(b"fs/microsd//./a.bin") == data
    assert client.names(b"/fs/microsd") == [f"Fa.bin\t{len(data)}"]
    assert client.open_sessions() == 0


def test_the_tree_is_listed_from_its_root(client: Client) -> None:
    assert client.names(b"/") == ["D@MADE", "Dfs"]
    assert client.names(b"") == ["D@MADE", "Dfs"]
    assert client.names(b"/@MADE") == [f"Ffile\t{len(MADE)}"]
    assert client.names(b"/fs") == ["Dmicrosd"]
    assert client.names(b"/fs/microsd") == []
    assert client.trouble(Op.LIST, b"/etc") == ErrorCode.NOT_FOUND


def test_a_long_folder_is_listed_in_parts(client: Client) -> None:
    names = [f"file-with-a-long-name-{i:02}" for i in range(40)]
    for name in names:
        client.put(b"/fs/microsd/" + name.encode(), b"x")
    assert client.names(b"/fs/microsd") == [f"F{name}\t1" for name in names]


def test_create_empties_and_open_to_write_keeps(client: Client) -> None:
    client.put(b"/fs/microsd/a", b"0123456789")
    client.good(Op.OPEN_WO, b"/fs/microsd/a")
    client.good(Op.WRITE, b"AB", offset=2)
    assert client.good(Op.READ, offset=0, size=10).data == b"01AB456789"
    client.good(Op.CREATE, b"/fs/microsd/a")
    assert client.trouble(Op.READ, offset=0, size=10) == ErrorCode.END_OF_FILE


def test_a_hole_reads_as_zeros(client: Client) -> None:
    client.good(Op.CREATE, b"/fs/microsd/a")
    client.good(Op.WRITE, b"end", offset=5)
    client.good(Op.TERMINATE)
    assert client.get(b"/fs/microsd/a") == b"\0\0\0\0\0end"
    client.good(Op.TRUNCATE, b"/fs/microsd/a", offset=2)
    assert client.get(b"/fs/microsd/a") == b"\0\0"


def test_folders_and_names(client: Client) -> None:
    client.good(Op.MAKE_FOLDER, b"/fs/microsd/d")
    assert client.trouble(Op.MAKE_FOLDER, b"/fs/microsd/d") == ErrorCode.EXISTS
    client.put(b"/fs/microsd/d/a", b"1")
    assert client.trouble(Op.REMOVE_FOLDER, b"/fs/microsd/d") in (ErrorCode.FAIL, ErrorCode.FAIL_ERRNO)
    client.good(Op.RENAME, b"/fs/microsd/d/a\0/fs/microsd/b\0")
    client.put(b"/fs/microsd/c", b"2")
    assert client.trouble(Op.RENAME, b"/fs/microsd/b\0/fs/microsd/c\0") == ErrorCode.EXISTS
    assert client.trouble(Op.RENAME, b"/fs/microsd/none\0/fs/microsd/e\0") == ErrorCode.NOT_FOUND
    client.good(Op.REMOVE_FOLDER, b"/fs/microsd/d")
    client.good(Op.REMOVE, b"/fs/microsd/b")
    assert client.trouble(Op.REMOVE, b"/fs/microsd/b") == ErrorCode.NOT_FOUND
    assert client.names(b"/fs/microsd") == ["Fc\t1"]


def test_the_checksum_is_the_one_of_the_protocol(client: Client) -> None:
    client.put(b"/fs/microsd/a", b"123456789")
    (crc,) = struct.unpack("<I", client.good(Op.CHECKSUM, b"/fs/microsd/a").data)
    # the polynomial of CRC-32, but starting from 0 and not inverted
    expected = 0
    for byte in b"123456789":
        expected ^= byte
        for _ in range(8):
            expected = expected >> 1 ^ (0xEDB88320 if expected & 1 else 0)
    assert crc == expected
    assert crc != zlib.crc32(b"123456789")


def test_made_files_can_be_read_and_not_written(client: Client) -> None:
    assert client.get(b"@MADE/file?a=1") == MADE
    for op in (Op.CREATE, Op.OPEN_WO, Op.REMOVE, Op.TRUNCATE, Op.MAKE_FOLDER, Op.REMOVE_FOLDER):
        assert client.trouble(op, b"/@MADE/file") == ErrorCode.PROTECTED
    assert client.trouble(Op.RENAME, b"/@MADE/file\0/fs/microsd/x") == ErrorCode.PROTECTED
    client.good(Op.OPEN_RO, b"/@MADE/file")
    assert client.trouble(Op.WRITE, b"x") == ErrorCode.PROTECTED


def test_what_the_vehicle_writes_is_protected(client: Client) -> None:
    client.good(Op.MAKE_FOLDER, b"/fs/microsd/log")
    client.put(b"/fs/microsd/log/now.ulg", b"ULog")
    client.good(Op.OPEN_WO, b"/fs/microsd/log/now.ulg")
    client.tree.protected = ("log", "now.ulg")
    assert client.trouble(Op.WRITE, b"x") == ErrorCode.PROTECTED
    for op in (Op.REMOVE, Op.CREATE, Op.TRUNCATE):
        assert client.trouble(op, b"/fs/microsd/log/now.ulg") == ErrorCode.PROTECTED
    assert client.trouble(Op.RENAME, b"/fs/microsd/log\0/fs/microsd/old\0") == ErrorCode.PROTECTED
    assert client.get(b"/fs/microsd/log/now.ulg") == b"ULog"


def burst(client: Client, packets: list[Packet]) -> bytes:
    assert [packet.seq for packet in packets] == list(range(packets[0].seq, packets[0].seq + len(packets)))
    for before, after in itertools.pairwise(packets):
        assert after.offset == before.offset + len(before.data)
    return b"".join(packet.data for packet in packets if packet.opcode == Op.ACK)


def test_a_burst_is_paced_and_its_last_packet_marked(client: Client) -> None:
    client.good(Op.OPEN_RO, b"@MADE/file")
    got = b""
    while len(got) < len(MADE):
        client.seq += 1
        asked = Packet(client.seq, 0, Op.BURST, DATA_BYTES, offset=len(got))
        assert client.send(asked) == []
        packets: list[Packet] = []
        while not (packets and packets[-1].burst_complete):
            assert client.service.next_timer() <= client.now_us + TICK_US
            more = client.poll()
            assert 0 < len(more) <= 16
            packets += more
        assert len(packets) <= BURST_PACKETS
        assert packets[0].seq == asked.seq + 1
        got += burst(client, packets)
    assert got == MADE
    assert packets[-1].opcode == Op.NAK
    assert packets[-1].data == bytes((ErrorCode.END_OF_FILE,))
    assert client.poll() == []


def test_two_clients_with_one_session_number_do_not_meet(card: Card) -> None:
    one = Client(card)
    two = Client(card, OTHER, one.service)
    one.good(Op.CREATE, b"/fs/microsd/one")
    two.good(Op.OPEN_RO, b"@MADE/file")
    one.good(Op.WRITE, b"1")
    assert two.good(Op.READ, size=4).data == MADE[:4]
    one.good(Op.RESET)
    assert two.good(Op.READ, size=4).data == MADE[:4]
    assert one.trouble(Op.READ, size=4) == ErrorCode.INVALID_SESSION


def test_several_sessions_of_one_client(client: Client) -> None:
    client.put(b"/fs/microsd/a", b"aaaa")
    for number in range(5):
        client.good(Op.OPEN_RO, b"@MADE/file" if number % 2 else b"/fs/microsd/a", session=number)
    for number in range(5):
        expected = MADE[:4] if number % 2 else b"aaaa"
        assert client.good(Op.READ, session=number, size=4).data == expected
    assert client.open_sessions() == 5


def test_a_repeated_request_is_answered_again_and_not_done_again(client: Client) -> None:
    client.put(b"/fs/microsd/a", b"1")
    asked = Packet(100, 0, Op.REMOVE, 13, data=b"/fs/microsd/a")
    first = client.send(asked)
    assert client.send(asked) == first
    assert first[0].opcode == Op.ACK
    client.now_us += REPEAT_US + 1
    assert client.send(asked)[0].data[0] == ErrorCode.NOT_FOUND


def test_a_lost_reply_to_create_does_not_empty_what_was_written(client: Client) -> None:
    create = Packet(100, 0, Op.CREATE, 13, data=b"/fs/microsd/a")
    client.send(create)
    client.good(Op.WRITE, b"data")
    client.send(create)
    assert client.good(Op.READ, size=10).data == b"data"


def test_sessions_end(client: Client) -> None:
    client.good(Op.OPEN_RO, b"@MADE/file")
    client.good(Op.TERMINATE)
    assert client.trouble(Op.READ) == ErrorCode.INVALID_SESSION
    assert client.trouble(Op.TERMINATE) == ErrorCode.INVALID_SESSION
    client.good(Op.OPEN_RO, b"@MADE/file", session=3)
    client.now_us += IDLE_US
    client.poll()
    assert client.open_sessions() == 0
    for number in range(MAX_SESSIONS):
        client.good(Op.OPEN_RO, b"@MADE/file", session=number)
    assert client.trouble(Op.OPEN_RO, b"@MADE/file", session=200) == ErrorCode.NO_SESSIONS
    client.good(Op.OPEN_RO, b"@MADE/file", session=0)
    client.service.forget(GCS.link)
    assert client.open_sessions() == 0


HOSTILE = [
    b"/fs/microsd/../secret",
    b"../secret",
    b"/fs/../../etc/passwd",
    b"/fs/microsd/\xff\xfe",
    b"/fs/microsd/a\nb",
    b"/fs/microsd/..\\x",
    b"/fs/microsd/" + b"a" * 300,
]


@pytest.mark.parametrize("path", HOSTILE)
def test_hostile_paths_lead_nowhere(client: Client, tmp_path: Path, path: bytes) -> None:
    (tmp_path / "secret").write_bytes(b"key")
    path = path[:DATA_BYTES]
    for op in (Op.OPEN_RO, Op.CREATE, Op.OPEN_WO, Op.REMOVE, Op.MAKE_FOLDER, Op.LIST, Op.CHECKSUM):
        if len(path) == DATA_BYTES and op in (Op.CREATE, Op.MAKE_FOLDER, Op.OPEN_WO):
            continue  # cut at the end of the packet, it is a valid name
        assert client.ask(op, path).opcode == Op.NAK
    assert (tmp_path / "secret").read_bytes() == b"key"


def test_a_name_longer_than_a_disk_takes_is_no_path() -> None:
    with pytest.raises(FileError):
        path_of(b"/fs/microsd/" + b"a" * 256)


def test_a_nul_ends_a_path(client: Client) -> None:
    client.put(b"/fs/microsd/a\0/../../x", b"1")
    assert client.names(b"/fs/microsd") == ["Fa\t1"]


def test_links_on_the_disk_are_not_followed(tmp_path: Path) -> None:
    client = Client(DirectoryCard(tmp_path / "card"))
    (tmp_path / "secret").write_bytes(b"key")
    (tmp_path / "card" / "link").symlink_to(tmp_path / "secret")
    (tmp_path / "card" / "folder").symlink_to(tmp_path)
    assert client.names(b"/fs/microsd") == []
    for path in (b"/fs/microsd/link", b"/fs/microsd/folder/secret"):
        for op in (Op.OPEN_RO, Op.CREATE, Op.OPEN_WO, Op.REMOVE, Op.CHECKSUM, Op.TRUNCATE):
            assert client.ask(op, path).opcode == Op.NAK
    assert (tmp_path / "secret").read_bytes() == b"key"


def test_hostile_sizes_are_refused(client: Client) -> None:
    client.good(Op.CREATE, b"/fs/microsd/a")
    assert client.trouble(Op.WRITE, b"x" * DATA_BYTES, size=240) == ErrorCode.INVALID_DATA_SIZE
    assert client.ask(Op.WRITE, b"x", offset=2**32 - 1).opcode == Op.NAK
    assert client.ask(Op.TRUNCATE, b"/fs/microsd/a", offset=2**32 - 1).opcode == Op.NAK
    assert client.trouble(Op.READ, offset=2**32 - 1, size=239) == ErrorCode.END_OF_FILE
    assert client.get(b"/fs/microsd/a") == b""


def test_the_card_can_be_full(client: Client) -> None:
    client.good(Op.CREATE, b"/fs/microsd/a")
    client.good(Op.WRITE, b"x", offset=99_999)
    client.good(Op.CREATE, b"/fs/microsd/b")
    assert client.ask(Op.WRITE, b"x", offset=60_000).opcode == Op.NAK
    client.good(Op.WRITE, b"x", offset=40_000)
    refused = [client.ask(Op.CREATE, b"/fs/microsd/%d" % i).opcode == Op.NAK for i in range(100)]
    assert refused[0] is False
    assert refused[-1] is True


def test_folders_do_not_nest_for_ever(client: Client) -> None:
    """Folders moved one into the next would become deeper than any path that can be written."""
    top = b"/fs/microsd/"
    client.good(Op.MAKE_FOLDER, top + b"0")
    refused = 0
    for i in range(1, 60):
        client.good(Op.MAKE_FOLDER, top + b"%d" % i)
        moved = client.ask(Op.RENAME, top + b"%d\0%b%d/a" % (i - 1, top, i))
        refused += moved.opcode == Op.NAK
    assert refused == 1, "the tower that is deep enough stays, and another begins"


def test_a_path_has_so_many_names_at_most(client: Client) -> None:
    deep = [b"/fs/microsd"]
    for _ in range(Limits().depth):
        deep.append(deep[-1] + b"/d")
        client.good(Op.MAKE_FOLDER, deep[-1])
    assert client.trouble(Op.MAKE_FOLDER, deep[-1] + b"/e") == ErrorCode.FAIL_ERRNO
    assert client.trouble(Op.CREATE, deep[-1] + b"/e") == ErrorCode.FAIL_ERRNO
    client.put(deep[-2] + b"/e", b"1")
    assert client.trouble(Op.RENAME, deep[-2] + b"/e\0" + deep[-1] + b"/e") == ErrorCode.FAIL_ERRNO


@pytest.fixture
def deep_folder(tmp_path: Path) -> Iterator[Path]:
    """Folders nested more deeply than Python calls may be."""
    top = tmp_path / "card"
    top.mkdir()
    inner = os.open(top, os.O_RDONLY)
    for _ in range(1010):
        os.mkdir("a", dir_fd=inner)
        inner, outer = os.open("a", os.O_RDONLY, dir_fd=inner), inner
        os.close(outer)
    os.close(inner)
    yield top
    subprocess.run(["rm", "-r", top], check=True)  # pytest cannot remove it


def test_a_card_is_counted_however_deep_it_is(deep_folder: Path) -> None:
    """However the directory was filled, the vehicle starts and serves it."""
    client = Client(DirectoryCard(deep_folder))
    assert client.names(b"/fs/microsd") == ["Da"]
    client.put(b"/fs/microsd/b", b"1")
    client.good(Op.MAKE_FOLDER, b"/fs/microsd/c")
    assert client.ask(Op.RENAME, b"/fs/microsd/a\0/fs/microsd/c/a").opcode == Op.NAK


def test_what_is_taken_away_makes_room(client: Client) -> None:
    for _ in range(20):
        client.put(b"/fs/microsd/a", b"x" * 90_000)
        client.good(Op.TRUNCATE, b"/fs/microsd/a", offset=10_000)
        client.put(b"/fs/microsd/b", b"x" * 90_000)
        client.good(Op.REMOVE, b"/fs/microsd/b")
        client.good(Op.MAKE_FOLDER, b"/fs/microsd/d")
        client.good(Op.REMOVE_FOLDER, b"/fs/microsd/d")


def test_a_checksum_is_counted_over_many_ticks(client: Client) -> None:
    """A tick reads a limited amount; a client that repeats its request meanwhile is not answered twice."""
    client.put(b"/fs/microsd/a", b"")
    client.good(Op.TRUNCATE, b"/fs/microsd/a", offset=100_000)
    asked = Packet(1, 0, Op.CHECKSUM, 14, data=b"/fs/microsd/a\0")
    assert client.send(asked) == client.send(asked) == []
    replies = [client.poll() for _ in range(5)]
    (reply,) = [reply for one in replies for reply in one]
    assert struct.unpack("<I", reply.data) == (checksum(bytes(100_000)),)
    assert client.service.next_timer() > 0
    client.send(asked)
    client.good(Op.REMOVE, b"/fs/microsd/a")
    (reply,) = client.poll()
    assert (reply.opcode, reply.data[0]) == (Op.NAK, ErrorCode.NOT_FOUND)


def test_checksums_of_many_clients_are_counted_in_turn(card: Card, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tick reads no more for many clients than for one."""
    first = Client(card)
    first.put(b"/fs/microsd/a", b"")
    first.good(Op.TRUNCATE, b"/fs/microsd/a", offset=100_000)
    reads: list[tuple[Any, ...]] = []
    read = card.read
    monkeypatch.setattr(card, "read", lambda *asked: (reads.append(asked), read(*asked))[1])
    clients = [Client(card, Peer("gcs", number, 190), first.service) for number in range(1, 9)]
    for client in clients:
        assert client.send(Packet(1, 0, Op.CHECKSUM, 14, data=b"/fs/microsd/a\0")) == []
    replies: list[Packet] = []
    ticks = 0
    while len(replies) < len(clients):
        replies += first.poll()
        ticks += 1
        assert len(reads) <= ticks
    assert {struct.unpack("<I", reply.data) for reply in replies} == {(checksum(bytes(100_000)),)}
    assert first.service.next_timer() > 0


def test_unknown_opcodes_and_replies(client: Client) -> None:
    assert client.trouble(99) == ErrorCode.UNKNOWN_COMMAND
    assert client.send(Packet(1, 0, Op.ACK, 0)) == []
    assert client.send(Packet(1, 0, Op.NAK, 1, data=b"\1")) == []


def test_the_parameter_pack_is_read_by_pymavlink(rig: Any) -> None:
    pack = parameter_pack(rig.table, {"withdefaults": "1"})
    decoded = MAVFTP.ftp_param_decode(pack)
    assert [name.decode() for name, _, _ in decoded.params] == list(rig.table.names)
    for name, value, _ in decoded.params:
        assert value == pytest.approx(rig.table[name.decode()], rel=1e-7)  # a float32
    rig.table.set("LOAD_MASS", 0.5)
    decoded = MAVFTP.ftp_param_decode(parameter_pack(rig.table, {"withdefaults": "1"}))
    assert decoded.params[0][:2] == (b"CTRL_RATE_HZ", 250.0)
    values = {name: value for name, value, _ in decoded.params}
    defaults = {name: value for name, value, _ in decoded.defaults}
    assert values[b"LOAD_MASS"] == 0.5
    assert defaults[b"LOAD_MASS"] == pytest.approx(0.0843, rel=1e-7)
    part = MAVFTP.ftp_param_decode(parameter_pack(rig.table, {"start": "1", "count": "2"}))
    assert [name.decode() for name, _, _ in part.params] == list(rig.table.names[1:3])


def test_the_mission_pack_holds_the_items_as_they_travel(items: Callable[[int], Any]) -> None:
    pack = mission_pack(items(3))
    assert struct.unpack_from("<5H", pack) == (0x763D, 0, 0, 0, 3)
    kind = mavlink.MAVLink_mission_item_int_message
    assert len(pack) == 10 + 3 * kind.unpacker.size
    for seq, item in enumerate(items(3)):
        values = kind.unpacker.unpack_from(pack, 10 + seq * kind.unpacker.size)
        named = dict(zip(kind.ordered_fieldnames, values, strict=True))
        assert named["seq"] == seq
        assert all(named[field] == value for field, value in item._asdict().items())


PATHS = [
    b"/fs/microsd/a",
    b"/fs/microsd/d",
    b"/fs/microsd/d/b",
    b"@MADE/file",
    b"/",
    b"/fs/microsd/../x",
    b"",
]
DATA = st.sampled_from(PATHS) | st.binary(max_size=DATA_BYTES)
PACKET = st.builds(
    Packet,
    seq=st.integers(0, 5) | st.integers(0, 65535),
    session=st.integers(0, 3) | st.integers(0, 255),
    opcode=st.integers(0, 16) | st.integers(0, 255),
    size=st.integers(0, 255),
    request_opcode=st.integers(0, 255),
    burst_complete=st.integers(0, 255),
    offset=st.integers(0, 300) | st.integers(0, 2**32 - 1),
    data=DATA,
)
OPENING = st.builds(
    lambda seq, session, opcode, path: Packet(seq, session, opcode, len(path), data=path),
    st.integers(0, 65535),
    st.integers(0, 5),
    st.sampled_from([Op.OPEN_RO, Op.OPEN_WO, Op.CREATE]),
    st.sampled_from([b"/fs/microsd/a", b"@MADE/file"]),
)
STEP = st.tuples(
    PACKET | OPENING, st.booleans(), st.sampled_from([GCS, OTHER]), st.sampled_from([0, TICK_US, IDLE_US])
)


@pytest.fixture
def few_sessions(monkeypatch: pytest.MonkeyPatch) -> int:
    """So few sessions at the same time that some steps reach their number, and that they are counted fast."""
    monkeypatch.setattr(ftp, "MAX_SESSIONS", 2)
    return 2


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=st.lists(STEP, max_size=40))
def test_no_requests_break_it_and_no_session_is_left(
    steps: list[Any], few_sessions: int, tmp_path_factory: Any
) -> None:
    limits = Limits(file_bytes=10_000, total_bytes=20_000, files=20)
    disk = DirectoryCard(tmp_path_factory.mktemp("card"), limits)
    clients = [Client(MemoryCard(limits)), Client(disk)]
    for packet, fits, peer, pause_us in steps:
        whole = packet._replace(size=len(packet.data)) if fits else packet
        for client in clients:
            client.peer = peer
            before = client.open_sessions()
            replies = client.send(whole)
            assert len(replies) <= 1
            assert client.open_sessions() <= min(before + 1, few_sessions)
            client.now_us += pause_us
            client.poll()
    for client in clients:
        while client.service.next_timer() <= client.now_us + TICK_US:  # a burst is a use
            client.now_us += TICK_US
            client.poll()
        client.now_us += IDLE_US
        client.poll()
        assert client.open_sessions() == 0
        assert client.service.next_timer() > client.now_us
