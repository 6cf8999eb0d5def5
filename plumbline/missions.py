"""Missions made in Python."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike

from gcs.errors import input_error
from missions import model
from missions.fileformat import MissionFileError, load_mission, mission_of
from missions.model import Step
from missions.toml_files import FileError
from missions.writing import mission_table, write_toml
from plumbline.arguments import file_path, items, name_or_file, text


class Mission(model.Mission):
    """Where the load goes: steps one after another, from a take-off to a landing.

    ```python
    Mission("there", [Takeoff(1.0), Waypoint(2.0, 0.0, 1.0, hold_s=2.0), Land()])
    ```

    `name` is what it goes by, `title` one line for lists and reports. `assumptions`: a sentence for each
    value that was chosen without a source. A Mission is within the bounds of a mission file
    (docs/missions.md), or there is none: `Error` says which step is wrong. It keeps angles as a file does, in
    degrees, so an angle in radians may differ by a rounding.
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
        table = mission_table(
            title or name,
            description,
            items("assumptions", assumptions, "a list of texts"),
            items("steps", steps, "a list of steps, as [Takeoff(1.0), Land()]"),
        )
        try:
            made = mission_of(table, name, name)
        except MissionFileError as error:
            raise input_error(error) from None
        super().__init__(made.name, made.title, made.description, made.assumptions, made.steps)

    @classmethod
    def load(cls, name_or_path: str | PathLike[str]) -> Mission:
        """A shipped mission by its name, or that of a file, which goes by the name of the file."""
        try:
            found = load_mission(name_or_file("mission", name_or_path))
        except MissionFileError as error:
            raise input_error(error) from None
        return cls(found.name, found.steps, found.title, found.description, found.assumptions)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the mission file, which `load` and every command read; one that is there is replaced."""
        table = mission_table(self.title, self.description, self.assumptions, self.steps)
        try:
            write_toml(file_path("path", path), table)
        except FileError as error:
            raise input_error(error) from None
