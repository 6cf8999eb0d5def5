"""The two ways to run a flight client on sockets: in lockstep with the vehicle, and on the wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

from gcs.clients.capture import Capture
from gcs.clients.flight import FlightClient
from gcs.clients.lockstep import LockstepTurns, TruthQueue, ground_turn
from gcs.errors import NoVehicleError
from gcs.shell.display import FlightDisplay, notify
from gcs.shell.link import UdpSocket, monotonic_us
from gcs.shell.stopping import StopRequest
from gcs.shell.vehicle_socket import VehicleSocket

if TYPE_CHECKING:
    from gcs.workflows.flight_page import FlightPage

_WAIT_S = 0.2
_TICK_S = 0.01  # on the wall clock; not at each datagram, to leave the cores to punctual processes
START_LIMIT_S = 60.0  # a start takes some seconds on an idle machine; all kernels are compiled before
BUSY_CHECK_S = 3.0  # of silence, after which it is checked whether the autopilot is computing
START_CHECK_S = 10.0  # the same before the start, which is itself computing
SILENCE_LIMIT_S = 20.0  # of a vehicle in lockstep that has sent before
STALL_LIMIT_S = 60.0  # without progress of the clock of a vehicle that sends; no load delays it so long

EndReason = Callable[[], str]  # why one of the child processes has ended; empty if none has


class DatagramSource(Protocol):
    """A source of datagrams: a socket, or those of its datagrams that concern the vehicle."""

    def drain(self) -> list[bytes]:
        """All datagrams that have arrived, without waiting."""


class ClockMonitor:
    """Notices that the vehicle's clock stands while the vehicle still sends: its simulator is silent."""

    def __init__(self, now_s: float) -> None:
        self._time_us: int | None = None
        self._last_check_s = now_s
        self._stalled_s = 0.0  # counted only while this process ran

    def stall_reason(self, time_us: int | None, now_s: float) -> str:
        """What is wrong with a clock that is at `time_us` now (None: not known); empty if nothing is."""
        elapsed_s, self._last_check_s = min(now_s - self._last_check_s, 1.0), now_s
        if time_us is None or time_us != self._time_us:
            self._time_us, self._stalled_s = time_us, 0.0
            return ""
        self._stalled_s += elapsed_s
        if self._stalled_s < STALL_LIMIT_S:
            return ""
        since = f"{time_us * 1e-6:.3f} s for {self._stalled_s:.0f} s"
        return f"the vehicle's clock has stood at {since}: the autopilot speaks, but its simulator is silent"


