"""The loop of the simulator around Betaflight's SITL target, in real time."""

from __future__ import annotations

from collections.abc import Callable

from autopilot.shell.options import Address, StopRequest
from sitl.hil import HilSimulator
from sitl.interfaces.betaflight import Exchange, read_motors
from sitl.pacing import Pacing
from sitl.shell.link import Link
from sitl.shell.loops import POLL_S, run_real_time


def run_betaflight(
    link: Link,
    simulator: HilSimulator,
    stop: StopRequest,
    notify: Callable[[str], None],
    pacing: Pacing | None = None,
) -> None:
    """Tick for ever by the wall clock once a firmware answers; the world restarts with each new firmware."""
    exchange = Exchange(simulator)

    def send_tick() -> None:
        host, _ = link.peer or link.address
        link.send(exchange.state(), (host, link.address[1] + 1))

    def process(datagram: bytes, sender: Address) -> None:
        motors, before = read_motors(datagram), link.peer
        if motors is None or not link.accepts(sender):
            return
        if before not in {None, sender}:
            notify(f"the firmware restarted at t = {simulator.now_us / 1e6:.3f} s, and the world restarts")
            simulator.restart()
        link.note_answer()
        exchange.receive(motors)

    link.timeout(POLL_S)
    while link.peer is None:  # the firmware sends nothing until it receives a state
        stop.check()
        send_tick()
        arrived = link.receive()
        if arrived:
            process(*arrived)
    run_real_time(link, simulator, pacing or Pacing(1.0), stop, notify, send_tick, process)
