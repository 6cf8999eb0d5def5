"""TOML files that a pydantic schema describes: the list of the shipped ones, reading, and error messages.

Missions, vehicles and sensor profiles are such files. Of each kind, this module knows only where the shipped
files are and a key that identifies it, so that every package may use it.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, get_args

from missions.nearest import did_you_mean, nearest
from missions.text_files import TextFileError, text_of
from missions.units import split_unit

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError
    from pydantic.fields import FieldInfo

Spec = TypeVar("Spec", bound="BaseModel")

_SUFFIX = ".toml"
_MAX_VALUE_CHARS = 40  # characters of a value
_SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
_NUMBER_WITH_UNIT = re.compile(
    r"\s*(\w+)\s*=\s*([-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)\s*[A-Za-z%/][\w%/^*]*\s*(?:#.*)?$"
)
_DECIMAL_COMMA = re.compile(r"\s*(\w+)\s*=\s*([-+]?\d+),(\d+)\s*(?:#.*)?$")
_CAPITAL_BOOLEAN = re.compile(r"\s*(\w+)\s*=\s*(?i:true|false)\s*(?:#.*)?$")
_BARE_TEXT = re.compile(r"\s*(\w+)\s*=\s*([^\W\d][^\"'#\\\x00-\x1f]*?)\s*(?:#.*)?$")
# plainer texts for what the parser says in its own terms
_DUPLICATES = {
    "Cannot overwrite": "{key} is given twice in this table",
    "Cannot declare": "[{key}] stands there twice; keep one, or write [[{key}]] for each table of a list",
}


class _Kind(NamedTuple):
    """What this module knows of a kind of file."""

    package: str  # folder of the shipped files
    marker_key: (
        str  # a key that all files of this kind have and no others: it identifies files of another kind
    )


_KINDS = {
    "mission": _Kind("missions", "items"),
    "vehicle": _Kind("autopilot.vehicle.vehicles", "quad_mass_kg"),
    "sensors": _Kind("sitl.sensors", "imu"),
}


class FileError(ValueError):
    """The given file or name is wrong. `problems` has one line for each error; str() has them all."""

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(self.problems))


@dataclass(frozen=True)
class TomlText:
    """A file as read: its name, the beginning of every message about it, and its text."""

    name: str
    where: str
    text: str


@dataclass(frozen=True)
class TomlFiles:
    """One kind of file. `package` is the folder of the shipped ones; it may be omitted for the kinds in
    `_KINDS`."""

    kind: str  # its name in messages
    error: type[FileError] = FileError
    package: str = ""

    def names(self) -> tuple[str, ...]:
        """Names that may be given in place of a path, sorted."""
        return _names(self._package)

    def choice(self) -> str:
        """The values of an option that names such a file, for its help: `bebop, heavy, thesis or a file`."""
        return f"{', '.join(self.names())} or a file"

    def read(self, name_or_path: str | PathLike[str]) -> TomlText:
        """The text of a shipped name or of a file; an error for an unknown name lists the names."""
        given = str(name_or_path)
        if given in self.names():
            text = _folder(self._package).joinpath(given + _SUFFIX).read_text(encoding="utf-8")
            return TomlText(given, "/".join((*self._package.split("."), given + _SUFFIX)), text)
        path = Path(given)
        if not (given and (path.exists() or path.suffix or given != path.name)):  # a word that is not a path
            shipped = f"{self._hint(given)}shipped: {', '.join(self.names())}"
            raise self.error([f"unknown {self.kind} {given!r}; {shipped}; or the path of a file"])
        if path.suffix == ".py" and path.is_file():
            takes = "--law, --estimator and --planner take classes of Python files"
            raise self.error([f"{given}: is a Python file; a {self.kind} file is TOML ({takes})"])
        try:
            return TomlText(path.stem, given, text_of(path))
        except TextFileError as error:
            named = not path.is_file() and path.suffix in ("", _SUFFIX)
            near = nearest(path.stem, self.names()) if named else ""
            hint = f"; did you mean the shipped {near}?" if near else ""
            raise self.error([f"{given}: {error}{hint}"]) from None

    def table(self, text: str, where: str) -> dict[str, Any]:
        """The keys and values of a TOML text. `where` begins each line of an error."""
        try:
            return tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise self.error([_toml_problem(error, text, where)]) from None
        except ValueError:  # of a whole number with thousands of digits
            raise self.error([f"{where}: a number has too many digits"]) from None
        except RecursionError:
            raise self.error([f"{where}: nested too deeply"]) from None

    def record(
        self,
        spec: type[Spec],
        table: Mapping[str, Any],
        where: str,
        written: Mapping[str, Any] | None = None,
    ) -> Spec:
        """The table as a validated `spec`. `written` is what the file contains of it, if not all."""
        from pydantic import ValidationError  # listing names needs no schema

        found = [kind for kind, known in _KINDS.items() if known.marker_key in table]
        if found and self.kind in _KINDS and self.kind not in found:
            raise self.error([f"{where}: is a {found[0]} file; a {self.kind} file is wanted here"])
        try:
            return spec.model_validate(table)
        except ValidationError as error:
            given = table if written is None else written
            raise self.error(problems(error, spec, where, given=given)) from None

    def _hint(self, given: str) -> str:
        other = other_kind_hint(given, self.kind)
        if other:
            return other
        beside = given + _SUFFIX
        return f"did you mean {beside}? " if Path(beside).is_file() else did_you_mean(given, self.names())

    @property
    def _package(self) -> str:
        return self.package or _KINDS[self.kind].package


def other_kind_hint(name: str, kind: str) -> str:
    """The beginning of a hint if a file of another kind is shipped by that name, otherwise empty."""
    for other, known in _KINDS.items():
        if other != kind and name in _names(known.package):
            return f"{name} is one of the shipped {other.removesuffix('s')}s; "
    return ""


def _names(package: str) -> tuple[str, ...]:
    entries = (entry.name for entry in _folder(package).iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in entries if name.endswith(_SUFFIX)))


def _folder(package: str) -> Traversable:
    """The folder of a package, or of a folder without code inside a package."""
    owner, _, folder = package.rpartition(".")
    return files(owner).joinpath(folder) if owner else files(package)


def problems(
    error: ValidationError,
    spec: type[BaseModel],
    where: str,
    at: str = "",
    given: Mapping[str, Any] | None = None,
) -> list[str]:
    """One line for each error, unknown keys first. A key that is missing because it is misspelt is not
    reported twice, and the keys that a table may have are listed once.

    `where` names the file, `at` the table within it that was validated against `spec`, and `given` is that
    table: a key that it already has is not suggested for an unknown one.
    """
    unknown, others, suggested = [], [], set()
    listed: set[type[BaseModel]] = set()
    for finding in error.errors(include_url=False):
        path, key, owner = _place(finding["loc"], spec, at)
        if finding["type"] == "extra_forbidden":
            near = _suggested_key(key, owner, _keys_of(given or {}, finding["loc"][:-1]))
            suggested.add(path.removesuffix(key) + near)
            unknown.append(f"{where}: {path}: {_unknown_key_text(near, owner, owner in listed)}")
            if not near:
                listed.add(owner)
        else:
            others.append((path, _problem(dict(finding), path, owner.model_fields.get(key))))
    return unknown + [f"{where}: {line}" for path, line in others if path not in suggested]


def format_value(value: Any) -> str:
    """The value as the file would write it, cut to fit a line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = f'"{value}"' if isinstance(value, str) else str(value)
    text = " ".join(text.split())
    return text if len(text) <= _MAX_VALUE_CHARS else text[: _MAX_VALUE_CHARS - 3] + "..."


