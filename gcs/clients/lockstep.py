"""The ground station's part of lockstep: the vehicle's TIMESYNC begins its turn, its answer ends the turn.

The vehicle waits between its question (tc1 = 0, ts1 = its time in ns) and the answer (tc1 > ts1), so it
processes whatever the ground station sends before the answer at that same tick. A later tc1 promises that the
ground station sends nothing before that time: until then the vehicle asks, but does not wait for answers, and
gets none.
"""

from __future__ import annotations

from collections.abc import Iterable

from autopilot.wire.codec import FieldReader, FrameWriter, layout_of
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.capture import Capture
from gcs.clients.datagrams import messages
from gcs.clients.flight import FlightClient
from gcs.clients.operation import GROUND

_TIMESYNC = layout_of(mavlink.MAVLink_timesync_message)
_TC1, _TS1 = (FieldReader(mavlink.MAVLink_timesync_message, name) for name in ("tc1", "ts1"))
_TIMES = {
    message_id: FieldReader(kind, "time_usec")
    for message_id, kind in mavlink.mavlink_map.items()
    if "time_usec" in kind.fieldnames
}


class LockstepTurns:
    """Finds the vehicle's questions and makes each answer once.

    The answers have a separate sequence counter: if everything runs in one process there are no answers, and
    the sequence numbers of the other frames must be the same in both cases.
    """

    def __init__(self) -> None:
        self._writer = FrameWriter(*GROUND)
        self._answered_ns: int | None = None
        self._answer = b""

    def question(self, datagram: bytes) -> int | None:
        """The vehicle's time in ns if `datagram` contains its question, else None."""
        for one in messages(datagram)[0]:
            if one.id == mavlink.MAVLINK_MSG_ID_TIMESYNC and _TC1.read(one.frame) == 0:
                return int(_TS1.read(one.frame))
        return None

    def repeated_answer(self, question_ns: int) -> bytes | None:
        """The earlier answer if this question was already answered; empty if it is older than the last
        answered question; None if it is new."""
        if self._answered_ns is None or question_ns > self._answered_ns:
            return None
        return self._answer if question_ns == self._answered_ns else b""

    def answer(self, question_ns: int, silent_until_us: int = 0) -> bytes:
        """The datagram that ends the ground station's turn and promises to send nothing before
        `silent_until_us`."""
        self._answered_ns = question_ns
        silent_until_ns = max(question_ns + 1, silent_until_us * 1000)
        self._answer = self._writer.frame((_TIMESYNC, (silent_until_ns, question_ns)))
        return self._answer


class TruthQueue:
    """Holds truth datagrams back until the time that they carry is reached.

    The simulator may already be at a later tick when the ground station reads its datagrams: a datagram of a
    later window must not be recorded in this one.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[int, bytes]] = []

    def put(self, datagrams: Iterable[bytes]) -> None:
        """Add datagrams in the order of their arrival."""
        for datagram in datagrams:
            received, _ = messages(datagram)
            times = [_TIMES[one.id].read(one.frame) for one in received if one.id in _TIMES]
            self._waiting.append((max(times, default=0), datagram))

    def take_until(self, now_us: int) -> list[bytes]:
        """Remove and return the datagrams whose times are at most `now_us`."""
        ready = [datagram for time_us, datagram in self._waiting if time_us <= now_us]
        self._waiting = [(time_us, datagram) for time_us, datagram in self._waiting if time_us > now_us]
        return ready


def ground_turn(
    client: FlightClient, capture: Capture, truth: list[bytes], vehicle: list[bytes], now_us: int
) -> list[bytes]:
    """The ground station's turn: process the vehicle's datagrams, return those to send, and capture both and
    the truth."""
    for datagram in truth:
        capture.on_truth(datagram)
    for datagram in vehicle:
        client.receive(datagram, now_us)
        capture.on_vehicle(datagram)
    sent = client.poll(now_us)
    for datagram in sent:
        capture.on_sent(datagram)
    return sent
