"""Missions by name or file, with errors for the command line. Imports little: `gcs fly` begins with it."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from gcs.errors import InputError, input_error
from missions.fileformat import MissionFileError, load_mission
from missions.model import Mission

if TYPE_CHECKING:
    from gcs.foreign_mission import ForeignMission

LOOP_TEXT = (
    "repeats items without end (DO_JUMP) until a ground station makes an item behind them the present one, "
    "and here none can"
)


def load(name_or_path: str | PathLike[str], with_loops: bool = False) -> Mission:
    """The mission that is flown from take-off to landing: a shipped one by its name, that of a mission file,
    or that of a file of another ground station; GcsError states what is wrong with it. `with_loops`: another
    ground station may leave a loop without end, which otherwise is wrong too."""
    mission = _found(name_or_path, complete=True)
    if mission.loop_ends and not with_loops:
        raise InputError(f"{name_or_path}: {LOOP_TEXT}: gcs fly --speed 1, or gcs upload")
    return mission


def read(name_or_path: str | PathLike[str]) -> Mission:
    """The same, but of a file of another ground station whatever the vehicle accepts of it."""
    return _found(name_or_path, complete=False)


def is_mission_file(path: Path) -> bool:
    """Whether this is a mission file of ours, whatever its ending."""
    try:
        load_mission(path)
    except MissionFileError:
        return False
    return True


def _found(name_or_path: str | PathLike[str], complete: bool) -> Mission:
    try:
        return load_mission(name_or_path)
    except MissionFileError as error:
        if Path(name_or_path).is_file():
            mission = _read_foreign(Path(name_or_path), complete)
            if mission is not None:
                return mission
        raise input_error(error) from None


def _read_foreign(path: Path, complete: bool) -> Mission | None:
    """The mission of a file of another ground station, None if it is not one; InputError if it must be
    `complete` and would not be flown as it stands there, or not to a landing."""
    from gcs.formats.missions import is_foreign, read_mission  # load much, and are imported only when needed

    if not is_foreign(path):
        return None
    mission = read_mission(path)
    problem = _why_not_flown(path, mission) if complete else ""
    if problem:
        raise InputError(*(f"{path}: {line}" for line in (*mission.left_out, problem)))
    return mission


def _why_not_flown(path: Path, mission: ForeignMission) -> str:
    """Why the mission is not flown as it stands in the file from take-off to landing; empty if it is."""
    if not mission.steps:
        return "nothing that can be flown"
    if mission.left_out:
        these = "this" if len(mission.left_out) == 1 else "these"
        return f"not flown without {these}; gcs upload {path} --skip brings the rest to a running vehicle"
    from gcs.mission_items import ends_on_ground  # loads much

    if not ends_on_ground(mission):
        return (
            "does not end on the ground; end it with NAV_LAND or NAV_RETURN_TO_LAUNCH, or bring it to a "
            f"running vehicle: gcs upload {path}"
        )
    return ""
