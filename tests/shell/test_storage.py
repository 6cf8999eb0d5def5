"""What outlives the process: missions and parameters come back, and a bad file is reported and set aside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from autopilot.onboard.flight_log import LogChunk
from autopilot.services.mission_store import StoredMission
from autopilot.shell.atomic_file import seal
from autopilot.shell.storage import (
    CARD_DIRECTORY,
    MISSION_FILE,
    PARAMETER_FILE,
    SIGNING_FILE,
    SIMULATOR_PARAMETER_FILE,
    Storage,
    StorageError,
)
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import encode_steps
from autopilot.wire.parameter_table import ParameterTable
from missions.fileformat import load_mission, shipped

HOME = Home()


def table() -> ParameterTable:
    return autopilot_parameters(load_vehicle("bebop"))


def stored(name: str) -> StoredMission:
    items = encode_steps(load_mission(name).steps, HOME)
    return StoredMission(items)


@pytest.mark.parametrize("name", shipped())
def test_a_mission_comes_back_as_it_was(tmp_path: Path, name: str) -> None:
    Storage(tmp_path).store_mission(stored(name))
    assert Storage(tmp_path).load_mission(HOME) == (stored(name), "")
    assert [p.name for p in tmp_path.iterdir() if p.is_file()] == [MISSION_FILE], "nothing half written stays"


def test_no_mission_and_an_empty_one_are_the_same(tmp_path: Path) -> None:
    storage = Storage(tmp_path / "new" / "deep")
    assert storage.load_mission(HOME) == (None, "")
    storage.store_mission(stored("hover"))
    storage.store_mission(StoredMission())
    assert storage.load_mission(HOME) == (None, "")
    storage.store_mission(StoredMission())


@pytest.mark.parametrize("damage", ["cut", "bit", "empty", "other"])
def test_a_corrupt_mission_is_set_aside_and_said(tmp_path: Path, damage: str) -> None:
    storage = Storage(tmp_path)
    storage.store_mission(stored("hover"))
    path = tmp_path / MISSION_FILE
    data = path.read_bytes()
    bad = {
        "cut": data[:-7],
        "bit": data[:20] + bytes([data[20] ^ 4]) + data[21:],
        "empty": b"",
        "other": b"x" * 99,
    }
    path.write_bytes(bad[damage])
    mission, trouble = storage.load_mission(HOME)
    assert mission is None
    assert str(path) in trouble
    assert "moved to mission.corrupt" in trouble
    assert (tmp_path / "mission.corrupt").read_bytes() == bad[damage]
    assert storage.load_mission(HOME) == (None, ""), "it troubles but once"


def refused(path: Path) -> Path:
    raise PermissionError(1, "not allowed", str(path))


def test_a_corrupt_mission_that_cannot_be_set_aside_is_said_too(tmp_path: Path, monkeypatch: Any) -> None:
    storage = Storage(tmp_path)
    (tmp_path / MISSION_FILE).write_bytes(b"rubbish")
    monkeypatch.setattr("autopilot.shell.storage.keep_copy", refused)
    mission, trouble = storage.load_mission(HOME)
    assert mission is None
    assert "not allowed, starting without a mission" in trouble


def test_logs_are_stored_in_parts_and_the_oldest_make_room(tmp_path: Path) -> None:
    storage = Storage(tmp_path)
    folder = tmp_path / CARD_DIRECTORY / "log"
    for name in ("a", "b", "c"):
        path = ("log", f"{name}.ulg")
        storage.store_log(LogChunk(path, bytes(600_000), False), 1.0)
        storage.store_log(LogChunk(path, b"end", True), 1.0)
    # room is made when a log begins: the logs before it are no more than a megabyte
    assert sorted(log.name for log in folder.iterdir()) == ["b.ulg", "c.ulg"]
    assert (folder / "c.ulg").read_bytes() == bytes(600_000) + b"end"


def test_a_log_is_not_written_through_a_link(tmp_path: Path) -> None:
    storage = Storage(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / CARD_DIRECTORY / "log").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match="symbolic links"):
        storage.store_log(LogChunk(("log", "a.ulg"), b"x", False), 1.0)
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_signing_key_is_kept_for_nobody_else_to_read(tmp_path: Path) -> None:
    storage, key = Storage(tmp_path), bytes(range(32))
    assert storage.load_signing() is None
    for timestamp in (5, 7):
        storage.store_signing(key, timestamp)
        assert (tmp_path / SIGNING_FILE).stat().st_mode & 0o777 == 0o600
    again = Storage(tmp_path).load_signing()
    assert again is not None
    assert (again.key, again.timestamp) == (key, 7)
    storage.store_signing(None, 0)
    assert Storage(tmp_path).load_signing() is None


@pytest.mark.parametrize("text", ["", "00", "zz" * 32 + " 5", "00" * 31 + " 5", "00" * 32 + " x", "\xff"])
def test_a_key_that_cannot_be_read_is_no_reason_to_fly_without(tmp_path: Path, text: str) -> None:
    (tmp_path / SIGNING_FILE).write_bytes(seal(text))
    with pytest.raises(StorageError, match="remove it"):
        Storage(tmp_path).load_signing()


def test_a_key_or_its_time_is_never_another_one(tmp_path: Path) -> None:
    Storage(tmp_path).store_signing(bytes(range(32)), 123456)
    path = tmp_path / SIGNING_FILE
    whole = path.read_bytes()
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.raises(StorageError, match="remove it"):
            Storage(tmp_path).load_signing()
        assert path.exists(), "mended by hand, or removed"


def test_parameters_come_back_and_only_those_that_were_set(tmp_path: Path) -> None:
    storage = Storage(tmp_path)
    storage.store_parameter("NGC_KX", 5.123456789012345)
    storage.store_parameter("MIS_SPEED", 0.7)
    storage.store_parameter("NGC_KX", 5.25)
    again = table()
    assert Storage(tmp_path).load_parameters(again) == []
    assert again.changed() == {"NGC_KX": 5.25, "MIS_SPEED": 0.7}
    assert [p.name for p in tmp_path.iterdir() if p.is_file()] == [PARAMETER_FILE]


def test_a_parameter_is_stored_beside_those_of_earlier_runs(tmp_path: Path) -> None:
    Storage(tmp_path).store_parameter("NGC_KX", 5.0)
    later = Storage(tmp_path)
    later.load_parameters(table())
    later.store_parameter("NGC_KV", 2.0)
    again = table()
    Storage(tmp_path).load_parameters(again)
    assert again.changed() == {"NGC_KX": 5.0, "NGC_KV": 2.0}


def test_what_no_longer_fits_is_left_out_and_said(tmp_path: Path) -> None:
    (tmp_path / PARAMETER_FILE).write_bytes(seal("NGC_KX 5.0\nOLD_NAME 1.0\nMIS_SPEED 900\n"))
    again = table()
    troubles = Storage(tmp_path).load_parameters(again)
    assert again.changed() == {"NGC_KX": 5.0}
    assert len(troubles) == 2
    assert all("left out" in trouble for trouble in troubles)
    assert any("OLD_NAME" in trouble for trouble in troubles)
    assert any("MIS_SPEED = 900" in trouble for trouble in troubles)


@pytest.mark.parametrize(
    "text", [b"\xff\xfe\x00", b"NGC_KX 5.0\n", seal("NGC_KX five\n"), seal("NGC_KX 5.0\n")[1:]]
)
def test_a_file_that_is_none_is_said_and_changes_nothing(tmp_path: Path, text: bytes) -> None:
    (tmp_path / PARAMETER_FILE).write_bytes(text)
    again = table()
    troubles = Storage(tmp_path).load_parameters(again)
    assert len(troubles) == 1
    assert "starting with the defaults" in troubles[0]
    assert again.changed() == {}
    storage = Storage(tmp_path)
    assert storage.load_parameters(again) == troubles, "also the next time"
    storage.store_parameters()
    assert (tmp_path / "parameters.corrupt").read_bytes() == text
    assert Storage(tmp_path).load_parameters(again) == []


@pytest.mark.parametrize("name", ["fence", "rally", "world"])
def test_a_damaged_file_is_kept_aside_when_another_takes_its_place(tmp_path: Path, name: str) -> None:
    file = {"fence": "fence.bin", "rally": "rally.bin", "world": SIMULATOR_PARAMETER_FILE}[name]
    (tmp_path / file).write_bytes(b"rubbish")
    storage = Storage(tmp_path)
    assert len(storage.load_areas(HOME)[1] + storage.load_simulator_parameters()[1]) == 1
    assert [p.name for p in tmp_path.glob(f"{name}.*")] == [file], "it stays where it is"
    for kind in (mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY):
        storage.store_areas(kind, ())
    storage.store_simulator_parameters({"SIM_WIND_E": 3.0})
    assert (tmp_path / f"{name}.corrupt").read_bytes() == b"rubbish"
    assert [p.name for p in tmp_path.glob("*.corrupt*")] == [f"{name}.corrupt"], (
        "of what was read none is kept"
    )
    again = Storage(tmp_path)
    assert again.load_areas(HOME) == ({}, [])
    assert again.load_simulator_parameters() == ({"SIM_WIND_E": 3.0}, [])


def test_what_was_lost_is_a_reason_not_to_arm_until_it_is_stored_again(tmp_path: Path) -> None:
    for name in ("fence.bin", "rally.bin", PARAMETER_FILE):
        (tmp_path / name).write_bytes(b"rubbish")
    storage = Storage(tmp_path)
    assert storage.lost == ()
    assert len(storage.load_parameters(table())) == 1
    _, troubles = storage.load_areas(HOME)
    assert len(troubles) == 2
    assert [text.split(";")[0] for text in storage.lost] == [
        "the stored fence is damaged",
        "the stored parameters are damaged",
    ]
    storage.store_areas(mavlink.MAV_MISSION_TYPE_FENCE, ())
    storage.store_parameters()
    assert storage.lost == ()
    again = Storage(tmp_path)
    assert again.load_parameters(table()) == []
    assert len(again.load_areas(HOME)[1]) == 1, "the rally points"
    assert again.lost == ()


def test_a_directory_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for bad in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(StorageError, match=r"--storage .*name a directory that can be made") as caught:
            Storage(bad)
        assert "\n" not in str(caught.value)


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    storage = Storage(tmp_path)
    storage.store_parameter("NGC_KX", 5.0)
    (tmp_path / ".parameters.txt.new").mkdir()  # has the effect of a full or read-only disk, also for root
    with pytest.raises(OSError, match=r"\.parameters\.txt\.new"):
        storage.store_parameter("NGC_KX", 7.0)
    again = table()
    Storage(tmp_path).load_parameters(again)
    assert again["NGC_KX"] == 5.0


def test_a_directory_serves_one_autopilot_at_a_time(tmp_path: Path) -> None:
    first, second = Storage(tmp_path), Storage(tmp_path)
    first.lock()
    with pytest.raises(StorageError, match="another autopilot keeps its mission and parameters there"):
        second.lock()
    del first
    second.lock()


def test_the_simulators_parameters_come_back_where_they_were_saved(tmp_path: Path) -> None:
    assert Storage(tmp_path).load_simulator_parameters() == ({}, [])
    Storage(tmp_path).store_simulator_parameters({"SIM_WIND_E": 3.0, "SIM_LOAD_MASS": 0.1})
    assert Storage(tmp_path).load_simulator_parameters() == ({"SIM_WIND_E": 3.0, "SIM_LOAD_MASS": 0.1}, [])
    Storage(tmp_path).store_simulator_parameters({})
    assert Storage(tmp_path).load_simulator_parameters() == ({}, [])
    (tmp_path / SIMULATOR_PARAMETER_FILE).write_bytes(seal("SIM_WIND_E three"))
    values, troubles = Storage(tmp_path).load_simulator_parameters()
    assert values == {} and len(troubles) == 1
