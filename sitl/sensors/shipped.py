"""Which sensor profiles are shipped: the files of this folder. No kernel is loaded, so help may ask."""

from __future__ import annotations

from missions.toml_files import FileError, TomlFiles


class ProfileError(FileError):
    """A sensor profile cannot be used: the fault of its file or of its name."""


PROFILES = TomlFiles("sensors", ProfileError)
