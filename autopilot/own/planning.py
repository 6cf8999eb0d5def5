"""Calls a custom path planner."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from autopilot.own.chosen import OwnSetup
from autopilot.own.guard import Guard, Wrong, shown
from autopilot.own.planner import METHOD, OwnPlanner, load_planner
from autopilot.trajectory.route import Path, PlanError, Planner, Route, check_path


def planner_for(setup: OwnSetup | None) -> Planner | None:
    """The planner of this setup as a function; None if there is no setup: the built-in planner is used."""
    return None if setup is None else planner_of(load_planner(setup.reference), setup.values)


def planner_of(planner: OwnPlanner, values: Mapping[str, float]) -> Planner:
    """The planner with these parameters as a function, which raises PlanError, with file and line, if it
    fails."""

    def plan(route: Route) -> Path:
        guard = Guard(planner, lambda: None)

        def answer() -> Any:
            return planner.made(values).plan(route)

        def checked(path: Any) -> Path:
            if not isinstance(path, Path):
                raise Wrong(f"{METHOD} returned {shown(path)}, which must be made by polynomials or samples")
            try:
                check_path(path, route)
            except PlanError as error:
                raise Wrong(str(error)) from None
            return path

        path = guard.call(METHOD, inf, answer, checked)
        guard.raise_interruption()
        if path is None:
            raise PlanError(f"{planner.told} failed: {guard.why}")
        return path

    return plan
