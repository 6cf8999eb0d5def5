"""The `sitl` program: sockets, clock and signals around `sitl.hil`."""

from __future__ import annotations

import errno
import os
import secrets
import select
import signal
import socket
import sys
import time
from collections.abc import Callable

import click

from autopilot.shell.compiling import ONCE, SIMULATOR
from autopilot.shell.options import (
    Address,
    Stop,
    StopRequest,
    address_option,
    be_punctual,
    datagram_socket,
    home_option,
    reason,
    receive,
    send,
    set_timeout,
    setting_option,
    shown,
)
from autopilot.vehicle.file import VEHICLES
from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from sitl.hil import HilSimulator
from sitl.pacing import Pacing
from sitl.sensors.shipped import PROFILES

_RESEND_FIRST_S = 0.05
_RESEND_LAST_S = 1.0
_LOOK_S = 0.2  # between two looks at a request to stop, while nothing comes
_TAKE_OVER_S = 0.5  # of silence of the autopilot that is served, until another may take its place
_LOST_S = 3.0  # of silence, until it is said that the autopilot is gone
_SPIN_NS = 150_000  # before a due time: longer than a sleep oversleeps
_TRUTH_WINDOW_US = 20_000  # in lockstep: of truth in one datagram
_SLOW_SHARE = 0.95  # of the clock that was asked for: a slower one is said
_SLOW_AGAIN_NS = 10_000_000_000  # between two words about it
_STALL_NS = 200_000_000  # later than this the schedule is moved instead of caught up with


class Link:
    """The socket that autopilots speak to, the one that is served, and where truth goes."""

    def __init__(self, listen: Address, truth: Address, say: Callable[[str], None]) -> None:
        try:
            self._socket = datagram_socket(listen)
            self._socket.bind(listen)
        except OSError as error:
            busy = "is another sitl running? " if error.errno == errno.EADDRINUSE else ""
            raise ValueError(
                f"cannot listen on {shown(listen)}: {reason(error)}; {busy}choose another with --listen"
            ) from None
        try:
            self._truth_socket = datagram_socket(truth)
        except OSError as error:
            raise ValueError(
                f"cannot send truth to {shown(truth)}: {reason(error)}; choose another with --truth"
            ) from None
        self._truth = truth
        self._gathered: list[bytes] = []  # truth of this window
        self._window_ends_us = 0
        self._timeout_s = 0.0
        self._say = say
        self._heard = 0.0  # when the peer last answered, monotonic clock
        self._turned_away: set[Address] = set()
        self.peer: Address | None = None

    def close(self) -> None:
        self._socket.close()
        self._tell_gathered()
        self._truth_socket.close()

    def timeout(self, seconds: float) -> None:
        """How long `receive` waits; 0: for ever. By SO_RCVTIMEO, which costs nothing per datagram."""
        if seconds != self._timeout_s:
            set_timeout(self._socket, seconds)
            self._timeout_s = seconds

    def wait(self, seconds: float) -> None:
        """Until a datagram is there, or so long."""
        select.select([self._socket], [], [], seconds)

    def receive(self, flags: int = 0) -> tuple[bytes, Address] | None:
        """The next datagram and its sender, None after the timeout."""
        return receive(self._socket, flags)

    def send(self, simulator: HilSimulator) -> None:
        """The sensors of the present tick to the autopilot. What cannot be sent counts as lost on the way."""
        if self.peer is not None:
            send(self._socket, simulator.sensor_datagram(), self.peer)

    def send_truth(self, simulator: HilSimulator) -> None:
        """The truth of the present tick, if there is any."""
        truth = simulator.truth_datagram()
        if truth is not None:
            send(self._truth_socket, truth, self._truth)

    def gather_truth(self, simulator: HilSimulator) -> None:
        """The truth of the present tick, if there is any; sent at the end of the window with all of it."""
        truth, now_us = simulator.truth_datagram(), simulator.core.now_us
        if truth is not None:
            self._gathered.append(truth)
        if not self._window_ends_us - _TRUTH_WINDOW_US < now_us < self._window_ends_us:
            self._window_ends_us = now_us - now_us % _TRUTH_WINDOW_US + _TRUTH_WINDOW_US
            self._tell_gathered()

    def _tell_gathered(self) -> None:
        if self._gathered:
            send(self._truth_socket, b"".join(self._gathered), self._truth)
            self._gathered.clear()

    def take(self, datagram: bytes, sender: Address, simulator: HilSimulator) -> bool:
        """Hand a datagram on. True if it is a heartbeat whose sender is served from now on.

        While one autopilot answers, no other takes its place.
        """
        if sender == self.peer and simulator.receive(datagram):
            self._heard = time.monotonic()
            return False
        if not simulator.greets(datagram):
            return False
        if sender != self.peer:
            if self.peer is not None and time.monotonic() - self._heard < _TAKE_OVER_S:
                if sender not in self._turned_away:
                    self._turned_away.add(sender)
                    served = shown(self.peer)
                    self._say(f"the autopilot at {shown(sender)} is not served: that at {served} answers")
                return False
            self._say(f"serving the autopilot at {shown(sender)}")
            self.peer = sender
        simulator.introduce()
        return True