def bounds(field: FieldInfo) -> str:
    """The range of a number, as `> 0 and <= 1000`; empty if it has none."""
    found = []
    for rule in field.metadata:
        for attribute in ("gt", "ge", "lt", "le"):
            bound = getattr(rule, attribute, None)
            if bound is not None:
                found.append(f"{_SIGNS[attribute]} {bound:g}")
    return " and ".join(found)


def _toml_problem(error: tomllib.TOMLDecodeError, text: str, where: str) -> str:
    """`file:line:column: not TOML: what`; the parser gives the place inside its message."""
    message = str(error)
    place = re.search(r"\(at line (\d+), column (\d+)\)", message)
    if place:
        line, column = place.groups()
    else:
        line, column = str(text.count("\n") + 1), str(len(text) - text.rfind("\n"))
    lines = text.splitlines()
    at = lines[int(line) - 1] if 0 < int(line) <= len(lines) else ""
    reason = message.split(" (at ", maxsplit=1)[0]
    if at.lstrip().startswith("[[") and reason.startswith("Cannot overwrite"):
        reason = "Cannot declare"  # a table [key] stands before the list [[key]]
    duplicate = next((instead for begins, instead in _DUPLICATES.items() if reason.startswith(begins)), "")
    if duplicate:
        reason = duplicate.format(key=re.split(r"[\]=]", at.lstrip(" \t["), maxsplit=1)[0].strip())
    return f"{where}:{line}:{column}: not TOML: {reason}{'' if duplicate else _toml_hint(at)}"


