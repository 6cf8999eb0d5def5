"""The LOG_ messages: list, download in any order and with losses, erase; any requests."""

from __future__ import annotations

import os
import random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.services.file_tree import FileTree
from autopilot.services.files import Entry, MemoryCard
from autopilot.services.logs import BLOCK, BLOCKS_PER_TICK, LogService
from autopilot.services.records import Peer, Send, Verdict
from autopilot.services.streams import NEVER_US
from autopilot.wire.dialect import plumbline as m

TICK_US = 4000
GCS, OTHER = Peer("gcs", 255, 190), Peer("api", 245, 190)


def decide(request: Any) -> Verdict:
    raise AssertionError("logs are nobody's decision")


class Rig:
    def __init__(self, *logs: bytes) -> None:
        card = MemoryCard()
        card.make_folder(("log",))
        for number, data in enumerate(logs):
            card.create(("log", f"{number}.ulg"))
            card.write(("log", f"{number}.ulg"), 0, data)
        card.create(("log", "notes.txt"))
        self.tree = FileTree(card, {})
        self.service = LogService(self.tree)
        self.now_us = 0

    def ask(self, kind: str, message: Any, peer: Peer = GCS) -> list[Any]:
        return self._messages(getattr(self.service, f"receive_{kind}")(message, peer, self.now_us, decide))

    def poll(self) -> list[Any]:
        self.now_us += TICK_US
        return self._messages(self.service.poll(self.now_us))

    def run(self) -> list[Any]:
        """All messages still to come."""
        messages = []
        while self.service.next_timer() != NEVER_US:
            messages += self.poll()
        return messages

    def list(self, start: int = 0, end: int = 0xFFFF) -> list[Any]:
        return [*self.ask("list", m.MAVLink_log_request_list_message(1, 1, start, end)), *self.run()]

    def order(self, log: int, start: int, count: int, peer: Peer = GCS) -> list[Any]:
        return self.ask("data", m.MAVLink_log_request_data_message(1, 1, log, start, count), peer)

    @staticmethod
    def _messages(outputs: list[Any]) -> list[Any]:
        assert all(isinstance(output, Send) for output in outputs)
        return [output.message for output in outputs]


def joined(blocks: list[Any], size: int) -> bytes:
    data = bytearray(size)
    for block in blocks:
        data[block.ofs : block.ofs + block.count] = bytes(block.data[: block.count])
    return bytes(data)


def test_no_logs_are_one_entry_that_says_so() -> None:
    (entry,) = Rig().list()
    assert (entry.num_logs, entry.last_log_num) == (0, 0)
    (data,) = Rig().order(3, 90, 9999)
    assert (data.id, data.ofs, data.count) == (3, 90, 0)


def test_the_list_tells_every_log_or_those_asked_for() -> None:
    rig = Rig(b"a", b"bb", b"ccc")
    entries = rig.list()
    assert [(e.id, e.num_logs, e.last_log_num, e.size) for e in entries] == [
        (0, 3, 2, 1),
        (1, 3, 2, 2),
        (2, 3, 2, 3),
    ]
    assert [e.id for e in rig.list(1, 1)] == [1]


@pytest.mark.parametrize(
    ("name", "begin_s"),
    [
        ("2026-01-31_12-30-59.ulg", 1_769_862_659),
        ("2026-01-31_12-30-59_002.ulg", 1_769_862_659),
        ("2026-13-31_12-30-59.ulg", 77),  # no date
        ("1960-01-31_12-30-59.ulg", 0),  # before the first time of the field
        ("log100.ulg", 77),
    ],
)
def test_a_log_has_the_time_at_which_it_began(name: str, begin_s: int) -> None:
    """Not that at which it was written last: that of a log that is being written advances."""
    rig = Rig(b"")
    rig.tree.card.entries = lambda path: [Entry(name, 10, False, 77)]  # type: ignore[method-assign,assignment,misc]
    assert [entry.time_utc for entry in rig.list()] == [begin_s]


