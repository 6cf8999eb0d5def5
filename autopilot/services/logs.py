"""The flight logs on the card, served by the LOG_ messages: list, download, erase.

Logs are numbered from 0 in the order of their names. A client may request several ranges of one log, as
MAVProxy does for missed blocks; a range within another requested range is not sent twice (MAVSDK requests the
rest of a range again with every block of it). Blocks are sent at a steady pace. A range that extends beyond
the end of the log ends with a block of fewer than 90 bytes, which is empty if the log is a multiple of that.
"""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from autopilot.services.file_tree import FileTree
from autopilot.services.files import LOG_FOLDER, LOG_SUFFIX, Entry, FileError, log_begin_s
from autopilot.services.records import Decide, Link, Output, Peer, Send
from autopilot.services.streams import NEVER_US
from autopilot.wire.convert.scaling import saturated
from autopilot.wire.dialect import plumbline as mavlink

BLOCK = 90  # LOG_DATA.data
BLOCK_INTERVAL_US = 250  # between two blocks: 360 kB/s
BLOCKS_PER_TICK = 32  # blocks in one tick
MAX_RANGES = 32
MAX_CLIENTS = 16
_UINT32 = 2**32 - 1


@dataclass(slots=True)
class _Client:
    """Entries and ranges for which a client still waits."""

    entries: deque[Any] = field(default_factory=deque)
    log: int = -1
    ranges: deque[tuple[int, int]] = field(default_factory=deque)  # from, to
    due_us: int = 0

    @property
    def waiting(self) -> bool:
        return bool(self.entries or self.ranges)


class LogService:
    """Serves the log folder of a tree's card to any number of clients."""

    def __init__(self, tree: FileTree) -> None:
        self._tree = tree
        self._clients: dict[Peer, _Client] = {}

    def receive_list(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """LOG_REQUEST_LIST: an entry for each log of the range, or one that states that there are no logs."""
        logs = self._logs()
        if not logs:
            return [Send(peer.link, mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0))]
        client = self._client(peer, now_us)
        last = len(logs) - 1
        client.entries = deque(
            mavlink.MAVLink_log_entry_message(
                number, len(logs), last, saturated(log_begin_s(log), 0, _UINT32), min(log.size, _UINT32)
            )
            for number, log in enumerate(logs)
            if message.start <= number <= message.end
        )
        return []

    def receive_data(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """LOG_REQUEST_DATA: add a range to those to be sent."""
        logs = self._logs()
        if message.id >= len(logs):
            return [Send(peer.link, _block(message.id, message.ofs, b""))]
        client = self._client(peer, now_us)
        requested = (message.ofs, message.ofs + message.count)
        if client.log != message.id or requested[1] >= logs[message.id].size:
            client.ranges.clear()  # another log, or the whole rest of this one
        client.log = message.id
        already_requested = any(start <= requested[0] and requested[1] <= end for start, end in client.ranges)
        if not already_requested and len(client.ranges) < MAX_RANGES:
            client.ranges.append(requested)
        return []

    def receive_end(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """LOG_REQUEST_END: stop sending to the client."""
        self._clients.pop(peer, None)
        return []

    def receive_erase(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """LOG_ERASE: remove all logs except the one that is being written."""
        for log in self._logs():
            path = (*LOG_FOLDER, log.name)
            if path != self._tree.protected:
                with suppress(FileError):  # its entry in the next list tells that it is still there
                    self._tree.card.remove(path)
        self._clients.clear()
        return []

    def next_timer(self) -> int:
        """Time at which `poll` has something to send, in us."""
        if not self._clients:
            return NEVER_US
        return min((client.due_us for client in self._clients.values() if client.waiting), default=NEVER_US)

    def poll(self, now_us: int) -> list[Output]:
        """Entries and blocks that are due."""
        outputs: list[Output] = []
        for peer, client in list(self._clients.items()):
            if not client.waiting or client.due_us > now_us:
                continue
            budget = min((now_us - client.due_us) // BLOCK_INTERVAL_US + 1, BLOCKS_PER_TICK)
            client.due_us = (
                max(client.due_us, now_us - BLOCKS_PER_TICK * BLOCK_INTERVAL_US) + budget * BLOCK_INTERVAL_US
            )
            while budget and client.entries:
                outputs.append(Send(peer.link, client.entries.popleft()))
                budget -= 1
            if budget and client.ranges:
                outputs += [Send(peer.link, block) for block in self._blocks(client, budget)]
        return outputs

    def forget(self, link: Link) -> None:
        """Forget all clients on a link that no longer exists."""
        for peer in [peer for peer in self._clients if peer.link == link]:
            del self._clients[peer]

    def _client(self, peer: Peer, now_us: int) -> _Client:
        client = self._clients.pop(peer, None) or _Client()
        if not client.waiting:
            client.due_us = now_us
        if len(self._clients) >= MAX_CLIENTS:
            del self._clients[next(iter(self._clients))]  # the client whose last request is oldest
        self._clients[peer] = client
        return client

    def _blocks(self, client: _Client, budget: int) -> list[Any]:
        """At most `budget` blocks of the requested ranges."""
        logs = self._logs()
        if client.log >= len(logs):
            client.ranges.clear()
            return [_block(client.log, 0, b"")]
        path = (*LOG_FOLDER, logs[client.log].name)
        blocks: list[Any] = []
        while budget > len(blocks) and client.ranges:
            start, end = client.ranges.popleft()
            size = min(end - start, BLOCK * (budget - len(blocks)))
            try:
                data = self._tree.card.read(path, start, size)
            except FileError:
                data = b""
            ended = len(data) < size
            blocks += [
                _block(client.log, start + place, data[place : place + BLOCK])
                for place in range(0, len(data), BLOCK)
            ]
            if ended and len(data) % BLOCK == 0:
                blocks.append(_block(client.log, start + len(data), b""))
            if not ended and start + size < end:
                client.ranges.appendleft((start + size, end))
        return blocks

    def _logs(self) -> list[Entry]:
        try:
            entries = self._tree.card.entries(LOG_FOLDER)
        except FileError:
            return []
        return [entry for entry in entries if entry.name.endswith(LOG_SUFFIX) and not entry.is_folder]


def _block(log: int, offset: int, data: bytes) -> Any:
    padded = data.ljust(BLOCK, b"\0")
    return mavlink.MAVLink_log_data_message(log, min(offset, _UINT32), len(data), list(padded))
