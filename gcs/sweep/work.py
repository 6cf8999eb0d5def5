"""A sweep as work for a crew: what every worker must know, and the function that flies one flight of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from gcs.sweep.flight import Boarding, Flown, boarding, fly
from gcs.sweep.plan import Case, PlanError, SweepPlan
from gcs.sweep.store import Row, row_of
from missions.fileformat import load_mission
from missions.model import Mission

Clock = Callable[[], float]  # seconds


@dataclass(frozen=True)
class Work:
    """All that a worker must know, wherever it runs."""

    plan: SweepPlan
    mission: Mission
    boardings: dict[str, Boarding]  # by law


def prepare(plan: SweepPlan) -> Work:
    """The work of a plan; flies the beginning of one flight for each law, which also compiles its kernels.

    The instants of arming and starting are those of the settings that all flights share. A vehicle that is
    not ready at them, under what is varied, is asked again.
    """
    mission = load_mission(plan.mission)
    cases = {law: Case(0, law, plan.seeds[0], ()) for law in plan.laws}
    bare = SweepPlan(plan.mission, plan.vehicle, plan.sensors, plan.laws, plan.seeds, (), plan.settings)
    boardings = {}
    for law, case in cases.items():
        try:
            boardings[law] = boarding(mission, bare.conditions(case))
        except ValueError as error:
            raise PlanError(f"law {law}: {error}") from None
    return Work(plan, mission, boardings)


def fly_case(work: Work, case: Case, clock: Clock) -> Row:
    """Fly one of the flights. One that cannot be flown at all has the outcome `refused`."""
    began_s = clock()
    try:
        flown = fly(work.mission, work.plan.conditions(case), work.boardings[case.law])
    except (ValueError, ArithmeticError) as error:
        flown = Flown(outcome="refused", reason=str(error))
    return row_of(work.plan, case, flown, clock() - began_s)


def batches(cases: Sequence[Case], size: int) -> list[tuple[Case, ...]]:
    """The cases in groups of up to `size`, each of one law, so that a worker need not change its kernels."""
    groups: list[tuple[Case, ...]] = []
    group: list[Case] = []
    for case in cases:
        if group and (len(group) == size or group[0].law != case.law):
            groups.append(tuple(group))
            group = []
        group.append(case)
    return [*groups, tuple(group)] if group else groups