def _toml_hint(line: str) -> str:
    """What to write instead, for mistakes that can be recognised from the line."""
    if found := _NUMBER_WITH_UNIT.match(line):
        key, number = found.groups()
        return f"; a number is written without its unit, which the key names: {key} = {number}"
    if found := _DECIMAL_COMMA.match(line):
        key, whole, decimals = found.groups()
        return f"; a decimal point is needed: {key} = {whole}.{decimals}"
    if _CAPITAL_BOOLEAN.match(line):
        return "; true and false are written in lower case"
    if found := _BARE_TEXT.match(line):
        key, text = found.groups()
        return f"; text is written in quotes: {key} = {format_value(text)}"
    return ""


def _place(location: Sequence[str | int], spec: type[BaseModel], at: str) -> tuple[str, str, type[BaseModel]]:
    """(`items[3].terms[0].axis`, `axis`, the table's spec) for a location within `spec`."""
    path, key, owner = at, "", spec
    for part in location:
        if isinstance(part, int):
            path += f"[{part}]"
            continue
        if key in owner.model_fields:
            owner = _table_of(owner.model_fields[key].annotation) or owner
        key = part if part.isprintable() else repr(part)  # a message is one line
        path += f".{key}" if path else key
    return path, "" if location and isinstance(location[-1], int) else key, owner


def _table_of(annotation: Any) -> type[BaseModel] | None:
    """The spec of the table that a key holds, alone, in a list, or optionally; None if it holds none."""
    from pydantic import BaseModel

    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (_table_of(argument) for argument in get_args(annotation))
    return next((table for table in found if table is not None), None)


def _problem(error: dict[str, Any], path: str, field: FieldInfo | None) -> str:
    about = f" ({field.description})" if field is not None and field.description else ""
    if error["type"] == "missing":
        return f"{path} is missing{about}"
    if error["type"] == "too_long" and isinstance(error["input"], list | tuple):
        return f"{path} has {len(error['input'])} entries; must be {_allowed(error, field)}{about}"
    if error["type"] == "value_error":
        return f"{path} {error['ctx']['error']}".lstrip()
    return f"{path} = {format_value(error['input'])}; must be {_allowed(error, field)}{about}"


def _keys_of(table: Any, location: Sequence[str | int]) -> Collection[str]:
    """The keys of the table at a location within a table."""
    for part in location:
        try:
            table = table[part]
        except (KeyError, IndexError, TypeError):  # the location has more parts than the table
            return ()
    return table if isinstance(table, Mapping) else ()


def _suggested_key(key: str, owner: type[BaseModel], given: Collection[str]) -> str:
    """The key that was meant, or "": the same quantity in another unit, or a similar key that is not
    given."""
    known = list(owner.model_fields)
    # altitude_ft and altitude both mean altitude_m: compare the part before the unit
    stem = key.rsplit("_", 1)[0]
    same = [k for k in known if "_" in k and (k.rsplit("_", 1)[0] in (stem, key) or k.startswith(stem + "_"))]
    begun = [k for k in known if k.startswith(key)]
    if len(begun) == 1:
        return begun[0]
    if "_" not in key and same:  # a word alone, such as cable: related keys are listed in order of importance
        return same[0]
    return nearest(key, same, min_similarity=0.0) or nearest(key, [one for one in known if one not in given])


def _unknown_key_text(near: str, owner: type[BaseModel], listed: bool) -> str:
    """`listed`: an earlier line lists the allowed keys."""
    if near:
        return f"unknown key; write {near}{_unit_note(near)}"
    if listed:
        return "unknown key"
    known = ", ".join(owner.model_fields)
    return "unknown key; " + (f"allowed: {known}" if known else "this item takes no keys")


def _unit_note(key: str) -> str:
    _, unit = split_unit(key)
    return f" (in {unit.words})" if unit else ""


def _allowed(error: dict[str, Any], field: FieldInfo | None) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in ("greater_than", "greater_than_equal", "less_than", "less_than_equal"):
        # the rules of an element of a tuple or of an optional value are not rules of the field itself
        broken = " and ".join(f"{_SIGNS[name]} {bound:g}" for name, bound in context.items())
        return bounds(field) or broken if field is not None else broken
    fixed = {
        "finite_number": "a finite number",
        "float_type": "a number",
        "int_type": "a whole number",
        "int_from_float": "a whole number",
        "int_parsing": "a whole number",
        "float_parsing": "a number",
        "int_parsing_size": "a smaller whole number",
        "bool_type": "true or false",
        "bool_parsing": "true or false",
        "string_type": "a text in quotes",
        "list_type": "a list",
        "tuple_type": "a list",
        "dict_type": "a table",
        "model_type": "a table",
        "string_too_short": "a text that is not empty",
        "string_too_long": f"at most {context.get('max_length')} characters long",
        "too_short": f"a list of at least {context.get('min_length')}",
        "too_long": f"a list of at most {context.get('max_length')}",
        "literal_error": str(context.get("expected")).replace("'", '"'),
    }
    return fixed.get(kind, str(error["msg"]).removeprefix("must be "))
