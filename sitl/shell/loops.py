"""The loops of the simulator around Plumbline's own autopilot: in lockstep, and on the wall clock."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

from autopilot.shell.options import Address, StopRequest, shown
from autopilot.wire.dialect import plumbline as mavlink
from sitl.hil import HilSimulator
from sitl.pacing import Pacing
from sitl.shell.link import Link
from sitl.shell.tick_loop import TickLoop

_RESEND_FIRST_S = 0.05
_RESEND_LAST_S = 1.0
LOOK_S = 0.2  # between two checks for a request to stop, while nothing arrives
LOST_S = 3.0  # of silence, after which the autopilot is reported as silent
WAITED_S = 1.0  # for one answer: longer than on a busy machine; such a wait is reported
SPIN_NS = 150_000  # before a due time: longer than a sleep overruns
_SLOW_SHARE = 0.95  # of the requested speed of the clock: a slower one is reported
_SLOW_AGAIN_NS = 10_000_000_000  # between two reports of it
_STALL_NS = 200_000_000  # a greater lateness moves the schedule and is not caught up with
_STOOD_NS = 2_000_000_000  # between two ticks, without waiting for an answer: longer than on a busy machine


class Watch:
    """Reports when the autopilot falls silent and when it answers again, once each."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._lost: Address | None = None

    def heard(self, link: Link) -> None:
        """Note that an answer came."""
        lost, self._lost = self._lost, None
        if lost is not None and lost == link.peer:  # else another has taken its place, which was reported
            self._say(f"autopilot at {shown(link.peer)} answers again")

    def silence(self, since: float, link: Link, simulator: HilSimulator) -> None:
        """Note that no answer has come since that time of the monotonic clock."""
        if self._lost is None and time.monotonic() - since > LOST_S:
            self._lost = link.peer
            self._say(
                f"no answer from the autopilot at {shown(link.peer)} for {LOST_S:g} s "
                f"(t = {simulator.now_us / 1e6:.3f} s); waiting for it"
            )


def meet(link: Link, simulator: HilSimulator, stop: StopRequest) -> None:
    """Wait for the heartbeat of an autopilot."""
    link.timeout(LOOK_S)
    while link.peer is None:
        stop.check()
        arrived = link.receive()
        if arrived:
            link.take(*arrived, simulator)


def run_lockstep(
    link: Link,
    simulator: HilSimulator,
    stop: StopRequest,
    say: Callable[[str], None],
    pacing: Pacing | None = None,
) -> None:
    """Tick for ever, each tick as soon as the one before is answered, but no faster than `pacing` allows."""
    watch = Watch(say)
    clock = None if pacing is None else Clock(pacing, simulator, say)
    ticks = TickLoop(link, simulator) if pacing is None else None
    link.timeout(_RESEND_FIRST_S)
    while True:
        stop.check()
        if clock is not None:
            clock.wait()
        link.gather_truth(simulator)
        link.send(simulator.sensor_datagram())
        if ticks is None:
            asked_s = time.monotonic()  # waiting that is not counted would look like a busy machine
            arrived = link.receive()
        else:
            moved, arrived = ticks.run()
            if moved:
                continue
            asked_s = time.monotonic()
        greeted = arrived is not None and link.take(*arrived, simulator)
        if not simulator.answered:
            waited_s = _insist(link, simulator, stop, watch, arrived is None or greeted, asked_s)
            if waited_s >= WAITED_S:
                say(f"waited {waited_s:.1f} s for the autopilot")
                if clock is not None:
                    clock.skip(waited_s)
        simulator.advance()


