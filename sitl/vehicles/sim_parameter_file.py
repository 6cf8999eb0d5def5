"""The file that defines the simulator's parameters; reading it is cheap."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from typing import Any

FILE = "sim_parameters.toml"


def sim_document() -> dict[str, Any]:
    """The parsed file."""
    return tomllib.loads((files("sitl") / FILE).read_text(encoding="utf-8"))
