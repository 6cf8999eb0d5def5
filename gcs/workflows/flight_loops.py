"""The two ways to run a flight client on sockets: in lockstep with the vehicle, and on the wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from gcs.clients.capture import Capture
from gcs.clients.flight import FlightClient
from gcs.clients.lockstep import LockstepTurns, TruthQueue
from gcs.errors import NoVehicleError
from gcs.shell.display import FlightDisplay
from gcs.shell.link import UdpSocket, monotonic_us, wait
from gcs.shell.stopping import StopRequest

_WAIT_S = 0.2
_TICK_S = 0.01  # on the wall clock; not at each datagram, to leave the cores to those who must be punctual
START_LIMIT_S = 60.0  # some seconds on an idle machine; all kernels are compiled before
SILENCE_LIMIT_S = 20.0  # of a vehicle in lockstep that was there before

Ended = Callable[[], str]  # why a process of ours has ended, or empty


def run_lockstep(
    client: FlightClient,
    capture: Capture,
    vehicle: UdpSocket,
    truth: UdpSocket,
    ended: Ended,
    display: FlightDisplay,
    stop: StopRequest,
    first_word: Callable[[], None],
) -> None:
    """Fly until the client has its outcome. `first_word` is called when the vehicle is heard at first.

    A process that ends before that raises NoVehicleError; one that ends later is an outcome.
    """
    turns = LockstepTurns()
    truth_queue = TruthQueue()
    pending: list[bytes] = []
    started = False
    heard_s = time.monotonic()
    while client.outcome is None:
        wait([vehicle], _WAIT_S)
        datagrams = vehicle.drain()
        if stop:
            client.interrupt()
        elif not datagrams:
            limit_s = SILENCE_LIMIT_S if started else START_LIMIT_S
            reason = ended()
            if not reason and time.monotonic() - heard_s > limit_s:
                reason = f"the autopilot has sent nothing for {limit_s:.0f} s"
            if reason and not started:
                raise NoVehicleError(reason)
            if reason:
                client.lose(reason)
            display.update(client.progress)
            continue
        heard_s = time.monotonic()
        for datagram in datagrams:
            question_ns = turns.question(datagram)
            if question_ns is None:
                pending.append(datagram)
                continue
            given = turns.repeated(question_ns)
            if given is not None:
                vehicle.send(given)
                continue
            if not started:
                started = True
                first_word()
            pending.append(datagram)
            now_us = question_ns // 1000
            truth_queue.put(truth.drain())
            _turn(client, capture, truth_queue.until(now_us), pending, now_us, vehicle)
            pending.clear()
            vehicle.send(turns.answer(question_ns))
            capture.flush(now_us)
            display.update(client.progress)
            if client.outcome is not None:
                break


def _turn(
    client: FlightClient,
    capture: Capture,
    truth: list[bytes],
    vehicle: list[bytes],
    now_us: int,
    link: UdpSocket,
) -> None:
    for datagram in truth:
        client.receive(datagram, "truth", now_us)
        capture.on_truth(datagram)
    for datagram in vehicle:
        client.receive(datagram, "vehicle", now_us)
        capture.on_vehicle(datagram)
    for datagram in client.poll(now_us):
        link.send(datagram)
        capture.on_sent(datagram)


def run_wall_clock(
    client: FlightClient,
    capture: Capture,
    vehicle: UdpSocket,
    truth: UdpSocket | None,
    ended: Ended,
    display: FlightDisplay,
    stop: StopRequest,
    first_word: Callable[[], None],
) -> None:
    """Fly until the client has its outcome. Log records bear the vehicle's clock once it is known."""
    started = False
    while client.outcome is None:
        time.sleep(_TICK_S)
        now_us = monotonic_us()
        _turn(client, capture, truth.drain() if truth else [], vehicle.drain(), now_us, vehicle)
        capture.flush(client.view.time_us or 0)
        if not started and client.connection.target is not None:
            started = True
            first_word()
        display.update(client.progress)
        if stop:
            client.interrupt()
        reason = ended()
        if reason and client.connection.target is None:
            raise NoVehicleError(reason)
        if reason:
            client.lose(reason)
