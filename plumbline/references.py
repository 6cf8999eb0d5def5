"""Custom laws, estimators and planners as scripts give them: by name, file and class, or the class itself."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from pathlib import Path

from autopilot.own.estimator import load_estimator
from autopilot.own.law import load_law
from autopilot.own.planner import load_planner
from autopilot.own.saved_class import is_found_elsewhere, is_named, save_class
from autopilot.own.set_attributes import attributes_set_since
from autopilot.own.source import OwnError, local_reference
from autopilot.vehicle.parameters import LAWS
from gcs.errors import GcsError


def law_reference(law: str | type, folder: Path | None = None) -> str:
    """The law as the command line names it; `Error` if no law has that name, or if the class is no law.

    A class that only this process has, as one of a notebook's cell, is saved in `folder` for others.
    """
    return law if law in LAWS else _reference("law", law, load_law, folder)


def estimator_reference(estimator: str | type | None, folder: Path | None = None) -> str:
    """The same for an estimator; None is the built-in one."""
    return "" if estimator is None else _reference("estimator", estimator, load_estimator, folder)


def planner_reference(planner: str | type | None, folder: Path | None = None) -> str:
    """The same for a path planner."""
    return "" if planner is None else _reference("planner", planner, load_planner, folder)


def _reference(what: str, given: str | type, load: Callable[[str], object], folder: Path | None) -> str:
    if not isinstance(given, str | type):
        raise GcsError(f"{what} = {given!r}; must be a name, FILE.py:CLASS, MODULE:CLASS or the class itself")
    named = given if isinstance(given, str) else _place(given)
    try:
        load(named)
    except OwnError as error:
        raise GcsError(f"{what} {error}") from None
    if isinstance(given, str) or folder is None:
        return named
    if is_found_elsewhere(given):
        if changed := attributes_set_since(given):
            raise GcsError(
                f"{what} {given.__name__}: {', '.join(changed)} was set after the class was defined, which "
                "other processes, that read the file of the class, do not see; set it there, or make it a "
                "parameter of the class"
            )
        return named
    try:
        return str(save_class(given, folder))
    except (pickle.PicklingError, OSError) as error:
        text = f"{what} {given.__name__} cannot be given to other processes ({error}); write it to a file"
        raise GcsError(text) from None


def _place(kind: type) -> str:
    """Where a class is found again: in its file, or, for a class of a notebook, in this process only."""
    if not is_named(kind):
        return local_reference(kind)
    if kind.__module__ == "__main__" and (place := getattr(sys.modules["__main__"], "__file__", None)):
        return f"{place}:{kind.__qualname__}"
    return f"{kind.__module__}:{kind.__qualname__}"