class Clock:
    """The wall clock that lockstep follows if the machine is fast enough; reports when it is not."""

    def __init__(self, pacing: Pacing, simulator: HilSimulator, say: Callable[[str], None]) -> None:
        self._pacing, self._simulator, self._say = pacing, simulator, say
        self._period_ns = round(simulator.tick_us * 1000 / pacing.speed)
        self._due = time.perf_counter_ns()
        self._told_ns = 0
        self._began_ns = time.perf_counter_ns()  # the last tick, or the end of a wait for an answer

    def skip(self, seconds: float) -> None:
        """Leave out a time for which the clock stood because no answer came."""
        self._due = self._began_ns = time.perf_counter_ns()
        self._pacing.pause(round(seconds * 1e9))

    def wait(self) -> None:
        """Wait until the next tick is due."""
        # a greater lateness than _STALL_NS is not caught up with
        self._due = max(self._due, time.perf_counter_ns() - _STALL_NS) + self._period_ns
        before, now = self._began_ns, _sleep_until(self._due)
        self._began_ns = now
        if now - before >= _STOOD_NS + self._period_ns:
            stood_s = (now - before) * 1e-9
            self._say(f"stood still for {stood_s:.1f} s (SIGSTOP, Ctrl-Z, a debugger, or the machine did)")
            self.skip(stood_s)
            return
        pacing = self._pacing
        pacing.record(self._due, now)
        figures = pacing.figures
        if figures is self._simulator.pacing:
            return
        self._simulator.pacing = figures
        speed = figures.rate_hz * self._simulator.tick_us * 1e-6
        if 0.0 < speed < _SLOW_SHARE * pacing.speed and now - self._told_ns > _SLOW_AGAIN_NS:
            self._told_ns = now
            text = f"Machine busy: clock at {speed:.2f} x, not {pacing.speed:g} x"
            self._say(text.lower())
            self._simulator.parameters.say(text, mavlink.MAV_SEVERITY_NOTICE)


def _insist(
    link: Link, simulator: HilSimulator, stop: StopRequest, watch: Watch, again: bool, began: float
) -> float:
    """Resend the present tick until it is answered; `again`: immediately, because nothing or a greeting came.
    Returns how long the answer took, in s, since the tick was sent at `began` (monotonic)."""
    sent = time.monotonic()
    silence_s = _RESEND_FIRST_S
    while not simulator.answered:
        stop.check()
        # not for every stray datagram: the second answer to a resent tick would double all ticks that follow
        now = time.monotonic()
        if again or now - sent >= silence_s:
            link.send(simulator.sensor_datagram())
            sent = now
            silence_s = min(2.0 * silence_s, _RESEND_LAST_S)
            link.timeout(silence_s)
        watch.silence(began, link, simulator)
        arrived = link.receive()
        again = arrived is None or link.take(*arrived, simulator)
    link.timeout(_RESEND_FIRST_S)
    watch.heard(link)
    return time.monotonic() - began


def run_real_time(
    link: Link,
    simulator: HilSimulator,
    pacing: Pacing,
    stop: StopRequest,
    say: Callable[[str], None],
    ask: Callable[[], None],
    take: Callable[[bytes, Address], object],
) -> None:
    """Tick for ever on an absolute schedule; a command that comes too late is missed, and counted.

    `ask` sends the present tick to the autopilot, `take` processes each datagram that comes back.
    """
    watch = Watch(say)
    period_ns = simulator.tick_us * 1000 / pacing.speed
    simulator.pacing = pacing.figures
    heard = time.monotonic()
    start = time.perf_counter_ns()
    tick = 0
    while True:
        stop.check()
        due = start + round(tick * period_ns)
        now = _sleep_until(due)
        ask()
        pacing.record(due, now)
        simulator.pacing = pacing.figures
        link.send_truth(simulator)
        if now - due > _STALL_NS:
            start += now - due
        tick += 1
        if _await_answer(link, simulator, start + round(tick * period_ns), take):
            heard = time.monotonic()
            watch.heard(link)
        else:
            watch.silence(heard, link, simulator)
        simulator.advance()


def _await_answer(
    link: Link, simulator: HilSimulator, due_ns: int, take: Callable[[bytes, Address], object]
) -> bool:
    """Wait until the present tick is answered (True) or the next one is due."""
    while True:
        arrived = link.receive(socket.MSG_DONTWAIT)
        if arrived:
            take(*arrived)
            if simulator.answered:
                return True
        left = due_ns - time.perf_counter_ns()
        if left <= 0:
            return False
        if not arrived and left > SPIN_NS:
            link.wait((left - SPIN_NS) * 1e-9)


def _sleep_until(due_ns: int) -> int:
    """Sleep, then spin for the last part; returns the present time."""
    left = due_ns - time.perf_counter_ns()
    if left > SPIN_NS:
        time.sleep((left - SPIN_NS) * 1e-9)
    while True:
        now = time.perf_counter_ns()
        if now >= due_ns:
            return now
