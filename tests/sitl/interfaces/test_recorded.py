"""Recorded answers of the firmwares while they lifted the load, replayed on our world.

Each recording holds the answers of some two seconds, from the ground until the load hangs.
"""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import pytest

from sitl.hil import HilSimulator
from sitl.interfaces import ardupilot, px4

RECORDED = Path(__file__).with_name("recorded")
PACKET = 40  # bytes of a packet of ArduPilot

Flown = tuple[list[bytes], HilSimulator]


def recording(name: str) -> bytes:
    return gzip.decompress((RECORDED / f"{name}.gz").read_bytes())


def by_ardupilot(seed: int = 1) -> Flown:
    simulator = HilSimulator.build("iris", "rtk", seed, {"SIM_RATE_HZ": ardupilot.RATE_HZ})
    exchange, said = ardupilot.Exchange(simulator), recording("arducopter-4.5.7")
    packets = [ardupilot.read_servo_packet(said[at : at + PACKET]) for at in range(0, len(said), PACKET)]
    return [exchange.receive(packet, 0.0).answer for packet in packets], simulator


def by_px4(seed: int = 1) -> Flown:
    simulator = HilSimulator.build("iris", "rtk", seed, {"SIM_RATE_HZ": px4.RATE_HZ})
    exchange, told = px4.Exchange(simulator), []
    for frame in px4.Stream().feed(recording("px4-1.14.2")):
        told.append(exchange.sensors())
        assert exchange.receive(frame)
        simulator.advance()
    return told, simulator


@pytest.mark.parametrize("flown", [by_ardupilot, by_px4])
def test_what_a_firmware_said_lifts_the_load(flown: Callable[[], Flown]) -> None:
    told, simulator = flown()
    state = simulator.core.state
    assert len(told) > 500 and simulator.now_us > 1_900_000
    assert state.x_load[2] > 0.2 and state.x_quad[2] - state.x_load[2] > 0.8


@pytest.mark.parametrize("flown", [by_ardupilot, by_px4])
def test_what_a_firmware_said_is_answered_with_the_same_bytes_each_time(
    flown: Callable[[int], Flown],
) -> None:
    first = flown(1)[0]
    assert flown(1)[0] == first
    assert flown(2)[0] != first
