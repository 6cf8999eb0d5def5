"""Progress of a batch: how many flights are flown, how fast, the time remaining, and which flights run."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from gcs.batch.runner import Running
from gcs.shell.display import LiveBars, Row

if TYPE_CHECKING:
    from rich.progress import ProgressColumn


_FIRST_HINT_S = 2.0  # after this time without a flight, the display says that the first are on their way
_MINUTES_S = 120.0  # times of this or more are shown in minutes


class BatchDisplay(LiveBars):
    """A bar for all flights, and for each running flight a line with its progress."""

    def __init__(self, stored: int, total: int, quiet: bool) -> None:
        """`stored` flights of `total` are reused from an earlier run."""
        super().__init__(quiet)
        self._stored, self._total = stored, total
        self._start_s = time.monotonic()
        self.flown = 0  # in this run
        self.completed = 0  # of these
        self._last_reported = -1  # `flown` at the last plain line

    @property
    def elapsed_s(self) -> float:
        """Wall time since the display was made."""
        return time.monotonic() - self._start_s

    def add(self, flown: int, completed: int, running: Running = ()) -> None:
        """Count `flown` more flights, of which `completed` completed; `running` are running now."""
        self.flown += flown
        self.completed += completed
        last = flown > 0 and self._stored + self.flown == self._total
        plain = (lambda: self._line(running)) if self.flown != self._last_reported else None
        self._show(lambda: self._rows(running), plain, at_once=last)

    def columns(self) -> tuple[ProgressColumn | str, ...]:
        from rich.progress import BarColumn, MofNCompleteColumn

        return (BarColumn(bar_width=32), MofNCompleteColumn(), "{task.description}")

    def _rows(self, running: Running) -> dict[str, Row]:
        rows: dict[str, Row] = {
            "": {
                "description": f"{self._figures()}{self._remaining()}",
                "completed": self._stored + self.flown,
                "total": self._total,
            }
        }
        for title, line in running:
            text = line.removeprefix("gcs:").strip()
            rows[title] = {"description": f"{title}: {text or 'starting'}", "total": None}
        return rows

    def _figures(self) -> str:
        if not self.flown:
            return "flights, the first are on their way" if self.elapsed_s > _FIRST_HINT_S else "flights"
        flights_per_s = self.flown / max(self.elapsed_s, 1e-3)
        share = f"{100.0 * self.completed / self.flown:.0f} % of them completed"
        return f"flights flown, {share}, {rate_text(flights_per_s)}"

    def _line(self, running: Running) -> str:
        self._last_reported = self.flown
        titles = f"; running: {'; '.join(title for title, _ in running)}" if running else ""
        return f"{self._stored + self.flown} of {self._total} {self._figures()}{self._remaining()}{titles}"

    def _remaining(self) -> str:
        left = self._total - self._stored - self.flown
        if not left or not self.flown:
            return ""
        left_s = left * self.elapsed_s / self.flown
        text = f"{left_s:.0f} s" if left_s < _MINUTES_S else f"{left_s / 60.0:.0f} min"
        return f", {text} remaining"


def rate_text(flights_per_s: float) -> str:
    """The rate per second or, below one, per minute."""
    if flights_per_s >= 1.0:
        return f"{flights_per_s:.1f} flights/s"
    return f"{60.0 * flights_per_s:.1f} flights/min"
