"""Streams are locked to the clock: counted, not approximated."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.services.streams import DEFAULT, NEVER_US, OFF, Streams

TICK_US = 4000


def fired(streams: Streams, key: int, ticks: int, tick_us: int = TICK_US) -> list[int]:
    return [n for n in range(ticks) if key in streams.take_due(n * tick_us)]


def test_every_second_tick_for_ever():
    assert fired(Streams({1: 8000}, 0), 1, 10_000) == list(range(0, 10_000, 2))


def test_an_interval_between_ticks_keeps_its_mean_rate():
    ticks = fired(Streams({1: 50_000}, 0), 1, 2500)
    assert len(ticks) == 200
    assert {b - a for a, b in pairwise(ticks)} == {12, 13}


@given(
    interval=st.integers(1, 3_000_000),
    tick_us=st.sampled_from([1000, 2000, 4000, 10_000]),
    n=st.integers(1, 500),
)
def test_fires_at_the_first_tick_at_or_after_each_multiple(interval, tick_us, n):
    expected = sorted({-(-k * interval // tick_us) for k in range(n * tick_us // interval + 2)})
    assert fired(Streams({1: interval}, 0), 1, n, tick_us) == [k for k in expected if k < n]


def test_skipped_ticks_are_not_made_up_for():
    streams = Streams({1: 8000}, 0)
    assert streams.take_due(80_000) == (1,)
    assert streams.take_due(80_000) == ()
    assert streams.next_us == 88_000


def test_intervals_change_stop_and_come_back():
    streams = Streams({1: 8000, 2: OFF}, 0)
    streams.set_interval(1, OFF, 0)
    assert streams.next_us == NEVER_US
    assert streams.take_due(10**9) == ()
    streams.set_interval(2, 4000, 0)
    assert fired(streams, 2, 5) == [0, 1, 2, 3, 4]
    streams.set_interval(1, DEFAULT, 100_000)
    streams.set_interval(2, DEFAULT, 100_000)
    assert (streams.interval(1), streams.interval(2)) == (8000, OFF)
    assert streams.next_us == 104_000


def test_a_message_that_is_no_stream_has_no_interval():
    assert Streams({1: 8000}, 0).interval(7) is None


@pytest.mark.parametrize("now_us", [1, 7999, 8000])
def test_a_link_that_comes_late_joins_the_same_beat(now_us):
    assert Streams({1: 8000}, now_us).next_us == 8000
