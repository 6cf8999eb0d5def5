"""Progress on stderr: bars on a terminal, otherwise a plain line now and then."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from threading import Timer
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import ProgressColumn, TaskID

    from gcs.clients.flight import Progress

_REFRESH_S = 0.1
_LINE_INTERVAL_S = 10.0  # between two plain lines of the same stage
_NOTIFY_AFTER_S = 2.0  # of silence, after which a user is told what is being done
_BAR_DELAY_S = 0.5  # a short step needs no bar

Row = Mapping[str, Any]  # description, completed, total and the fields of one bar


def notify(line: str) -> None:
    """Print one line of trouble or news to stderr. If stderr was closed (`2>&1 | head`), nothing stops."""
    try:
        print(f"gcs: {line}", file=sys.stderr, flush=True)
    except BrokenPipeError:
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115 - it is stderr from here on


@contextmanager
def notify_if_slow(line: str, quiet: bool = False) -> Iterator[None]:
    """Print what is being done if it takes longer than `_NOTIFY_AFTER_S`."""
    timer = Timer(_NOTIFY_AFTER_S, notify, (line,))
    timer.daemon = True
    if not quiet:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


_real_stdout: list[TextIO] = []  # stdout, while `sys.stdout` is stderr


def reserve_stdout_for_results() -> None:
    """From here on, only `results_to_stdout` and `write_to_stdout` write to stdout. Anything else that is
    printed in this process, for example by a custom law, goes to stderr."""
    if not _real_stdout:
        _real_stdout.append(sys.stdout)
        sys.stdout = sys.stderr


def restore_stdout() -> None:
    """From here on, all that is printed goes to stdout again."""
    if _real_stdout:
        sys.stdout = _real_stdout.pop()


@contextmanager
def results_to_stdout() -> Iterator[None]:
    """Within the block, `sys.stdout` is stdout, even if stdout is kept for results."""
    if not _real_stdout:
        yield
        return
    replacement, sys.stdout = sys.stdout, _real_stdout[0]
    try:
        yield
    finally:
        _real_stdout[0], sys.stdout = sys.stdout, replacement


def write_to_stdout(write: Callable[[], None]) -> None:
    """Write to stdout by `write`. If its reader has closed it (`| head`), the work continues silently."""
    with results_to_stdout():
        try:
            write()
            sys.stdout.flush()
        except (BrokenPipeError, SystemExit):  # rich raises the latter
            sys.stdout = Path(os.devnull).open("w")  # noqa: SIM115 - it is stdout from here on


def stderr_is_terminal() -> bool:
    """True if stderr is a terminal that can redraw."""
    return sys.stderr.isatty()


class LiveBars:
    """The life cycle of all progress displays: opened by the first `_show`, closed with the `with` block.

    On a terminal `_show` draws bars, at most ten times a second; otherwise it prints a plain line when the
    stage changes, and every ten seconds. A quiet display does neither.
    """

    _transient = False  # whether the bars disappear when they are closed

    def __init__(self, quiet: bool, delay_s: float = 0.0) -> None:
        self._quiet = quiet
        self._bars: Bars | None = None
        self._tasks: dict[str, TaskID] = {}
        self._next_s = time.monotonic() + delay_s
        self._stage: str | None = None  # of the last plain line
        self._last_line_s = 0.0

    def columns(self) -> tuple[ProgressColumn | str, ...]:
        """Columns of the bars."""
        raise NotImplementedError

    @property
    def due(self) -> bool:
        """Whether the next refresh is due; never if quiet."""
        return not self._quiet and time.monotonic() >= self._next_s

    def _show(
        self,
        rows: Callable[[], Mapping[str, Row]],
        plain: Callable[[], str] | None,
        stage: str = "",
        at_once: bool = False,
    ) -> None:
        """Show progress if it is due, or immediately with `at_once`; `rows` gives the bars by name, `plain`
        the line."""
        now_s = time.monotonic()
        if self._quiet or (now_s < self._next_s and not at_once):
            return
        self._next_s = now_s + _REFRESH_S
        if stderr_is_terminal():
            self._draw(rows())
        elif plain is not None and (
            at_once or stage != self._stage or now_s - self._last_line_s > _LINE_INTERVAL_S
        ):
            self._stage, self._last_line_s = stage, now_s
            notify(plain())

    def _note_line(self) -> None:
        """Note that a plain line was printed, so that the next one is not due soon."""
        self._last_line_s = time.monotonic()

    def _draw(self, rows: Mapping[str, Row]) -> None:
        bars = self._bars or self._open()
        for name in [name for name in self._tasks if name not in rows]:
            bars.remove_task(self._tasks.pop(name))
        for name, row in rows.items():
            if name in self._tasks:
                bars.update(self._tasks[name], **row)
            else:
                self._tasks[name] = bars.add_task(**row)
        bars.refresh()

    def _open(self) -> Bars:
        from rich.console import Console
        from rich.progress import Progress

        console = Console(stderr=True)
        self._bars = Progress(*self.columns(), console=console, auto_refresh=False, transient=self._transient)
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
    """One flight: phase, mission item, load error as the vehicle estimates it, rotor use, simulated time and
    its ratio to real time."""

    def __init__(self, title: str, quiet: bool) -> None:
        super().__init__(quiet)
        self._title = title
        self._start: tuple[float, float] | None = None  # wall clock and vehicle clock, first message

    def update(self, progress: Progress) -> None:
        """Show `progress` if it is due."""
        now_s = time.monotonic()
        if self._start is None and progress.sim_time_s > 0.0:
            self._start = (now_s, progress.sim_time_s)
        self._show(
            lambda: {"flight": self._row(progress, now_s)},
            lambda: self._line(self._fields(progress, now_s)),
            progress.phase,
        )

    def columns(self) -> tuple[ProgressColumn | str, ...]:
        from rich.progress import BarColumn

        return (
            "[bold]{task.description}",
            BarColumn(bar_width=24),
            "{task.percentage:>3.0f}%",
            "[cyan]{task.fields[phase]}",
            "{task.fields[item]}",
            "load error (est.) {task.fields[error]}",
            "rotors {task.fields[rotors]}",
            "{task.fields[clock]} {task.fields[pace]}",
        )

    def _row(self, progress: Progress, now_s: float) -> Row:
        bar = {"description": self._title, "completed": progress.fraction, "total": 1.0}
        return {**bar, **self._fields(progress, now_s)}

    def _fields(self, progress: Progress, now_s: float) -> dict[str, str]:
        return {
            "phase": progress.phase,
            "item": f"item {progress.item}/{progress.items - 1}" if progress.sim_time_s else "",
            "error": _number_or_dash(progress.load_error_m, 1e3, "mm"),
            "rotors": _number_or_dash(progress.rotor_use, 1e2, "%"),
            "clock": f"{progress.sim_time_s:6.1f} s",
            "pace": self._pace(progress, now_s),
        }

    def _pace(self, progress: Progress, now_s: float) -> str:
        if self._start is None or now_s - self._start[0] < 2.0 * _REFRESH_S:
            return ""
        pace = f"x{(progress.sim_time_s - self._start[1]) / (now_s - self._start[0]):.1f}"
        return "" if pace == "x0.0" else pace  # too little simulated time has passed

    def _line(self, fields: dict[str, str]) -> str:
        words = [fields["clock"], fields["phase"], fields["item"]]
        for label, field in (("load error (est.)", "error"), ("rotors", "rotors")):
            figure = fields[field].strip()
            words.append("" if figure.startswith("-") else f"{label} {figure}")
        words.append(fields["pace"])
        return "  ".join(word for word in words if word)


class CompileDisplay(LiveBars):
    """What is being compiled, kernel by kernel, how many parts remain, and the time taken so far."""

    _transient = True

    def update(self, running: Mapping[str, str], remain: int, total: int, remaining: str) -> None:
        """Show the kernel of each running part (`running`: kernels by the parts' titles), that `remain` of
        `total` parts are not done, and the text `remaining` on the remaining time."""
        self._show(
            lambda: {
                "all": {
                    "description": "compiling the flight software, once",
                    "completed": total - remain,
                    "total": total,
                    "kernel": remaining,
                },
                **{
                    title: {"description": f"  {title}", "completed": 0, "total": None, "kernel": kernel}
                    for title, kernel in running.items()
                },
            },
            lambda: f"compiling {_parts(running)}; {remaining}",
        )

    def done(self, title: str, seconds: float, remaining: str) -> None:
        """If stderr is no terminal, print that a part is done, how long it took, and what is left."""
        if not self._quiet and not stderr_is_terminal():
            notify(f"compiled {title} in {seconds:.0f} s; {remaining}")
            self._note_line()

    def columns(self) -> tuple[ProgressColumn | str, ...]:
        from rich.progress import BarColumn, TimeElapsedColumn

        return ("{task.description}", BarColumn(bar_width=16), TimeElapsedColumn(), "{task.fields[kernel]}")


class StepDisplay(LiveBars):
    """A bar for any other step that takes more than half a second; without a terminal, plain lines for a
    `long` one."""

    _transient = True

    def __init__(self, title: str, quiet: bool = False, long: bool = False) -> None:
        super().__init__(quiet, _BAR_DELAY_S)
        self._title = title
        self._long = long

    def update(self, done: int, total: int, title: str | None = None) -> None:
        """Show that `done` of `total` are done; a `total` of 0 means that it is unknown."""
        shown_title = title or self._title
        row = {"description": shown_title, "completed": done, "total": total or None}
        done_text = f": {done} of {total}" if total else ""
        self._show(lambda: {"step": row}, (lambda: shown_title + done_text) if self._long else None)

    def columns(self) -> tuple[ProgressColumn | str, ...]:
        from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn

        return (SpinnerColumn(), "{task.description}", BarColumn(), MofNCompleteColumn())


def _parts(running: Mapping[str, str]) -> str:
    """Titles, each with the kernel that is being compiled, if it is known."""
    return ", ".join(f"{title} ({kernel})" if kernel else title for title, kernel in running.items())


def _number_or_dash(value: float | None, scale: float, unit: str) -> str:
    return f"{'-':>4} {unit}" if value is None else f"{value * scale:4.0f} {unit}"
