"""How punctual a real-time run is: lateness of each tick and achieved rate, from times given as arguments."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

from sitl.hil import PacingFigures

_WINDOW_NS = 1_000_000_000
_MAX_LATENESS_US = 2**32 - 1


def percentile(ascending: Sequence[int], share: float) -> int:
    """The smallest value that at least `share` of the values do not exceed; 0 if there are no values."""
    if not ascending:
        return 0
    rank = -int(-share * len(ascending) // 1)  # ceiling
    return ascending[min(max(rank, 1), len(ascending)) - 1]


class Pacing:
    """Lateness of the ticks of one run; `figures` are those of the last full second."""

    def __init__(self, speed: float) -> None:
        self.figures = PacingFigures(speed_factor=speed)
        self.speed = speed  # requested simulated seconds per second
        self._late_us = array("L")
        self._window_start = 0
        self._window_first = 0  # index of its first tick
        self._first_ns = self._last_ns = self._due_ns = -1
        self._stalls = 0  # ticks that began a whole tick late or later

    def record(self, due_ns: int, now_ns: int) -> None:
        """Record that a tick that was due at `due_ns` began at `now_ns`."""
        if self._first_ns < 0:
            self._first_ns = self._window_start = now_ns
        self._last_ns = now_ns
        if 0 <= self._due_ns < due_ns and now_ns - due_ns >= due_ns - self._due_ns:
            self._stalls += 1
        self._due_ns = due_ns
        elapsed = now_ns - self._window_start
        if elapsed >= _WINDOW_NS:
            window = sorted(self._late_us[self._window_first :])
            self.figures = PacingFigures(
                speed_factor=self.speed,
                rate_hz=len(window) * 1e9 / elapsed,
                late_p50_us=percentile(window, 0.50),
                late_p99_us=percentile(window, 0.99),
                late_max_us=window[-1] if window else 0,
            )
            self._window_start = now_ns
            self._window_first = len(self._late_us)
        self._late_us.append(min(max(now_ns - due_ns, 0) // 1000, _MAX_LATENESS_US))

    def pause(self, duration_ns: int) -> None:
        """Leave out a time in which the clock waited for an autopilot: it is no measure of the machine."""
        self._first_ns += duration_ns
        self._window_start = self._last_ns + duration_ns
        self._window_first = len(self._late_us)
        self._due_ns = -1

    def summary(self, missed: int) -> str:
        """One line on the whole run."""
        late = sorted(self._late_us)
        if len(late) < 2:
            return "no ticks"
        rate = (len(late) - 1) * 1e9 / max(self._last_ns - self._first_ns, 1)
        text = (
            f"{rate:.2f} ticks/s, late p50 {percentile(late, 0.50)} p99 {percentile(late, 0.99)} "
            f"max {late[-1]} us, {missed} of {len(late)} commands missed"
        )
        if self._stalls:
            text += f"; the machine stalled {self._stalls} times for a tick or longer"
        return text