class Watch:
    """Says when the autopilot falls silent and when it is back, once each."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._lost = False

    def heard(self, link: Link) -> None:
        """An answer came."""
        if self._lost:
            self._lost = False
            self._say(f"autopilot at {shown(link.peer)} answers again")

    def silence(self, since: float, link: Link, simulator: HilSimulator) -> None:
        """No answer since that time of the monotonic clock."""
        if not self._lost and time.monotonic() - since > _LOST_S:
            self._lost = True
            self._say(
                f"no answer from the autopilot at {shown(link.peer)} for {_LOST_S:g} s "
                f"(t = {simulator.now_us / 1e6:.3f} s); waiting for it"
            )


def meet(link: Link, simulator: HilSimulator, stop: StopRequest) -> None:
    """Wait until an autopilot speaks."""
    link.timeout(_LOOK_S)
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
    """Tick for ever, each tick as soon as the one before is answered, but no faster than `pacing` says."""
    watch = Watch(say)
    clock = None if pacing is None else _Clock(pacing, simulator, say)
    link.timeout(_RESEND_FIRST_S)
    while True:
        stop.check()
        if clock is not None:
            clock.wait()
        link.gather_truth(simulator)
        link.send(simulator)
        arrived = link.receive()
        greeted = arrived is not None and link.take(*arrived, simulator)
        if not simulator.answered:
            _insist(link, simulator, stop, watch, arrived is None or greeted)
        simulator.advance()


class _Clock:
    """The wall clock that lockstep keeps to where the machine can; says where it cannot."""

    def __init__(self, pacing: Pacing, simulator: HilSimulator, say: Callable[[str], None]) -> None:
        self._pacing, self._simulator, self._say = pacing, simulator, say
        self._period_ns = round(simulator.tick_us * 1000 / pacing.speed)
        self._due = time.perf_counter_ns()
        self._told_ns = 0

    def wait(self) -> None:
        """Until the next tick is due."""
        # what was waited for is not caught up with
        self._due = max(self._due, time.perf_counter_ns() - _STALL_NS) + self._period_ns
        now = _sleep_until(self._due)
        pacing = self._pacing
        pacing.record(self._due, now)
        figures = pacing.figures
        if figures is self._simulator.pacing:
            return
        self._simulator.pacing = figures
        share = figures.rate_hz * self._simulator.tick_us * 1e-6 / pacing.speed
        if 0.0 < share < _SLOW_SHARE and now - self._told_ns > _SLOW_AGAIN_NS:
            self._told_ns = now
            text = f"Machine busy: clock at {share:.2f} of {pacing.speed:g} x"
            self._say(text.lower())
            self._simulator.parameters.say(text, mavlink.MAV_SEVERITY_NOTICE)


def _insist(link: Link, simulator: HilSimulator, stop: StopRequest, watch: Watch, again: bool) -> None:
    """Until the present tick is answered, send it again; `again`: at once, as nothing came or a greeting."""
    began = sent = time.monotonic()
    silence_s = _RESEND_FIRST_S
    while not simulator.answered:
        stop.check()
        # not for every stray datagram: the answer to one doubled tick would double all that follow
        now = time.monotonic()
        if again or now - sent >= silence_s:
            link.send(simulator)
            sent = now
            silence_s = min(2.0 * silence_s, _RESEND_LAST_S)
            link.timeout(silence_s)
        watch.silence(began, link, simulator)
        arrived = link.receive()
        again = arrived is None or link.take(*arrived, simulator)
    link.timeout(_RESEND_FIRST_S)
    watch.heard(link)


def run_real_time(
    link: Link,
    simulator: HilSimulator,
    pacing: Pacing,
    stop: StopRequest,
    say: Callable[[str], None],
) -> None:
    """Tick for ever on an absolute schedule; a command that comes too late is missed, and counted."""
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
        link.send(simulator)
        pacing.record(due, now)
        simulator.pacing = pacing.figures
        link.send_truth(simulator)
        if now - due > _STALL_NS:
            start += now - due
        tick += 1
        if _await_answer(link, simulator, start + round(tick * period_ns)):
            heard = time.monotonic()
            watch.heard(link)
        else:
            watch.silence(heard, link, simulator)
        simulator.advance()


def _await_answer(link: Link, simulator: HilSimulator, due_ns: int) -> bool:
    """Until the present tick is answered (True) or the next one is due."""
    while True:
        arrived = link.receive(socket.MSG_DONTWAIT)
        if arrived:
            link.take(*arrived, simulator)
            if simulator.answered:
                return True
        left = due_ns - time.perf_counter_ns()
        if left <= 0:
            return False
        if not arrived and left > _SPIN_NS:
            link.wait((left - _SPIN_NS) * 1e-9)


def _sleep_until(due_ns: int) -> int:
    """Sleep, then spin over the last part; returns the time it is."""
    left = due_ns - time.perf_counter_ns()
    if left > _SPIN_NS:
        time.sleep((left - _SPIN_NS) * 1e-9)
    while True:
        now = time.perf_counter_ns()
        if now >= due_ns:
            return now


def _run_on(cpu: int) -> None:
    try:
        os.sched_setaffinity(0, {cpu})
    except (AttributeError, OSError):
        raise ValueError(f"cannot run on core {cpu}; leave --cpu out, or name another core") from None


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--sensors",
    default="lab",
    show_default=True,
    metavar="NAME|FILE",
    help=f"Sensor profile: {PROFILES.choice()}.",
)
@click.option(
    "--vehicle",
    default="bebop",
    show_default=True,
    metavar="NAME|FILE",
    help=f"What really flies: {VEHICLES.choice()}.",
)
@click.option(
    "--seed", default=1, show_default=True, type=click.IntRange(0, 2**63 - 1), help="Seed of all noise."
)
@click.option(
    "--speed",
    type=click.FloatRange(0.0, 1000.0, min_open=True),
    help="Simulated seconds per second, at most.  [default: 1; with --lockstep: no limit]",
)
@click.option("--lockstep", is_flag=True, help="As fast as the autopilot answers.")
@click.option(
    "--real-time",
    is_flag=True,
    help="Keep to the wall clock: do not wait for an autopilot that is late, its command is missed.",
)
@click.option(
    "--listen",
    type=address_option,
    metavar="HOST:PORT",
    default="127.0.0.1:4560",
    show_default=True,
    help="Where autopilots find us.",
)
@click.option(
    "--truth",
    type=address_option,
    metavar="HOST:PORT",
    default="127.0.0.1:14560",
    show_default=True,
    help="Where the truth goes, for logs and reports.",
)
@click.option(
    "--truth-every",
    type=click.IntRange(1, 1000),
    default=2,
    show_default=True,
    metavar="N",
    help="Truth on every Nth tick.",
)
@click.option(
    "--set",
    "settings",
    type=setting_option,
    metavar="NAME=VALUE",
    multiple=True,
    help="Set a SIM_ parameter; repeatable. Parameters of the autopilot are passed over.",
)
@click.option("--home", type=home_option, metavar="LAT,LON,ALT", help="Origin of the world: degrees, metres.")
@click.option("--cpu", type=click.IntRange(0), metavar="N", help="Run on this processor core only.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
@click.version_option(package_name="plumbline", message="sitl (Plumbline) %(version)s")
def main(
    sensors: str,
    vehicle: str,
    seed: int,
    speed: float | None,
    lockstep: bool,
    real_time: bool,
    listen: Address,
    truth: Address,
    truth_every: int,
    settings: tuple[tuple[str, float], ...],
    home: Home | None,
    cpu: int | None,
    quiet: bool,
) -> None:
    """Simulate a quadrotor with a load on a cable, and its sensors.

    Waits for an autopilot, sends it sensor readings and takes rotor commands back, by MAVLink over UDP. The
    world waits for the answer to every tick: on a busy machine its clock is slower, and nothing is lost.
    """
    if lockstep and real_time:
        raise click.UsageError("--lockstep and --real-time exclude each other")

    def say(text: str) -> None:
        if not quiet:
            print(f"sitl: {text}", flush=True)

    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the loops run, there is nothing to bring to an end
    link: Link | None = None
    factor = 1.0 if speed is None else speed
    unlimited = lockstep and speed is None
    pacing = Pacing(factor)
    simulator: HilSimulator | None = None
    began = time.monotonic()
    try:
        # first, so that nothing is said into the void while kernels are compiled
        link = Link(listen, truth, say)

        def build() -> HilSimulator:
            return HilSimulator.build(
                vehicle,
                sensors,
                seed,
                dict(settings),
                home,
                not real_time,
                truth_every,
                boot_id=secrets.randbits(63),
            )

        compiled = SIMULATOR.ready
        if not compiled:
            say(ONCE)
        warm = build()  # compiles, or loads, every kernel
        warm.truth_datagram()
        warm.receive(b"")
        warm.advance()
        if not compiled:
            SIMULATOR.done()
        simulator = build()
        if cpu is not None:
            _run_on(cpu)
        # where it would wait spinning for most of the time, it would keep others from their work
        be_punctual(real_time and simulator.tick_us * 1000 / factor > 4 * _SPIN_NS)
        mode = "in lockstep" if unlimited else f"at {factor:g} x real time, waiting where that is too fast"
        if real_time:
            mode = f"at {factor:g} x real time, waiting for nobody"
        say(
            f"vehicle {vehicle}, sensors {sensors}, seed {seed}, {1e6 / simulator.tick_us:g} Hz {mode}; "
            f"waiting for an autopilot on {shown(listen)}"
        )
        with StopRequest() as stop:
            meet(link, simulator, stop)
            began = time.monotonic()
            if real_time:
                run_real_time(link, simulator, pacing, stop, say)
            else:
                run_lockstep(link, simulator, stop, say, None if unlimited else pacing)
    except ValueError as error:
        print(f"sitl: {error}", file=sys.stderr)
        sys.exit(1)
    except Stop:
        pass
    finally:
        if link is not None:
            link.close()
    if simulator is not None:
        say(_summary(simulator, real_time, pacing, time.monotonic() - began))


def _summary(simulator: HilSimulator, real_time: bool, pacing: Pacing, wall_s: float) -> str:
    simulated_s = simulator.now_us / 1e6
    text = f"stopped at t = {simulated_s:.3f} s; "
    if real_time:
        text += pacing.summary(simulator.missed)
    else:
        text += f"{simulated_s / max(wall_s, 1e-9):.2f} x real time"
    if simulator.rejected:
        text += f"; {simulator.rejected} commands were not numbers"
    if simulator.diverged:
        text += "; the vehicle left the domain of the model"
    return text


if __name__ == "__main__":
    main()
