"""Where home is, and positions around it in MAVLink's scaled degrees.

The earth is flat around home: the tangent plane, at home, of a sphere of the equatorial radius. Each function
is the exact inverse of the other on the lattice of 1e-7 degrees and millimetres of the messages; off the
lattice they differ by half a step (5.6 mm northwards, less eastwards, 0.5 mm in height).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from autopilot.geometry.jitable import jitable
from autopilot.wire.convert.scaling import int32, saturated

if TYPE_CHECKING:
    from autopilot.geometry.linear import Vec3

EARTH_RADIUS_M = 6378137.0
_METRES_PER_DEGREE = EARTH_RADIUS_M * math.pi / 180.0
_DEG_E7 = 1e-7
_TURN_DEG_E7 = 3_600_000_000


class Home(NamedTuple):
    """The origin of the world: latitude and longitude in degrees, altitude in m above mean sea level."""

    latitude_deg: float = 47.397742
    longitude_deg: float = 8.545594
    altitude_m: float = 0.0


def home_from_text(text: str) -> Home:
    """Home from `LAT,LON,ALT` in degrees and metres; ValueError states what is wrong."""
    try:
        latitude, longitude, altitude = (float(word) for word in text.split(","))
    except ValueError:
        raise ValueError(f"home {text!r}; must be LAT,LON,ALT in degrees and metres") from None
    for name, value, limit in (
        ("latitude", latitude, 85.0),  # nearer to a pole, east and west are of no use
        ("longitude", longitude, 180.0),
        ("altitude", altitude, 100000.0),
    ):
        if not abs(value) <= limit:
            raise ValueError(f"home {text!r}: {name} {value:g}; must be {-limit:g} ... {limit:g}")
    return Home(latitude, longitude, altitude)


@jitable
def enu_from_geodetic(latitude_degE7: int, longitude_degE7: int, altitude_mm: int, home: Home) -> Vec3:
    """Position in m (east, north, up) from home, given degrees * 1e7 and mm above mean sea level."""
    around = longitude_degE7 - round(home.longitude_deg / _DEG_E7)
    turns = round(around / _TURN_DEG_E7)
    east_deg = (longitude_degE7 - turns * _TURN_DEG_E7) * _DEG_E7 - home.longitude_deg
    north_deg = latitude_degE7 * _DEG_E7 - home.latitude_deg
    return (
        east_deg * _METRES_PER_DEGREE * math.cos(math.radians(home.latitude_deg)),
        north_deg * _METRES_PER_DEGREE,
        altitude_mm * 1e-3 - home.altitude_m,
    )


@jitable
def geodetic_from_enu(position: Vec3, home: Home) -> tuple[int, int, int]:
    """(latitude, longitude) in degrees * 1e7 and altitude in mm above mean sea level, saturated to int32."""
    east_deg = position[0] / (_METRES_PER_DEGREE * math.cos(math.radians(home.latitude_deg)))
    north_deg = position[1] / _METRES_PER_DEGREE
    longitude = saturated((home.longitude_deg + east_deg) / _DEG_E7, -(2**62), 2**62)
    half = _TURN_DEG_E7 // 2
    return (
        saturated((home.latitude_deg + north_deg) / _DEG_E7, -900_000_000, 900_000_000),
        (longitude + half) % _TURN_DEG_E7 - half,
        int32((home.altitude_m + position[2]) * 1e3),
    )
