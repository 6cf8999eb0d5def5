"""Missions by name or file, with the errors of a command. It is light: `gcs fly` begins with it."""

from __future__ import annotations

from gcs.errors import input_error
from missions.fileformat import MissionFileError, load_mission
from missions.model import Mission


def load(name_or_path: str) -> Mission:
    """The mission; GcsError says what is wrong with it."""
    try:
        return load_mission(name_or_path)
    except MissionFileError as error:
        raise input_error(error) from None
