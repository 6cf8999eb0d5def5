"""Processor time of this thread for each tick, and ticks that began late because of the machine."""

from __future__ import annotations

import time

_BIN_US = 10
_BINS = 2000
_MEAN_TICKS = 256  # over which the time from tick to tick is averaged


class TickCost:
    """Counts ticks by the processor time that they took, in bins of 10 us up to 20 ms.

    A tick that follows the last one after more than twice the usual time was delayed: by the machine, unless
    the last one took longer than a tick. The usual time depends on the speed at which the simulator flies.
    """

    def __init__(self) -> None:
        self._bins = [0] * (_BINS + 1)
        self._longest_us = self._ticks = self._overruns = self._delays = 0
        self._last_ns = self._last_wall_ns = -1
        self._usual_us = 0.0  # wall time from tick to tick

    def tick(self, period_us: int) -> None:
        """A tick begins; the time since the previous call belongs to the previous tick. Ticks last
        `period_us`; 0: not known yet, and nothing is counted."""
        now_ns, wall_ns = time.thread_time_ns(), time.monotonic_ns()
        if self._last_ns >= 0 and period_us > 0:
            cost_us, wall_us = (now_ns - self._last_ns) // 1000, (wall_ns - self._last_wall_ns) // 1000
            self.count(cost_us, wall_us, period_us)
        self._last_ns, self._last_wall_ns = now_ns, wall_ns

    def count(self, cost_us: int, wall_us: int, period_us: int) -> None:
        """Count a tick that took `cost_us`; the next one began `wall_us` after it."""
        usual_us = self._usual_us or wall_us
        self._delays += wall_us > 2.0 * usual_us and cost_us <= period_us
        self._usual_us = usual_us + (min(wall_us, 2.0 * usual_us) - usual_us) / _MEAN_TICKS
        self._bins[min(cost_us // _BIN_US, _BINS)] += 1
        self._longest_us = max(self._longest_us, cost_us)
        self._ticks += 1
        self._overruns += cost_us > period_us

    def pause(self) -> None:
        """The time until the next tick belongs to no tick."""
        self._last_ns = -1

    def _percentile_us(self, share: float) -> int:
        """The upper edge of the bin that this share of the ticks does not exceed."""
        remaining = share * self._ticks
        for k, count in enumerate(self._bins):
            remaining -= count
            if remaining <= 0.0:
                return min((k + 1) * _BIN_US, self._longest_us)
        return self._longest_us

    def summary(self) -> str:
        """One line about the whole run; empty before the first tick has ended."""
        if not self._ticks:
            return ""
        text = (
            f"processor time of a tick: p50 {self._percentile_us(0.5)} p99 {self._percentile_us(0.99)} "
            f"max {self._longest_us} us; {self._overruns} of {self._ticks} took longer than a tick"
        )
        if self._delays:
            text += f"; the machine delayed {self._delays} by a tick or longer"
        return text
