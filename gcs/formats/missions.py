"""Missions of other ground stations: reads and writes their files, and finds what the vehicle cannot fly."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from autopilot.shell.atomic_file import write_atomically
from autopilot.wire.command_names import numbered_name
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import (
    AREA_COMMANDS,
    COMMAND,
    ENDLESS,
    JUMPS,
    Handling,
    MissionItemError,
    WireItem,
    endless_loops,
    handling_of,
    located_steps,
)
from gcs.foreign_mission import FileNumbers, ForeignMission
from gcs.formats.items import FormatError
from gcs.formats.jumps import redirected
from gcs.formats.plan import Plan, read_plan, write_plan
from gcs.formats.waypoints import HEADER, is_home_row, read_waypoints, write_waypoints
from gcs.mission_items import flown_steps, loop_ends
from missions.model import Land, Release
from missions.text_files import TextFileError, text_of

PLAN_ENDING = ".plan"
WAYPOINT_ENDINGS = (".waypoints", ".wpl", ".txt", ".mission")


def is_foreign(path: Path) -> bool:
    """Whether a mission file is in the format of another ground station, judged by its ending."""
    return path.suffix.lower() in (PLAN_ENDING, *WAYPOINT_ENDINGS)


def read_foreign(path: Path) -> Plan:
    """The content of a .plan or .waypoints file; FormatError says what is wrong with it."""
    try:
        text = text_of(path)
    except TextFileError as error:
        raise FormatError(f"{path}: {error}") from None
    try:
        if path.suffix.lower() == PLAN_ENDING and not text.startswith(HEADER):
            return read_plan(text)
        return Plan(read_waypoints(text), [], counts_home=True)
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from None


def write_foreign(
    path: Path,
    items: Sequence[WireItem],
    home: Home,
    fence: Sequence[WireItem] = (),
    rally: Sequence[WireItem] = (),
) -> None:
    """Write the items in the format of the ending; an old file is replaced once the new one is complete. Only
    a .plan can contain fence and rally points."""
    if not is_foreign(path):
        endings = ", ".join((PLAN_ENDING, *WAYPOINT_ENDINGS))
        raise FormatError(f"{path}: ending {path.suffix!r}; must be one of {endings}")
    items = without_home(items, home)
    in_plan = path.suffix.lower() == PLAN_ENDING
    text = write_plan(items, home, fence, rally) if in_plan else write_waypoints(items, home)
    try:
        write_atomically(path, text.encode())
    except OSError as error:
        raise FormatError(f"{path}: cannot be written: {error.strerror}") from None


def without_home(items: Sequence[WireItem], home: Home) -> Sequence[WireItem]:
    """The items without the home that a vehicle with ArduPilot's identity has as item 0."""
    if items and is_home_row(items[0]) and _is_home(items[0], home):
        return redirected(items[1:], lambda target: max(target - 1, 0))
    return items


def read_mission(path: Path) -> ForeignMission:
    """The mission in a file, flown from the home for which it is planned; FormatError says what is wrong with
    the file."""
    plan = read_foreign(path)
    return mission_of(plan, planned_home(plan), path.stem)


def planned_home(plan: Plan) -> Home:
    """The home for which a file is planned: the one it names, or else where the vehicle is by default."""
    row = _home_row(plan)
    if plan.home is not None or row is None:
        return plan.home or Home()
    return Home(row.x * 1e-7, row.y * 1e-7, row.z)


