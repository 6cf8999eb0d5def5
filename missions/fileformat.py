"""Mission files: TOML in, `Mission` out, and one clear line for each error in them.

`docs/missions.md` describes the format; `missions.schema` holds the keys and bounds.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from missions.errors import PathError
from missions.model import TOLERANCE_M, Mission
from missions.nearest import nearest
from missions.places import misplaced_trajectories
from missions.schema import ITEMS, FileSpec, Item, TrajectoryItem
from missions.text_files import TextFileError, text_of
from missions.toml_files import FileError, TomlFiles, format_value, problems


class MissionFileError(FileError):
    """A mission file is missing or wrong: a mistake in the file or in the name given for it."""


# tables that belong inside others, found at the top of a file
_MISPLACED = {
    "terms": 'not a key of the file; write [[items.terms]] behind an item of type "signals"',
    "factors": "not a key of the file; write [[items.terms.factors]] behind its [[items.terms]]",
}

_HEADER = re.compile(r"[ \t]*\[\[[ \t]*items[ \t]*\]\]")

MISSIONS = TomlFiles("mission", MissionFileError)


def shipped() -> tuple[str, ...]:
    """Names of the missions that come with Plumbline, sorted."""
    return MISSIONS.names()


def load_mission(name_or_path: str | PathLike[str]) -> Mission:
    """The mission of a shipped name (`case-b`) or of a file; else a MissionFileError."""
    found = MISSIONS.read(name_or_path)
    return parse_mission(found.text, found.name, found.where)


def parse_mission(text: str, name: str, where: str) -> Mission:
    """The mission that a TOML text describes. `where`, its file, begins each line of a MissionFileError; the
    files of trajectories are found from its folder."""
    return mission_of(MISSIONS.table(text, where), name, where, text)


def mission_of(table: Mapping[str, Any], name: str, where: str, text: str = "") -> Mission:
    """The mission of these keys and values. `where` begins each line of a MissionFileError.

    `text` is the content of the file `where`, if there is one: errors in an item are then reported with the
    line of its [[items]].
    """
    misplaced = [f"{where}: {key}: {message}" for key, message in _MISPLACED.items() if key in table]
    if isinstance(table.get("items"), Mapping):
        misplaced.append(
            f"{where}: items is a single table; write [[items]], in two brackets, before each item"
        )
    misplaced += [
        f"{where}: {key}: not a table of the file; write [[items]], in two brackets, before each item"
        for key, value in table.items()
        if key not in FileSpec.model_fields and _is_misnamed_item(key, value)
    ]
    if misplaced:
        raise MissionFileError(misplaced)
    head = MISSIONS.record(FileSpec, table, where)
    locations = _item_locations(text, where, len(head.items))
    items: list[Item] = []
    errors: list[str] = []
    for index, item in enumerate(head.items):
        at = f"items[{index}]"
        kind = item.get("type")
        if not isinstance(kind, str) or kind not in ITEMS:
            errors.append(f"{locations[index]}: {at}.{_kind_problem(item)}")
            continue
        try:
            spec = ITEMS[kind].model_validate({k: v for k, v in item.items() if k != "type"})
            if isinstance(spec, TrajectoryItem) and spec.file is not None:
                spec = _with_rows(spec, Path(where).parent / spec.file)
            items.append(spec)
        except TextFileError as error:
            errors.append(f"{locations[index]}: {at}.file = {format_value(item['file'])}: {error}")
        except ValidationError as error:
            errors += problems(error, ITEMS[kind], locations[index], at, item)
    errors = errors or _order_problems([item["type"] for item in head.items], locations)
    if errors:
        raise MissionFileError(errors)
    steps = tuple(item.step() for item in items)
    errors = [f"{locations[i]}: items[{i}] {problem}" for i, problem in misplaced_trajectories(steps)]
    if errors:
        raise MissionFileError(errors)
    found = tuple(locations) if text else ()
    return Mission(name, head.title, head.description, tuple(head.assumptions), steps, locations=found)


def _with_rows(item: TrajectoryItem, file: Path) -> TrajectoryItem:
    """A trajectory through the rows of its file; TextFileError with the reason if there is none."""
    from missions.trajectory import read_rows, through_rows  # loads much

    text = text_of(file)
    try:
        found = read_rows(text)
        trajectory = through_rows(found.rows, TOLERANCE_M if item.tolerance_m is None else item.tolerance_m)
    except PathError as error:
        place = "" if error.index is None else f"line {found.lines[error.index]} "
        raise TextFileError(f"{place}{error.text}") from None
    except ValueError as error:
        raise TextFileError(str(error)) from None
    return item.along(trajectory)


def _is_misnamed_item(key: str, value: Any) -> bool:
    """Whether a key at the top of a file has tables that are probably items: [[item]], [[waypoint]]."""
    tables = value if isinstance(value, list) and value else [value]
    has_tables = all(isinstance(one, Mapping) for one in tables)
    return has_tables and key.isprintable() and bool(nearest(key, ("items", *ITEMS)))


def _item_locations(text: str, where: str, count: int) -> list[str]:
    """`FILE:LINE` of each item, from the `[[items]]` lines; `where` alone if their number is not `count`."""
    lines = [number for number, line in enumerate(text.split("\n"), 1) if _HEADER.match(line)]
    return [f"{where}:{line}" for line in lines] if len(lines) == count else [where] * count


def _kind_problem(table: Mapping[str, Any]) -> str:
    """What is wrong with the type of an item that has no known one, from the name of the key on."""
    allowed = ", ".join(ITEMS)
    if "type" not in table:
        meant = next((key for key in table if key.isprintable() and nearest(key, ("type",))), "")
        return f"{meant}: unknown key; write type" if meant else f"type is missing; must be one of {allowed}"
    kind = table["type"]
    near = nearest(str(kind), ITEMS)
    hint = f" (did you mean {near}?)" if near else ""
    return f"type = {format_value(kind)}; must be one of {allowed}{hint}"


def _order_problems(kinds: Sequence[str], locations: Sequence[str]) -> list[str]:
    """The rules between items: the first is a take-off, the last a landing; some need a load not released."""
    last = len(kinds) - 1
    errors = []
    for index, kind in enumerate(kinds):
        at = f'{locations[index]}: items[{index}].type = "{kind}"; '
        if index == 0 and kind != "takeoff":
            errors.append(at + 'must be "takeoff": a mission begins on the ground')
        elif index > 0 and kind == "takeoff":
            errors.append(at + "only the first item may be a take-off")
        if index == last and kind != "land":
            errors.append(at + 'must be "land": a mission ends on the ground')
        elif index < last and kind == "land":
            errors.append(at + "only the last item may be a landing")
        released = any(before in ("release", "place") for before in kinds[:index])
        if kind in ("signals", "trajectory", "attitude", "winch", "place") and released:
            errors.append(at + "needs the load, which an item before it has released")
    return errors
