"""Missions made in Python."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields
from os import PathLike
from pathlib import Path
from typing import Any

from gcs.errors import GcsError, InputError, input_error
from missions import model
from missions.fileformat import MissionFileError, load_mission, mission_of
from missions.model import KINDS, Signals, Step, Term
from missions.places import misplaced_trajectories
from missions.toml_files import FileError
from missions.writing import mission_table, write_toml
from plumbline.arguments import file_path, items, name_or_file, shown_value, text


class Mission(model.Mission):
    """A sequence of steps, from a take-off to a landing, that says where the load goes.

    ```python
    Mission("there", [Takeoff(1.0), Waypoint(2.0, 0.0, 1.0, hold_s=2.0), Land()])
    ```

    `name` is its short name, `title` one line for lists and reports. `assumptions`: a sentence for each
    value that was chosen without a source. A Mission is checked when it is created, by the rules of mission
    files (docs/missions.md): `Error` says which step is wrong. It keeps angles as a file does, in degrees, so
    an angle given in radians may differ by a rounding.
    """

    __slots__ = ()

    def __init__(
        self,
        name: str,
        steps: Iterable[Step],
        title: str = "",
        description: str = "",
        assumptions: Iterable[str] = (),
    ) -> None:
        text("name", name, "there")
        if not name.strip():
            raise GcsError(f"name = {shown_value(name)}; must be a text that is not empty, as 'there'")
        if name.splitlines() != [name] or not (title or name.isprintable()):
            raise GcsError(
                f"name = {shown_value(name)}; must be one line of printable characters, as 'there'"
            )
        texts = items("assumptions", assumptions, "a list of texts")
        step_list = items("steps", steps, "a list of steps, as [Takeoff(1.0), Land()]")
        if wrong := list(_mistakes(step_list)):
            raise InputError(*(f"{name}: {line}" for line in wrong))
        table = mission_table(title or name, description, texts, step_list)
        try:
            checked = mission_of(table, name, name)
        except MissionFileError as error:
            raise input_error(error) from None
        if misplaced := [f"{name}: items[{i}] {text}" for i, text in misplaced_trajectories(step_list)]:
            raise InputError(*misplaced)
        super().__init__(checked.name, checked.title, checked.description, checked.assumptions, checked.steps)

    @classmethod
    def load(cls, name_or_path: str | PathLike[str]) -> Mission:
        """A shipped mission by its name, or the mission in a file, which is then named after the file."""
        file = name_or_file("mission", name_or_path)
        try:
            found = load_mission(file)
        except MissionFileError as error:
            from gcs.formats.missions import is_foreign  # loads much

            if Path(file).is_file() and is_foreign(Path(file)):
                raise InputError(f"{file}: holds more than steps; plumbline.fly takes it as it is") from None
            raise input_error(error) from None
        return cls.of(found)

    def replace(self, **changes: Any) -> Mission:
        """A copy with other values of the arguments of this class, by their names."""
        given = ("name", "steps", "title", "description", "assumptions")
        if unknown := sorted(set(changes) - set(given)):
            raise GcsError(f"{unknown[0]}: a Mission has no such part; it has {', '.join(given)}")
        return Mission(**{name: getattr(self, name) for name in given} | changes)

    @classmethod
    def of(cls, mission: model.Mission) -> Mission:
        """A mission as one that can be saved; it is checked like any other."""
        if isinstance(mission, cls):
            return mission
        return cls(mission.name, mission.steps, mission.title, mission.description, mission.assumptions)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the mission as a TOML file, which `load` and every command read; an existing file is
        replaced."""
        file = file_path("path", path)
        if file.suffix.lower() not in ("", ".toml"):
            raise GcsError(f"{file}: a mission is written as TOML; name it {file.stem}.toml")
        table = mission_table(self.title, self.description, self.assumptions, self.steps)
        try:
            write_toml(file, table)
        except FileError as error:
            raise input_error(error) from None


def _mistakes(steps: Iterable[Any]) -> Iterator[str]:
    """Mistakes that are possible in steps written in Python, but not in the items of a file."""
    for index, step in enumerate(steps):
        at = f"items[{index}]"
        if isinstance(step, type) and step in KINDS:
            yield _class_problem(at, step)
        terms: Any = step.terms if isinstance(step, Signals) else None
        if not isinstance(terms, Sequence) or isinstance(terms, str):
            continue
        if not terms:
            yield f"{at}.terms is empty; must be a list of one Term at least"
        for ordinal, term in enumerate(terms):
            part = f"{at}.terms[{ordinal}]"
            if term is Term:
                yield _class_problem(part, Term)
            elif isinstance(term, Term) and term.hold_s is None and term.fall_s:
                yield f"{part} has fall_s without hold_s; give both, or neither to stay at the top"


def _class_problem(at: str, kind: type[Any]) -> str:
    call = f"{kind.__name__}({'...' if fields(kind) else ''})"
    return f"{at} is the class {kind.__name__}; write {call}"
