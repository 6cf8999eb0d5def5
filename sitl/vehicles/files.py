"""Truth files: what really flies, as TOML, checked before anything starts."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from sitl.plant.records import Truth

_ROOM = Path(__file__).resolve().parent

_Positive = Annotated[float, Field(gt=0.0, strict=True, allow_inf_nan=False)]
_NotNegative = Annotated[float, Field(ge=0.0, strict=True, allow_inf_nan=False)]


class TruthFileError(ValueError):
    """A truth file is missing or wrong: the fault of whoever wrote or named it."""


class _TruthFile(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    quad_mass_kg: _Positive
    arm_m: _Positive
    inertia_kg_m2: tuple[_Positive, _Positive, _Positive]
    load_mass_kg: _Positive
    cable_length_m: _Positive
    gravity_m_s2: _Positive
    rotor_min_n: Annotated[float, Field(strict=True)]
    rotor_max_n: Annotated[float, Field(strict=True)]
    rotor_tau_s: _NotNegative
    torque_ratio_m: _NotNegative
    quad_drag_n_s_m: _NotNegative
    quad_drag_quadratic_n_s2_m2: _NotNegative
    spin_drag_n_m_s2: _NotNegative
    load_drag_n_s_m: _NotNegative
    load_drag_quadratic_n_s2_m2: _NotNegative
    gear_height_m: _Positive
    gear_spread_m: _Positive
    rotor_reach_m: _Positive
    rotor_height_m: _NotNegative
    load_radius_m: _Positive
    # the sub-step near the ground resolves contacts up to this frequency: docs/plant.md
    contact_frequency_rad_s: Annotated[float, Field(strict=True, ge=20.0, le=200.0)]
    contact_damping_ratio: Annotated[float, Field(strict=True, ge=0.0, le=1.5)]
    friction: Annotated[float, Field(strict=True, ge=0.0, le=5.0)]
    slip_rate_1_s: Annotated[float, Field(strict=True, gt=0.0, le=600.0)]

    @model_validator(mode="after")
    def _consistent(self) -> _TruthFile:
        # `not a < b`, because a comparison with nan is false
        if not self.rotor_min_n < self.rotor_max_n:
            raise ValueError(
                f"rotor_max_n = {self.rotor_max_n:g}; must be > rotor_min_n = {self.rotor_min_n:g}"
            )
        x, y, z = self.inertia_kg_m2
        if not (x <= y + z and y <= x + z and z <= x + y):
            raise ValueError(
                f"inertia_kg_m2 = {[x, y, z]}; each must be <= the sum of the other two, or no body has it"
            )
        return self

    def truth(self) -> Truth:
        return Truth(
            quad_mass=self.quad_mass_kg,
            arm=self.arm_m,
            inertia=self.inertia_kg_m2,
            load_mass=self.load_mass_kg,
            cable_length=self.cable_length_m,
            gravity=self.gravity_m_s2,
            rotor_min=self.rotor_min_n,
            rotor_max=self.rotor_max_n,
            rotor_tau=self.rotor_tau_s,
            torque_ratio=self.torque_ratio_m,
            quad_drag=self.quad_drag_n_s_m,
            quad_drag_quadratic=self.quad_drag_quadratic_n_s2_m2,
            spin_drag=self.spin_drag_n_m_s2,
            load_drag=self.load_drag_n_s_m,
            load_drag_quadratic=self.load_drag_quadratic_n_s2_m2,
            gear_height=self.gear_height_m,
            gear_spread=self.gear_spread_m,
            rotor_reach=self.rotor_reach_m,
            rotor_height=self.rotor_height_m,
            load_radius=self.load_radius_m,
            contact_frequency=self.contact_frequency_rad_s,
            contact_damping=self.contact_damping_ratio,
            friction=self.friction,
            slip_rate=self.slip_rate_1_s,
        )


def shipped() -> tuple[str, ...]:
    """Names that `load_truth` knows without a path."""
    return tuple(sorted(path.stem for path in _ROOM.glob("*.toml")))


def load_truth(name_or_path: str | Path) -> Truth:
    """The truth of a shipped name (`bebop`, `thesis`) or a TOML file; TruthFileError says what is wrong."""
    path = Path(name_or_path)
    if str(name_or_path) in shipped():
        path = _ROOM / f"{name_or_path}.toml"
    shown = _shown(path)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise TruthFileError(
            f"{shown}: no such vehicle; must be {', '.join(shipped())} or the path of a file"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise TruthFileError(f"{shown}: cannot be read: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise TruthFileError(f"{shown}: not TOML: {error}") from None
    try:
        return _TruthFile.model_validate(table).truth()
    except ValidationError as error:
        raise TruthFileError(f"{shown}: {_first_fault(error)}") from None


def _shown(path: Path) -> str:
    """`path` as short as it is unambiguous: shipped files from the project's root."""
    return f"sitl/vehicles/{path.name}" if path.parent == _ROOM else str(path)


def _first_fault(error: ValidationError) -> str:
    """The first fault in one line: key = value; what is allowed."""
    faults = error.errors(include_url=False)
    fault: dict[str, Any] = dict(faults[0])
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"]).lstrip(".")
    context = fault.get("ctx", {})
    match fault["type"]:
        case "missing":
            return f"{key} is missing{more}"
        case "extra_forbidden":
            return f"{key}: unknown key; must be one of {', '.join(_TruthFile.model_fields)}{more}"
        case "greater_than":
            allowed = f"must be > {context['gt']:g}"
        case "greater_than_equal":
            allowed = f"must be >= {context['ge']:g}"
        case "less_than_equal":
            allowed = f"must be <= {context['le']:g}"
        case "value_error":
            return f"{context['error']}{more}"
        case _:
            allowed = fault["msg"].replace("Input should be", "must be")
    return f"{key} = {fault['input']!r}; {allowed}{more}"
