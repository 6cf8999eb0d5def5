"""The ground station that shares the clock: what it receives in a window, and when it is waited for."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from itertools import count
from typing import Any

import pytest

from autopilot.services.records import Event, TimesyncAnswered
from autopilot.shell.ground import AutopilotError, LockstepGroundStation
from autopilot.shell.options import Stop
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink

TICK_US, WINDOW_US = 4_000, 20_000


class Vehicle:
    """An onboard software that sends its time at each tick, and a question at the first of each window."""

    def __init__(self) -> None:
        self.now_us = 0
        self.writer = FrameWriter(1, 1)
        self.heard: list[Any] = []

    def add_link(self, link: str) -> None:
        assert link == "ground"

    def ground_datagrams(self) -> list[tuple[str, bytes]]:
        return [("ground", self.writer.frame(mavlink.MAVLink_system_time_message(self.now_us, 0)))]

    def timesync_request(self, link: str) -> bytes | None:
        ask = mavlink.MAVLink_timesync_message(0, self.now_us * 1000)
        return None if self.now_us % WINDOW_US else self.writer.frame(ask)

    def receive_ground(self, datagram: bytes, link: str) -> list[Event]:
        received = [one.message for one in decode(datagram)[0]]
        self.heard += received
        return [TimesyncAnswered(link, m.tc1, m.ts1) for m in received if hasattr(m, "tc1")]


class Waits(Exception):
    """The vehicle waits for an answer."""


class NoPatience:
    """Raises when the vehicle has checked this often whether it should stop: it waits in vain."""

    def __init__(self, looks: int) -> None:
        self.looks = looks

    def check(self) -> None:
        self.looks -= 1
        if self.looks < 0:
            raise Waits


class Rig:
    """The vehicle's end of the link, and a socket that plays the ground station."""

    def __init__(self) -> None:
        self.ground = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.ground.bind(("127.0.0.1", 0))
        self.ground.settimeout(5.0)
        self.vehicle: Any = Vehicle()
        self.step = LockstepGroundStation(self.ground.getsockname())
        self.step.join(self.vehicle)
        self.writer = FrameWriter(255, 190)
        with pytest.raises(Waits):
            self.tick(looks=1)  # the datagram tells the ground the vehicle's address
        self.address = self.ground.recvfrom(65535)[1]
        assert [m.get_type() for m in self.told()] == ["TIMESYNC"], "what is not answered is asked again"

    def say(self, message: Any) -> None:
        self.ground.sendto(self.writer.frame(message), self.address)

    def waits(self, time_us: int) -> None:
        """Check that the vehicle waits at this time, whatever it receives that is no answer."""
        for _ in range(9):
            self.ground.sendto(b"no answer", self.address)
        with pytest.raises(Waits):
            self.ticks_to(time_us + TICK_US)
        assert self.vehicle.now_us == time_us

    def answer(self, time_us: int, tc1: int) -> None:
        """Answer the question of a time, asked or not yet asked."""
        self.say(mavlink.MAVLink_timesync_message(tc1, time_us * 1000))

    def tick(self, looks: int = 8) -> None:
        self.step.exchange(self.vehicle, lambda events: None, NoPatience(looks))  # type: ignore[arg-type]
        self.vehicle.now_us += TICK_US

    def ticks_to(self, time_us: int) -> None:
        while self.vehicle.now_us < time_us:
            self.tick()

    def told(self) -> list[Any]:
        return [one.message for one in decode(self.ground.recv(65535))[0]]


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    yield made
    made.step.close()
    made.ground.close()


def test_a_window_is_one_datagram_that_ends_with_the_question(rig: Rig) -> None:
    rig.answer(0, 1)
    rig.answer(WINDOW_US, WINDOW_US * 1000 + 1)
    rig.ticks_to(WINDOW_US + TICK_US)
    first, second = rig.told(), rig.told()
    assert [m.get_type() for m in first] == ["SYSTEM_TIME", "TIMESYNC"]
    assert [m.time_unix_usec for m in second[:-1]] == [4_000, 8_000, 12_000, 16_000, 20_000]
    assert (second[-1].tc1, second[-1].ts1) == (0, WINDOW_US * 1000)


def test_who_promises_silence_is_not_waited_for_until_it_is_over(rig: Rig) -> None:
    rig.answer(0, 60_000_000)
    rig.ticks_to(60_000)
    for time_us in (20_000, 40_000):  # these come late, and the vehicle does not wait for them
        rig.answer(time_us, 60_000_000)
    rig.waits(60_000)
    rig.say(mavlink.MAVLink_system_time_message(0, 7))
    rig.answer(60_000, 60_000_001)
    rig.tick()
    assert [m.get_type() for m in rig.vehicle.heard] == ["TIMESYNC", "SYSTEM_TIME", "TIMESYNC"]
    rig.waits(80_000)


def test_who_is_silent_for_long_hears_of_several_windows_at_once(rig: Rig) -> None:
    rig.answer(0, 400_000_000)
    rig.ticks_to(80_000)
    assert [m.get_type() for m in rig.told()] == ["SYSTEM_TIME", "TIMESYNC"]
    rig.ground.settimeout(0.0)
    with pytest.raises(BlockingIOError):
        rig.told()
    rig.tick()
    windows = [rig.told() for _ in range(4)]
    assert [window[-1].ts1 // 1000 for window in windows] == [20_000, 40_000, 60_000, 80_000]
    said = [m.time_unix_usec for window in windows for m in window[:-1]]
    assert said == list(range(TICK_US, 80_000 + TICK_US, TICK_US))


def test_it_hears_of_each_window_at_once_before_it_is_waited_for(rig: Rig) -> None:
    rig.answer(0, 400_000_000)
    rig.ticks_to(320_000 + TICK_US)
    for _ in range(17):
        rig.told()
    for time_us in (340_000, 360_000, 380_000):
        rig.ticks_to(time_us + TICK_US)
        assert rig.told()[-1].ts1 == time_us * 1000
    rig.waits(400_000)


@pytest.mark.parametrize("tc1", [1, 1_767_225_600_000_000_000, 2**63 - 1, -5])
def test_a_clock_of_its_own_is_no_promise(rig: Rig, tc1: int) -> None:
    rig.answer(0, tc1)
    rig.tick()
    rig.waits(WINDOW_US)


def test_it_can_be_stopped_while_it_waits(rig: Rig) -> None:
    class Asked:
        def check(self) -> None:
            raise Stop

    with pytest.raises(Stop):
        rig.step.exchange(rig.vehicle, lambda events: None, Asked())  # type: ignore[arg-type]


def test_one_that_is_silent_for_long_ends_the_program(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """As when it was stopped (SIGSTOP), or ended without notice: the clock has waited for it meanwhile."""
    ticking = count(0.0, 2.0)  # s of the monotonic clock, which advances at each look
    monkeypatch.setattr(time, "monotonic", lambda: next(ticking))
    with pytest.raises(AutopilotError, match="the ground station was silent for 30 s; stopping"):
        rig.tick(looks=40)
