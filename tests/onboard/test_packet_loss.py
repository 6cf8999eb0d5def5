"""A lossy ground link: as many datagrams are lost as configured, and the same ones every time."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.onboard.packet_loss import PacketLoss
from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink

HEARTBEAT = FrameWriter(1, 1).frame(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))
TIMESYNC = FrameWriter(1, 1).frame(mavlink.MAVLink_timesync_message(0, 123_456))
DATAGRAMS = 20_000
# Standard deviations of a binomial count; 1 in 15 000 draws lies further out, and the seed is fixed
SIGMAS = 4.0


@pytest.mark.parametrize("percent", [0.5, 10.0, 50.0, 99.0])
@pytest.mark.parametrize("direction", [0, 1])
def test_as_many_are_lost_as_asked(direction: int, percent: float) -> None:
    loss = PacketLoss(direction)
    lost = sum(loss.drops(HEARTBEAT, percent) for _ in range(DATAGRAMS))
    share = percent / 100.0
    assert abs(lost - share * DATAGRAMS) < SIGMAS * math.sqrt(DATAGRAMS * share * (1.0 - share))


def test_all_or_nothing() -> None:
    assert not any(PacketLoss(0).drops(HEARTBEAT, 0.0) for _ in range(100))
    loss = PacketLoss(1)
    assert all(loss.drops(HEARTBEAT, 100.0) for _ in range(100))


@pytest.mark.parametrize(
    "message",
    [
        mavlink.MAVLink_param_set_message(1, 1, b"SIM_LOSS_PCT", 0.0, mavlink.MAV_PARAM_TYPE_REAL32),
        mavlink.MAVLink_param_value_message(b"SIM_LOSS_PCT", 0.0, mavlink.MAV_PARAM_TYPE_REAL32, 9, 3),
    ],
)
def test_a_link_that_loses_all_can_be_mended(message: Any) -> None:
    loss = PacketLoss(0)
    frame = FrameWriter(255, 190).frame(message)
    assert not any(loss.drops(frame, 100.0) for _ in range(100))


def test_the_clock_is_never_lost_and_takes_no_draw() -> None:
    with_clock, without = PacketLoss(0), PacketLoss(0)
    drawn = []
    for _ in range(500):
        assert not with_clock.drops(TIMESYNC, 100.0)
        drawn.append(with_clock.drops(HEARTBEAT, 30.0))
    assert drawn == [without.drops(HEARTBEAT, 30.0) for _ in range(500)]


def test_losses_are_the_same_every_time_and_not_the_same_both_ways() -> None:
    def pattern(direction: int) -> list[bool]:
        loss = PacketLoss(direction)
        return [loss.drops(HEARTBEAT, 30.0) for _ in range(1000)]

    assert pattern(0) == pattern(0)
    assert pattern(0) != pattern(1)
    together = sum(a and b for a, b in zip(pattern(0), pattern(1), strict=True))
    assert abs(together - 90) < SIGMAS * math.sqrt(1000 * 0.09 * 0.91), "independent of each other"


@given(datagram=st.binary(max_size=40))
def test_any_bytes_can_be_lost(datagram: bytes) -> None:
    PacketLoss(0).drops(datagram, 50.0)
