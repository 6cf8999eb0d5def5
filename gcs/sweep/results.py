"""Results of a sweep: shares of success and errors over the settings, and the limits of each parameter."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from autopilot.own.law import law_name
from gcs.analysis.axes import Floats
from gcs.sweep.plan import SweepPlan

if TYPE_CHECKING:
    import pyarrow

BINS = 8  # for a parameter whose values were drawn
COMPLETED = "completed"
_TAIL = 0.025  # probability beyond each end of an interval
STEP_FIGURES = ("rise_time_90_s", "overshoot_pct", "settling_time_5pct_s")
# of which medians are stated
MEDIAN_FIGURES = ("load_error_max_m", "load_error_rms_m", *STEP_FIGURES, "psi_R_max", "psi_q_max")


@dataclass(frozen=True)
class Flights:
    """The flights of one law, n of them."""

    law: str
    values: dict[str, Floats]  # (n,) by varied parameter
    completed: NDArray[np.bool_]  # (n,)
    error_m: Floats  # (n,) greatest load error of the mission
    outcome: tuple[str, ...]
    lost_phase: tuple[str, ...]
    index: NDArray[np.int64]  # (n,) numbers of the flights in the sweep
    seed: NDArray[np.int64]  # (n,)
    reference: str  # of the law, as the user named it
    reason: tuple[str, ...] = ()  # why a flight was not completed
    # (n,) by name, MEDIAN_FIGURES; infinite: a time that passed without what it waits for; NaN: unknown
    figures: Mapping[str, Floats] = field(default_factory=dict)

    def median(self, name: str, rows: NDArray[Any] | slice = slice(None)) -> float:
        """The median of a figure over those of the rows that completed; NaN if none has it."""
        values = self.figures[name][rows]
        known = values[self.completed[rows] & ~np.isnan(values)]
        return float(np.median(known)) if len(known) else np.nan

    @property
    def are_steps(self) -> bool:
        """Whether some flight has a step response."""
        return bool(np.isfinite(self.figures["overshoot_pct"]).any())


@dataclass(frozen=True)
class Cells:
    """Figures over one or two parameters; NaN where nothing was flown, errors also where none completed."""

    axes: tuple[Floats, ...]  # centres, one array for each parameter
    flown: Floats  # flights
    success: Floats  # share
    error_median_m: Floats  # of the flights that completed
    error_worst_m: Floats
    shown: NDArray[np.intp]  # row of the flight to show for a cell: a lost one, else the worst; -1: none
    step_medians: Mapping[str, Floats]  # by name, STEP_FIGURES; of the flights that completed


@dataclass(frozen=True)
class CompletionRange:
    """The ranges of a parameter, around its default value, in which flights complete.

    `all_from`, `all_to`: every flight completes, whatever else is varied. `some_from`, `some_to`: there is a
    setting of all other parameters at which all seeds complete. NaN: not even at the default value.
    """

    name: str
    nominal: float
    all_from: float
    all_to: float
    some_from: float
    some_to: float


def flights_by_law(table: pyarrow.Table, plan: SweepPlan) -> list[Flights]:
    """The flights of the table by law, in the order of the plan."""

    def values(column: str, kind: type) -> NDArray[Any]:
        return np.array(table.column(column).to_pylist(), dtype=kind)

    texts = ("law", "outcome", "lost_phase", "reason")
    law, outcome, phase, reason = (values(column, object) for column in texts)
    error = values("load_error_max_m", float)
    index, seed = values("index", int), values("seed", int)
    varied = {v.name: values(v.name, float) for v in plan.varied}
    figures = {name: values(name, float) for name in MEDIAN_FIGURES}
    for name in ("rise_time_90_s", "settling_time_5pct_s"):
        never = np.isnan(figures[name]) & np.isfinite(figures["overshoot_pct"])
        figures[name] = np.where(never, np.inf, figures[name])
    found = []
    for reference in plan.laws:
        name = law_name(reference)
        rows = law == name
        found.append(
            Flights(
                name,
                {parameter: column[rows] for parameter, column in varied.items()},
                outcome[rows] == COMPLETED,
                error[rows],
                tuple(outcome[rows].tolist()),
                tuple(phase[rows].tolist()),
                index[rows],
                seed[rows],
                reference,
                tuple(reason[rows].tolist()),
                {figure: column[rows] for figure, column in figures.items()},
            )
        )
    return found


def share_interval(completed: int, flights: int) -> tuple[float, float]:
    """The 95 % confidence interval of Clopper and Pearson for the share of flights that complete, of which
    these were drawn: the exact one of the binomial distribution, never too narrow."""
    from scipy.special import betaincinv  # loads for a third of a second

    missed = flights - completed
    low = float(betaincinv(completed, missed + 1, _TAIL)) if completed else 0.0
    high = float(betaincinv(completed + 1, missed, 1.0 - _TAIL)) if missed else 1.0
    return low, high


def share_record(completed: int, flights: int) -> dict[str, float]:
    """The share of flights that completed, with its 95 % interval, as `gcs sweep --json` prints them."""
    low, high = share_interval(completed, flights)
    share = completed / max(flights, 1)
    return {"completed_fraction": share, "completed_low_95": low, "completed_high_95": high}


def interval_text(completed: int, flights: int) -> str:
    """The 95 % interval of the share in percent: `40 … 100`."""
    return " … ".join(map(_percent, share_interval(completed, flights)))


def _percent(share: float) -> str:
    """The share in percent, with two digits of its distance from 0 or 100 %, whichever is nearer."""
    if share <= 0.5:
        return f"{float(f'{100.0 * share:.2g}'):g}"
    return f"{100.0 - float(f'{100.0 * (1.0 - share):.2g}'):.10g}"


def law_record(flights: Flights) -> dict[str, object]:
    """Numbers and medians of the flights of one law, as `gcs sweep --json` prints them; None: not known, or
    more than half of the flights never got there."""
    medians = {name: flights.median(name) for name in MEDIAN_FIGURES}
    completed = int(flights.completed.sum())
    return {
        "law": flights.law,
        "flights": len(flights.outcome),
        "completed": completed,
        **share_record(completed, len(flights.outcome)),
        "medians": {name: value if np.isfinite(value) else None for name, value in medians.items()},
    }


def levels(plan: SweepPlan, name: str) -> Floats:
    """The values of a parameter, or the centres of the bins of its drawn values."""
    varied = next(v for v in plan.varied if v.name == name)
    if plan.sample and varied.continuous:
        edges = np.linspace(min(varied.values), max(varied.values), BINS + 1)
        return np.asarray(0.5 * (edges[1:] + edges[:-1]))
    return np.array(sorted(set(varied.values)))


def _nearest(values: Floats, centres: Floats) -> NDArray[np.intp]:
    return np.asarray(np.argmin(np.abs(values[:, None] - centres[None, :]), axis=1))


def cells(flights: Flights, plan: SweepPlan, names: tuple[str, ...]) -> Cells:
    """The figures over the named parameters, taken over all other settings and seeds."""
    axes = tuple(levels(plan, name) for name in names)
    shape = tuple(len(axis) for axis in axes)
    cell_of_flight = np.ravel_multi_index(
        [_nearest(flights.values[name], axis) for name, axis in zip(names, axes, strict=True)], shape
    )
    count = int(np.prod(shape))
    flown = np.bincount(cell_of_flight, minlength=count).astype(float)
    completed_flights = np.bincount(cell_of_flight, weights=flights.completed.astype(float), minlength=count)
    median, worst = np.full(count, np.nan), np.full(count, np.nan)
    step_medians = {name: np.full(count, np.nan) for name in STEP_FIGURES}
    shown = np.full(count, -1, dtype=np.intp)
    for cell in np.unique(cell_of_flight):
        rows = np.flatnonzero(cell_of_flight == cell)
        rated = rows[flights.completed[rows] & np.isfinite(flights.error_m[rows])]
        errors = flights.error_m[rated]
        lost = rows[~flights.completed[rows]]
        if len(rated):
            median[cell], worst[cell] = np.median(errors), errors.max()
        for name, of_cells in step_medians.items():
            of_cells[cell] = flights.median(name, rows)
        shown[cell] = lost[0] if len(lost) else rated[np.argmax(errors)] if len(rated) else rows[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        success = np.where(flown > 0.0, completed_flights / flown, np.nan)
    return Cells(
        axes,
        flown.reshape(shape),
        success.reshape(shape),
        median.reshape(shape),
        worst.reshape(shape),
        shown.reshape(shape),
        {name: medians.reshape(shape) for name, medians in step_medians.items()},
    )


def completion_range(flights: Flights, plan: SweepPlan, name: str, nominal: float) -> CompletionRange:
    """The ranges of a parameter around `nominal` (or the nearest flown value) in which flights complete.

    A flight that has not been flown yet counts as not completed: a value counts when all its flights have
    completed, a setting when all its seeds have.
    """
    centres = levels(plan, name)
    names = [varied.name for varied in plan.varied]
    planned = np.array([case.varied for case in plan.cases() if case.law == flights.reference])
    flown = np.stack([flights.values[other] for other in names], axis=1)[flights.completed]
    planned_counts, completed_counts = (
        _count_settings(rows, names.index(name), centres) for rows in (planned, flown)
    )
    all_complete = np.array(
        [bool(a) and a == g for a, g in zip(planned_counts, completed_counts, strict=True)]
    )
    some_complete = np.array(
        [
            any(g[others] == n for others, n in a.items())
            for a, g in zip(planned_counts, completed_counts, strict=True)
        ]
    )
    start = int(np.argmin(np.abs(centres - nominal)))
    return CompletionRange(
        name, nominal, *_span(centres, all_complete, start), *_span(centres, some_complete, start)
    )


def _count_settings(values: Floats, column: int, centres: Floats) -> list[Counter[tuple[float, ...]]]:
    """For each value in `centres` of the parameter in `column`: the settings of all other parameters in those
    rows of `values` that are nearest to it, and how often each occurs."""
    found: list[Counter[tuple[float, ...]]] = [Counter() for _ in centres]
    others = np.delete(values, column, axis=1)
    for level, setting in zip(_nearest(values[:, column], centres), others.tolist(), strict=True):
        found[level][tuple(setting)] += 1
    return found


def _span(centres: Floats, is_complete: NDArray[np.bool_], start: int) -> tuple[float, float]:
    if not is_complete[start]:
        return np.nan, np.nan
    low = high = start
    while low > 0 and is_complete[low - 1]:
        low -= 1
    while high + 1 < len(centres) and is_complete[high + 1]:
        high += 1
    return float(centres[low]), float(centres[high])
