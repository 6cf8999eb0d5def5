"""How long parts take, on an idle machine and on a busy one."""

from __future__ import annotations

import pytest

from gcs.expected_flight import limit_text
from gcs.workflows.expected import duration_text, expected_s, remaining_s

COSTS = [26.0, 10.0, 8.0, 3.0]


def test_parts_share_the_cores():
    assert expected_s(COSTS, 1) == pytest.approx(47.0)
    assert expected_s(COSTS, 2) == pytest.approx(26.0)
    assert expected_s(COSTS[1:], 2) == pytest.approx(11.0)
    assert expected_s(COSTS[3:], 2) == pytest.approx(3.0)


def test_what_remains_is_told_at_the_pace_of_what_is_done():
    assert remaining_s([], [(26.0, 6.0), (10.0, 6.0)], [8.0], 2) == pytest.approx(20.0)
    # what took 10 s on an idle machine took 30 s
    assert remaining_s([(10.0, 30.0)], [(26.0, 30.0)], [8.0], 2) == pytest.approx(48.0)
    # nothing is done yet, but both have taken three times as long as they should
    assert remaining_s([], [(26.0, 78.0), (10.0, 30.0)], [8.0], 2) == pytest.approx(7.5 + 24.0)


def test_what_should_be_done_takes_a_while_yet():
    assert remaining_s([(10.0, 10.0)], [(26.0, 32.0)], [], 2) == pytest.approx(8.0)


def test_a_core_is_shared_with_what_else_runs_until_the_pace_is_known():
    # four processes want two cores
    assert remaining_s([], [(26.0, 6.0), (10.0, 6.0)], [], 2, busy=2.0) == pytest.approx(46.0)
    assert remaining_s([(10.0, 10.0)], [(26.0, 6.0), (10.0, 6.0)], [], 2, busy=2.0) == pytest.approx(20.0)


def test_a_fast_machine_is_not_promised_to_stay_fast():
    assert remaining_s([(10.0, 1.0)], [], [8.0], 1) == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.0, "about 1 s"), (34.6, "about 35 s"), (134.0, "about 130 s"), (400.0, "about 7 min")],
)
def test_in_words(seconds, words):
    assert duration_text(seconds) == words


@pytest.mark.parametrize(("seconds", "words"), [(0.1, "0.1 s"), (2.5, "2.5 s"), (119.04, "119 s")])
def test_a_time_limit_in_words(seconds, words):
    assert limit_text(seconds) == words