def test_a_whole_log_ends_with_a_short_block() -> None:
    for size in (0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 40 * BLOCK, 40 * BLOCK + 7):
        log = os.urandom(size)
        rig = Rig(log)
        blocks = rig.order(0, 0, 2**32 - 1) + rig.run()
        assert joined(blocks, size) == log
        assert [b.ofs for b in blocks] == list(range(0, size + 1, BLOCK))
        assert blocks[-1].count == size % BLOCK
        assert all(b.count == BLOCK for b in blocks[:-1])


def test_a_range_that_ends_inside_has_no_block_too_many() -> None:
    rig = Rig(os.urandom(1000))
    rig.order(0, 90, 180)
    assert [(b.ofs, b.count) for b in rig.run()] == [(90, 90), (180, 90)]
    rig.order(0, 810, 190)
    assert [(b.ofs, b.count) for b in rig.run()] == [(810, 90), (900, 90), (990, 10)]


def test_blocks_are_paced() -> None:
    rig = Rig(os.urandom(100_000))
    rig.order(0, 0, 2**32 - 1)
    assert all(0 < len(rig.poll()) <= BLOCKS_PER_TICK for _ in range(20))


def test_gaps_are_filled_as_mavproxy_asks_for_them() -> None:
    log = os.urandom(50_003)
    rig, rng = Rig(log), random.Random(1)
    rig.order(0, 0, 2**32 - 1)
    got = [block for block in rig.run() if rng.random() > 0.2]
    while True:
        missing = sorted(set(range(0, len(log), BLOCK)) - {block.ofs for block in got})
        if not missing:
            break
        for place in missing[:20]:
            rig.order(0, place, BLOCK)
        got += [block for block in rig.run() if rng.random() > 0.2]
    assert joined(got, len(log)) == log


def test_the_rest_of_a_range_ordered_anew_is_not_sent_twice() -> None:
    rig = Rig(os.urandom(100_000))
    rig.order(0, 0, 90 * 100)
    got = rig.poll()
    last = got[-1].ofs + BLOCK
    rig.order(0, last, 90 * 100 - last)
    rig.order(0, last + BLOCK, 90 * 100 - last - BLOCK)
    assert [block.ofs for block in got + rig.run()] == list(range(0, 9000, BLOCK))


def test_two_clients_and_the_end_of_one() -> None:
    logs = [os.urandom(9000), os.urandom(8000)]
    rig = Rig(*logs)
    rig.order(0, 0, 2**32 - 1)
    rig.order(1, 0, 2**32 - 1, OTHER)
    rig.poll()
    rig.ask("end", m.MAVLink_log_request_end_message(1, 1))
    assert {block.id for block in rig.run()} == {1}
    rig.order(0, 0, 2**32 - 1)
    rig.service.forget("gcs")
    assert rig.run() == []


def test_erase_keeps_the_log_that_is_being_written_and_other_files() -> None:
    rig = Rig(b"a", b"b")
    rig.tree.protected = ("log", "1.ulg")
    rig.ask("erase", m.MAVLink_log_erase_message(1, 1))
    assert [entry.name for entry in rig.tree.card.entries(("log",))] == ["1.ulg", "notes.txt"]


WORD = st.integers(0, 3) | st.integers(0, 0xFFFF)
LONG = st.integers(0, 400) | st.integers(0, 2**32 - 1)
ASK = st.one_of(
    st.tuples(
        st.just("list"), st.builds(m.MAVLink_log_request_list_message, st.just(1), st.just(1), WORD, WORD)
    ),
    st.tuples(
        st.just("data"),
        st.builds(m.MAVLink_log_request_data_message, st.just(1), st.just(1), WORD, LONG, LONG),
    ),
    st.tuples(st.just("end"), st.just(m.MAVLink_log_request_end_message(1, 1))),
    st.tuples(st.just("erase"), st.just(m.MAVLink_log_erase_message(1, 1))),
)


@settings(max_examples=80)
@given(steps=st.lists(st.tuples(ASK, st.sampled_from([GCS, OTHER]), st.integers(0, 3)), max_size=30))
def test_no_requests_break_it_and_it_comes_to_rest(steps: list[Any]) -> None:
    rig = Rig(os.urandom(1000), os.urandom(180))
    for (kind, message), peer, ticks in steps:
        rig.ask(kind, message, peer)
        for _ in range(ticks):
            rig.poll()
    rig.run()
