"""Writes telemetry into a .tlog, in an order that depends only on the content of the messages.

Within a sync window (between two calls of `flush`) the messages of the truth come first, then those of the
vehicle, then those that the ground sent; all records of a window carry its time. A flight captured from byte
queues in one process and the same flight captured over UDP in lockstep therefore give the same file. TIMESYNC
is left out because only one of the two has it, and SIM_BOOT because it differs in every run.
"""

from __future__ import annotations

from typing import Protocol

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.datagrams import messages

LOCKSTEP_BOOT_UNIX_US = 1_767_225_600_000_000  # 2026-01-01: there is no wall clock in lockstep

_NOT_RECORDED = {mavlink.MAVLINK_MSG_ID_TIMESYNC, mavlink.MAVLINK_MSG_ID_SIM_BOOT}


class FrameLog(Protocol):
    """The destination of the capture: autopilot.wire.tlog.TlogWriter."""

    def write(self, unix_us: int, *frames: bytes) -> None:
        """Append a record of this time for each frame."""


class Capture:
    """Collects datagrams and writes their frames, window by window."""

    def __init__(self, log: FrameLog, boot_unix_us: int = LOCKSTEP_BOOT_UNIX_US) -> None:
        self.records = 0
        self._log = log
        self._boot_unix_us = boot_unix_us
        self._truth: list[bytes] = []
        self._vehicle: list[bytes] = []
        self._sent: list[bytes] = []

    def on_truth(self, datagram: bytes) -> None:
        """Add a datagram of the simulated world."""
        self._truth.append(datagram)

    def on_vehicle(self, datagram: bytes) -> None:
        """Add a datagram of the vehicle."""
        self._vehicle.append(datagram)

    def on_sent(self, datagram: bytes) -> None:
        """Add a datagram that the ground station sent."""
        self._sent.append(datagram)

    def flush(self, now_us: int) -> None:
        """Write the window that ends at `now_us`, time since boot."""
        unix_us = self._boot_unix_us + now_us
        frames = [
            one.frame
            for datagram in (*self._truth, *self._vehicle, *self._sent)
            for one in messages(datagram)[0]
            if one.id not in _NOT_RECORDED
        ]
        if frames:
            self._log.write(unix_us, *frames)
            self.records += len(frames)
        self._truth.clear()
        self._vehicle.clear()
        self._sent.clear()
