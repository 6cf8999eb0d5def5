"""The sockets of the simulator: one for the autopilots, and one from which the truth is sent."""

from __future__ import annotations

import errno
import select
import socket
import time
from collections.abc import Callable

from autopilot.shell.options import (
    Address,
    address_text,
    datagram_socket,
    os_error_text,
    receive,
    send,
    set_timeout,
)
from autopilot.wire.codec import FrameWriter
from autopilot.wire.convert.simulator import SIMULATOR_COMPONENT
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.periods import next_multiple
from sitl.hil import HilSimulator
from sitl.messages import VEHICLE_SYSTEM

_TAKEOVER_SILENCE_S = 0.5  # silence of the autopilot that is served, after which another may take its place
_MAX_REPORTED = 8  # of the refused autopilots
_REFUSAL_PERIOD_S = 1.0  # between two messages to refused autopilots
_TEXT_LENGTH = 50  # of STATUSTEXT
TRUTH_WINDOW_US = 20_000  # in lockstep: time whose truth is sent in one datagram


class Link:
    """The socket for the autopilots, the autopilot that is served, and the address for the truth."""

    def __init__(self, listen: Address, truth: Address, notify: Callable[[str], None]) -> None:
        try:
            self._socket = datagram_socket(listen)
            self._socket.bind(listen)
        except OSError as error:
            busy = "is another sitl running? " if error.errno == errno.EADDRINUSE else ""
            raise ValueError(
                f"cannot listen on {address_text(listen)}: {os_error_text(error)}; "
                f"{busy}choose another with --listen"
            ) from None
        try:
            self._truth_socket = datagram_socket(truth)
        except OSError as error:
            raise ValueError(
                f"cannot send truth to {address_text(truth)}: {os_error_text(error)}; "
                "choose another with --truth"
            ) from None
        self.truth = truth  # address to which it is sent
        self.address = listen
        self._gathered: list[bytes] = []  # truth of this window
        self.window_ends_us = 0
        self._timeout_s = 0.0
        self._notify = notify
        self._last_answer_s = 0.0  # when the peer last answered, monotonic clock
        self._refused: set[Address] = set()
        self._connected_s: float | None = None  # when the first peer was met, monotonic clock
        self.peer: Address | None = None
        # when a refused autopilot was last notified, monotonic clock
        self._last_refusal_s = -_REFUSAL_PERIOD_S
        # a separate sequence counter: the frames to the autopilot that is served are numbered without a gap
        self._writer = FrameWriter(VEHICLE_SYSTEM, SIMULATOR_COMPONENT)

    @property
    def served_s(self) -> float:
        """Wall clock time since the first autopilot was met."""
        return 0.0 if self._connected_s is None else time.monotonic() - self._connected_s

    def close(self) -> None:
        self._socket.close()
        self._send_gathered()
        self._truth_socket.close()

    def timeout(self, seconds: float) -> None:
        """Set how long `receive` waits; 0: for ever. By SO_RCVTIMEO, which costs nothing per datagram."""
        if seconds != self._timeout_s:
            set_timeout(self._socket, seconds)
            self._timeout_s = seconds

    def wait(self, seconds: float) -> None:
        """Wait until a datagram has arrived, but no longer than this."""
        select.select([self._socket], [], [], seconds)

    def receive(self, flags: int = 0) -> tuple[bytes, Address] | None:
        """The next datagram and its sender, None after the timeout."""
        return receive(self._socket, flags)

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        """Send to the autopilot that is served, or to `address`. What cannot be sent counts as lost."""
        address = address or self.peer
        if address is not None:
            send(self._socket, datagram, address)

    def send_truth(self, simulator: HilSimulator) -> None:
        """Send the truth of the present tick, if there is any."""
        truth = _truth_of(simulator)
        if truth:
            send(self._truth_socket, truth, self.truth)

    def gather_truth(self, simulator: HilSimulator) -> None:
        """Store the truth of the present tick, if there is any; all is sent at the end of the window."""
        truth, now_us = _truth_of(simulator), simulator.core.now_us
        if truth:
            self._gathered.append(truth)
        if not self.window_ends_us - TRUTH_WINDOW_US < now_us < self.window_ends_us:
            self.window_ends_us = next_multiple(now_us, TRUTH_WINDOW_US)
            self._send_gathered()

    def take_gathered(self) -> bytes:
        """Hand over the truth of this window so far to a caller that continues to gather it."""
        gathered = b"".join(self._gathered)
        self._gathered.clear()
        return gathered

    def gather(self, truth: bytes, window_ends_us: int) -> None:
        """Take back the truth that `take_gathered` gave, with what was added, and the end of that window."""
        self.window_ends_us = window_ends_us
        if truth:
            self._gathered.append(truth)

    @property
    def sockets(self) -> tuple[socket.socket, socket.socket]:
        """The socket for the autopilots, and the socket from which the truth is sent."""
        return self._socket, self._truth_socket

    def _send_gathered(self) -> None:
        if self._gathered:
            send(self._truth_socket, b"".join(self._gathered), self.truth)
            self._gathered.clear()

    def accepts(self, sender: Address) -> bool:
        """Whether the sender is the autopilot that is served: while one answers, no other takes its place."""
        if sender == self.peer:
            return True
        if self.peer is not None and time.monotonic() - self._last_answer_s < _TAKEOVER_SILENCE_S:
            self._report_refusal(sender, self.peer)
            return False
        self._notify(f"serving the autopilot at {address_text(sender)}")
        self.peer = sender
        self.note_connection()
        return True

    def _report_refusal(self, sender: Address, peer: Address) -> None:
        """Report it on the terminal, once for each of the first: a flood can have any number of addresses."""
        if sender in self._refused or len(self._refused) == _MAX_REPORTED:
            return
        self._refused.add(sender)
        others = "; others are not named" if len(self._refused) == _MAX_REPORTED else ""
        self._notify(
            f"the autopilot at {address_text(sender)} is not served: "
            f"that at {address_text(peer)} answers{others}"
        )

    def note_connection(self) -> None:
        """Note when the first autopilot is met."""
        if self._connected_s is None:
            self._connected_s = time.monotonic()

    def note_answer(self) -> None:
        """Note that the autopilot that is served has answered."""
        self._last_answer_s = time.monotonic()

    def process(self, datagram: bytes, sender: Address, simulator: HilSimulator) -> bool:
        """Pass a datagram on. True if it is a heartbeat whose sender is served from now on."""
        if sender == self.peer and simulator.receive(datagram):
            self.note_answer()
            return False
        if not simulator.has_heartbeat(datagram):
            return False
        if not self.accepts(sender):
            self._send_refusal(sender)
            return False
        simulator.announce_boot()
        return True

    def _send_refusal(self, sender: Address) -> None:
        """Notify an autopilot which one is served in its place, but not for every datagram of a flood."""
        now_s = time.monotonic()
        if now_s - self._last_refusal_s < _REFUSAL_PERIOD_S:
            return
        self._last_refusal_s = now_s
        text = f"Serving another autopilot: {address_text(self.peer)}".encode()[:_TEXT_LENGTH]
        severity = mavlink.MAV_SEVERITY_ERROR
        self.send(self._writer.frame(mavlink.MAVLink_statustext_message(severity, text)), sender)


def _truth_of(simulator: HilSimulator) -> bytes:
    """The truth of the present tick, preceded by the number of this run of the world when that is due."""
    return (simulator.run_datagram() or b"") + (simulator.truth_datagram() or b"")
