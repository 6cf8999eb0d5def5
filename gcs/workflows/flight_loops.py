"""The two ways to run a flight client on sockets: in lockstep with the vehicle, and on the wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from gcs.clients.capture import Capture
from gcs.clients.flight import FlightClient
from gcs.clients.lockstep import LockstepTurns, TruthQueue, ground_turn
from gcs.errors import NoVehicleError
from gcs.shell.display import FlightDisplay, say
from gcs.shell.link import UdpSocket, monotonic_us
from gcs.shell.stopping import StopRequest
from gcs.shell.vehicle_socket import VehicleSocket

if TYPE_CHECKING:
    from gcs.workflows.flight_page import FlightPage

_WAIT_S = 0.2
_TICK_S = 0.01  # on the wall clock; not at each datagram, to leave the cores to punctual processes
START_LIMIT_S = 60.0  # a start takes some seconds on an idle machine; all kernels are compiled before
WORKING_S = 3.0  # of silence, after which it is checked whether the autopilot is computing
SILENCE_LIMIT_S = 20.0  # of a vehicle in lockstep that has sent before
STANDING_LIMIT_S = 60.0  # without progress of the clock of a vehicle that sends; no load delays it so long

Ended = Callable[[], str]  # why one of the child processes has ended; empty if none has


class Drained(Protocol):
    """A source of datagrams: a socket, or those of its datagrams that concern the vehicle."""

    def drain(self) -> list[bytes]:
        """All datagrams that have arrived, without waiting."""


class Clock:
    """Notices that the vehicle's clock stands while the vehicle still sends: its simulator is silent."""

    def __init__(self, now_s: float) -> None:
        self._time_us: int | None = None
        self._looked_s = now_s
        self._stood_s = 0.0  # counted only while this process ran

    def standing(self, time_us: int | None, now_s: float) -> str:
        """What is wrong with a clock that is at `time_us` now (None: not known); empty if nothing is."""
        passed_s, self._looked_s = min(now_s - self._looked_s, 1.0), now_s
        if time_us is None or time_us != self._time_us:
            self._time_us, self._stood_s = time_us, 0.0
            return ""
        self._stood_s += passed_s
        if self._stood_s < STANDING_LIMIT_S:
            return ""
        since = f"{time_us * 1e-6:.3f} s for {self._stood_s:.0f} s"
        return f"the vehicle's clock has stood at {since}: the autopilot speaks, but its simulator is silent"


def run_lockstep(
    client: FlightClient,
    capture: Capture,
    vehicle: UdpSocket,
    truth: UdpSocket,
    ended: Ended,
    display: FlightDisplay,
    stop: StopRequest,
    first_word: Callable[[], None],
    page: FlightPage | None = None,
    works: Callable[[], bool] = lambda: False,
) -> None:
    """Fly until the client has its outcome. `first_word` is called at the vehicle's first question.

    If a process ends before that, NoVehicleError is raised; if one ends later, that is an outcome. An
    autopilot that is silent while it `works` is computing what was requested; the loop waits for it.
    """
    turns = LockstepTurns()
    truth_queue = TruthQueue()
    pending: list[bytes] = []
    started = False
    promised_us = 0  # time until which the vehicle continues without waiting for answers
    asked_us: int | None = None  # the time of the vehicle's last question
    clock = Clock(time.monotonic())
    heard_s = worked_s = time.monotonic()
    waits = False
    while client.outcome is None:
        datagrams = vehicle.wait(_WAIT_S)
        if stop:
            client.interrupt()
        elif not datagrams:
            limit_s = SILENCE_LIMIT_S if started else START_LIMIT_S
            reason = ended()
            silent_s = time.monotonic() - heard_s
            if started and silent_s > WORKING_S and works():
                if not waits:
                    say(
                        "waiting for the autopilot, which is computing (for example shaping a difficult path)"
                    )
                waits, worked_s = True, time.monotonic()
            if not reason and time.monotonic() - max(heard_s, worked_s) > limit_s:
                reason = f"the autopilot has sent nothing for {limit_s:.0f} s"
            if reason and not started:
                raise NoVehicleError(reason)
            if reason:
                client.lose(reason)
            _show(display, client)
            continue
        heard_s, waits = time.monotonic(), False
        for datagram in datagrams:
            question_ns = turns.question(datagram)
            if question_ns is None:
                pending.append(datagram)
                reason = (ended() or clock.standing(asked_us, heard_s)) if started else ""
                if reason:
                    client.lose(reason)
                continue
            given = turns.repeated(question_ns)
            if given is not None:
                vehicle.send(given)
                continue
            if not started:
                started = True
                first_word()
            pending.append(datagram)
            now_us = asked_us = question_ns // 1000
            truth_queue.put(truth.drain())
            told = truth_queue.until(now_us)
            for sent in ground_turn(client, capture, told, pending, now_us):
                vehicle.send(sent)
            if page is not None:
                for sent in page.turn(client, capture, told, pending, now_us, now_us >= promised_us):
                    vehicle.send(sent)
            pending.clear()
            answer = turns.answer(question_ns, client.silent_until_us)
            if now_us >= promised_us:  # earlier, the vehicle does not wait for an answer
                vehicle.send(answer)
            promised_us = max(promised_us, client.silent_until_us)
            capture.flush(now_us)
            _show(display, client)
            if client.outcome is not None:
                break
    _let_stand(vehicle, turns, promised_us)


def _let_stand(vehicle: UdpSocket, turns: LockstepTurns, promised_us: int) -> None:
    """Wait until the vehicle waits for an answer, so that its own log always ends at the same tick."""
    while datagrams := vehicle.wait(_WAIT_S):
        for datagram in datagrams:
            question_ns = turns.question(datagram)
            if question_ns is not None and question_ns >= promised_us * 1000:
                return


def _show(display: FlightDisplay, client: FlightClient) -> None:
    if display.due:
        display.update(client.progress)


def run_wall_clock(
    client: FlightClient,
    capture: Capture,
    vehicle: UdpSocket | VehicleSocket,
    truth: Drained,
    ended: Ended,
    display: FlightDisplay,
    stop: StopRequest,
    first_word: Callable[[], None],
    page: FlightPage | None = None,
) -> None:
    """Fly until the client has its outcome. Log records have the time of the vehicle's clock once known."""
    started, clock = False, Clock(time.monotonic())
    while client.outcome is None:
        time.sleep(_TICK_S)
        now_us = monotonic_us()
        told, heard = truth.drain(), vehicle.drain()
        for sent in ground_turn(client, capture, told, heard, now_us):
            vehicle.send(sent)
        if page is not None:
            for sent in page.turn(client, capture, told, heard, now_us, may_speak=True):
                vehicle.send(sent)
        capture.flush(client.view.time_us or 0)
        if not started and client.connection.target is not None:
            started = True
            first_word()
        _show(display, client)
        if stop:
            client.interrupt()
        reason = ended() or clock.standing(client.view.time_us, now_us * 1e-6)
        if reason and client.connection.target is None:
            raise NoVehicleError(reason)
        if reason:
            client.lose(reason)
