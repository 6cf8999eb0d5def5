"""A custom planner, as `gcs check` uses it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from autopilot.own.own_code import OwnCode, naming_option, parameters_for
from autopilot.own.planner import load_planner
from autopilot.own.planning import plan_function
from autopilot.own.source import OwnError
from autopilot.own.trial import try_planner
from autopilot.shell.watched_calls import watched_calls
from autopilot.trajectory.route import Planner
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.shipped import VehicleFileError
from gcs.errors import InputError, input_error


@contextmanager
def own_planner(reference: str, vehicle: str) -> Iterator[Planner]:
    """The planner with its default parameters for a vehicle, and with its calls watched. GcsError if there is
    no such vehicle, if the planner cannot be loaded, or if it fails on the routes of a trial, as before a
    flight."""
    with watched_calls():
        try:
            values = parameters_for(
                load_belief(vehicle), OwnCode(planner=reference), all_known=False
            ).values()
            loaded = load_planner(reference)
            with naming_option("planner"):
                try_planner(loaded, values)
        except OwnError as error:
            raise InputError(str(error)) from None
        except VehicleFileError as error:
            raise input_error(error) from None
        yield plan_function(loaded, values)
