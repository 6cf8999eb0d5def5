"""Missions by name or file, with errors for the command line. Imports little: `gcs fly` begins with it."""

from __future__ import annotations

from pathlib import Path

from gcs.errors import InputError, input_error
from missions.fileformat import MissionFileError, load_mission
from missions.model import Mission


def load(name_or_path: str) -> Mission:
    """The mission; GcsError states what is wrong with it."""
    try:
        return load_mission(name_or_path)
    except MissionFileError as error:
        path = Path(name_or_path)
        if path.is_file() and _is_of_others(path):
            raise InputError(
                f"{path}: a file of another ground station; gcs check {path} checks it, and "
                f"gcs upload {path} brings it to a running vehicle (docs/tools.md)"
            ) from None
        raise input_error(error) from None


def _is_of_others(path: Path) -> bool:
    from gcs.formats.missions import is_foreign  # loads much, and is therefore imported only when needed

    return is_foreign(path)
