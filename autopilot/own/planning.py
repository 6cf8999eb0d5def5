"""Calls a custom path planner."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from autopilot.own.guard import CallError, Guard, short_repr
from autopilot.own.own_code import OwnSetup
from autopilot.own.planner import METHOD, OwnPlanner, load_planner
from autopilot.trajectory.route import Path, PlanError, Planner, Route, check_path


def plan_function_for(setup: OwnSetup | None) -> Planner | None:
    """The planner of this setup as a function; None if there is no setup: the built-in planner is used."""
    return None if setup is None else plan_function(load_planner(setup.reference), setup.values)


def plan_function(planner: OwnPlanner, values: Mapping[str, float]) -> Planner:
    """The planner with these parameters as a function, which raises PlanError, with file and line, if it
    fails."""

    def plan(route: Route) -> Path:
        guard = Guard(planner, lambda: None)

        def call_method() -> Any:
            return planner.new_instance(values).plan(route)

        def check(path: Any) -> Path:
            if not isinstance(path, Path):
                raise CallError(
                    f"{METHOD} returned {short_repr(path)}, which must be made by polynomials or samples"
                )
            try:
                check_path(path, route)
            except PlanError as error:
                raise CallError(str(error)) from None
            return path

        path = guard.call(METHOD, inf, call_method, check)
        guard.raise_interruption()
        if path is None:
            raise PlanError(f"{planner.label} failed: {guard.reason}")
        return path

    return plan
