"""The units that end the names of keys, as signs and in words. Imports nothing of Plumbline."""

from __future__ import annotations

from typing import NamedTuple


class Unit(NamedTuple):
    """A unit as tables and messages name it."""

    sign: str
    words: str


# a key may end in several of them; the longest one counts
_UNITS = {
    "_n_s2_m2": Unit("N s^2/m^2", "newtons per (metre per second) squared"),
    "_n_s_m": Unit("N s/m", "newtons per metre per second"),
    "_m_s2": Unit("m/s^2", "metres per second squared"),
    "_m_s": Unit("m/s", "metres per second"),
    "_rad_s": Unit("rad/s", "radians per second"),
    "_1_s": Unit("1/s", "per second"),
    "_n": Unit("N", "newtons"),
    "_m": Unit("m", "metres"),
    "_s": Unit("s", "seconds"),
    "_ms": Unit("ms", "milliseconds"),
    "_us": Unit("us", "microseconds"),
    "_v": Unit("V", "volts"),
    "_hz": Unit("Hz", "hertz"),
    "_kg": Unit("kg", "kilograms"),
    "_deg": Unit("deg", "degrees"),
    "_rad": Unit("rad", "radians"),
}


def split_unit(key: str) -> tuple[str, Unit | None]:
    """A key without its unit, and the unit; None if it ends with none."""
    ending = max((one for one in _UNITS if key.endswith(one)), key=len, default="")
    return key.removesuffix(ending), _UNITS.get(ending)
