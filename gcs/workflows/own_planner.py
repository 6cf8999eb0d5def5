"""A custom planner, as `gcs check` uses it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from autopilot.own.own_code import OwnCode, parameters_for
from autopilot.own.planner import load_planner
from autopilot.own.planning import plan_function
from autopilot.own.source import OwnError
from autopilot.shell.watched_calls import watched_calls
from autopilot.trajectory.route import Planner
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.shipped import VehicleFileError
from gcs.errors import InputError, input_error


@contextmanager
def own_planner(reference: str, vehicle: str) -> Iterator[Planner]:
    """The planner with its default parameters for a vehicle, and with its calls watched. GcsError if there is
    no such vehicle, or if the planner cannot be loaded."""
    try:
        values = parameters_for(load_belief(vehicle), OwnCode(planner=reference), all_known=False).values()
        planner = plan_function(load_planner(reference), values)
    except OwnError as error:
        raise InputError(str(error)) from None
    except VehicleFileError as error:
        raise input_error(error) from None
    with watched_calls():
        yield planner
