"""Vehicle files: TOML in, `Vehicle` out.

A file whose `believed` names another vehicle is the true vehicle: the simulator flies it, and keys that it
leaves out have the other vehicle's values. The autopilot and the checks of missions assume the other vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.shipped import VEHICLES, VehicleFileError
from autopilot.wire.parameter_table import ParameterError
from missions.toml_files import format_value


class Reference(NamedTuple):
    """The file of the vehicle that the autopilot assumes, and how messages about it begin."""

    table: dict[str, Any]
    where: str


def load_vehicle(name_or_path: str | PathLike[str]) -> Vehicle:
    """The true vehicle of a shipped name (`bebop`) or of a file; a VehicleFileError says what is wrong."""
    table, where = _table(name_or_path)
    return _vehicle(table, where, _reference(table, where, name_or_path))


def load_belief(name_or_path: str | PathLike[str]) -> Vehicle:
    """The vehicle that the autopilot assumes, with the parameters of both vehicles (those of the true one
    take precedence); a VehicleFileError says what is wrong with one of them."""
    table, where = _table(name_or_path)
    reference = _reference(table, where, name_or_path)
    own = _vehicle(table, where, reference) if reference is None or "parameters" in table else None
    return _belief(table, where, reference, own)


def load_truth_and_belief(name_or_path: str | PathLike[str]) -> tuple[Vehicle, Vehicle]:
    """The true vehicle and the one that the autopilot assumes, as the two functions above return them; each
    file is read once."""
    table, where = _table(name_or_path)
    reference = _reference(table, where, name_or_path)
    true = _vehicle(table, where, reference)
    return true, _belief(table, where, reference, true)


def _vehicle(table: dict[str, Any], where: str, reference: Reference | None) -> Vehicle:
    """The vehicle of a table, completed by that of the assumed vehicle if it names one."""
    found = VEHICLES.record(Vehicle, _completed(table, where, reference), where, written=table)
    problems = [f"{where}: parameters.{line}" for line in _parameter_problems(found)]
    if problems:
        raise VehicleFileError(problems)
    return found


def _belief(table: dict[str, Any], where: str, reference: Reference | None, true: Vehicle | None) -> Vehicle:
    """The assumed vehicle of a table; `true`: the true one, None if it has no parameters of its own."""
    if reference is None:
        assert true is not None
        return true
    with _errors_naming_reference(where, table):
        belief = _vehicle(reference.table, reference.where, None)
    if true is None:
        return belief
    return belief.model_copy(update={"parameters": {**belief.parameters, **true.parameters}})


def belief_of(name_or_path: str | PathLike[str]) -> str | PathLike[str]:
    """Name or path of the assumed vehicle: the one that `believed` names, or the given one."""
    table, _ = _table(name_or_path)
    return _believed(table, name_or_path) or name_or_path


def _parameter_problems(vehicle: Vehicle) -> Iterator[str]:
    """What is wrong with the parameters with which a vehicle is delivered. Unknown ones may be those of a
    custom law, estimator or planner: what flies the vehicle checks them (`autopilot.own.own_code`)."""
    if not vehicle.parameters:
        return
    from autopilot.vehicle.parameters import definitions, vehicle_values

    known = definitions().parameters
    for name, value in vehicle.parameters.items():
        if name not in known and name.startswith("SIM_"):
            yield f"{name}: is the simulator's, and these are the autopilot's; other keys say what is true"
        elif name not in known:
            continue
        elif known[name].from_vehicle:
            yield f"{name}: is {known[name].from_vehicle}; write that key instead"
        else:
            try:
                known[name].parameter(name, vehicle_values(vehicle)).checked(value)
            except ParameterError as error:
                yield str(error)


def vehicle_keys(name_or_path: str | PathLike[str]) -> tuple[dict[str, Any], str]:
    """The keys of a file, completed by those of the assumed vehicle if it names one; and the place with which
    messages about it begin."""
    table, where = _table(name_or_path)
    reference = _reference(table, where, name_or_path)
    return _completed(table, where, reference), where


def _completed(table: dict[str, Any], where: str, reference: Reference | None) -> dict[str, Any]:
    """The table with the keys that it leaves out: those of the assumed vehicle, and the name of the file."""
    return {**(reference.table if reference else {}), "name": Path(where).stem, **table}


def _reference(table: dict[str, Any], where: str, name_or_path: str | PathLike[str]) -> Reference | None:
    """What the file of the assumed vehicle says; None if the table names none."""
    believed = _believed(table, name_or_path)
    if not believed:
        return None
    with _errors_naming_reference(where, table):
        reference = Reference(*_table(believed))
    if reference.table.get("believed"):
        text = f"{where}: believed: {reference.where} has a `believed` of its own; name that one"
        raise VehicleFileError([text])
    return reference


def _table(name_or_path: str | PathLike[str]) -> tuple[dict[str, Any], str]:
    found = VEHICLES.read(name_or_path)
    return VEHICLES.table(found.text, found.where), found.where


@contextmanager
def _errors_naming_reference(where: str, table: dict[str, Any]) -> Iterator[None]:
    """Make a VehicleFileError of the assumed vehicle name the file and the key that refer to it."""
    try:
        yield
    except VehicleFileError as error:
        lines = [f"{where}: believed = {format_value(table['believed'])}; {line}" for line in error.problems]
        raise VehicleFileError(lines) from None


def _believed(table: dict[str, Any], name_or_path: str | PathLike[str]) -> str:
    """Name or path of the vehicle assumed for this table; empty: itself."""
    name = table.get("believed")
    if not isinstance(name, str) or not name or name in VEHICLES.names():
        return name if isinstance(name, str) else ""
    path_beside_file = Path(name_or_path).parent / name
    return str(path_beside_file) if path_beside_file.suffix or path_beside_file.is_file() else name
