"""Descents to land: how long they take, and where their quick part ends."""

from __future__ import annotations

import pytest

from autopilot.trajectory.descent import SLOW_WAY_M, descent_pace, quick_way_m
from autopilot.trajectory.transfer import lift_pace

LEAST_S = 2.0


@pytest.mark.parametrize("way_m", [16.0, 20.0, 35.0, 100.0])
def test_the_quick_part_ends_where_the_slow_one_begins(way_m: float) -> None:
    assert quick_way_m(way_m, 1.5, 0.8, 1.5, LEAST_S) == way_m - SLOW_WAY_M
    slow_s = lift_pace(SLOW_WAY_M, 0.8, 1.5, LEAST_S).duration_s
    quick_s = lift_pace(way_m - SLOW_WAY_M, 1.5, 1.5, LEAST_S).duration_s
    assert descent_pace(way_m, 1.5, 0.8, 1.5, LEAST_S).duration_s == quick_s + slow_s


def test_35_m_take_half_a_minute() -> None:
    assert lift_pace(35.0, 0.8, 1.5, LEAST_S).duration_s == pytest.approx(46.0, abs=1.0)
    assert descent_pace(35.0, 1.5, 0.8, 1.5, LEAST_S).duration_s == pytest.approx(34.0, abs=1.0)


@pytest.mark.parametrize(
    ("way_m", "quick_m_s"),
    [(0.0, 1.5), (2.0, 1.5), (3.0, 1.5), (14.0, 1.5), (30.0, 0.05), (30.0, 0.9)],
    ids=[
        "none",
        "the last metres",
        "no more than these",
        "too short for two ways",
        "slowest",
        "hardly quicker",
    ],
)
def test_one_transfer_is_flown_where_it_takes_no_longer(way_m: float, quick_m_s: float) -> None:
    assert quick_way_m(way_m, quick_m_s, 0.8, 1.5, LEAST_S) == 0.0
    assert descent_pace(way_m, quick_m_s, 0.8, 1.5, LEAST_S) == lift_pace(way_m, 0.8, 1.5, LEAST_S)
