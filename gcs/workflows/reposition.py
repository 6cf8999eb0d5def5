"""Sending the load of a running vehicle to a position in metres."""

from __future__ import annotations

import math
from dataclasses import dataclass

from autopilot.geometry.linear import Vec3, add, norm, sub
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.limits import FARTHEST_M
from gcs.clients import command
from gcs.clients.operation import Operation
from gcs.errors import GcsError
from gcs.shell.session import Session

LOAD_S = 2.0  # in which a vehicle reports the position of its load


@dataclass(frozen=True)
class Move:
    """The command that sends the load, or a vehicle that released it, to a position; how far that is."""

    operation: Operation
    distance_m: float  # NaN if the vehicle does not report the position of its load


def reposition(
    session: Session, offset: tuple[float, float, float | None], from_load: bool, speed_m_s: float | None
) -> Move:
    """The command that sends the load to the position at `offset` (east, north, up in m; up None: at the
    load's height) from the vehicle's home or, with `from_load`, from the present position of the load."""
    message = session.request(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
    origin = Home(message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3)
    load = _load(session)
    origin_position = load if from_load else _home(session, origin)
    if origin_position is None:
        raise GcsError("the vehicle does not report the position of its load")
    east, north, up = add(origin_position, (offset[0], offset[1], offset[2] or 0.0))
    horizontal_m = math.hypot(east, north)
    if horizontal_m > FARTHEST_M:
        raise GcsError(
            f"the place is {horizontal_m / 1e3:.4g} km from the vehicle's origin; "
            f"must be at most {FARTHEST_M / 1e3:g} km"
        )
    latitude, longitude, _ = geodetic_from_enu((east, north, up), origin)
    height_m = math.nan if offset[2] is None else up
    operation = command.reposition(session.target, latitude, longitude, height_m, speed_m_s)
    alone = session.view.motion_without_load
    body = load if alone is None else alone[0]
    if body is None:
        return Move(operation, math.nan)
    destination = (
        east,
        north,
        body[2] if offset[2] is None else up,
    )  # without a height, load or vehicle keeps its own
    return Move(operation, norm(sub(destination, body)))


def _home(session: Session, origin: Home) -> Vec3:
    home = session.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    return enu_from_geodetic(home.latitude, home.longitude, home.altitude, origin)


def _load(session: Session) -> Vec3 | None:
    latest = session.view.latest
    if not session.watch(lambda: "LOAD_STATE" in latest, LOAD_S):
        return None
    load = latest["LOAD_STATE"]
    return (load.y, load.x, -load.z)
