"""The vehicle as the autopilot believes it to be: a file of the same keys as the true one, read for itself.

Truth and belief are two things here on purpose. How far they may differ is what people come to find out.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from autopilot.wire.convert import ROTOR_FMAX


class BeliefError(ValueError):
    """A vehicle file is missing or wrong: the fault of whoever named it."""


@dataclass(frozen=True)
class Belief:
    """Mass, geometry, rotors and drag, SI; `limited` is False where the file knows no greatest force.

    Rotor lag and drag may be left out of the file: then there are none.
    """

    quad_mass_kg: float
    load_mass_kg: float
    cable_length_m: float
    arm_m: float
    inertia_kg_m2: tuple[float, float, float]
    gravity_m_s2: float
    rotor_min_n: float
    rotor_max_n: float
    limited: bool
    torque_ratio_m: float
    rotor_tau_s: float
    quad_drag_n_s_m: float
    quad_drag_quadratic_n_s2_m2: float


def shipped_vehicles() -> tuple[str, ...]:
    """Names of the vehicle files that come with the autopilot."""
    names = (p.name for p in files(__package__).iterdir() if p.name != "parameters.toml")
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def load_belief(name_or_path: str) -> Belief:
    """The shipped vehicle of that name, or the file at that path; BeliefError if it will not do."""
    if name_or_path in shipped_vehicles():
        where, text = f"{name_or_path}.toml", (files(__package__) / f"{name_or_path}.toml").read_text()
    else:
        where = name_or_path
        try:
            text = Path(name_or_path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise BeliefError(
                f"vehicle {name_or_path!r}: {error}; give a file or one of {', '.join(shipped_vehicles())}"
            ) from None
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BeliefError(f"{where}: not TOML: {error}") from None
    rotor_max = _number(where, data, "rotor_max_n", finite=False)
    limited = rotor_max < math.inf
    return Belief(
        quad_mass_kg=_positive(where, data, "quad_mass_kg"),
        load_mass_kg=_positive(where, data, "load_mass_kg"),
        cable_length_m=_positive(where, data, "cable_length_m"),
        arm_m=_positive(where, data, "arm_m"),
        inertia_kg_m2=_three(where, data, "inertia_kg_m2"),
        gravity_m_s2=_positive(where, data, "gravity_m_s2"),
        # where there is no limit the parameters keep the forces of Table 4-1 and the mixer ignores them
        rotor_min_n=_number(where, data, "rotor_min_n", finite=False) if limited else 0.0,
        rotor_max_n=_positive(where, data, "rotor_max_n") if limited else ROTOR_FMAX,
        limited=limited,
        torque_ratio_m=_positive(where, data, "torque_ratio_m"),
        rotor_tau_s=_none_or_more(where, data, "rotor_tau_s"),
        quad_drag_n_s_m=_none_or_more(where, data, "quad_drag_n_s_m"),
        quad_drag_quadratic_n_s2_m2=_none_or_more(where, data, "quad_drag_quadratic_n_s2_m2"),
    )


def _number(where: str, data: dict[str, Any], key: str, finite: bool = True) -> float:
    if key not in data:
        raise BeliefError(f"{where}: {key} is missing; it must be a number")
    value = data[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        raise BeliefError(f"{where}: {key} = {value!r}; must be a number")
    if finite and math.isinf(value):
        raise BeliefError(f"{where}: {key} = {value!r}; must be finite")
    return float(value)


def _positive(where: str, data: dict[str, Any], key: str) -> float:
    value = _number(where, data, key)
    if value <= 0.0:
        raise BeliefError(f"{where}: {key} = {value}; must be > 0")
    return value


def _none_or_more(where: str, data: dict[str, Any], key: str) -> float:
    value = _number(where, {key: 0.0, **data}, key)
    if value < 0.0:
        raise BeliefError(f"{where}: {key} = {value}; must be >= 0")
    return value


def _three(where: str, data: dict[str, Any], key: str) -> tuple[float, float, float]:
    value = data.get(key)
    if not isinstance(value, list) or len(value) != 3:
        raise BeliefError(f"{where}: {key} = {value!r}; must be three numbers")
    x, y, z = (_positive(where, {key: item}, key) for item in value)
    return x, y, z
