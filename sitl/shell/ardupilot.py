"""The loop of the simulator around ArduPilot's JSON interface: a frame of the firmware is a tick."""

from __future__ import annotations

import time
from collections.abc import Callable

from autopilot.shell.options import StopRequest
from sitl.hil import HilSimulator
from sitl.interfaces.ardupilot import Exchange, read_servo_packet
from sitl.pacing import Pacing
from sitl.shell.link import Link
from sitl.shell.loops import LONG_WAIT_S, POLL_S, Clock, Watch


def run_ardupilot(
    link: Link,
    simulator: HilSimulator,
    stop: StopRequest,
    notify: Callable[[str], None],
    pacing: Pacing | None = None,
) -> None:
    """Tick for ever, each tick when the firmware requests it, but no faster than `pacing` allows."""
    exchange, watch = Exchange(simulator), Watch(notify)
    clock = None if pacing is None else Clock(pacing, simulator, notify)
    link.timeout(POLL_S)
    last_received_s = time.monotonic()
    while True:
        stop.check()
        arrived = link.receive()
        now_s = time.monotonic()
        if arrived is None:
            if link.peer is not None:
                watch.check_silence(last_received_s, link, simulator)
            continue
        datagram, sender = arrived
        packet = read_servo_packet(datagram)
        if packet is None or not link.accepts(sender):
            continue
        link.note_answer()
        watch.note_answer(link)
        if clock is not None:
            if now_s - last_received_s >= LONG_WAIT_S:
                clock.skip(now_s - last_received_s)
            clock.wait()
        last_received_s = now_s
        reply = exchange.receive(packet, now_s)
        if reply.notice:
            notify(reply.notice)
        if reply.answer:
            link.send(reply.answer)
        if reply.advanced:
            link.gather_truth(simulator)
