"""Profile files: TOML, checked before anything starts; what is wrong is said in one line."""

from __future__ import annotations

import tomllib
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from sitl.sensors.profile import (
    Barometer,
    CableSensor,
    Gnss,
    Imu,
    LoadTracker,
    Magnetometer,
    Mocap,
    Profile,
)

_ROOM = Path(__file__).resolve().parent
_TABLES: dict[str, type[BaseModel]] = {
    "description": BaseModel,
    "imu": Imu,
    "mocap": Mocap,
    "load_tracker": LoadTracker,
    "cable_sensor": CableSensor,
    "gnss": Gnss,
    "barometer": Barometer,
    "magnetometer": Magnetometer,
}
_BOUNDS = {
    "greater_than": ("gt", ">"),
    "greater_than_equal": ("ge", ">="),
    "less_than": ("lt", "<"),
    "less_than_equal": ("le", "<="),
}
_REQUIREMENTS = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "finite_number": "must be a finite number",
    "string_type": "must be a text",
    "model_type": "must be a table",
}


class ProfileError(ValueError):
    """A sensor profile cannot be used: the fault of its file or of its name."""


def shipped() -> tuple[str, ...]:
    """Names of the profiles that come with Plumbline."""
    return tuple(sorted(path.stem for path in _ROOM.glob("*.toml")))


def _requirement(error: ErrorDetails) -> str:
    """What was wrong with a value, as 'must ...'."""
    context: dict[str, Any] = error.get("ctx", {})
    kind = error["type"]
    if kind in _BOUNDS:
        key, sign = _BOUNDS[kind]
        return f"must be {sign} {context[key]:g}"
    if kind == "literal_error":
        return f"must be {context['expected']}"
    return _REQUIREMENTS.get(kind, error["msg"])


def _complaint(error: ErrorDetails) -> str:
    """One error of the validation, in words: where, what was found, what is allowed."""
    where = ".".join(str(part) for part in error["loc"])
    if error["type"] == "missing":
        return f"{where} is missing"
    if error["type"] == "extra_forbidden":
        known = sorted(_TABLES[str(error["loc"][0])].model_fields if len(error["loc"]) > 1 else _TABLES)
        close = get_close_matches(str(error["loc"][-1]), known, n=1)
        hint = f"did you mean {close[0]}?" if close else f"known are {', '.join(known)}"
        return f"{where} is not known; {hint}"
    value = error["input"]
    shown = f"{where} = {value!r}" if isinstance(value, str | int | float) else where
    return f"{shown}; {_requirement(error)}"


def parse_profile(text: str, source: str) -> Profile:
    """The profile written in `text`; `source` names it in errors."""
    try:
        return Profile.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ProfileError(f"{source}: not a TOML file: {error}") from None
    except ValidationError as error:
        errors = error.errors()
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise ProfileError(f"{source}: {_complaint(errors[0])}{more}") from None


def load_profile(name_or_path: str) -> Profile:
    """A shipped profile by its name, or a file."""
    if name_or_path in shipped():
        path = _ROOM / f"{name_or_path}.toml"
    else:
        path = Path(name_or_path)
        if not path.is_file():
            raise ProfileError(
                f"{name_or_path}: no such sensors; must be {', '.join(shipped())} or the path of a file"
            )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ProfileError(f"{path}: cannot be read: {error}") from None
    return parse_profile(text, f"sitl/sensors/{path.name}" if path.parent == _ROOM else str(path))
