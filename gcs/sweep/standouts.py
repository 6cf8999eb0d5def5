"""The flights of a sweep that stand out, and how each of its flights is flown again, with a report."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gcs.sweep.plan import SweepPlan
from gcs.sweep.results import Flights, flights_of
from gcs.sweep.store import Store
from gcs.workflows.flight_options import own_words

FOLDER = "flights"  # of a sweep's directory: flown again, each with a report


@dataclass(frozen=True)
class Standout:
    """A flight that somebody wants to see."""

    law: str
    reference: str  # of the law, as it was named
    kind: str  # worst, median or lost
    index: int  # of the sweep
    seed: int
    varied: dict[str, float]
    outcome: str
    error_m: float  # NaN where there is none
    reason: str = ""  # of one that was not completed

    @property
    def name(self) -> str:
        """Of its directory."""
        return f"{self.law}-{self.kind}"

    @property
    def told(self) -> str:
        """What is seen there, in a few words."""
        if self.kind == "lost":
            return f"{self.outcome}: {self.reason}" if self.reason else self.outcome
        return f"load error {1e3 * self.error_m:.1f} mm"


def standouts(flights: Flights) -> list[Standout]:
    """Of one law, of the flights that completed the worst and the median by their load error, and of the
    others the first."""
    rated = np.flatnonzero(flights.completed & np.isfinite(flights.error_m))
    ranked = rated[np.argsort(flights.error_m[rated], kind="stable")]
    found = []
    if len(ranked):
        found.append(_standout(flights, "worst", int(ranked[-1])))
    if len(ranked) > 2:
        found.append(_standout(flights, "median", int(ranked[(len(ranked) - 1) // 2])))
    lost = np.flatnonzero(~flights.completed)
    if len(lost):
        found.append(_standout(flights, "lost", int(lost[0])))
    return found


def stored_standouts(directory: Path, plan: SweepPlan) -> list[Standout]:
    """Those of all laws, of the flights that lie in the directory of a sweep."""
    laws = flights_of(Store(directory, plan).read(), plan)
    return [one for flights in laws for one in standouts(flights)]


def _standout(flights: Flights, kind: str, row: int) -> Standout:
    return Standout(
        law=flights.law,
        reference=flights.reference,
        kind=kind,
        index=int(flights.index[row]),
        seed=int(flights.seed[row]),
        varied={name: float(values[row]) for name, values in flights.values.items()},
        outcome=flights.outcome[row],
        error_m=float(flights.error_m[row]),
        reason=flights.reason[row] if flights.reason else "",
    )


def flight_settings(plan: SweepPlan, varied: Mapping[str, float]) -> tuple[str, ...]:
    """NAME=VALUE of all that is set for a flight, with the digits that give the same numbers."""
    return tuple(f"{name}={value!r}" for name, value in {**dict(plan.settings), **varied}.items())


def base_command(plan: SweepPlan) -> str:
    """What the commands of all flights begin with; law, seed and what is varied follow.

    A sweep does not check whether the vehicle can do it, hence --force.
    """
    words = ["gcs", "fly", plan.mission, "--vehicle", plan.vehicle, "--sensors", plan.sensors, "--force"]
    words += own_words(plan.estimator, plan.planner)
    for setting in flight_settings(plan, {}):
        words += ["--set", setting]
    return shlex.join(words)


def command_of(plan: SweepPlan, flight: Standout, directory: Path) -> str:
    """The command that flies it again into the directory of the sweep, whatever of it lies there already."""
    words = ["--law", flight.reference, "--seed", str(flight.seed)]
    for name, value in flight.varied.items():
        words += ["--set", f"{name}={value!r}"]
    out = shlex.join(["--out", str(directory / FOLDER / flight.name), "--overwrite"])
    return f"{base_command(plan)} {shlex.join(words)} {out}"
