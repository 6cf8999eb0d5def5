"""How punctual a real-time run is: lateness of each tick and achieved rate, from times given as arguments."""

from __future__ import annotations

import math
from collections import Counter
from itertools import accumulate

from sitl.hil import PacingFigures

_WINDOW_NS = 1_000_000_000


def percentile(counts: Counter[int], share: float) -> int:
    """The smallest value that at least `share` of the values do not exceed; 0 if there are no values.

    `counts`: how often each value occurs.
    """
    rank = max(math.ceil(share * counts.total()), 1)
    ascending = sorted(counts)
    cumulative = accumulate(counts[value] for value in ascending)
    return next((value for value, count in zip(ascending, cumulative, strict=True) if count >= rank), 0)


class Pacing:
    """Lateness of the ticks of one run; `figures` are those of the last full second."""

    def __init__(self, speed: float) -> None:
        self.figures = PacingFigures(speed_factor=speed)
        self.speed = speed  # requested simulated seconds per second
        self._counts: Counter[int] = Counter()  # ticks by their lateness, us, before the present window
        self._window: list[int] = []  # lateness of the ticks of the present window, us
        self._window_start = 0
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
            window = Counter(self._window)
            self.figures = PacingFigures(
                speed_factor=self.speed,
                rate_hz=len(self._window) * 1e9 / elapsed,
                late_p50_us=percentile(window, 0.50),
                late_p99_us=percentile(window, 0.99),
                late_max_us=max(window, default=0),
            )
            self._start_window(now_ns)
        self._window.append(max(now_ns - due_ns, 0) // 1000)

    def _start_window(self, now_ns: int) -> None:
        self._counts.update(self._window)
        self._window.clear()
        self._window_start = now_ns

    def pause(self, duration_ns: int) -> None:
        """Leave out a time in which the clock waited for an autopilot: it is no measure of the machine."""
        self._first_ns += duration_ns
        self._start_window(self._last_ns + duration_ns)
        self._due_ns = -1

    def summary(self, missed: int) -> str:
        """One line on the whole run."""
        self._start_window(self._last_ns)
        ticks = self._counts.total()
        if ticks < 2:
            return "no ticks"
        late = self._counts
        rate = (ticks - 1) * 1e9 / max(self._last_ns - self._first_ns, 1)
        text = (
            f"{rate:.2f} ticks/s, late p50 {percentile(late, 0.50)} p99 {percentile(late, 0.99)} "
            f"max {max(late)} us, {missed} of {ticks} commands missed"
        )
        if self._stalls:
            text += f"; the machine stalled {self._stalls} times for a tick or longer"
        return text
