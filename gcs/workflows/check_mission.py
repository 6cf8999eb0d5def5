"""Missions as the commands take them: loaded, and checked against the vehicle that is to fly them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from autopilot.trajectory.feasibility import PathReport, Violation, check, paths
from autopilot.trajectory.route import PlanError, Planner
from autopilot.wire.convert import Home
from autopilot.wire.items import WireItem, decode_items
from gcs.errors import GcsError
from gcs.mission_items import items_of
from gcs.workflows.checked import note_flyable
from gcs.workflows.mission_file import load
from gcs.workflows.vehicle_limits import load_limits
from missions.model import Mission


def violations(mission: Mission, vehicle: str, shaped: bool = True) -> list[Violation]:
    """What the vehicle cannot do of it; with paths `shaped` by the autopilot or as they are asked.

    InputError if a vehicle would not even accept it.
    """
    items_of(mission, Home())
    found = check(mission, load_limits(vehicle), shaped)
    if not found:
        note_flyable(mission, vehicle, shaped)
    return found


def path_reports(mission: Mission, vehicle: str, planner: Planner | None = None) -> list[PathReport]:
    """How the vehicle flies it, its paths shaped by the autopilot, and with `planner` those through waypoints
    made by that; GcsError says what is wrong with one of these."""
    try:
        return paths(mission, load_limits(vehicle), planner)
    except PlanError as error:
        raise GcsError(f"{mission.name}: {error}") from None


@dataclass(frozen=True)
class Check:
    """What `gcs check` found: what the vehicle cannot do, or else how it flies each path."""

    mission: str
    vehicle: str
    violations: tuple[Violation, ...]
    paths: tuple[PathReport, ...]

    def lines(self) -> tuple[str, ...]:
        """For people."""
        if self.violations:
            return tuple(map(str, self.violations))
        return (f"{self.mission}: vehicle {self.vehicle} can fly it", *map(str, self.paths))


def check_mission(name_or_path: str, vehicle: str, as_asked: bool, planner: Planner | None = None) -> Check:
    """Check a mission against a vehicle; `as_asked`: without shaping, and without a report of its paths.

    GcsError if somebody's own `planner` does not plan it.
    """
    mission = load(name_or_path)
    found = violations(mission, vehicle, not as_asked)
    reports = [] if found or as_asked else path_reports(mission, vehicle, planner)
    return Check(mission.name, vehicle, tuple(found), tuple(reports))


def load_checked(name_or_path: str, vehicle: str, force: bool) -> Mission:
    """The mission, which the vehicle can fly unless `force` says that it need not."""
    mission = load(name_or_path)
    if force:
        return mission
    refuse_unflyable(mission, vehicle)
    return mission


def check_items(name: str, items: Sequence[WireItem], home: Home, vehicle: str) -> None:
    """GcsError unless the vehicle can fly what the items stand for."""
    steps = decode_items(items, home)
    refuse_unflyable(Mission(name, name, "", (), steps), vehicle, True)


def refuse_unflyable(mission: Mission, vehicle: str, shaped: bool = True) -> None:
    """GcsError unless the vehicle can fly the mission."""
    found = violations(mission, vehicle, shaped)
    if found:
        listed = "; ".join(map(str, found))
        raise GcsError(f"{mission.name} cannot be flown by vehicle {vehicle}: {listed}; --force tries")
