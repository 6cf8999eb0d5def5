"""What a person sees while something lasts: on stderr, live on a terminal, a few plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import ProgressColumn, TaskID

    from gcs.clients.flight import Progress

_REFRESH_S = 0.1
_PLAIN_S = 10.0  # between two plain lines of the same phase


def say(line: str) -> None:
    """One line of trouble or news on stderr."""
    print(f"gcs: {line}", file=sys.stderr, flush=True)


def is_live() -> bool:
    """True if stderr is a terminal that can redraw."""
    return sys.stderr.isatty()


class LiveBars:
    """Bars on a terminal, drawn when they are told to; they go as the `with` block is left."""

    _bars: Bars | None = None

    def _open(self, *columns: ProgressColumn | str, transient: bool = False) -> Bars:
        from rich.console import Console
        from rich.progress import Progress

        self._bars = Progress(*columns, console=Console(stderr=True), auto_refresh=False, transient=transient)
        self._bars.start()
        return self._bars

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bars is not None:
            self._bars.stop()
            self._bars = None


class FlightDisplay(LiveBars):
    """Where the flight is: phase, mission item, load error, rotor use, simulated time and its pace."""

    def __init__(self, title: str, quiet: bool) -> None:
        self._title = title
        self._quiet = quiet
        self._task: TaskID | None = None
        self._next_s = 0.0
        self._began: tuple[float, float] | None = (
            None  # wall clock and vehicle clock at the first sign of life
        )
        self._told = ""  # the phase of the last plain line
        self._told_s = 0.0

    def update(self, progress: Progress) -> None:
        """Show `progress`, if it is time to."""
        now_s = time.monotonic()
        if self._quiet or now_s < self._next_s:
            return
        self._next_s = now_s + _REFRESH_S
        if self._began is None and progress.sim_time_s > 0.0:
            self._began = (now_s, progress.sim_time_s)
        if self._bars is not None and self._task is not None:
            fields: dict[str, Any] = self._fields(progress, now_s)
            self._bars.update(self._task, completed=progress.fraction, **fields)
            self._bars.refresh()
        elif progress.phase != self._told or now_s - self._told_s > _PLAIN_S:
            self._told, self._told_s = progress.phase, now_s
            say(self._line(self._fields(progress, now_s)))

    def _fields(self, progress: Progress, now_s: float) -> dict[str, str]:
        return {
            "phase": progress.phase,
            "item": f"item {progress.item + 1}/{progress.items}" if progress.sim_time_s else "",
            "error": _or_dash(progress.load_error_m, 1e3, "mm"),
            "rotors": _or_dash(progress.rotor_use, 1e2, "%"),
            "clock": f"{progress.sim_time_s:6.1f} s",
            "pace": self._pace(progress, now_s),
        }

    def _pace(self, progress: Progress, now_s: float) -> str:
        if self._began is None or now_s - self._began[0] < 2.0 * _REFRESH_S:
            return ""
        return f"x{(progress.sim_time_s - self._began[1]) / (now_s - self._began[0]):.1f}"

    def _line(self, fields: dict[str, str]) -> str:
        words = [fields["clock"], fields["phase"], fields["item"]]
        for label in ("load", "rotors"):
            figure = fields["error" if label == "load" else label].strip()
            words.append("" if figure.startswith("-") else f"{label} {figure}")
        words.append(fields["pace"])
        return "  ".join(word for word in words if word)

    def __enter__(self) -> Self:
        if not self._quiet and is_live():
            from rich.progress import BarColumn

            bars = self._open(
                "[bold]{task.description}",
                BarColumn(bar_width=24),
                "{task.percentage:>3.0f}%",
                "[cyan]{task.fields[phase]}",
                "{task.fields[item]}",
                "load {task.fields[error]}",
                "rotors {task.fields[rotors]}",
                "{task.fields[clock]} {task.fields[pace]}",
            )
            blank: dict[str, Any] = dict.fromkeys(("item", "error", "rotors", "clock", "pace"), "")
            self._task = bars.add_task(self._title, total=1.0, phase="starting", **blank)
        return self


class StepDisplay(LiveBars):
    """A bar for anything else that takes more than a second; `update(done, total)` as it goes."""

    def __init__(self, title: str, quiet: bool = False) -> None:
        self._title = title
        self._shown = not quiet and is_live()
        self._task: TaskID | None = None
        self._next_s = time.monotonic() + 0.5  # what is over sooner needs no bar

    def update(self, done: int, total: int, title: str | None = None) -> None:
        """Show that `done` of `total` are done; a `total` of 0 means not known."""
        now_s = time.monotonic()
        if not self._shown or now_s < self._next_s:
            return
        self._next_s = now_s + _REFRESH_S
        if self._bars is None:
            from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn

            columns = (SpinnerColumn(), "{task.description}", BarColumn(), MofNCompleteColumn())
            self._bars = self._open(*columns, transient=True)
            self._task = self._bars.add_task(self._title, total=None)
        if self._task is not None:
            self._bars.update(
                self._task, completed=done, total=total or None, description=title or self._title
            )
        self._bars.refresh()


def _or_dash(value: float | None, scale: float, unit: str) -> str:
    return f"{'-':>4} {unit}" if value is None else f"{value * scale:4.0f} {unit}"
