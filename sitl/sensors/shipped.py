"""The shipped sensor profiles: the files of this folder. Loads no kernel, so that help texts can use it."""

from __future__ import annotations

from missions.toml_files import FileError, TomlFiles


class ProfileError(FileError):
    """A sensor profile cannot be used: its file or its name is wrong."""


PROFILES = TomlFiles("sensors", ProfileError)
