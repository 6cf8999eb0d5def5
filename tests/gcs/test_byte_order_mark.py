"""Text files as editors of Windows write them: the byte order mark is not part of their content."""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from autopilot.shell.options import signing_key_option
from autopilot.vehicle.file import load_vehicle
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import encode_mission
from autopilot.wire.parameter_table import parse_text
from gcs.formats.missions import read_foreign, write_foreign
from gcs.recorded.column_map import ColumnMap, load_map
from gcs.recorded.recording import read_recording
from gcs.workflows.new_file import new_file
from missions.fileformat import load_mission
from missions.text_files import TextFileError, text_of
from sitl.sensors.files import load_profile

ROWS = 300
COLUMNS = ColumnMap.model_validate(
    {
        "rate_hz": 100.0,
        "vehicle": {"position": [0, 1, 2], "quaternion": [3, 4, 5, 6], "quaternion_order": "xyzw"},
        "model": {"mass_ratio": 0.1},
    }
)
MAP = '[vehicle]\nposition = [0, 1, 2]\nquaternion = [3, 4, 5, 6]\nquaternion_order = "xyzw"\n'
MAP += "[model]\nmass_ratio = 0.1\n"


def written(kind: str, path: Path) -> None:
    """Write a file of this kind."""
    if kind in ("mission", "vehicle", "sensors"):
        new_file(kind, str(path))
    elif kind == "column map":
        path.write_text(MAP, encoding="utf-8")
    elif kind == "parameters":
        path.write_text("MIS_SPEED 1.5\n", encoding="utf-8")
    elif kind == "signing key":
        path.write_text("pass phrase\n", encoding="utf-8")
        path.chmod(0o600)
    elif kind == "recording":
        np.savetxt(path, np.tile([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0], (ROWS, 1)), delimiter=",")
    else:
        write_foreign(path, encode_mission(load_mission("hover"), Home()), Home())


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "mission": ("a.toml", load_mission),
    "vehicle": ("a.toml", load_vehicle),
    "sensors": ("a.toml", load_profile),
    "column map": ("a.toml", load_map),
    "plan": ("a.plan", read_foreign),
    "waypoints": ("a.waypoints", read_foreign),
    "parameters": ("a.params", lambda path: parse_text(text_of(path))),
    "signing key": ("a.key", lambda path: signing_key_option(str(path))),
    "recording": ("a.csv", lambda path: len(read_recording(path, COLUMNS).position)),
}


@pytest.mark.parametrize("kind", READERS)
def test_a_file_with_the_mark_says_the_same(kind: str, tmp_path: Path) -> None:
    name, read = READERS[kind]
    path = tmp_path / name
    written(kind, path)
    plain = read(path)
    path.write_bytes(BOM_UTF8 + path.read_bytes())
    assert read(path) == plain


def test_text_in_utf_16_is_told_how_to_be_saved(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text('title = "Hover"\n', encoding="utf-16")
    with pytest.raises(TextFileError, match="not a text file in UTF-8 but in UTF-16; save it as UTF-8"):
        text_of(path)
