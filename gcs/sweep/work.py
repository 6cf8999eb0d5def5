"""A sweep as work for workers: the data that each of them needs, and the function that flies some flights."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from autopilot.geometry.lane_numbers import LANES
from autopilot.own.law import name_of
from autopilot.shell.compiling import Part
from autopilot.shell.watched_calls import watched_calls
from gcs.shell.display import told_if_slow
from gcs.sweep import lane_kernel
from gcs.sweep.cell import cell_of
from gcs.sweep.flight import Boarding, Flown, SweptFlight, boarding, fly
from gcs.sweep.group import FEWEST, Group, suits
from gcs.sweep.plan import Case, PlanError, SweepPlan
from gcs.sweep.store import Row, row_of
from gcs.sweep.warmup import lanes_part, sweep_parts
from missions.fileformat import load_mission
from missions.model import Mission

Clock = Callable[[], float]  # seconds
LANES_PAY = 1000  # least number of flights with a law for which its lanes are compiled
_MOST_AT_A_TIME = 2 * LANES  # flights that one worker is given at a time

_NOT_FLOWN = (ValueError, ArithmeticError)


@dataclass(frozen=True)
class Work:
    """All data that a worker needs, wherever it runs."""

    plan: SweepPlan
    mission: Mission
    boardings: dict[str, Boarding]  # by law
    in_lanes: frozenset[str] = frozenset()  # laws with which eight flights are flown at once


def prepare(plan: SweepPlan, warm: Callable[[Iterable[Part]], None], quiet: bool = True) -> Work:
    """The work of a plan; flies the beginning of one flight for each law.

    `warm` compiles the given parts of the flight software that are not compiled yet. The instants of arming
    and starting are those of a flight with only the settings that all flights share. A vehicle that is not
    ready then because of a varied parameter is asked again.
    """
    warm(sweep_parts(plan.laws))
    mission = load_mission(plan.mission)
    cases = {law: Case(0, law, plan.seeds[0], ()) for law in plan.laws}
    bare = replace(plan, varied=(), sample=0)
    boardings, in_lanes = {}, set()
    for law, case in cases.items():
        conditions = bare.conditions(case)
        try:
            with watched_calls(), told_if_slow(f"preparing the flights with law {name_of(law)}", quiet):
                boardings[law] = boarding(mission, conditions)
        except ValueError as error:
            raise PlanError(f"law {name_of(law)}: {error}") from None
        one = SweptFlight(cell_of(mission, conditions), case.seed, boardings[law])
        if _lanes_pay(plan, law) and suits(one):
            warm([lanes_part(law)])
            in_lanes.add(law)
    return Work(plan, mission, boardings, frozenset(in_lanes))


def _lanes_pay(plan: SweepPlan, law: str) -> bool:
    """Whether there are flights that differ only in their seeds, and the lanes are compiled already or the
    flights are enough to compile them."""
    compiled = hasattr(lane_kernel.fly_lanes, "overloads") and not any(plan.own(law))
    enough = plan.points * len(plan.seeds) >= LANES_PAY
    return compiled and len(plan.seeds) >= FEWEST and (enough or lanes_part(law).ready)


def fly_cases(
    work: Work, cases: Sequence[Case], clock: Clock, stopped: Callable[[], bool] = lambda: False
) -> list[Row]:
    """Fly these flights, up to eight of a cell at once if that is prepared; if `stopped`, only those that
    have begun."""
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
            some = members[first : first + LANES]
            at_once = law in work.in_lanes and len(some) >= FEWEST
            found = _fly_at_once(work, some, clock) if at_once else None
            if found is None:
                found = [fly_one(work, case, clock) for case in some if not stopped()]
            rows += found
    return rows


def fly_one(work: Work, case: Case, clock: Clock) -> Row:
    """Fly one flight. If it cannot be flown at all, its outcome is `refused`."""
    began_s = clock()
    try:
        flown = fly(work.mission, work.plan.conditions(case), work.boardings[case.law])
    except _NOT_FLOWN as error:
        flown = Flown(outcome="refused", reason=str(error))
    return row_of(work.plan, case, flown, clock() - began_s)


def _fly_at_once(work: Work, cases: Sequence[Case], clock: Clock) -> list[Row] | None:
    """Fly flights of one cell in lanes; None: they must be flown one by one."""
    began_s = clock()
    try:
        cell = cell_of(work.mission, work.plan.conditions(cases[0]))
        flights = [SweptFlight(cell, case.seed, work.boardings[case.law]) for case in cases]
        if not suits(flights[0]):
            return None
        Group(flights).run()
    except _NOT_FLOWN:
        return None
    each_s = (clock() - began_s) / len(cases)
    return [
        row_of(work.plan, case, flight.flown, each_s) for case, flight in zip(cases, flights, strict=True)
    ]


def batches(plan: SweepPlan, cases: Sequence[Case], workers: int) -> list[tuple[Case, ...]]:
    """The cases in groups for this number of workers, each group of one law, so that a worker need not change
    kernels within it."""
    size = batch_size(len(cases), workers)
    groups: list[tuple[Case, ...]] = []
    for law, members in groupby(cases, key=lambda case: case.law):
        most = 1 if any(plan.own(law)) else size  # in Python a flight takes seconds
        of_law = list(members)
        groups += [tuple(of_law[first : first + most]) for first in range(0, len(of_law), most)]
    return groups


def batch_size(flights: int, workers: int) -> int:
    """The number of flights that a worker is given at a time: few flights are divided among all workers; of
    many, a group takes a second or two."""
    share = max(1, -(-flights // workers))
    if share <= LANES:
        return share
    return _MOST_AT_A_TIME if share >= 4 * _MOST_AT_A_TIME else LANES
