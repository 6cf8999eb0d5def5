"""Custom laws, estimators and planners as scripts give them: by name, file and class, or the class itself."""

from __future__ import annotations

import sys
from collections.abc import Callable

from autopilot.own.estimator import load_estimator
from autopilot.own.law import load_law
from autopilot.own.planner import load_planner
from autopilot.own.source import OwnError
from autopilot.vehicle.parameters import LAWS
from gcs.errors import GcsError


def law_reference(law: str | type) -> str:
    """The law as the command line names it; `Error` if no law has that name, or if the class is no law."""
    return law if law in LAWS else _reference("law", law, load_law)


def estimator_reference(estimator: str | type | None) -> str:
    """The same for an estimator; None is the built-in one."""
    return "" if estimator is None else _reference("estimator", estimator, load_estimator)


def planner_reference(planner: str | type | None) -> str:
    """The same for a path planner."""
    return "" if planner is None else _reference("planner", planner, load_planner)


def _reference(what: str, given: str | type, load: Callable[[str], object]) -> str:
    if not isinstance(given, str | type):
        raise GcsError(f"{what} = {given!r}; must be a name, FILE.py:CLASS, MODULE:CLASS or the class itself")
    named = given if isinstance(given, str) else _place(given)
    try:
        load(named)
    except OwnError as error:
        raise GcsError(f"{what} {error}") from None
    return named


def _place(kind: type) -> str:
    """Where a class is found again: in its file, or, for a class of a notebook, in this process only."""
    if kind.__module__ == "__main__" and (place := getattr(sys.modules["__main__"], "__file__", None)):
        return f"{place}:{kind.__qualname__}"
    return f"{kind.__module__}:{kind.__qualname__}"
