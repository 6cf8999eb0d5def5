"""Mission files: TOML in, `Mission` out, and one clear line for whatever is wrong with them.

`docs/missions.md` describes the format; `missions.schema` holds the keys and bounds.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from missions.model import Mission
from missions.schema import ITEMS, FileSpec, Item, Spec

_SUFFIX = ".toml"


class MissionFileError(ValueError):
    """The file or the name given is at fault. `problems` has one line each; str() has them all."""

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(self.problems))


def shipped() -> tuple[str, ...]:
    """Names of the missions that come with Plumbline, sorted."""
    folder = files("missions").iterdir()
    return tuple(sorted(f.name.removesuffix(_SUFFIX) for f in folder if f.name.endswith(_SUFFIX)))


def load_mission(name_or_path: str | PathLike[str]) -> Mission:
    """The mission of a shipped name (`case-b`) or of a file; else a MissionFileError."""
    given = str(name_or_path)
    if given in shipped():
        text = files("missions").joinpath(given + _SUFFIX).read_text(encoding="utf-8")
        return parse_mission(text, name=given, where=f"missions/{given}{_SUFFIX}")
    path = Path(given)
    if not given or not (path.is_file() or path.suffix == _SUFFIX or len(path.parts) > 1):
        near = get_close_matches(given, shipped(), n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        names = ", ".join(shipped())
        raise MissionFileError([f"unknown mission {given!r}; {hint}shipped: {names}; or the path of a file"])
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise MissionFileError([f"{given}: not a text file in UTF-8 (byte {error.start})"]) from None
    except OSError as error:
        raise MissionFileError([f"{given}: cannot be read: {error.strerror}"]) from None
    return parse_mission(text, name=path.stem, where=given)


def parse_mission(text: str, name: str, where: str) -> Mission:
    """The mission that a TOML text describes. `where` begins each line of a MissionFileError."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise MissionFileError([_toml_problem(error, text, where)]) from None
    try:
        head = FileSpec.model_validate(document)
    except ValidationError as error:
        raise MissionFileError(_problems(error, FileSpec, where, "")) from None
    items: list[Item] = []
    problems: list[str] = []
    for index, table in enumerate(head.items):
        at = f"items[{index}]"
        kind = table.get("type")
        if not isinstance(kind, str) or kind not in ITEMS:
            problems.append(f"{where}: {at}.type {_kind_problem(table)}")
            continue
        try:
            items.append(ITEMS[kind].model_validate({k: v for k, v in table.items() if k != "type"}))
        except ValidationError as error:
            problems += _problems(error, ITEMS[kind], where, at)
    problems = problems or _order_problems([table["type"] for table in head.items], where)
    if problems:
        raise MissionFileError(problems)
    steps = tuple(item.step() for item in items)
    return Mission(name, head.title, head.description, tuple(head.assumptions), steps)


def _toml_problem(error: tomllib.TOMLDecodeError, text: str, where: str) -> str:
    """`file:line:column: not TOML: what`; the parser says the place within its sentence."""
    message = str(error)
    place = re.search(r"\(at line (\d+), column (\d+)\)", message)
    if place:
        line, column = place.groups()
    else:
        line, column = str(text.count("\n") + 1), str(len(text) - text.rfind("\n"))
    return f"{where}:{line}:{column}: not TOML: {message.split(' (at ', maxsplit=1)[0]}"


def _kind_problem(table: Mapping[str, Any]) -> str:
    allowed = ", ".join(ITEMS)
    if "type" not in table:
        return f"is missing; must be one of {allowed}"
    kind = table["type"]
    near = get_close_matches(str(kind), ITEMS, n=1)
    hint = f" (did you mean {near[0]}?)" if near else ""
    return f"= {_shown(kind)}; must be one of {allowed}{hint}"


def _order_problems(kinds: Sequence[str], where: str) -> list[str]:
    """The rules between items: the flight begins on the ground with a take-off and ends with a landing."""
    last = len(kinds) - 1
    problems = []
    for index, kind in enumerate(kinds):
        at = f'{where}: items[{index}].type = "{kind}"; '
        if index == 0 and kind != "takeoff":
            problems.append(at + 'must be "takeoff": a mission begins on the ground')
        elif index > 0 and kind == "takeoff":
            problems.append(at + "only the first item may be a take-off")
        if index == last and kind != "land":
            problems.append(at + 'must be "land": a mission ends on the ground')
        elif index < last and kind == "land":
            problems.append(at + "only the last item may be a landing")
        if kind in ("signals", "attitude") and "release" in kinds[:index]:
            problems.append(at + "swings the load, which an item before it has released")
    return problems


