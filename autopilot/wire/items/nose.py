"""Where the nose is to point, by commands and mission items."""

from __future__ import annotations

from math import copysign, pi, radians

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.command import Asked
from missions.model import LookAt, NoseAim, TurnNose


def turn_nose(angle_deg: float, rate_deg_s: float, sense: int, relative: bool) -> TurnNose:
    """The turn that CONDITION_YAW requests by param1 ... param4, which are within their limits."""
    rate_rad_s = radians(rate_deg_s) if rate_deg_s > 0.0 else None
    if relative:
        # counter-clockwise is negative; param3, if given, determines the sign
        clockwise = copysign(radians(angle_deg), sense) if sense else radians(angle_deg)
        return TurnNose(-clockwise, relative=True, rate_rad_s=rate_rad_s)
    return TurnNose(0.5 * pi - radians(angle_deg), sense=-sense, rate_rad_s=rate_rad_s)


def turn(asked: Asked) -> NoseAim:
    """CONDITION_YAW as an item."""
    return turn_nose(asked["angle_deg"], asked.item.param2, asked["sense"], asked["relative"])


def look(asked: Asked) -> NoseAim:
    """DO_SET_ROI_LOCATION as an item."""
    return LookAt(asked["east_m"], asked["north_m"])


def look_away(asked: Asked) -> NoseAim:
    """DO_SET_ROI_NONE as an item."""
    return LookAt(None, None)


def look_or_not(asked: Asked) -> NoseAim:
    """DO_SET_ROI as an item: param1 is the mode; ArduPilot leaves it 0 and gives a place."""
    if asked["mode"] == mavlink.MAV_ROI_NONE and not asked.is_placed():
        return LookAt(None, None)
    return look(asked)
