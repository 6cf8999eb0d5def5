"""Sensor profiles made in Python."""

from __future__ import annotations

from typing import ClassVar

from missions.toml_files import TomlFiles
from plumbline.tables import Table
from sitl.sensors.profile import Profile
from sitl.sensors.shipped import PROFILES


class Sensors(Table, Profile):
    """A sensor profile: a table for each sensor, with the keys of a profile file (docs/sensors.md).

    ```python
    slow = Sensors.load("lab").replace(mocap={"rate_hz": 50.0, "latency_ms": 20.0})
    ```
    """

    files: ClassVar[TomlFiles] = PROFILES
