"""Heading commands: the commands and mission items that turn the vehicle or point it at a place."""

from __future__ import annotations

from math import copysign, pi, radians

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.command import ItemContext
from missions.model import HeadingCommand, LookAt, TurnHeading


def turn_heading(angle_deg: float, rate_deg_s: float, sense: int, relative: bool) -> TurnHeading:
    """The turn that CONDITION_YAW requests by param1 ... param4, which are within their limits."""
    rate_rad_s = radians(rate_deg_s) if rate_deg_s > 0.0 else None
    if relative:
        # counter-clockwise is negative; param3, if given, determines the sign
        clockwise = copysign(radians(angle_deg), sense) if sense else radians(angle_deg)
        return TurnHeading(-clockwise, relative=True, rate_rad_s=rate_rad_s)
    return TurnHeading(0.5 * pi - radians(angle_deg), sense=-sense, rate_rad_s=rate_rad_s)


def condition_yaw(context: ItemContext) -> HeadingCommand:
    """CONDITION_YAW as an item."""
    return turn_heading(context["angle_deg"], context.item.param2, context["sense"], context["relative"])


def set_roi_location(context: ItemContext) -> HeadingCommand:
    """DO_SET_ROI_LOCATION as an item."""
    return LookAt(context["east_m"], context["north_m"])


def set_roi_none(context: ItemContext) -> HeadingCommand:
    """DO_SET_ROI_NONE as an item."""
    return LookAt(None, None)


def set_roi(context: ItemContext) -> HeadingCommand:
    """DO_SET_ROI as an item: param1 is the mode; ArduPilot leaves it 0 and gives a place."""
    if context["mode"] == mavlink.MAV_ROI_NONE and not context.has_position():
        return LookAt(None, None)
    return set_roi_location(context)
