"""Quality of a link, judged by its messages: age, losses, rate, and the speed of the vehicle's clock."""

from __future__ import annotations

from collections import deque
from typing import Any

from autopilot.wire.codec import Received

LOST_US = 3_000_000  # of silence
_SPAN_US = 2_000_000  # over which rate and pace are measured
_GAP = 128  # of sequence numbers: a gap of this size or more is a restart


class LinkQuality:
    """Updated by `on_message` and `on_clock`; `record` gives the figures."""

    def __init__(self) -> None:
        self.last_received_us: int | None = None
        self._sequences: dict[int, int] = {}  # the last of each component
        self._window_us = 0
        self._received = self._missed = 0  # in this window
        self._rate = 0.0
        self._loss = 0.0
        self._clocks: deque[tuple[int, int]] = deque(maxlen=512)  # our time, the vehicle's

    def on_message(self, one: Received, now_us: int) -> None:
        """Count one message."""
        self.last_received_us = now_us
        last = self._sequences.get(one.component)
        self._sequences[one.component] = one.sequence
        if last is not None:
            gap = (one.sequence - last - 1) & 0xFF
            self._missed += gap if gap < _GAP else 0
        self._received += 1
        if now_us - self._window_us >= _SPAN_US:
            span_s = (now_us - self._window_us) * 1e-6
            self._rate = self._received / span_s if self._window_us else 0.0
            self._loss = self._missed / (self._received + self._missed)
            self._window_us, self._received, self._missed = now_us, 0, 0

    def on_clock(self, vehicle_us: int, now_us: int) -> None:
        """Note the time of the vehicle's clock."""
        if self._clocks and (vehicle_us < self._clocks[-1][1] or now_us < self._clocks[-1][0]):
            self._clocks.clear()
        if not self._clocks or now_us - self._clocks[-1][0] >= 10_000:
            self._clocks.append((now_us, vehicle_us))
        while len(self._clocks) > 2 and now_us - self._clocks[0][0] > _SPAN_US:
            self._clocks.popleft()

    @property
    def pace(self) -> float | None:
        """Seconds of the vehicle's clock per second of ours."""
        if len(self._clocks) < 2:
            return None
        (start_us, first_us), (now_us, last_us) = self._clocks[0], self._clocks[-1]
        if now_us - start_us < 100_000:
            return None
        return (last_us - first_us) / (now_us - start_us)

    def record(self, now_us: int) -> dict[str, Any]:
        """age (s), loss (0 ... 1), rate (messages per second), pace, lost (whether silent for too long)."""
        age_us = 0 if self.last_received_us is None else max(0, now_us - self.last_received_us)
        pace = self.pace
        return {
            "age": round(age_us * 1e-6, 2),
            "loss": round(self._loss, 3),
            "rate": round(self._rate),
            "pace": None if pace is None else round(pace, 2),
            "lost": age_us > LOST_US,
        }
