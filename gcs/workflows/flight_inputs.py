"""What a flight of its own is started with, checked before anything starts: vehicle, sensors and settings.

The programs would refuse the same, each in its own log; here it is told at once. This module alone of the
ground station knows both tables of parameters.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.parameter_table import ParameterError, ParameterTable
from gcs.errors import InputError, input_error
from missions.toml_files import FileError
from sitl.sensors.files import load_profile
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import truth_of

_WORLD = "SIM_"


def check_flight_inputs(vehicle: str, sensors: str, settings: Iterable[tuple[str, float]]) -> None:
    """GcsError if there is no such vehicle or sensor profile, or if a parameter cannot be set so."""
    try:
        found = load_vehicle(vehicle)
        load_profile(sensors)
    except FileError as error:
        raise input_error(error) from None
    own, world = autopilot_parameters(found), sim_parameters(truth_of(found))
    for name, value in settings:
        table = world if name.startswith(_WORLD) and name not in own else own
        if name not in table:
            raise InputError(f"--set {name}: {_unknown(name, [*own.names, *world.names])}")
        _check(table, name, value)


def _check(table: ParameterTable, name: str, value: float) -> None:
    try:
        table.check(name, value)
    except ParameterError as error:
        raise InputError(f"--set {error}") from None


def _unknown(name: str, names: list[str]) -> str:
    """What is said of an unknown parameter: the nearest one, and all that begin as it does."""
    near = get_close_matches(name, names, n=1, cutoff=0.75)
    hint = f"did you mean {near[0]}? " if near else ""
    prefix = name.partition("_")[0] + "_"
    kin = sorted(known for known in names if known.startswith(prefix))
    if kin:
        return f"no such parameter; {hint}there are {', '.join(kin)}"
    groups = ", ".join(sorted({known.partition("_")[0] + "_" for known in names}))
    return f"no such parameter; {hint}names begin with one of {groups}"
