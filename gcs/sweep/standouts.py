"""The flights of a sweep that stand out, and the command that flies a flight again, with a report."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from autopilot.vehicle.file import load_belief
from gcs.folders import REPEATS_FOLDER
from gcs.sweep.plan import SweepPlan
from gcs.sweep.results import Flights, flights_by_law
from gcs.sweep.store import Store
from gcs.workflows.flight_options import ignore_options, own_part_options, time_limit_option


@dataclass(frozen=True)
class Standout:
    """A flight of interest."""

    law: str
    reference: str  # of the law, as the user named it
    kind: str  # worst, median or lost
    index: int  # number of the flight in the sweep
    seed: int
    varied: dict[str, float]
    outcome: str
    error_m: float  # NaN if there is none
    reason: str = ""  # why it was not completed

    @property
    def name(self) -> str:
        """The name of its directory."""
        return f"{self.law}-{self.kind}"

    @property
    def summary(self) -> str:
        """What happened in it, in a few words."""
        if self.kind == "lost":
            return f"{self.outcome}: {self.reason}" if self.reason else self.outcome
        return f"load error {1e3 * self.error_m:.1f} mm"


def standouts(flights: Flights) -> list[Standout]:
    """The flights of one law that stand out: of the completed ones, the worst and the median by load error;
    of the others, the first."""
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
    """The flights of all laws that stand out, from those stored in the directory of a sweep."""
    laws = flights_by_law(Store(directory, plan).read(), plan)
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


def flight_settings(plan: SweepPlan, law: str, varied: Mapping[str, float]) -> tuple[str, ...]:
    """NAME=VALUE for each setting of a flight with this law, with the digits that give exactly the same
    numbers."""
    settings = plan.known_to(law, {**dict(plan.settings), **plan.with_followers(varied)})
    return tuple(f"{name}={value!r}" for name, value in settings.items())


def ignored_parameters(plan: SweepPlan, law: str) -> tuple[str, ...]:
    """Parameters in the vehicle's file that have no effect in flights with this law."""
    foreign = plan.foreign_to(law)
    return tuple(name for name in load_belief(plan.vehicle).parameters if name in foreign) if foreign else ()


def base_command(plan: SweepPlan, law: str) -> str:
    """The beginning of the commands of all flights with this law; law, seed and varied settings follow.

    A sweep does not check whether the vehicle can fly the mission, hence --force.
    """
    words = ["gcs", "fly", plan.mission, "--vehicle", plan.vehicle, "--sensors", plan.sensors, "--force"]
    words += own_part_options(plan.estimator, plan.planner)
    words += ignore_options(ignored_parameters(plan, law))
    words += time_limit_option(plan.limit_s)
    for setting in flight_settings(plan, law, {}):
        words += ["--set", setting]
    return shlex.join(words)


def repeat_command(plan: SweepPlan, flight: Standout, directory: Path) -> str:
    """The command that flies it again into the directory of the sweep, and overwrites an earlier repeat."""
    words = ["--law", flight.reference, "--seed", str(flight.seed)]
    for name, value in plan.known_to(flight.reference, plan.with_followers(flight.varied)).items():
        words += ["--set", f"{name}={value!r}"]
    out = shlex.join(["--out", str(directory / REPEATS_FOLDER / flight.name), "--overwrite"])
    return f"{base_command(plan, flight.reference)} {shlex.join(words)} {out}"
