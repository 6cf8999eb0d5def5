"""A file is there whole or not at all: a process killed at any system call of a write loses nothing."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from autopilot.services.mission_store import StoredMission
from autopilot.shell.atomic_file import DamagedError, keep_copy, seal, unseal, write_atomically
from autopilot.shell.storage import Storage
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, encode_steps
from missions.fileformat import load_mission
from tests.doubles.killed import killed_at

HOME = Home()
FENCE, RALLY = mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY
RUBBISH = b"rubbish"


def fence(radius: float) -> tuple[WireItem, ...]:
    circle = WireItem(
        frame=mavlink.MAV_FRAME_GLOBAL,
        command=mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
        current=0,
        autocontinue=1,
        param1=radius,
        param2=0.0,
        param3=0.0,
        param4=0.0,
        x=round(HOME.latitude_deg * 1e7),
        y=round(HOME.longitude_deg * 1e7),
        z=0.0,
    )
    return (circle,)


def rally(height: float) -> tuple[WireItem, ...]:
    (circle,) = fence(0.0)
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    return (circle._replace(frame=frame, command=mavlink.MAV_CMD_NAV_RALLY_POINT, z=height),)


def missions(directory: Path) -> Any:
    return Storage(directory).load_mission(HOME)


def areas(directory: Path) -> Any:
    found, troubles = Storage(directory).load_areas(HOME)
    return found, troubles


def parameters(directory: Path) -> Any:
    table = autopilot_parameters(load_vehicle("bebop"))
    troubles = Storage(directory).load_parameters(table)
    return table.changed(), troubles


def world(directory: Path) -> Any:
    return Storage(directory).load_simulator_parameters()


def key(directory: Path) -> Any:
    signing = Storage(directory).load_signing()
    return signing and (signing.key, signing.timestamp)


WRITES = {
    "mission": (
        lambda storage: storage.store_mission(StoredMission(encode_steps(load_mission("hover").steps, HOME))),
        lambda storage: storage.store_mission(
            StoredMission(encode_steps(load_mission("case-b").steps, HOME))
        ),
        missions,
    ),
    "mission cleared": (
        lambda storage: storage.store_mission(StoredMission(encode_steps(load_mission("hover").steps, HOME))),
        lambda storage: storage.store_mission(StoredMission()),
        missions,
    ),
    "fence": (
        lambda storage: storage.store_areas(FENCE, fence(20.0)),
        lambda storage: storage.store_areas(FENCE, fence(30.0)),
        areas,
    ),
    "fence cleared": (
        lambda storage: storage.store_areas(FENCE, fence(20.0)),
        lambda storage: storage.store_areas(FENCE, ()),
        areas,
    ),
    "rally points": (
        lambda storage: storage.store_areas(RALLY, rally(20.0)),
        lambda storage: storage.store_areas(RALLY, rally(30.0)),
        areas,
    ),
    "rally points cleared": (
        lambda storage: storage.store_areas(RALLY, rally(20.0)),
        lambda storage: storage.store_areas(RALLY, ()),
        areas,
    ),
    "parameters": (
        lambda storage: storage.store_parameter("NGC_KX", 5.0),
        lambda storage: storage.store_parameter("NGC_KX", 5.5),
        parameters,
    ),
    "world": (
        lambda storage: storage.store_simulator_parameters({"SIM_WIND_E": 3.0}),
        lambda storage: storage.store_simulator_parameters({"SIM_WIND_E": 4.0}),
        world,
    ),
    "world cleared": (
        lambda storage: storage.store_simulator_parameters({"SIM_WIND_E": 3.0}),
        lambda storage: storage.store_simulator_parameters({}),
        world,
    ),
    "key taken away": (
        lambda storage: storage.store_signing(bytes(range(32)), 5),
        lambda storage: storage.store_signing(None, 0),
        key,
    ),
    "key": (
        lambda storage: storage.store_signing(bytes(range(32)), 5),
        lambda storage: storage.store_signing(bytes(range(32)), 7),
        key,
    ),
}


@pytest.mark.parametrize("what", WRITES)
def test_a_process_killed_at_any_system_call_leaves_the_old_or_the_new(tmp_path: Path, what: str) -> None:
    first, second, read = WRITES[what]
    first(Storage(tmp_path))
    old = read(tmp_path)
    storage = Storage(tmp_path)
    fresh = tmp_path / "fresh"
    first(Storage(fresh))
    second(Storage(fresh))
    new = read(fresh)
    assert old != new
    seen = []
    number = 0
    while killed_at(number, lambda: second(storage)):
        seen.append(read(tmp_path))
        number += 1
    assert number >= 3, "calls at which it was killed"
    seen.append(read(tmp_path))
    assert seen == sorted(seen, key=lambda found: found != old), "the old, then the new"
    assert all(found in (old, new) for found in seen)
    assert seen[-1] == new
    assert not list(tmp_path.glob("*.corrupt*"))


# stored files, and how each is read and replaced; a start finds a damaged one for as long as it is there
REPLACED = {
    "mission.bin": lambda storage: storage.load_mission(HOME),
    "fence.bin": lambda storage: (storage.load_areas(HOME), storage.store_areas(FENCE, fence(30.0))),
    "rally.bin": lambda storage: (storage.load_areas(HOME), storage.store_areas(RALLY, ())),
    "parameters.txt": lambda storage: (
        storage.load_parameters(autopilot_parameters(load_vehicle("bebop"))),
        storage.store_parameter("NGC_KX", 5.0),
    ),
    "world.txt": lambda storage: (
        storage.load_simulator_parameters(),
        storage.store_simulator_parameters({"SIM_WIND_E": 4.0}),
    ),
}


@pytest.mark.parametrize("name", REPLACED)
def test_a_process_killed_as_it_sets_a_damaged_file_aside_loses_none(tmp_path: Path, name: str) -> None:
    replace, whole = REPLACED[name], tmp_path / "whole" / name
    replace(Storage(whole.parent))
    new = whole.read_bytes() if whole.exists() else None
    number, killed = 0, True
    while killed:
        path = tmp_path / str(number) / name
        storage = Storage(path.parent)
        path.write_bytes(RUBBISH)
        killed = killed_at(number, lambda storage=storage: replace(storage))
        found = path.read_bytes() if path.exists() else None
        aside = list(path.parent.glob("[!.]*.corrupt*"))
        assert found == RUBBISH or (found == new and len(aside) == 1)
        assert all(one.read_bytes() == RUBBISH for one in aside), "whole or not at all"
        replace(Storage(path.parent))  # at the next start
        assert (path.read_bytes() if path.exists() else None) == new
        number += 1
    assert number > 10, "calls at which it was killed"


def test_a_seal_is_broken_by_any_byte() -> None:
    whole = seal("FENCE 20.0\nOTHER -1e-3\n")
    assert unseal(whole) == "FENCE 20.0\nOTHER -1e-3\n"
    for place in range(len(whole)):
        for bit in range(8):
            damaged = bytearray(whole)
            damaged[place] ^= 1 << bit
            with pytest.raises(DamagedError):
                unseal(bytes(damaged))
        with pytest.raises(DamagedError):
            unseal(whole[:place])
        with pytest.raises(DamagedError):
            unseal(whole[:place] + whole[place + 1 :])


def test_a_damaged_file_never_takes_the_place_of_another(tmp_path: Path) -> None:
    path = tmp_path / "fence.bin"
    names = []
    for number in range(3):
        path.write_text(str(number))
        names.append(keep_copy(path).name)
    assert names == ["fence.corrupt", "fence.corrupt2", "fence.corrupt3"]
    assert [(tmp_path / name).read_text() for name in names] == ["0", "1", "2"]


def test_the_directory_is_brought_to_the_disk_after_the_new_name(tmp_path: Path, monkeypatch: Any) -> None:
    done: list[str] = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(
        os,
        "fsync",
        lambda handle: (done.append(f"fsync {Path(f'/proc/self/fd/{handle}').readlink()}"), fsync(handle)),
    )
    monkeypatch.setattr(os, "replace", lambda a, b: (done.append("replace"), replace(a, b)))
    write_atomically(tmp_path / "a", b"1")
    assert done == [f"fsync {tmp_path / '.a.new'}", "replace", f"fsync {tmp_path}"]


def test_a_file_of_the_same_stem_is_left_alone(tmp_path: Path) -> None:
    users = [tmp_path / name for name in ("mine.new", "mine.part", "mine.txt.new")]
    for file in users:
        file.write_text("the user's own")
    write_atomically(tmp_path / "mine.txt", b"1")
    assert [file.read_text() for file in users] == ["the user's own"] * 3
    assert {path.name for path in tmp_path.iterdir()} == {"mine.txt", *(file.name for file in users)}
