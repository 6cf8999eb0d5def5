"""A sweep as work for workers: the data that each of them needs, and the function that flies some flights."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from autopilot.geometry.lane_numbers import LANES
from autopilot.own.law import law_name
from autopilot.shell.compiling import Part
from autopilot.shell.watched_calls import watched_calls
from gcs.errors import GcsError
from gcs.mission_files import load
from gcs.shell.display import notify_if_slow
from gcs.sweep import lane_kernel
from gcs.sweep.cell import cell_of
from gcs.sweep.flight import FlightResult, StartTimes, SweepFlight, fly, start_times
from gcs.sweep.group import MIN_FLIGHTS, LaneGroup, fits_in_lanes
from gcs.sweep.plan import Case, SweepPlan
from gcs.sweep.plan_file import sweep_files
from gcs.sweep.plan_values import PlanError
from gcs.sweep.store import Row, row_of
from gcs.sweep.warmup import lanes_part, sweep_parts
from missions.model import Mission

Clock = Callable[[], float]  # seconds
MIN_FLIGHTS_FOR_LANES = 1000  # least number of flights with a law for which its lanes are compiled
_MAX_BATCH = 2 * LANES  # flights that one worker is given at a time

_FLIGHT_ERRORS = (ValueError, ArithmeticError)
_FILES_TEXT = (
    "completed flights are stored: restore it and run the same command again, or fly anew with another "
    "--out; workers of --scheduler need the same files at the same paths"
)


@dataclass(frozen=True)
class Work:
    """All data that a worker needs, wherever it runs."""

    plan: SweepPlan
    mission: Mission
    start_times_by_law: dict[str, StartTimes]  # by law
    files: Mapping[str, str]  # of the user's own: `sweep_files` as the sweep began
    lane_laws: frozenset[str] = frozenset()  # laws with which eight flights are flown at once


def prepare(
    plan: SweepPlan,
    files: Mapping[str, str],
    warm: Callable[[Iterable[Part]], None],
    quiet: bool = True,
) -> Work:
    """The work of a plan whose `sweep_files` are given; flies the beginning of one flight for each law.

    `warm` compiles the given parts of the flight software that are not compiled yet. The instants of arming
    and starting are those of a flight with seed 1 and only the settings that all flights share, so that they
    do not depend on which seeds are flown. A vehicle that is not ready then because of a varied parameter is
    asked again.
    """
    warm(sweep_parts(plan.laws))
    mission = load(plan.mission)
    cases = {law: Case(0, law, 1, ()) for law in plan.laws}
    without_variation = replace(plan, varied=(), sample=0)
    start_times_by_law, lane_laws = {}, set()
    for law, case in cases.items():
        conditions = without_variation.conditions(case)
        try:
            with watched_calls(), notify_if_slow(f"preparing the flights with law {law_name(law)}", quiet):
                start_times_by_law[law] = start_times(mission, conditions)
        except ValueError as error:
            raise PlanError(f"law {law_name(law)}: {error}") from None
        one = SweepFlight(cell_of(mission, conditions), case.seed, start_times_by_law[law])
        if _lanes_are_worthwhile(plan, law) and fits_in_lanes(one):
            warm([lanes_part(law)])
            lane_laws.add(law)
    return Work(plan, mission, start_times_by_law, files, frozenset(lane_laws))


def _lanes_are_worthwhile(plan: SweepPlan, law: str) -> bool:
    """Whether there are flights that differ only in their seeds, and the lanes are compiled already or the
    flights are enough to compile them."""
    compiled = hasattr(lane_kernel.fly_lanes, "overloads") and not any(plan.own(law))
    enough = plan.points * len(plan.seeds) >= MIN_FLIGHTS_FOR_LANES
    return compiled and len(plan.seeds) >= MIN_FLIGHTS and (enough or lanes_part(law).ready)


def fly_cases(
    work: Work, cases: Sequence[Case], clock: Clock, stopped: Callable[[], bool] = lambda: False
) -> list[Row]:
    """Fly these flights, up to eight of a cell at once if that is prepared; if `stopped`, only those that
    have begun. GcsError if files of the user's own are others than as the sweep began: for a worker that
    runs elsewhere, or because they were changed, also while these flights were flown."""
    _check_files(work)
    rows = _rows_of(work, cases, clock, stopped)
    _check_files(work)
    return rows


def _check_files(work: Work) -> None:
    """GcsError if a file of the user's own is not that with which the sweep began."""
    try:
        found = sweep_files(work.plan)
    except (OSError, ValueError) as error:
        raise GcsError(f"{error} for a worker in {Path.cwd()}; {_FILES_TEXT}") from None
    for name, digest in work.files.items():
        if found.get(name) != digest:
            state = "another file than as the sweep began" if name in found else "no such file"
            raise GcsError(f"{name}: {state}, for a worker in {Path.cwd()}; {_FILES_TEXT}")


