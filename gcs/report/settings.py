"""Parameters of a flight that differ from their defaults."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from autopilot.vehicle.shipped import VehicleFileError
from autopilot.wire.parameter_table import ParameterTable
from gcs.analysis.record import FlightMeta
from gcs.analysis.tracks import Telemetry

_DEFAULT_VEHICLE = "bebop"


class Setting(NamedTuple):
    """A parameter as displayed; `default` is None if it is not known."""

    name: str
    value: str
    default: str | None


def changed_settings(telemetry: Telemetry, meta: FlightMeta) -> list[Setting]:
    """Parameters set on the command line, and those that the vehicle reported as not the default."""
    values = {**telemetry.parameters, **meta.settings}
    tables = _tables(meta.vehicle or _DEFAULT_VEHICLE) if values else ()
    found = []
    for name, value in sorted(values.items()):
        default = _default(name, tables)
        if name not in meta.settings and (default is None or _is_equal(value, default)):
            continue
        found.append(Setting(name, _number(value), None if default is None else _number(default)))
    return found


def unchanged_settings(names: Iterable[str], telemetry: Telemetry, meta: FlightMeta) -> dict[str, str]:
    """The values of these parameters that the vehicle reported, else their defaults if known."""
    tables = _tables(meta.vehicle or _DEFAULT_VEHICLE)
    known = {name: telemetry.parameters.get(name, _default(name, tables)) for name in names}
    return {name: _number(value) for name, value in known.items() if value is not None}


def _default(name: str, tables: tuple[ParameterTable, ...]) -> float | None:
    return next((table.describe(name).default for table in tables if name in table), None)


def _tables(vehicle: str) -> tuple[ParameterTable, ...]:
    from autopilot.vehicle.file import load_belief
    from autopilot.vehicle.parameters import autopilot_parameters
    from sitl.vehicles.sim_parameters import sim_parameters
    from sitl.vehicles.truth import load_truth

    try:
        return sim_parameters(load_truth(vehicle)), autopilot_parameters(load_belief(vehicle))
    except (VehicleFileError, OSError):
        return ()


def _is_equal(value: float | str, default: float) -> bool:
    """Whether they are equal except for the rounding to single precision on the wire; true for a text."""
    return isinstance(value, str) or abs(value - default) <= 1e-6 * max(abs(default), 1e-6)


def _number(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
