"""A file of another kind than the wanted one is reported as such, and not key by key."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.shipped import VEHICLES
from missions.fileformat import MISSIONS, load_mission
from missions.toml_files import FileError, TomlFiles
from sitl.sensors.files import load_profile
from sitl.sensors.shipped import PROFILES

KINDS: tuple[tuple[TomlFiles, Callable[[Path], Any]], ...] = (
    (MISSIONS, load_mission),
    (VEHICLES, load_vehicle),
    (PROFILES, load_profile),
)


def test_a_python_file_is_told_where_it_belongs(tmp_path: Path) -> None:
    law = tmp_path / "law.py"
    law.touch()
    with pytest.raises(FileError, match=r"law\.py: is a Python file; a mission file is TOML \(--law, "):
        load_mission(law)


@pytest.mark.parametrize(
    ("load", "name", "said"),
    [
        (
            load_vehicle,
            "case-b",
            "unknown vehicle 'case-b'; case-b is one of the shipped missions; shipped: ",
        ),
        (load_mission, "lab", "unknown mission 'lab'; lab is one of the shipped sensors; shipped: "),
        (load_profile, "heavy", "unknown sensors 'heavy'; heavy is one of the shipped vehicles; shipped: "),
    ],
)
def test_the_name_of_another_kind_is_told_as_what_it_is(
    load: Callable[[str], Any], name: str, said: str
) -> None:
    with pytest.raises(FileError) as told:
        load(name)
    assert str(told.value).startswith(said)


@pytest.mark.parametrize(("wanted", "load"), KINDS, ids=lambda one: getattr(one, "kind", ""))
def test_the_shipped_files_of_the_other_kinds_are_told_as_what_they_are(
    tmp_path: Path, wanted: TomlFiles, load: Callable[[Path], Any]
) -> None:
    for other, _ in KINDS:
        for name in other.names():
            text = other.read(name).text
            if other is wanted or "believed =" in text:  # which is not complete by itself
                continue
            path = tmp_path / f"{name}.toml"
            path.write_text(text, encoding="utf-8")
            with pytest.raises(FileError) as told:
                load(path)
            line = f"{path}: is a {other.kind} file; a {wanted.kind} file is wanted here"
            assert told.value.problems == (line,)
