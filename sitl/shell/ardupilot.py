"""The loop of the simulator around ArduPilot's JSON interface: a frame of the firmware is a tick."""

from __future__ import annotations

import time
from collections.abc import Callable

from autopilot.shell.options import StopRequest
from sitl.hil import HilSimulator
from sitl.interfaces.ardupilot import Exchange, read_servo_packet
from sitl.pacing import Pacing
from sitl.shell.link import Link
from sitl.shell.loops import LOOK_S, WAITED_S, Clock, Watch


def run_ardupilot(
    link: Link,
    simulator: HilSimulator,
    stop: StopRequest,
    say: Callable[[str], None],
    pacing: Pacing | None = None,
) -> None:
    """Tick for ever, each tick when the firmware requests it, but no faster than `pacing` allows."""
    exchange, watch = Exchange(simulator), Watch(say)
    clock = None if pacing is None else Clock(pacing, simulator, say)
    link.timeout(LOOK_S)
    heard_s = time.monotonic()
    while True:
        stop.check()
        arrived = link.receive()
        now_s = time.monotonic()
        if arrived is None:
            if link.peer is not None:
                watch.silence(heard_s, link, simulator)
            continue
        datagram, sender = arrived
        packet = read_servo_packet(datagram)
        if packet is None or not link.serves(sender):
            continue
        link.heard()
        watch.heard(link)
        if clock is not None:
            if now_s - heard_s >= WAITED_S:
                clock.skip(now_s - heard_s)
            clock.wait()
        heard_s = now_s
        reply = exchange.receive(packet, now_s)
        if reply.news:
            say(reply.news)
        if reply.answer:
            link.send(reply.answer)
        if reply.moved:
            link.gather_truth(simulator)
