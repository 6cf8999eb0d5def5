"""What a mission is checked against before take-off: the numbers of a vehicle file, read as data."""

from __future__ import annotations

import tomllib
from dataclasses import fields
from importlib.resources import files
from pathlib import Path
from typing import Any

from autopilot.trajectory.feasibility import VehicleLimits
from gcs.errors import GcsError

_SUFFIX = ".toml"
_SHIPPED = "sitl.vehicles"  # the files, not the code


def shipped_vehicles() -> tuple[str, ...]:
    """Names of the vehicles that come with the simulator."""
    names = (entry.name for entry in files(_SHIPPED).iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in names if name.endswith(_SUFFIX)))


def load_limits(name_or_path: str) -> VehicleLimits:
    """Masses, lengths and rotor limits of a shipped vehicle or a file; what it leaves out is Table 4-1's."""
    if name_or_path in shipped_vehicles():
        text = files(_SHIPPED).joinpath(name_or_path + _SUFFIX).read_text(encoding="utf-8")
    else:
        try:
            text = Path(name_or_path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "not a text file"
            names = ", ".join(shipped_vehicles())
            raise GcsError(
                f"vehicle {name_or_path!r}: {reason}; must be {names} or the path of a file"
            ) from None
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise GcsError(f"vehicle {name_or_path}: not TOML: {error}") from None
    return VehicleLimits(**_known(table, name_or_path))


def _known(table: dict[str, Any], where: str) -> dict[str, Any]:
    """The keys that the check needs; the simulator judges the rest when it reads the file."""
    found: dict[str, Any] = {}
    for field in fields(VehicleLimits):
        if field.name not in table:
            continue
        value = table[field.name]
        numbers = value if isinstance(value, list) else [value]
        wanted = 3 if field.name == "inertia_kg_m2" else 1
        if len(numbers) != wanted or not all(isinstance(n, int | float) for n in numbers):
            what = "three numbers" if wanted == 3 else "a number"
            raise GcsError(f"vehicle {where}: {field.name} = {value!r}; must be {what}")
        found[field.name] = tuple(map(float, numbers)) if wanted == 3 else float(numbers[0])
    return found
