"""Ticks of the simulator without Python: the same bytes as with it, and where they end."""

from __future__ import annotations

import math
import socket
from collections.abc import Iterator

import pytest
from numba import config

from autopilot.shell.machine_sockets import SUPPORTED
from autopilot.wire.codec import FrameWriter
from autopilot.wire.convert.simulator import padded_forces
from gcs.shell.link import LOOPBACK, free_port
from sitl.hil import HilSimulator
from sitl.shell.link import TRUTH_WINDOW_US, Link
from sitl.shell.tick_loop import TickLoop
from tests.doubles.messages import hil_actuator_controls_message

pytestmark = pytest.mark.skipif(
    not SUPPORTED or bool(config.DISABLE_JIT), reason="without machine code all of it is Python"
)
TICK_US = 4000
LIFTING = (2.0, 2.0, 2.0, 2.0)
WAIT_S = 0.05  # for a datagram that does not come


GUST_US = 200_000  # when a gust begins, which is reported
GUST = {"SIM_GUST_E": 1.0, "SIM_GUST_AT_S": 1e-6 * GUST_US}


class Rig:
    """A simulator on a socket at tick 1, an autopilot, a receiver of the truth; and the same world in
    Python."""

    def __init__(self) -> None:
        self.truth, self.autopilot, self.stranger = (self.listener() for _ in range(3))
        address = (LOOPBACK, free_port())
        self.link = Link(address, self.truth.getsockname(), lambda text: None)
        self.link.peer = self.autopilot.getsockname()
        self.link.timeout(WAIT_S)
        self.simulator, self.twin = (
            HilSimulator.build(sensors="lab", seed=3, settings=GUST) for _ in range(2)
        )
        self.loop = TickLoop(self.link, self.simulator)
        self.writer = FrameWriter(1, 1)
        self.told: list[bytes] = []  # the truth that the twin sent
        for world in (self.simulator, self.twin):
            world.receive(self.answer(0))
            world.advance()
        self.tell()

    @staticmethod
    def listener() -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.bind((LOOPBACK, 0))
        made.settimeout(5.0)
        return made

    def tell(self) -> None:
        """Send what the simulator sends at this tick before its loop begins."""
        self.link.gather_truth(self.simulator)
        self.link.send(self.simulator.sensor_datagram())

    def answer(self, now_us: int, forces: tuple[float, ...] = LIFTING) -> bytes:
        writer = FrameWriter(1, 1)
        return writer.frame(
            hil_actuator_controls_message(now_us, padded_forces(forces), True, True, False, 0.0)
        )

    def send_datagrams(self, *datagrams: bytes) -> None:
        for datagram in datagrams:
            self.autopilot.sendto(datagram, self.link.address)

    def step_twin(self) -> bytes:
        """The twin's next tick: its truth is stored, its sensors are returned."""
        self.twin.receive(self.answer(self.twin.now_us))
        self.twin.advance()
        self.told.append(self.twin.truth_datagram() or b"")
        return self.twin.sensor_datagram()

    def heard(self) -> bytes:
        return self.autopilot.recv(65535)

    def close(self) -> None:
        self.link.close()
        for one in (self.truth, self.autopilot, self.stranger):
            one.close()


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    assert made.heard() == made.simulator.sensor_datagram()
    yield made
    made.close()


def test_ticks_without_python_are_those_with_it_to_the_byte(rig: Rig) -> None:
    ticks = 12
    rig.told.append(rig.twin.truth_datagram() or b"")
    rig.send_datagrams(*(rig.answer(TICK_US * (1 + i)) for i in range(ticks)))
    assert rig.loop.run() == (False, None), "then there is no answer"
    assert rig.simulator.now_us == TICK_US * (1 + ticks)
    for _ in range(ticks):
        assert rig.heard() == rig.step_twin()
    assert rig.simulator.sensor_datagram() == rig.twin.sensor_datagram(), "it can be sent again"
    assert rig.simulator.core.state == rig.twin.core.state
    windows = b"".join(rig.truth.recv(65535) for _ in range(2))
    assert windows == b"".join(rig.told[: 2 * TRUTH_WINDOW_US // TICK_US])


def test_python_goes_on_where_the_loop_has_ended(rig: Rig) -> None:
    rig.send_datagrams(*(rig.answer(TICK_US * (1 + i)) for i in range(7)))
    rig.loop.run()
    for _ in range(7):
        rig.step_twin()
    for _ in range(60):
        rig.simulator.receive(rig.answer(rig.simulator.now_us))
        rig.simulator.advance()
        truth = rig.simulator.truth_datagram() or b""
        assert rig.simulator.sensor_datagram() == rig.step_twin()
        assert truth == rig.told[-1]


def test_a_tick_with_more_to_say_is_left_to_python(rig: Rig) -> None:
    ticks = GUST_US // TICK_US
    rig.send_datagrams(*(rig.answer(TICK_US * i) for i in range(1, ticks + 5)))
    moved, arrived = rig.loop.run()
    assert (moved, arrived) == (True, None)
    assert rig.simulator.now_us == GUST_US
    for _ in range(1, ticks):
        rig.step_twin()
    assert rig.simulator.sensor_datagram() == rig.twin.sensor_datagram()
    assert (rig.simulator.truth_datagram() or b"") == rig.told[-1]


@pytest.mark.parametrize(
    "forge",
    [
        lambda good: b"",
        lambda good: b"no frame at all",
        lambda good: good[:-1] + bytes([good[-1] ^ 1]),
        lambda good: good[:20] + bytes([good[20] ^ 1]) + good[21:],
        lambda good: good + good,
        lambda good: good[:-1],
        lambda good: FrameWriter(9, 1).frame(
            hil_actuator_controls_message(TICK_US, padded_forces(LIFTING), True, True, False, 0.0)
        ),
    ],
)
def test_what_is_no_plain_answer_is_handed_to_python_and_moves_nothing(rig: Rig, forge: object) -> None:
    datagram = forge(rig.answer(TICK_US))  # type: ignore[operator]
    rig.send_datagrams(datagram)
    before = rig.simulator.core.state
    assert rig.loop.run() == (False, (datagram, rig.link.peer))
    assert (rig.simulator.now_us, rig.simulator.core.state) == (TICK_US, before)


def test_answers_of_other_ticks_and_answers_that_are_no_numbers_move_nothing(rig: Rig) -> None:
    for datagram in (rig.answer(0), rig.answer(2 * TICK_US), rig.answer(TICK_US, (math.nan, 1.0, 1.0, 1.0))):
        rig.send_datagrams(datagram)
        assert rig.loop.run() == (False, (datagram, rig.link.peer))
        assert rig.simulator.now_us == TICK_US


def test_a_stranger_moves_nothing(rig: Rig) -> None:
    rig.stranger.sendto(rig.answer(TICK_US), rig.link.address)
    assert rig.loop.run() == (False, (rig.answer(TICK_US), rig.stranger.getsockname()))
    assert rig.simulator.now_us == TICK_US


def test_a_simulator_that_has_more_to_say_waits_for_python(rig: Rig) -> None:
    rig.simulator.parameters.send_text("something")
    rig.send_datagrams(rig.answer(TICK_US))
    assert rig.loop.run() == (False, (rig.answer(TICK_US), rig.link.peer))
    assert rig.simulator.now_us == TICK_US
