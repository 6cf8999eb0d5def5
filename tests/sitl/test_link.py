"""The simulator's socket towards autopilots."""

from __future__ import annotations

from autopilot.shell.program import refusal_text
from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from gcs.shell.link import LOOPBACK, UdpSocket, free_port, wait
from sitl.hil import HilSimulator
from sitl.shell.link import Link

WAIT_S = 5.0


def test_a_flood_of_autopilots_that_are_turned_away_is_not_a_flood_of_lines() -> None:
    said: list[str] = []
    link = Link((LOOPBACK, free_port()), (LOOPBACK, free_port()), said.append)
    served = (LOOPBACK, 1)
    assert link.accepts(served)
    link.note_answer()
    said.clear()
    for port in range(2, 100):
        link.note_answer()
        assert not link.accepts((LOOPBACK, port))
    link.close()
    assert len(said) == 8
    assert said[0].endswith("is not served: that at 127.0.0.1:1 answers")
    assert said[-1].endswith("; others are not named")


def test_who_is_turned_away_is_told_who_is_served_and_not_at_each_greeting() -> None:
    rival = UdpSocket()
    link = Link((LOOPBACK, free_port()), (LOOPBACK, free_port()), lambda text: None)
    simulator = HilSimulator.build("bebop", "ideal", 1)
    beat = mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 1, 0, 1, 3)
    greeting = FrameWriter(1, 1).frame(beat)
    address = (LOOPBACK, int(rival.address.split(":")[1]))
    assert link.process(greeting, (LOOPBACK, 1), simulator)
    for _ in range(20):
        link.note_answer()
        assert not link.process(greeting, address, simulator)
    wait([rival], WAIT_S)
    told = rival.drain()
    link.close()
    rival.close()
    assert list(map(refusal_text, told)) == [
        "Serving another autopilot: 127.0.0.1:1; end that one, or start another sitl (--listen, --sim)"
    ]
    assert refusal_text(greeting) == refusal_text(b"\xfd garbage") == ""
