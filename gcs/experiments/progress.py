"""What a person sees while experiments are flown and drawn: bars on a terminal, plain lines elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

from gcs.experiments.flights import Status
from gcs.shell.display import LiveBars, is_live, say

if TYPE_CHECKING:
    from rich.progress import TaskID


class ExperimentDisplay(LiveBars):
    """One bar for the flights, a line for each that is in the air, one bar for the figures."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet
        self._tasks: dict[str, TaskID] = {}
        self._told = -1

    def flights(self, status: Status) -> None:
        """Show how far the flights are."""
        if self._bars is None:
            if not self._quiet and status.done != self._told:
                self._told = status.done
                names = ", ".join(experiment.name for experiment, _ in status.flying)
                say(f"{status.done}/{status.total} flown{'; in the air: ' + names if names else ''}")
            return
        self._bars.update(
            self._task("flights"), completed=status.done, total=status.total, description="flights"
        )
        flying = {experiment.name: (experiment, line) for experiment, line in status.flying}
        for name in [name for name in self._tasks if name not in flying and name != "flights"]:
            self._bars.remove_task(self._tasks.pop(name))
        for name, (experiment, line) in flying.items():
            words = line.removeprefix("gcs:").strip()
            self._bars.update(self._task(name, total=None), description=f"  {experiment.title}: {words}")
        self._bars.refresh()

    def figures(self, done: int, total: int, name: str) -> None:
        """Show how far the figures are."""
        if self._bars is None:
            if not self._quiet and done == 0:
                say(f"drawing {total} figures")
            return
        self._bars.update(self._task("figures"), completed=done, total=total, description=f"figures  {name}")
        self._bars.refresh()

    def _task(self, name: str, total: int | None = 1) -> TaskID:
        assert self._bars is not None
        if name not in self._tasks:
            self._tasks[name] = self._bars.add_task(name, total=total)
        return self._tasks[name]

    def __enter__(self) -> Self:
        if not self._quiet and is_live():
            from rich.progress import BarColumn, MofNCompleteColumn, TimeElapsedColumn

            columns = (BarColumn(bar_width=24), MofNCompleteColumn(), TimeElapsedColumn())
            self._open(*columns, "{task.description}")
        return self
