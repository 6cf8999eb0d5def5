"""QGC WPL 110: one item per line, twelve columns; Mission Planner, MAVProxy and QGroundControl read it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, home_item
from gcs.formats.items import FileItem, FormatError, frame_in_file, item_of, params_of
from gcs.formats.jumps import redirected

Number = TypeVar("Number", int, float)

HEADER = "QGC WPL 110"
_HOME, _HOME_FRAME = mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_FRAME_GLOBAL
_COLUMNS = 12
_WHOLE_COLUMNS = (0, 1, 2, 3, 11)  # of whole numbers


def read_waypoints(text: str) -> list[FileItem]:
    """The items of a file; columns are separated by tabs or spaces, `#` begins a comment."""
    lines = text.splitlines()
    if not lines or lines[0].split() != HEADER.split():
        first = lines[0].strip()[:40] if lines else ""
        raise FormatError(f"line 1: {first!r}; must be {HEADER!r}")
    items: list[FileItem] = []
    for number, line in enumerate(lines[1:], start=2):
        words = line.partition("#")[0].split()
        if not words:
            continue
        where = f"line {number}"
        if len(words) != _COLUMNS:
            raise FormatError(f"{where}: {len(words)} columns; must be {_COLUMNS}")
        seq, current, frame, command, autocontinue = (
            _parsed(int, words, column, where) for column in _WHOLE_COLUMNS
        )
        params = [_parsed(float, words, column, where) for column in range(4, 11)]
        if seq != len(items):
            raise FormatError(f"{where}: item number {seq}; must be {len(items)}")
        items.append(FileItem(item_of(frame, command, current, autocontinue, params, where), where))
    return items


def _parsed(kind: Callable[[str], Number], words: Sequence[str], column: int, where: str) -> Number:
    try:
        return kind(words[column])
    except ValueError:
        what = "a whole number" if kind is int else "a number"
        raise FormatError(f"{where}: column {column + 1} is {words[column]!r}; must be {what}") from None


def write_waypoints(items: Sequence[WireItem], home: Home) -> str:
    """The text of a file with the home in row 0, as ground stations read it, and these items behind it, so
    that jumps go to an item with a number greater by one. Numbers have enough digits to restore the items."""
    lines = [HEADER]
    for seq, item in enumerate((home_item(home), *redirected(items, lambda target: target + 1))):
        params = map(repr, params_of(item))
        columns = (seq, item.current, frame_in_file(item), item.command, *params, item.autocontinue)
        lines.append("\t".join(map(str, columns)))
    return "\n".join(lines) + "\n"


def is_home_row(item: WireItem) -> bool:
    """Whether the first item of a file can be the home."""
    return item.command == _HOME and frame_in_file(item) == _HOME_FRAME
