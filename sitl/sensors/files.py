"""Profile files: TOML, checked before anything starts; all errors are reported in one line."""

from __future__ import annotations

from os import PathLike

from sitl.sensors.profile import Profile
from sitl.sensors.shipped import PROFILES


def parse_profile(text: str, where: str) -> Profile:
    """The profile written in `text`; `where` names it in a ProfileError."""
    return PROFILES.record(Profile, PROFILES.table(text, where), where)


def load_profile(name_or_path: str | PathLike[str]) -> Profile:
    """The profile of a shipped name or of a file; else a ProfileError."""
    found = PROFILES.read(name_or_path)
    return parse_profile(found.text, found.where)
