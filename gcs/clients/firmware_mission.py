"""Converts a mission of the load into a mission of the vehicle, for autopilots that know of no load.

Each place of the load becomes a place of the vehicle, a cable length above it. Steps that cannot be expressed
in this way are refused.
"""

from __future__ import annotations

from collections.abc import Sequence

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from autopilot.wire.items.records import FRAME_MISSION, FRAME_RELATIVE
from missions.model import Delay, Land, PlaceLoad, Release, ReturnHome, Speed, Step, Takeoff, Waypoint

SLACK_FRACTION = 0.6  # of the cable's length: height of the vehicle above the load that lies on the ground
SETTLE_S = 2.0  # hold time above the load on the ground, and again once it hangs
_GROUND_SPEED = 1.0  # speed type of DO_CHANGE_SPEED
_USUAL_SPEED = -2.0  # of DO_CHANGE_SPEED: the one for which the autopilot is configured
_UNCHANGED = -1.0  # throttle
_NAMES = {
    "Winch": "the winch",
    "Signals": "signals (paths given by formulas)",
    "Trajectory": "a trajectory (a path given by timed points)",
    "AttitudeRun": "an attitude of vehicle or load",
    "PlaceLoad": "a load to be placed on the ground",
}


class FirmwareMissionError(ValueError):
    """A step that third-party firmware cannot fly."""


def firmware_items(
    steps: Sequence[Step],
    home: Home,
    cable_m: float,
    gear_height_m: float,
    item_0_is_home: bool,
    accepts_low_takeoff: bool = True,
) -> tuple[WireItem, ...]:
    """The items of these steps, for a vehicle whose centre of mass is `gear_height_m` above the ground when
    it stands.

    Heights of the items are relative to where the vehicle stood, as firmware interprets them.
    `item_0_is_home`: item 0 is home and is not flown, as with ArduPilot. `accepts_low_takeoff`: the vehicle
    first flies above the load with the cable slack; else it lifts the load from beside it. After a release,
    the places are those of the vehicle.
    """
    items: list[WireItem] = []
    if item_0_is_home:
        items.append(_item(mavlink.MAV_CMD_NAV_WAYPOINT, place=ZERO, home=home))
    east, north, height, above_load = 0.0, 0.0, 0.0, cable_m - gear_height_m

    def vehicle_position() -> Vec3:
        return east, north, height + above_load

    for step in steps:
        match step:
            case Takeoff():
                height = step.altitude_m
                # the vehicle stands beside the load: it flies above it with the cable slack, then lifts it
                low = (east, north, max(SLACK_FRACTION * cable_m - gear_height_m, 0.0))
                first = low if accepts_low_takeoff else vehicle_position()
                items.append(_item(mavlink.MAV_CMD_NAV_TAKEOFF, place=first, home=home))
                if accepts_low_takeoff:
                    items.append(_item(mavlink.MAV_CMD_NAV_WAYPOINT, SETTLE_S, place=low, home=home))
                items.append(
                    _item(mavlink.MAV_CMD_NAV_WAYPOINT, SETTLE_S, place=vehicle_position(), home=home)
                )
            case Waypoint():
                east, north, height = step.east_m, step.north_m, step.altitude_m
                items.append(
                    _item(mavlink.MAV_CMD_NAV_WAYPOINT, step.hold_s, place=vehicle_position(), home=home)
                )
            case ReturnHome():
                east, north = 0.0, 0.0
                items.append(_item(mavlink.MAV_CMD_NAV_WAYPOINT, place=vehicle_position(), home=home))
            case Speed():
                speed = _USUAL_SPEED if step.speed_m_s is None else step.speed_m_s
                items.append(_item(mavlink.MAV_CMD_DO_CHANGE_SPEED, _GROUND_SPEED, speed, _UNCHANGED))
            case Delay():
                items.append(
                    _item(
                        mavlink.MAV_CMD_NAV_LOITER_TIME, step.duration_s, place=vehicle_position(), home=home
                    )
                )
            case Release() if not isinstance(step, PlaceLoad):
                items.append(_item(mavlink.MAV_CMD_DO_GRIPPER, 1.0, float(mavlink.GRIPPER_ACTION_RELEASE)))
                above_load = 0.0
            case Land():
                items.append(_item(mavlink.MAV_CMD_NAV_LAND, place=(east, north, 0.0), home=home))
            case _:
                description = _NAMES.get(type(step).__name__, type(step).__name__)
                raise FirmwareMissionError(
                    f"it asks for {description}; this autopilot flies take-off, waypoints, speeds, delays, "
                    "release and landing"
                )
    return tuple(items)


def _item(
    command: int,
    *parameters: float,
    place: Vec3 | None = None,
    home: Home | None = None,
) -> WireItem:
    p1, p2, p3, p4 = (*parameters, *(0.0,) * (4 - len(parameters)))
    if place is None or home is None:
        return WireItem(FRAME_MISSION, command, 0, 1, p1, p2, p3, p4, 0, 0, 0.0)
    latitude, longitude, _ = geodetic_from_enu(place, home)
    return WireItem(FRAME_RELATIVE, command, 0, 1, p1, p2, p3, p4, latitude, longitude, place[2])
