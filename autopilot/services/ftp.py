"""FILE_TRANSFER_PROTOCOL: a file server for any number of clients, each with its own sessions.

A session has the number that its client proposes in the request that opens it (MAVProxy counts up, MAVSDK and
QGroundControl send 0); if a session with this number is open, the new file replaces the old one. Sessions
that are not used for `IDLE_US` are closed.

A request that arrives twice (same client, same sequence number, same bytes) is not executed twice: its reply
is sent again. Bursts are sent at a steady pace, `BURST_PACKETS` at a time, with the last packet marked. The
checksum of a file is computed in parts, one part per tick, for the clients in turn; a client has at most one
under way.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, NamedTuple

from autopilot.services.file_tree import FileTree, OpenFile, checksum
from autopilot.services.files import Entry, ErrorCode, FileError
from autopilot.services.records import Decide, Link, Output, Peer, Send
from autopilot.services.streams import NEVER_US
from autopilot.wire.dialect import plumbline as mavlink

IDLE_US = 60_000_000
REPEAT_US = 10_000_000  # for this time a reply is kept for a repeated request
MAX_SESSIONS = 64  # for all clients together
MAX_REPLIES = 32  # kept for each client
MAX_CLIENTS = 32  # whose replies are kept
BURST_PACKETS = 128
BURST_INTERVAL_US = 500  # between two packets of a burst: 478 kB/s
BURST_PACKETS_PER_TICK = 16  # packets of a burst in one tick
CHECKSUM_BYTES_PER_TICK = 2**17  # bytes of a file that are added to its checksum in one tick

PAYLOAD_BYTES = 251  # FILE_TRANSFER_PROTOCOL.payload
_HEADER = struct.Struct("<HBBBBBxI")  # seq, session, opcode, size, request opcode, burst complete, offset
DATA_BYTES = PAYLOAD_BYTES - _HEADER.size  # 239
_MAX_LISTED = DATA_BYTES // 3  # entries that fit into one reply: a letter, a name, and its end
_UINT32 = struct.Struct("<I")


class Op(IntEnum):
    """The opcodes."""

    NONE = 0
    TERMINATE = 1
    RESET = 2
    LIST = 3
    OPEN_RO = 4
    READ = 5
    CREATE = 6
    WRITE = 7
    REMOVE = 8
    MAKE_FOLDER = 9
    REMOVE_FOLDER = 10
    OPEN_WO = 11
    TRUNCATE = 12
    RENAME = 13
    CHECKSUM = 14
    BURST = 15
    ACK = 128
    NAK = 129


class Packet(NamedTuple):
    """The payload of FILE_TRANSFER_PROTOCOL."""

    seq: int
    session: int
    opcode: int
    size: int
    request_opcode: int = 0  # opcode that a reply answers
    burst_complete: int = 0  # of a burst
    offset: int = 0
    data: bytes = b""


def packet_of(payload: bytes) -> Packet:
    """Read a payload; `data` has the `size` bytes after the header."""
    seq, session, opcode, size, request_opcode, burst_complete, offset = _HEADER.unpack_from(payload)
    return Packet(
        seq,
        session,
        opcode,
        size,
        request_opcode,
        burst_complete,
        offset,
        payload[_HEADER.size : _HEADER.size + size],
    )


def payload_of(packet: Packet) -> bytes:
    """A whole payload, padded with zeros."""
    head = _HEADER.pack(
        packet.seq & 0xFFFF,
        packet.session,
        packet.opcode,
        packet.size,
        packet.request_opcode,
        packet.burst_complete,
        packet.offset,
    )
    return (head + packet.data).ljust(PAYLOAD_BYTES, b"\0")


@dataclass(slots=True)
class _Session:
    file: OpenFile
    used_us: int


@dataclass(frozen=True, slots=True)
class _Burst:
    """Packets that are still to be sent."""

    seq: int
    offset: int
    size: int
    left: int
    due_us: int


@dataclass(slots=True)
class _Checksum:
    """A checksum that is being computed."""

    request: Packet
    file: OpenFile
    offset: int = 0
    total: int = 0


_Key = tuple[Peer, int]  # a client and one of its sessions
# executed again when repeated, since these requests change nothing
_REPEATABLE = frozenset((Op.NONE, Op.LIST, Op.READ, Op.BURST, Op.CHECKSUM))


class FtpService:
    """Serves one tree to any number of clients."""

    def __init__(self, tree: FileTree) -> None:
        self._tree = tree
        self._sessions: dict[_Key, _Session] = {}
        self._bursts: dict[_Key, _Burst] = {}
        self._checksums: dict[Peer, _Checksum] = {}
        # the last replies by client: request to reply and when it was made
        self._replies: OrderedDict[Peer, OrderedDict[bytes, tuple[Packet, int]]] = OrderedDict()

    def receive(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """Execute a client's request, and answer it."""
        payload = bytes(message.payload)
        request = packet_of(payload)
        if request.opcode in (Op.ACK, Op.NAK):
            return []
        if request.opcode not in _REPEATABLE:
            known = self._replies.get(peer)
            kept = known.get(payload) if known else None
            if kept is not None and now_us - kept[1] <= REPEAT_US:
                return [_message(kept[0], peer)]
        try:
            reply = self._execute(request, peer, now_us)
        except FileError as error:
            reply = _refusal(request, error)
        if reply is None:
            return []
        if request.opcode not in _REPEATABLE:
            self._store_reply(peer, payload, reply, now_us)
        return [_message(reply, peer)]

    def next_timer(self) -> int:
        """Time at which `poll` has something to do, in us."""
        if self._checksums:
            return 0
        if not self._sessions:
            return NEVER_US
        bursts = min((burst.due_us for burst in self._bursts.values()), default=NEVER_US)
        idle = min(session.used_us for session in self._sessions.values())
        return min(bursts, idle + IDLE_US)

    def poll(self, now_us: int) -> list[Output]:
        """The packets of bursts that are due, and checksums; closes idle sessions."""
        outputs: list[Output] = []
        if self._checksums:  # one client's per tick, in turn, so that many clients make no tick longer
            peer = next(iter(self._checksums))
            self._checksums[peer] = checksum_state = self._checksums.pop(peer)
            outputs += self._continue_checksum(peer, checksum_state)
        for key, burst in list(self._bursts.items()):
            outputs += self._continue_burst(key, burst, now_us)
        for key, session in list(self._sessions.items()):
            if now_us - session.used_us >= IDLE_US:
                self._close(key)
        return outputs

    def forget(self, link: Link) -> None:
        """Forget all clients on a link that no longer exists."""
        for key in [key for key in self._sessions if key[0].link == link]:
            self._close(key)
        for peer in [peer for peer in self._replies if peer.link == link]:
            del self._replies[peer]
        for peer in [peer for peer in self._checksums if peer.link == link]:
            del self._checksums[peer]

    # ---- requests

    def _execute(self, request: Packet, peer: Peer, now_us: int) -> Packet | None:
        """The reply; None for a burst, whose packets are the replies, and for a checksum, whose reply follows
        when it is computed."""
        tree, data = self._tree, request.data
        if request.size > DATA_BYTES:
            raise FileError(ErrorCode.INVALID_DATA_SIZE)
        match request.opcode:
            case Op.NONE:
                return _ack(request)
            case Op.TERMINATE:
                self._session(request, peer, now_us)
                self._close((peer, request.session))
                return _ack(request)
            case Op.RESET:
                for key in [key for key in self._sessions if key[0] == peer]:
                    self._close(key)
                self._checksums.pop(peer, None)
                self._replies.pop(peer, None)
                return _ack(request)
            case Op.LIST:
                entries = tree.entries(data, request.offset, _MAX_LISTED)
                return _ack(request, _listing(entries), request.offset)
            case Op.OPEN_RO:
                file = tree.open(data)
                return self._open(file, request, peer, now_us)
            case Op.CREATE | Op.OPEN_WO:
                self._check_session_limit(request, peer)
                file = tree.open_to_write(data, request.opcode == Op.CREATE)
                return self._open(file, request, peer, now_us)
            case Op.READ:
                file = self._session(request, peer, now_us).file
                return _ack(
                    request, tree.read(file, request.offset, request.size or DATA_BYTES), request.offset
                )
            case Op.WRITE:
                file = self._session(request, peer, now_us).file
                tree.write(file, request.offset, data)
                return _ack(request, _UINT32.pack(len(data)), request.offset)
            case Op.BURST:
                self._session(request, peer, now_us)
                size = request.size or DATA_BYTES
                self._bursts[peer, request.session] = _Burst(
                    request.seq + 1, request.offset, size, BURST_PACKETS, now_us
                )
                return None
            case Op.REMOVE:
                tree.remove(data)
            case Op.MAKE_FOLDER:
                tree.make_folder(data)
            case Op.REMOVE_FOLDER:
                tree.remove_folder(data)
            case Op.TRUNCATE:
                tree.truncate(data, request.offset)
            case Op.RENAME:
                old, _, new = data.partition(b"\0")
                tree.rename(old, new)
            case Op.CHECKSUM:
                if len(self._checksums) >= MAX_CLIENTS and peer not in self._checksums:
                    raise FileError(ErrorCode.NO_SESSIONS)
                if peer not in self._checksums or self._checksums[peer].request != request:
                    self._checksums[peer] = _Checksum(request, tree.open(data))
                return None
            case _:
                raise FileError(ErrorCode.UNKNOWN_COMMAND)
        return _ack(request)

    def _check_session_limit(self, request: Packet, peer: Peer) -> None:
        if len(self._sessions) >= MAX_SESSIONS and (peer, request.session) not in self._sessions:
            raise FileError(ErrorCode.NO_SESSIONS)

    def _open(self, file: OpenFile, request: Packet, peer: Peer, now_us: int) -> Packet:
        self._check_session_limit(request, peer)
        key = (peer, request.session)
        self._close(key)
        self._sessions[key] = _Session(file, now_us)
        return _ack(request, _UINT32.pack(min(self._tree.size(file), 2**32 - 1)))

    def _session(self, request: Packet, peer: Peer, now_us: int) -> _Session:
        session = self._sessions.get((peer, request.session))
        if session is None:
            raise FileError(ErrorCode.INVALID_SESSION)
        session.used_us = now_us
        return session

    def _close(self, key: _Key) -> None:
        self._sessions.pop(key, None)
        self._bursts.pop(key, None)

    def _store_reply(self, peer: Peer, payload: bytes, reply: Packet, now_us: int) -> None:
        replies = self._replies.setdefault(peer, OrderedDict())
        self._replies.move_to_end(peer)
        replies[payload] = (reply, now_us)
        replies.move_to_end(payload)
        if len(replies) > MAX_REPLIES:
            replies.popitem(last=False)
        if len(self._replies) > MAX_CLIENTS:
            self._replies.popitem(last=False)

    # ---- checksums and bursts

    def _continue_checksum(self, peer: Peer, state: _Checksum) -> list[Output]:
        """Add the next part to a checksum; the reply after the last part."""
        try:
            data = self._tree.read(state.file, state.offset, CHECKSUM_BYTES_PER_TICK)
        except FileError as error:
            del self._checksums[peer]
            if error.code is not ErrorCode.END_OF_FILE:
                return [_message(_refusal(state.request, error), peer)]
            return [_message(_ack(state.request, _UINT32.pack(state.total)), peer)]
        state.total = checksum(data, state.total)
        state.offset += len(data)
        return []

    def _continue_burst(self, key: _Key, burst: _Burst, now_us: int) -> list[Output]:
        peer, number = key
        outputs: list[Output] = []
        session = self._sessions[key]
        session.used_us = max(session.used_us, now_us)
        due = min((now_us - burst.due_us) // BURST_INTERVAL_US + 1, BURST_PACKETS_PER_TICK, burst.left)
        for _ in range(due):
            request = Packet(burst.seq - 1, number, Op.BURST, burst.size)
            try:
                data = self._tree.read(session.file, burst.offset, burst.size)
            except FileError as error:
                del self._bursts[key]
                refusal = _refusal(request, error)._replace(offset=burst.offset, burst_complete=1)
                return [*outputs, _message(refusal, peer)]
            packet = _ack(request, data, burst.offset)._replace(burst_complete=int(burst.left == 1))
            outputs.append(_message(packet, peer))
            burst = replace(
                burst,
                seq=burst.seq + 1,
                offset=burst.offset + len(data),
                left=burst.left - 1,
                due_us=max(burst.due_us, now_us - BURST_PACKETS_PER_TICK * BURST_INTERVAL_US)
                + BURST_INTERVAL_US,
            )
        if burst.left:
            self._bursts[key] = burst
        else:
            del self._bursts[key]
        return outputs


def _listing(entries: list[Entry]) -> bytes:
    """As many entries as fit, each ended by NUL; FileError END_OF_FILE after the last entry."""
    listing = b""
    for entry in entries:
        text = f"D{entry.name}" if entry.is_folder else f"F{entry.name}\t{entry.size}"
        one = text.encode() + b"\0"
        if len(one) > DATA_BYTES:
            one = b"S\0"  # a name too long for a reply is skipped, but counted
        if len(listing) + len(one) > DATA_BYTES:
            break
        listing += one
    if not listing:
        raise FileError(ErrorCode.END_OF_FILE)
    return listing


def refusal_of(message: Any, peer: Peer) -> Any:
    """The reply to a request that could not be executed, through no fault of the client."""
    return _message(_refusal(packet_of(bytes(message.payload)), FileError(ErrorCode.FAIL)), peer).message


def _ack(request: Packet, data: bytes = b"", offset: int = 0) -> Packet:
    return Packet(request.seq + 1, request.session, Op.ACK, len(data), request.opcode, 0, offset, data)


def _refusal(request: Packet, error: FileError) -> Packet:
    data = bytes((error.code,))
    if error.code is ErrorCode.FAIL_ERRNO:
        data += bytes((error.errno & 0xFF,))
    return Packet(
        request.seq + 1, request.session, Op.NAK, len(data), request.opcode, 0, request.offset, data
    )


def _message(packet: Packet, peer: Peer) -> Send:
    message = mavlink.MAVLink_file_transfer_protocol_message(
        0, peer.system, peer.component, list(payload_of(packet))
    )
    return Send(peer.link, message, peer.addressed)
