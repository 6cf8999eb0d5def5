"""Ticks of the autopilot without Python: the same bytes as with it, and what ends them."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

import pytest
from numba import config

from autopilot.onboard.onboard import Onboard
from autopilot.onboard.tick_batch import NO_TIMESYNC_REQUESTS, TimesyncRequests
from autopilot.services.streams import NEVER_US
from autopilot.shell.machine_sockets import SUPPORTED
from autopilot.shell.options import set_timeout
from autopilot.shell.tick_loop import TickLoop
from autopilot.trajectory.timeline import expected_duration_s
from autopilot.wire.codec import decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import encode_mission
from gcs.clients.flight import FlightClient
from gcs.clients.lockstep import LockstepTurns
from gcs.closed_loop import Conditions, build_onboard, build_simulator
from missions.fileformat import load_mission

pytestmark = pytest.mark.skipif(
    not SUPPORTED or bool(config.DISABLE_JIT), reason="without machine code all of it is Python"
)
TICK_US = 4000
GROUND = "ground"
IN_FLIGHT = 2503  # ticks, after which the vehicle hovers, and the next tick sends nothing special
ALWAYS = TimesyncRequests(NEVER_US, NEVER_US, 4, (b"",))  # questions are allowed


class Said(NamedTuple):
    """What was received and sent at a tick."""

    sensors: bytes
    answer: bytes
    told: bytes  # to the ground station, with the question
    heard: tuple[bytes, ...]  # from there


@pytest.fixture(scope="module")
def flight() -> list[Said]:
    """The first ticks of a flight in Python alone."""
    mission, conditions, home = load_mission("hover"), Conditions(), Home()
    onboard, simulator = build_onboard(conditions, home), build_simulator(conditions, home)
    onboard.add_link(GROUND)
    client = FlightClient(encode_mission(mission, home), expected_duration_s(mission))
    turns, said = LockstepTurns(), []
    window: list[bytes] = []
    for _ in range(IN_FLIGHT + 200):
        sensors = simulator.sensor_datagram()
        answer = onboard.receive_sensors(sensors)
        assert answer is not None
        told = [datagram for _, datagram in onboard.ground_datagrams()]
        question = onboard.timesync_request(GROUND)
        heard: tuple[bytes, ...] = ()
        window += told
        if question is not None:
            told.append(question)
            for datagram in window:
                client.receive(datagram, onboard.now_us)
            window.clear()
            heard = (*client.poll(onboard.now_us), turns.answer(onboard.now_us * 1000))
            for datagram in heard:
                onboard.receive_ground(datagram, GROUND)
        said.append(Said(sensors, answer, b"".join(told), heard))
        simulator.receive(answer)
        simulator.advance()
    assert onboard.armed
    return said


class Rig:
    """An autopilot in flight behind a socket, and what the simulator sends there."""

    def __init__(self, flight: list[Said]) -> None:
        self.simulator, self.socket, self.ground = self._sockets = [
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(3)
        ]
        for one in self._sockets:
            one.bind(("127.0.0.1", 0))
        self.simulator.settimeout(5.0)
        self.simulator.connect(self.socket.getsockname())
        self.socket.connect(self.simulator.getsockname())
        set_timeout(self.socket, 0.05)
        self.loop = TickLoop(self.socket, self.socket, self.ground.getsockname())
        self.onboard = build_onboard(Conditions(), Home())
        self.onboard.add_link(GROUND)
        for said in flight[:IN_FLIGHT]:
            step(self.onboard, said)
        self.flight = flight[IN_FLIGHT:]

    def heard(self) -> list[bytes]:
        """What has arrived at the ground station, datagram by datagram."""
        return drain(self.ground)

    def close(self) -> None:
        for one in self._sockets:
            one.close()


def step(onboard: Onboard, said: Said) -> None:
    """A tick in Python, as in the flight."""
    assert onboard.receive_sensors(said.sensors) == said.answer
    told = [datagram for _, datagram in onboard.ground_datagrams()]
    question = onboard.timesync_request(GROUND)
    assert b"".join([*told, question or b""]) == said.told
    for datagram in said.heard:
        onboard.receive_ground(datagram, GROUND)


@pytest.fixture
def rig(flight: list[Said]) -> Iterator[Rig]:
    made = Rig(flight)
    yield made
    made.close()


def test_ticks_without_python_are_those_with_it_to_the_byte(rig: Rig) -> None:
    alone = done = 0
    heard: list[bytes] = []
    unsent = [b""]
    while done < len(rig.flight):
        for said in rig.flight[done : done + 40]:
            rig.simulator.send(said.sensors)
        before = rig.onboard.tick
        met = rig.loop.run(rig.onboard, ALWAYS._replace(unsent=tuple(unsent)))
        ran = rig.onboard.tick - before
        assert met.flew_ticks == (ran > 0)
        if met.flew_ticks:
            unsent = rig.onboard.unsent_windows
            heard += rig.heard()
            told = b"".join(one.told for one in rig.flight[: done + ran])
            assert b"".join((*heard, *unsent)) == told
            for said in rig.flight[done : done + ran]:
                assert rig.simulator.recv(65535) == said.answer
        done, alone = done + ran, alone + ran
        drain(rig.socket)
        if met.tick_to_decide is not None:
            assert rig.onboard.complete(met.tick_to_decide) == rig.flight[done].answer
            unsent += told_in_python(rig.onboard, rig.flight[done], unsent.pop())
            done += 1
        elif not met.can_continue and done < len(rig.flight):
            assert met.datagram is None
            assert rig.onboard.receive_sensors(rig.flight[done].sensors) == rig.flight[done].answer
            unsent += told_in_python(rig.onboard, rig.flight[done], unsent.pop())
            done += 1
    assert alone > 0.8 * len(rig.flight)
    assert len(heard) + len(unsent) - 1 == len(rig.flight) * TICK_US // 20_000, "a datagram for each window"


def told_in_python(onboard: Onboard, said: Said, before: bytes) -> list[bytes]:
    """The open window, which so far holds `before`, and the next one if this tick ends it."""
    told = [datagram for _, datagram in onboard.ground_datagrams()]
    question = onboard.timesync_request(GROUND)
    assert b"".join([*told, question or b""]) == said.told
    return [before + said.told] if question is None else [before + said.told, b""]


def drain(sock: socket.socket) -> list[bytes]:
    """The datagrams that have arrived and were not read."""
    come = []
    with suppress(BlockingIOError):
        while True:
            come.append(sock.recv(65535, socket.MSG_DONTWAIT))
    return come


def test_windows_are_sent_some_at_a_time_and_one_by_one_where_the_ground_will_be_waited_for(rig: Rig) -> None:
    for said in rig.flight[:20]:
        rig.simulator.send(said.sensors)
    together = ALWAYS._replace(max_windows=3, unsent=(b"one", b"two", b"op"))
    rig.loop.run(rig.onboard, together)
    first, second, third, *later = rig.heard()
    assert (first, second, third[:2]) == (b"one", b"two", b"op")
    assert (len(later), len(rig.onboard.unsent_windows)) == (3, 1)
    for said in rig.flight[20:25]:
        rig.simulator.send(said.sensors)
    rig.loop.run(rig.onboard, ALWAYS._replace(send_singly_us=rig.onboard.now_us))
    (window,) = rig.heard()
    assert decode(window)[0][-1].id == mavlink.MAVLINK_MSG_ID_TIMESYNC
    assert len(rig.onboard.unsent_windows) == 1


@pytest.mark.parametrize("unsent", [(bytes(60_000), b""), (b"window",) * 16 + (b"",)])
def test_more_than_there_is_room_for_is_left_to_python(rig: Rig, unsent: tuple[bytes, ...]) -> None:
    rig.simulator.send(rig.flight[0].sensors)
    assert rig.loop.run(rig.onboard, ALWAYS._replace(unsent=unsent)) == (False, False, None, None)


@pytest.mark.parametrize(
    "forge",
    [
        lambda good: b"no frame at all",
        lambda good: good[:-1] + bytes([good[-1] ^ 1]),
        lambda good: good[:30] + bytes([good[30] ^ 1]) + good[31:],
        lambda good: good[:-1],
        lambda good: good + b"\xfd",
    ],
)
def test_what_are_no_plain_sensors_is_handed_to_python_and_flies_nothing(rig: Rig, forge: object) -> None:
    datagram = forge(rig.flight[0].sensors)  # type: ignore[operator]
    rig.simulator.send(datagram)
    met = rig.loop.run(rig.onboard, ALWAYS)
    assert (met.flew_ticks, met.datagram) == (False, datagram)
    step(rig.onboard, rig.flight[0])


def test_ticks_that_are_over_or_far_ahead_are_handed_to_python(rig: Rig, flight: list[Said]) -> None:
    for said in (flight[IN_FLIGHT - 1], rig.flight[1]):
        rig.simulator.send(said.sensors)
        met = rig.loop.run(rig.onboard, ALWAYS)
        assert (met.flew_ticks, met.datagram) == (False, said.sensors)
    assert rig.onboard.receive_sensors(flight[IN_FLIGHT - 1].sensors) == flight[IN_FLIGHT - 1].answer
    step(rig.onboard, rig.flight[0])


def test_a_tick_that_was_flown_is_answered_again_with_the_same(rig: Rig) -> None:
    rig.simulator.send(rig.flight[0].sensors)
    rig.simulator.send(rig.flight[0].sensors)
    met = rig.loop.run(rig.onboard, ALWAYS)
    assert (met.flew_ticks, met.datagram) == (True, rig.flight[0].sensors)
    assert rig.onboard.receive_sensors(rig.flight[0].sensors) == rig.flight[0].answer


def test_no_question_is_asked_for_whose_answer_the_shell_waits(rig: Rig) -> None:
    for said in rig.flight[:20]:
        rig.simulator.send(said.sensors)
    rig.loop.run(rig.onboard, NO_TIMESYNC_REQUESTS)
    next_us = rig.onboard.now_us + TICK_US
    assert next_us % 20_000 == 0
    assert len(rig.onboard.unsent_windows) == 1, "an open window"


def test_a_request_is_answered_by_python(rig: Rig) -> None:
    rig.onboard.endpoint.send_text(6, "a text")
    assert rig.loop.run(rig.onboard, ALWAYS) == (False, False, None, None)
