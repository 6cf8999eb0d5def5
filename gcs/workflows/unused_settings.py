"""Settings without effect: parameters of another law, of an effect that is switched off, of a sensor that is
not fitted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from autopilot.vehicle.file import load_truth_and_belief
from autopilot.vehicle.parameters import (
    LAWS,
    SHAPE_ALWAYS,
    SHAPE_NEVER,
    autopilot_parameters,
)
from autopilot.wire.parameter_table import ParameterTable
from sitl.sensors.files import load_profile
from sitl.sensors.overrides import OVERRIDDEN_KEYS
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import truth_of

_PLUMBLINE = "plumbline"  # also flies the modes that a custom law does not define
_LQR = tuple(
    f"LQR_{name}" for name in ("Q_POS", "Q_TILT", "Q_YAW", "Q_SWING", "Q_RATE", "R_THRUST", "R_MOMENT")
)
_PLB = tuple(
    f"PLB_{name}" for name in ("DELAY_TOL", "LAG_TO_MS", "NOISE", "RATIO_I", "RATIO_Q", "RATIO_R", "ZETA")
)
_NGC_POSITION = ("NGC_KX", "NGC_KV", "NGC_WN_X")
_NGC_GAINS = ("NGC_KR", "NGC_KOMEGA", "NGC_KQ", "NGC_KW", "NGC_EPSILON")
# by law: parameters that no mode of it uses. The laws share their other modes, hence not all of a group.
UNUSED_BY_LAW: Mapping[str, frozenset[str]] = {
    "thesis": frozenset((*_LQR, *_PLB)),
    "lqr": frozenset((*_PLB, *_NGC_POSITION)),
    _PLUMBLINE: frozenset((*_LQR, *_NGC_POSITION, *_NGC_GAINS)),
}
_TABLES = {  # of a sensor profile
    "mocap": "tracker of the vehicle",
    "load_tracker": "tracker of the load",
    "cable_sensor": "camera for the load",
    "gnss": "receiver",
    "magnetometer": "magnetometer",
}


class _Requirement(NamedTuple):
    """Parameters that have an effect only if one of `needed` is not 0."""

    names: tuple[str, ...]
    needed: tuple[str, ...]
    why: str  # they have none otherwise, and what to do


_LOAD_TURNS = ("SIM_LOAD_HOOK", "SIM_LOAD_GYR_UP", "SIM_LOAD_PRESS", "SIM_LOAD_SPIN")
_BATTERY = (
    "SIM_BAT_CELLS",
    "SIM_BAT_CAP",
    "SIM_BAT_R",
    "SIM_BAT_HOVER_W",
    "SIM_BAT_CHARGE",
    "SIM_ESC_RPM_CTL",
)
_ANTENNA = tuple(f"{whose}_GPS_POS_{axis}" for whose in ("SIM", "VEH") for axis in "XYZ")
_PULSE = ("SIM_GUST_E", "SIM_GUST_N", "SIM_GUST_U")
_REQUIREMENTS = (
    _Requirement(
        ("SIM_GUST_AT_S", "SIM_GUST_NOW", "SIM_GUST_FOR_S"),
        _PULSE,
        "the gust has no speed; set SIM_GUST_E, SIM_GUST_N or SIM_GUST_U",
    ),
    _Requirement(("SIM_GUST_TAU_S",), ("SIM_GUST_STD",), "there are no random gusts; set SIM_GUST_STD"),
    _Requirement(
        ("SIM_ENGINE_AT_S", "SIM_ENGINE_MUL"), ("SIM_ENGINE_FAIL",), "no rotor fails; set SIM_ENGINE_FAIL"
    ),
    _Requirement(
        ("SIM_SENS_AT_S", "SIM_SENS_FOR_S"), ("SIM_SENS_FAIL",), "no sensor fails; set SIM_SENS_FAIL"
    ),
    _Requirement(
        ("SIM_CBL_MASS", "SIM_CBL_CD", "SIM_CBL_EA", "SIM_CBL_DAMP", "SIM_LOAD_GYR", *_LOAD_TURNS),
        ("SIM_CBL_LINKS",),
        "the cable has no links; set SIM_CBL_LINKS",
    ),
    _Requirement(("SIM_CBL_CD",), ("SIM_CABLE_DIAM",), "the cable has no diameter; set SIM_CABLE_DIAM"),
    _Requirement(_LOAD_TURNS, ("SIM_LOAD_GYR",), "the load does not turn; set SIM_LOAD_GYR"),
    _Requirement(_BATTERY, ("SIM_BATTERY",), "no battery limits the rotors; set SIM_BATTERY to 1"),
    _Requirement(("COM_LOW_BAT_ACT",), ("SIM_BATTERY",), "no battery is measured; set SIM_BATTERY to 1"),
    _Requirement(("SIM_BLADE_STIFF",), ("SIM_ROTOR_FLAP",), "the rotors do not flap; set SIM_ROTOR_FLAP"),
)


def unused_settings(
    vehicle: str, sensors: str, laws: Sequence[str], settings: Iterable[tuple[str, float]]
) -> dict[str, str]:
    """A line for each parameter, by its name, that is set to other values than its default and has no effect
    in any flight with one of these laws: why it has none, and what to do.

    `laws` as the user names them. A parameter may have several values, of different flights. Unknown
    parameters are left out. FileError if there is no such vehicle or sensor profile.
    """
    found, believed = load_truth_and_belief(vehicle)
    tables = sim_parameters(truth_of(found)), autopilot_parameters(believed)
    given: dict[str, set[float]] = {}
    for name, value in settings:
        given.setdefault(name, set()).add(value)
    profile = load_profile(sensors)
    fitted = {table for table in _TABLES if getattr(profile, table) is not None}
    lines = {}
    for name, values in given.items():
        table = next((one for one in tables if name in one), None)
        if table is None or values == {table[name]}:
            continue
        why = _law_problem(name, laws, given, tables[1]) or _simulator_problem(name, given, tables[0])
        if why := why or _sensor_problem(name, fitted, sensors):
            lines[name] = f"{name} has no effect: {why}"
    return lines


def _values(name: str, given: Mapping[str, set[float]], table: ParameterTable) -> set[float]:
    return given.get(name) or {table[name]}


def _law_problem(
    name: str, laws: Sequence[str], given: Mapping[str, set[float]], autopilot: ParameterTable
) -> str:
    kinds = [law if law in LAWS else _PLUMBLINE for law in laws]
    if all(name in UNUSED_BY_LAW[kind] for kind in kinds):
        return f"law {laws[0]} does not use it" if len(laws) == 1 else f"laws {', '.join(laws)} do not use it"
    if name == "MIS_SHAPE_ERR":
        shaping = _values("MIS_SHAPE", given, autopilot)
        if shaping == {SHAPE_NEVER}:
            return "no path is shaped; set MIS_SHAPE to 1 or 2"
        if SHAPE_ALWAYS not in shaping and _PLUMBLINE not in laws:
            return "paths are shaped for law plumbline only; set MIS_SHAPE to 2"
    return ""


def _simulator_problem(name: str, given: Mapping[str, set[float]], simulator: ParameterTable) -> str:
    if name in (*_PULSE, "SIM_GUST_FOR_S"):
        never = max(_values("SIM_GUST_AT_S", given, simulator)) < 0.0
        if never and not any(_values("SIM_GUST_NOW", given, simulator)):
            return "no gust begins; set SIM_GUST_AT_S, or SIM_GUST_NOW in flight"
    for requirement in _REQUIREMENTS:
        if name in requirement.names and not any(
            value for needed in requirement.needed for value in _values(needed, given, simulator)
        ):
            return requirement.why
    return ""


def _sensor_problem(name: str, fitted: set[str], sensors: str) -> str:
    tables = {table for key in OVERRIDDEN_KEYS.get(name, ()) for table in key.tables}
    if name in _ANTENNA:
        tables = {"gnss"}
    if not tables or not tables.isdisjoint((*fitted, "imu")):
        return ""
    missing = " and no ".join(text for table, text in _TABLES.items() if table in tables)
    return f"sensors {sensors} have no {missing}"
