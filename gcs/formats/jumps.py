"""The items to which DO_JUMP goes. The vehicle counts them from 0; files count otherwise."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem


def target_of(item: WireItem) -> int | None:
    """The number of the item to which it jumps; None if it is no jump, or goes to no whole number."""
    is_jump = item.command == mavlink.MAV_CMD_DO_JUMP and item.param1.is_integer()
    return int(item.param1) if is_jump else None


def redirected(items: Iterable[WireItem], new_number: Callable[[int], int]) -> list[WireItem]:
    """The items, with each jump to item n made one to `new_number(n)`."""
    found = []
    for item in items:
        target = target_of(item)
        found.append(item if target is None else item._replace(param1=float(new_number(target))))
    return found
