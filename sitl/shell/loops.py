"""The loops of the simulator around Plumbline's own autopilot: in lockstep, and on the wall clock."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

from autopilot.shell.options import Address, StopRequest, address_text
from autopilot.wire.dialect import plumbline as mavlink
from sitl.hil import HilSimulator
from sitl.pacing import Pacing
from sitl.shell.link import Link
from sitl.shell.tick_loop import TickLoop

_RESEND_FIRST_S = 0.05
_RESEND_LAST_S = 1.0
POLL_S = 0.2  # between two checks for a request to stop, while nothing arrives
LOST_S = 3.0  # of silence, after which the autopilot is reported as silent
LONG_WAIT_S = 1.0  # for one answer: longer than on a busy machine; such a wait is reported
SPIN_NS = 150_000  # before a due time: longer than a sleep overruns
_SLOW_SHARE = 0.95  # of the requested speed of the clock: a slower one is reported
_SLOW_REPORT_PERIOD_NS = 10_000_000_000  # between two reports of it
_STALL_NS = 200_000_000  # a greater lateness moves the schedule and is not caught up with
# between two ticks, without waiting for an answer: longer than on a busy machine
_MIN_STANDSTILL_NS = 2_000_000_000


class Watch:
    """Reports when the autopilot falls silent and when it answers again, once each."""

    def __init__(self, notify: Callable[[str], None]) -> None:
        self._notify = notify
        self._lost_peer: Address | None = None

    def note_answer(self, link: Link) -> None:
        """Note that an answer came."""
        lost_peer, self._lost_peer = self._lost_peer, None
        # else another has taken its place, which was reported
        if lost_peer is not None and lost_peer == link.peer:
            self._notify(f"autopilot at {address_text(link.peer)} answers again")

    def check_silence(self, since: float, link: Link, simulator: HilSimulator) -> None:
        """Note that no answer has come since that time of the monotonic clock."""
        if self._lost_peer is None and time.monotonic() - since > LOST_S:
            self._lost_peer = link.peer
            self._notify(
                f"no answer from the autopilot at {address_text(link.peer)} for {LOST_S:g} s "
                f"(t = {simulator.now_us / 1e6:.3f} s); waiting for it"
            )


def wait_for_autopilot(link: Link, simulator: HilSimulator, stop: StopRequest) -> None:
    """Wait for the heartbeat of an autopilot."""
    link.timeout(POLL_S)
    while link.peer is None:
        stop.check()
        arrived = link.receive()
        if arrived:
            link.process(*arrived, simulator)


def run_lockstep(
    link: Link,
    simulator: HilSimulator,
    stop: StopRequest,
    notify: Callable[[str], None],
    pacing: Pacing | None = None,
) -> None:
    """Tick for ever, each tick as soon as the one before is answered, but no faster than `pacing` allows."""
    watch = Watch(notify)
    clock = None if pacing is None else Clock(pacing, simulator, notify)
    ticks = TickLoop(link, simulator) if pacing is None else None
    link.timeout(_RESEND_FIRST_S)
    while True:
        stop.check()
        if clock is not None:
            clock.wait()
        link.gather_truth(simulator)
        link.send(simulator.sensor_datagram())
        if ticks is None:
            sent_s = time.monotonic()  # waiting that is not counted would look like a busy machine
            arrived = link.receive()
        else:
            moved, arrived = ticks.run()
            if moved:
                continue
            sent_s = time.monotonic()
        greeting_came = arrived is not None and link.process(*arrived, simulator)
        if not simulator.answered:
            waited_s = _resend_until_answered(
                link, simulator, stop, watch, arrived is None or greeting_came, sent_s
            )
            if waited_s >= LONG_WAIT_S:
                notify(f"waited {waited_s:.1f} s for the autopilot")
                if clock is not None:
                    clock.skip(waited_s)
        simulator.advance()


class Clock:
    """The wall clock that lockstep follows if the machine is fast enough; reports when it is not."""

    def __init__(self, pacing: Pacing, simulator: HilSimulator, notify: Callable[[str], None]) -> None:
        self._pacing, self._simulator, self._notify = pacing, simulator, notify
        self._period_ns = round(simulator.tick_us * 1000 / pacing.speed)
        self._due_ns = time.perf_counter_ns()
        self._reported_ns = 0
        self._began_ns = time.perf_counter_ns()  # the last tick, or the end of a wait for an answer

    def skip(self, seconds: float) -> None:
        """Leave out a time for which the clock stood because no answer came."""
        self._due_ns = self._began_ns = time.perf_counter_ns()
        self._pacing.pause(round(seconds * 1e9))

    def wait(self) -> None:
        """Wait until the next tick is due."""
        # a greater lateness than _STALL_NS is not caught up with
        self._due_ns = max(self._due_ns, time.perf_counter_ns() - _STALL_NS) + self._period_ns
        before, now = self._began_ns, _sleep_until(self._due_ns)
        self._began_ns = now
        if now - before >= _MIN_STANDSTILL_NS + self._period_ns:
            standstill_s = (now - before) * 1e-9
            self._notify(
                f"stood still for {standstill_s:.1f} s (SIGSTOP, Ctrl-Z, a debugger, or the machine did)"
            )
            self.skip(standstill_s)
            return
        pacing = self._pacing
        pacing.record(self._due_ns, now)
        figures = pacing.figures
        if figures is self._simulator.pacing:
            return
        self._simulator.pacing = figures
        speed = figures.rate_hz * self._simulator.tick_us * 1e-6
        if 0.0 < speed < _SLOW_SHARE * pacing.speed and now - self._reported_ns > _SLOW_REPORT_PERIOD_NS:
            self._reported_ns = now
            text = f"Machine busy: clock at {speed:.2f} x, not {pacing.speed:g} x"
            self._notify(text.lower())
            self._simulator.parameters.send_text(text, mavlink.MAV_SEVERITY_NOTICE)


def _resend_until_answered(
    link: Link, simulator: HilSimulator, stop: StopRequest, watch: Watch, resend: bool, began_s: float
) -> float:
    """Resend the present tick until it is answered; `resend`: at once, because nothing or a greeting came.
    Returns how long the answer took, in s, since the tick was sent at `began_s` (monotonic)."""
    sent = time.monotonic()
    silence_s = _RESEND_FIRST_S
    while not simulator.answered:
        stop.check()
        # not for every stray datagram: the second answer to a resent tick would double all ticks that follow
        now = time.monotonic()
        if resend or now - sent >= silence_s:
            link.send(simulator.sensor_datagram())
            sent = now
            silence_s = min(2.0 * silence_s, _RESEND_LAST_S)
            link.timeout(silence_s)
        watch.check_silence(began_s, link, simulator)
        arrived = link.receive()
        resend = arrived is None or link.process(*arrived, simulator)
    link.timeout(_RESEND_FIRST_S)
    watch.note_answer(link)
    return time.monotonic() - began_s


def run_real_time(
    link: Link,
    simulator: HilSimulator,
    pacing: Pacing,
    stop: StopRequest,
    notify: Callable[[str], None],
    send_tick: Callable[[], None],
    process: Callable[[bytes, Address], object],
) -> None:
    """Tick for ever on an absolute schedule; a command that comes too late is missed, and counted.

    `send_tick` sends the present tick to the autopilot, `process` processes each datagram that comes back.
    """
    watch = Watch(notify)
    period_ns = simulator.tick_us * 1000 / pacing.speed
    simulator.pacing = pacing.figures
    last_answer_s = time.monotonic()
    start = time.perf_counter_ns()
    tick = 0
    while True:
        stop.check()
        due = start + round(tick * period_ns)
        now = _sleep_until(due)
        send_tick()
        pacing.record(due, now)
        simulator.pacing = pacing.figures
        link.send_truth(simulator)
        if now - due > _STALL_NS:
            start += now - due
        tick += 1
        if _await_answer(link, simulator, start + round(tick * period_ns), process):
            last_answer_s = time.monotonic()
            watch.note_answer(link)
        else:
            watch.check_silence(last_answer_s, link, simulator)
        simulator.advance()


def _await_answer(
    link: Link, simulator: HilSimulator, due_ns: int, process: Callable[[bytes, Address], object]
) -> bool:
    """Wait until the present tick is answered (True) or the next one is due."""
    while True:
        arrived = link.receive(socket.MSG_DONTWAIT)
        if arrived:
            process(*arrived)
            if simulator.answered:
                return True
        remaining_ns = due_ns - time.perf_counter_ns()
        if remaining_ns <= 0:
            return False
        if not arrived and remaining_ns > SPIN_NS:
            link.wait((remaining_ns - SPIN_NS) * 1e-9)


def _sleep_until(due_ns: int) -> int:
    """Sleep, then spin for the last part; returns the present time."""
    remaining_ns = due_ns - time.perf_counter_ns()
    if remaining_ns > SPIN_NS:
        time.sleep((remaining_ns - SPIN_NS) * 1e-9)
    while True:
        now = time.perf_counter_ns()
        if now >= due_ns:
            return now