def mission_of(plan: Plan, home: Home, name: str) -> ForeignMission:
    """The parts of a plan that the vehicle would accept, flown from this home, and those that it would not.

    Commands that the vehicle keeps and skips (camera, gimbal ...) stay among the items; those that it would
    refuse are left out.
    """
    remaining = list(plan.items)
    numbers = list(range(len(remaining)))
    problems: list[tuple[int, str]] = []
    kept_items: dict[int, list[int]] = {}
    row = _home_row(plan)
    if row is not None:
        numbers.pop(0)
        _, where = remaining.pop(0)
        if not _is_home(row, home):
            text = f"item 0 ({where}): the home row, but the vehicle's home is elsewhere; left out"
            problems.append((0, text))
    for number, (item, _) in zip(numbers, remaining, strict=True):
        if handling_of(item.command) is Handling.KEPT:
            kept_items.setdefault(item.command, []).append(number)
    while True:
        try:
            # items that are left out move those behind them; a jump to one of them goes to the next
            items = redirected((one.item for one in remaining), partial(bisect_left, numbers))
            steps = located_steps(items, home)
            break
        except MissionItemError as error:
            place = min(max(error.seq, 0), len(remaining) - 1)
            number, (item, where) = numbers.pop(place), remaining.pop(place)
            problems.append((number, f"{_item_title(number, item, where)}: {_advice(item, error.text)}"))
    problems.sort()
    kept = [
        f"item{'' if len(found) == 1 else 's'} {', '.join(map(str, found))}, {numbered_name(command)}: "
        "kept on the vehicle but not done"
        for command, found in kept_items.items()
    ]
    flown = flown_steps(steps)
    ends = loop_ends(flown)
    kept += [
        f"item {number}, {numbered_name(item.command)}: repeats without end until a ground station makes an "
        "item behind it the present one (MISSION_SET_CURRENT); expected times count one pass"
        for number, item in zip(numbers, items, strict=True)
        if ends and item.command in JUMPS and item.param2 == ENDLESS
    ]
    release = next((i for i, one in enumerate(flown) if isinstance(one.step, Release)), None)
    if release is not None and any(first <= release <= last for last, first in endless_loops(flown).items()):
        number = numbers[flown[release].last]
        kept.append(f"item {number}: releases the load in the first pass; the next ones are flown without it")
    landing = flown[-1].last if flown and isinstance(flown[-1].step, Land) else len(remaining)
    if after := numbers[landing + 1 :]:
        places = f"item {after[0]}" if len(after) == 1 else f"items {after[0]} to {after[-1]}"
        kept.append(f"{places}: not flown; the mission ends with the landing of item {numbers[landing]}")
    return ForeignMission(
        name=name,
        title=name,
        description="",
        assumptions=(),
        steps=tuple(one.step for one in flown),
        loop_ends=ends,
        items=tuple(items),
        fence=plan.fence,
        rally=plan.rally,
        home=home,
        numbers=FileNumbers(tuple(numbers), tuple(numbers[one.last] for one in flown)),
        left_out=(*(line for _, line in problems), *plan.not_converted),
        notes=tuple(kept),
    )


def _home_row(plan: Plan) -> WireItem | None:
    """The home item with which the list begins, as Mission Planner writes it; None if it does not."""
    if not plan.items or not is_home_row(plan.items[0].item):
        return None
    takes_off = len(plan.items) > 1 and plan.items[1].item.command == mavlink.MAV_CMD_NAV_TAKEOFF
    return plan.items[0].item if plan.counts_home or takes_off else None


def _is_home(item: WireItem, home: Home) -> bool:
    """Whether the vehicle takes the item as its home, instead of flying it as a step or refusing it."""
    try:
        return not located_steps([item], home)
    except MissionItemError:
        return False


def _item_title(number: int, item: WireItem, where: str) -> str:
    return f"item {number} ({where}), {numbered_name(item.command)}"


def _advice(item: WireItem, text: str) -> str:
    if item.command in _ALTERNATIVES:
        return f"cannot be flown; {_ALTERNATIVES[item.command]}"
    if handling_of(item.command) is not Handling.FLOWN:
        return "cannot be flown; take it out, or use waypoints"
    return text


_ALTERNATIVES = {
    mavlink.MAV_CMD_NAV_VTOL_TAKEOFF: "use NAV_TAKEOFF",
    mavlink.MAV_CMD_NAV_VTOL_LAND: "use NAV_LAND",
    **{number: COMMAND[number].text for number in AREA_COMMANDS},
}