def _problems(error: ValidationError, spec: type[Spec], where: str, at: str) -> list[str]:
    """One line for each finding, unknown keys first; a key missing for being misspelt is not told twice."""
    unknown, others, meant = [], [], set()
    for finding in error.errors(include_url=False):
        path, key, owner = _place(finding["loc"], spec, at)
        if finding["type"] == "extra_forbidden":
            near = _meant_key(key, owner)
            meant.add(path.removesuffix(key) + near)
            unknown.append(f"{where}: {path}: {_unknown_key(near, owner)}")
        else:
            others.append((path, _problem(dict(finding), path, owner.model_fields.get(key))))
    return unknown + [f"{where}: {line}" for path, line in others if path not in meant]


def _place(location: Sequence[str | int], spec: type[Spec], at: str) -> tuple[str, str, type[Spec]]:
    """(`items[3].terms[0].axis`, `axis`, the table's spec) for a location within `spec`."""
    path, key, owner = at, "", spec
    for part in location:
        if isinstance(part, int):
            path += f"[{part}]"
            owner = owner.nested.get(key, owner)
            key = ""
        else:
            key = part if part.isprintable() else repr(part)  # a message is one line
            path += f".{key}" if path else key
    return path, key, owner


def _problem(error: dict[str, Any], path: str, field: FieldInfo | None) -> str:
    about = f" ({field.description})" if field is not None and field.description else ""
    if error["type"] == "missing":
        return f"{path} is missing{about}"
    if error["type"] == "value_error":
        return f"{path} {error['ctx']['error']}"
    return f"{path} = {_shown(error['input'])}; must be {_allowed(error, field)}{about}"


def _meant_key(key: str, owner: type[Spec]) -> str:
    """The key that was meant, or "": the same quantity in another unit, or a near spelling."""
    known = list(owner.model_fields)
    # altitude_ft and altitude both mean altitude_m: compare what stands before the unit
    stem = key.rsplit("_", 1)[0]
    same = [k for k in known if "_" in k and (k.rsplit("_", 1)[0] in (stem, key) or k.startswith(stem + "_"))]
    return (same + get_close_matches(key, known, n=1) + [""])[0]


def _unknown_key(near: str, owner: type[Spec]) -> str:
    if near:
        return f"unknown key; write {near}{_unit_note(near)}"
    known = ", ".join(owner.model_fields)
    return "unknown key; " + (f"allowed: {known}" if known else "this item takes no keys")


def _unit_note(key: str) -> str:
    units = {"_m_s": "metres per second", "_m": "metres", "_s": "seconds", "_deg": "degrees"}
    return next((f" (in {unit})" for suffix, unit in units.items() if key.endswith(suffix)), "")


def _allowed(error: dict[str, Any], field: FieldInfo | None) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in ("greater_than", "greater_than_equal", "less_than", "less_than_equal"):
        return _bounds(field) or f"within bounds ({error['msg']})"
    fixed = {
        "finite_number": "a finite number",
        "float_type": "a number",
        "string_type": "a text in quotes",
        "list_type": "a list",
        "dict_type": "a table",
        "model_type": "a table",
        "string_too_short": "a text that is not empty",
        "string_too_long": f"at most {context.get('max_length')} characters long",
        "too_short": f"a list of at least {context.get('min_length')}",
        "too_long": f"a list of at most {context.get('max_length')}",
        "literal_error": str(context.get("expected")).replace("'", '"'),
    }
    return fixed.get(kind, str(error["msg"]))


def _bounds(field: FieldInfo | None) -> str:
    """`> 0 and <= 1000`, from the field's metadata."""
    found = []
    for rule in field.metadata if field is not None else ():
        for attribute, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
            bound = getattr(rule, attribute, None)
            if bound is not None:
                found.append(f"{sign} {bound:g}")
    return " and ".join(found)


def _shown(value: Any) -> str:
    """The value as the file would write it, cut to fit a line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = f'"{value}"' if isinstance(value, str) else str(value)
    text = " ".join(text.split())
    return text if len(text) <= 40 else text[:37] + "..."
