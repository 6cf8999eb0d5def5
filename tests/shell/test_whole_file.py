"""A file is there whole or not at all: a process killed at any system call of a write loses nothing."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from autopilot.services.mission_store import StoredMission
from autopilot.shell.storage import Storage
from autopilot.shell.whole_file import DamagedError, keep_copy, seal, unseal, write_whole
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, encode_steps
from missions.fileformat import load_mission

HOME = Home()
CALLS = ("open", "write", "fsync", "close", "rename", "replace", "unlink", "mkdir")
FENCE = mavlink.MAV_MISSION_TYPE_FENCE


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


def killed_at(number: int, what: Callable[[], Any]) -> bool:
    """Do `what` in a process that dies by SIGKILL at its system call `number`, before it is made."""
    child = os.fork()
    if child == 0:
        left = [number]

        def counted(call: Callable[..., Any]) -> Callable[..., Any]:
            def made(*args: Any, **kwargs: Any) -> Any:
                left[0] -= 1
                if left[0] < 0:
                    os.kill(os.getpid(), signal.SIGKILL)
                return call(*args, **kwargs)

            return made

        for name in CALLS:
            setattr(os, name, counted(getattr(os, name)))
        try:
            what()
        finally:
            os.kill(os.getpid(), signal.SIGTERM)  # by the end, without the cleaning up of the test program
    _, status = os.waitpid(child, 0)
    return os.WTERMSIG(status) == signal.SIGKILL


def missions(directory: Path) -> Any:
    return Storage(directory).load_mission(HOME)


def areas(directory: Path) -> Any:
    found, troubles = Storage(directory).load_areas(HOME)
    return found.get(FENCE), troubles


def parameters(directory: Path) -> Any:
    table = autopilot_parameters(load_vehicle("bebop"))
    troubles = Storage(directory).load_parameters(table)
    return table.changed(), troubles


def world(directory: Path) -> Any:
    return Storage(directory).load_world()


def key(directory: Path) -> Any:
    signing = Storage(directory).load_signing()
    return signing and (signing.key, signing.timestamp)


WRITES = {
    "mission": (
        lambda storage: storage.keep_mission(StoredMission(encode_steps(load_mission("hover").steps, HOME))),
        lambda storage: storage.keep_mission(StoredMission(encode_steps(load_mission("case-b").steps, HOME))),
        missions,
    ),
    "mission cleared": (
        lambda storage: storage.keep_mission(StoredMission(encode_steps(load_mission("hover").steps, HOME))),
        lambda storage: storage.keep_mission(StoredMission()),
        missions,
    ),
    "fence": (
        lambda storage: storage.keep_areas(FENCE, fence(20.0)),
        lambda storage: storage.keep_areas(FENCE, fence(30.0)),
        areas,
    ),
    "parameters": (
        lambda storage: storage.keep_parameter("NGC_KX", 5.0),
        lambda storage: storage.keep_parameter("NGC_KX", 5.5),
        parameters,
    ),
    "world": (
        lambda storage: storage.keep_world({"SIM_WIND_E": 3.0}),
        lambda storage: storage.keep_world({"SIM_WIND_E": 4.0}),
        world,
    ),
    "key": (
        lambda storage: storage.keep_signing(bytes(range(32)), 5),
        lambda storage: storage.keep_signing(bytes(range(32)), 7),
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
    write_whole(tmp_path / "a", b"1")
    assert done == [f"fsync {tmp_path / 'a.new'}", "replace", f"fsync {tmp_path}"]
