"""A custom planner, as `gcs check` uses it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from autopilot.own.own_code import naming_option
from autopilot.own.planner import load_planner
from autopilot.own.planning import plan_function
from autopilot.own.source import OwnError
from autopilot.own.trial import try_planner
from autopilot.shell.watched_calls import watched_calls
from autopilot.trajectory.route import Planner
from gcs.errors import InputError


@contextmanager
def own_planner(reference: str, values: Mapping[str, float]) -> Iterator[Planner]:
    """The planner with these values of the parameters, and with its calls watched. GcsError if the planner
    cannot be loaded, or if it fails on the routes of a trial, as before a flight."""
    with watched_calls():
        try:
            loaded = load_planner(reference)
            with naming_option("planner"):
                try_planner(loaded, values)
        except OwnError as error:
            raise InputError(str(error)) from None
        yield plan_function(loaded, values)