def _rows_of(work: Work, cases: Sequence[Case], clock: Clock, stopped: Callable[[], bool]) -> list[Row]:
    rows: list[Row] = []
    for (law, _), cell in groupby(cases, key=lambda case: (case.law, case.varied)):
        members = list(cell)
        if any(work.plan.own(law)):
            with watched_calls():
                rows += [fly_one(work, case, clock) for case in members if not stopped()]
            continue
        for first in range(0, len(members), LANES):
            if stopped():
                break
            batch = members[first : first + LANES]
            in_lanes = law in work.lane_laws and len(batch) >= MIN_FLIGHTS
            batch_rows = _fly_in_lanes(work, batch, clock) if in_lanes else None
            if batch_rows is None:
                batch_rows = [fly_one(work, case, clock) for case in batch if not stopped()]
            rows += batch_rows
    return rows


def fly_one(work: Work, case: Case, clock: Clock) -> Row:
    """Fly one flight. If it cannot be flown at all, its outcome is `refused`."""
    start_s = clock()
    try:
        result = fly(work.mission, work.plan.conditions(case), work.start_times_by_law[case.law])
    except _FLIGHT_ERRORS as error:
        result = FlightResult(outcome="refused", reason=str(error))
    return row_of(work.plan, case, result, clock() - start_s)


def _fly_in_lanes(work: Work, cases: Sequence[Case], clock: Clock) -> list[Row] | None:
    """Fly flights of one cell in lanes; None: they must be flown one by one."""
    start_s = clock()
    try:
        cell = cell_of(work.mission, work.plan.conditions(cases[0]))
        flights = [SweepFlight(cell, case.seed, work.start_times_by_law[case.law]) for case in cases]
        if not fits_in_lanes(flights[0]):
            return None
        LaneGroup(flights).run()
    except _FLIGHT_ERRORS:
        return None
    flight_s = (clock() - start_s) / len(cases)
    return [
        row_of(work.plan, case, flight.result, flight_s) for case, flight in zip(cases, flights, strict=True)
    ]


def batches(plan: SweepPlan, cases: Sequence[Case], workers: int) -> list[tuple[Case, ...]]:
    """The cases in groups for this number of workers, each group of one law, so that a worker need not change
    kernels within it."""
    size = batch_size(len(cases), workers)
    groups: list[tuple[Case, ...]] = []
    for law, members in groupby(cases, key=lambda case: case.law):
        max_size = 1 if any(plan.own(law)) else size  # in Python a flight takes seconds
        of_law = list(members)
        groups += [tuple(of_law[first : first + max_size]) for first in range(0, len(of_law), max_size)]
    return groups


def batch_size(flights: int, workers: int) -> int:
    """The number of flights that a worker is given at a time: few flights are divided among all workers; of
    many, a group takes a second or two."""
    share = max(1, -(-flights // workers))
    if share <= LANES:
        return share
    return _MAX_BATCH if share >= 4 * _MAX_BATCH else LANES