def run_lockstep(
    client: FlightClient,
    capture: Capture,
    vehicle: UdpSocket,
    truth: UdpSocket,
    end_reason: EndReason,
    display: FlightDisplay,
    stop: StopRequest,
    on_first_message: Callable[[], None],
    page: FlightPage | None = None,
    is_busy: Callable[[], bool] = lambda: False,
    own_code: Sequence[str] = (),
) -> None:
    """Fly until the client has its outcome. `on_first_message` is called at the vehicle's first question.

    If a process ends before that, NoVehicleError is raised; if one ends later, that is an outcome. An
    autopilot that is silent while it `is_busy` is compiling or computing what was requested; the loop waits
    for it.
    `own_code` names the user's classes, for whose answers an idle autopilot may be waiting.
    """
    turns = LockstepTurns()
    truth_queue = TruthQueue()
    pending: list[bytes] = []
    started = False
    silent_until_us = 0  # time until which the vehicle continues without waiting for answers
    question_us: int | None = None  # the time of the vehicle's last question
    clock = ClockMonitor(time.monotonic())
    last_received_s = last_busy_s = time.monotonic()
    wait_reported = False
    while client.outcome is None:
        datagrams = vehicle.wait(_WAIT_S)
        if stop:
            client.interrupt(stop.reason)
        elif not datagrams:
            limit_s, check_s = (SILENCE_LIMIT_S, BUSY_CHECK_S) if started else (START_LIMIT_S, START_CHECK_S)
            reason = end_reason()
            silent_s = time.monotonic() - last_received_s
            if silent_s > check_s and is_busy():
                if not wait_reported:
                    own_work = f"an answer of {' or '.join(own_code)}, or " if own_code else ""
                    work = "shaping a difficult path" if started else "compiling before it starts"
                    notify(f"waiting for the autopilot, which is computing (for example {own_work}{work})")
                wait_reported, last_busy_s = True, time.monotonic()
            if not reason and time.monotonic() - max(last_received_s, last_busy_s) > limit_s:
                awaited = f", perhaps waiting for {' or '.join(own_code)}" if own_code else ""
                reason = f"the autopilot has sent nothing for {limit_s:.0f} s{awaited}"
            if reason and not started:
                raise NoVehicleError(reason)
            if reason:
                client.end_as_lost(reason)
            _show(display, client)
            continue
        last_received_s, wait_reported = time.monotonic(), False
        for datagram in datagrams:
            question_ns = turns.question(datagram)
            if question_ns is None:
                pending.append(datagram)
                reason = (end_reason() or clock.stall_reason(question_us, last_received_s)) if started else ""
                if reason:
                    client.end_as_lost(reason)
                continue
            earlier_answer = turns.repeated_answer(question_ns)
            if earlier_answer is not None:
                vehicle.send(earlier_answer)
                continue
            if not started:
                started = True
                on_first_message()
            pending.append(datagram)
            now_us = question_us = question_ns // 1000
            truth_queue.put(truth.drain())
            truth_datagrams = truth_queue.take_until(now_us)
            for sent in ground_turn(client, capture, truth_datagrams, pending, now_us):
                vehicle.send(sent)
            if page is not None:
                for sent in page.turn(
                    client, capture, truth_datagrams, pending, now_us, now_us >= silent_until_us
                ):
                    vehicle.send(sent)
            pending.clear()
            answer = turns.answer(question_ns, client.silent_until_us)
            if now_us >= silent_until_us:  # earlier, the vehicle does not wait for an answer
                vehicle.send(answer)
            silent_until_us = max(silent_until_us, client.silent_until_us)
            capture.flush(now_us)
            _show(display, client)
            if client.outcome is not None:
                break
    _wait_for_question(vehicle, turns, silent_until_us)


def _wait_for_question(vehicle: UdpSocket, turns: LockstepTurns, silent_until_us: int) -> None:
    """Wait until the vehicle waits for an answer, so that its own log always ends at the same tick."""
    while datagrams := vehicle.wait(_WAIT_S):
        for datagram in datagrams:
            question_ns = turns.question(datagram)
            if question_ns is not None and question_ns >= silent_until_us * 1000:
                return


def _show(display: FlightDisplay, client: FlightClient) -> None:
    if display.due:
        display.update(client.progress)


def run_wall_clock(
    client: FlightClient,
    capture: Capture,
    vehicle: UdpSocket | VehicleSocket,
    truth: DatagramSource,
    end_reason: EndReason,
    display: FlightDisplay,
    stop: StopRequest,
    on_first_message: Callable[[], None],
    page: FlightPage | None = None,
) -> None:
    """Fly until the client has its outcome. Log records have the time of the vehicle's clock once known."""
    started, clock = False, ClockMonitor(time.monotonic())
    while client.outcome is None:
        time.sleep(_TICK_S)
        now_us = monotonic_us()
        truth_datagrams, datagrams = truth.drain(), vehicle.drain()
        for sent in ground_turn(client, capture, truth_datagrams, datagrams, now_us):
            vehicle.send(sent)
        if page is not None:
            for sent in page.turn(client, capture, truth_datagrams, datagrams, now_us, may_send=True):
                vehicle.send(sent)
        capture.flush(client.view.time_us or 0)
        if not started and client.connection.target is not None:
            started = True
            on_first_message()
        _show(display, client)
        if stop:
            client.interrupt(stop.reason)
        reason = end_reason() or clock.stall_reason(client.view.time_us, now_us * 1e-6)
        if reason and client.connection.target is None:
            raise NoVehicleError(reason)
        if reason:
            client.end_as_lost(reason)
