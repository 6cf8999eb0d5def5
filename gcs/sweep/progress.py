"""What a person sees of a sweep: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

from gcs.shell.display import LiveBars, is_live, say

if TYPE_CHECKING:
    from rich.progress import TaskID

_PLAIN_S = 10.0
_REFRESH_S = 0.2


class SweepDisplay(LiveBars):
    """How many flights are flown, what share of them completed, how fast it goes and how long it takes."""

    def __init__(self, done: int, total: int, quiet: bool) -> None:
        self._before, self._done, self._total = done, done, total
        self._quiet = quiet
        self._task: TaskID | None = None
        self._began_s = time.monotonic()
        self._next_s = 0.0
        self.completed = 0
        self.flown = 0

    @property
    def elapsed_s(self) -> float:
        """Wall time since the display began."""
        return time.monotonic() - self._began_s

    def add(self, flown: int, completed: int) -> None:
        """So many more flights are flown, of which so many were completed."""
        self.flown += flown
        self.completed += completed
        now_s = time.monotonic()
        if self._quiet or now_s < self._next_s:
            return
        if self._bars is not None and self._task is not None:
            self._next_s = now_s + _REFRESH_S
            self._bars.update(self._task, completed=self._before + self.flown, description=self._words())
            self._bars.refresh()
        elif self.flown:
            self._next_s = now_s + _PLAIN_S
            say(f"{self._before + self.flown}/{self._total} flown, {self._words()}{self._left()}")

    def _words(self) -> str:
        pace = self.flown / max(self.elapsed_s, 1e-3)
        share = f"{100.0 * self.completed / self.flown:.0f} % completed" if self.flown else "-"
        return f"{share}, {pace:.1f} flights/s"

    def _left(self) -> str:
        left = self._total - self._before - self.flown
        minutes = left * self.elapsed_s / max(self.flown, 1) / 60.0
        return f", {minutes:.1f} min left" if left else ""

    def __enter__(self) -> Self:
        self._began_s = time.monotonic()
        if not self._quiet and is_live():
            from rich.progress import BarColumn, MofNCompleteColumn, TimeRemainingColumn

            columns = (
                BarColumn(bar_width=32),
                MofNCompleteColumn(),
                "{task.description}",
                TimeRemainingColumn(),
            )
            self._task = self._open(*columns).add_task("starting", total=self._total, completed=self._before)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._next_s = 0.0
        self.add(0, 0)
        super().__exit__(kind, error, trace)
