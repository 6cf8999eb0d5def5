"""What `autopilot` makes of its options and its storage: started here, up to where its loop would begin."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from autopilot.onboard.onboard import Onboard
from autopilot.shell import program
from autopilot.shell.command import main
from autopilot.shell.options import Stop
from autopilot.shell.storage import PARAMETER_FILE, Storage
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.items import WireItem
from gcs.shell.link import free_port
from tests.doubles.craft import ACCEPTED, Craft

FENCE, ARM = m.MAV_MISSION_TYPE_FENCE, m.MAV_CMD_COMPONENT_ARM_DISARM
TRIANGLE = tuple(
    WireItem(
        *(m.MAV_FRAME_GLOBAL, m.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, 0, 1),
        *(3.0, 0.0, 0.0, 0.0, round(latitude * 1e7), round(longitude * 1e7), 0.0),
    )
    for latitude, longitude in ((47.3, 8.5), (47.5, 8.5), (47.4, 8.7))
)
KEY = bytes(range(32))
ON, NOT_TAKEN = (
    "Signing is on: only signed messages are heard",
    "Signing key not changed: start the autopilot",
)


@pytest.fixture
def started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Craft]]:
    """Start `autopilot` with these options; return a craft with it, whose ground station receives from it."""
    found: list[Onboard] = []

    class Begun(program.Program):
        def report_problems(self, troubles: list[str]) -> None:
            super().report_problems(troubles)
            found.append(self.onboard)
            raise Stop

    def start(*options: str) -> Craft:
        places = ("--storage", str(tmp_path), "--ground-lockstep", str(free_port()))
        result = CliRunner().invoke(main, [*places, *options, "--quiet"])
        assert (result.exit_code, result.stdout) == (0, ""), result.output
        craft = Craft()
        craft.onboard = found.pop()
        return craft

    monkeypatch.setattr(program, "Program", Begun)
    interrupt = signal.getsignal(signal.SIGINT)
    yield start
    signal.signal(signal.SIGINT, interrupt)


def keep_fence(folder: Path, damaged: bool) -> Path:
    """Store a fence around home; return its file."""
    Storage(folder).store_areas(FENCE, TRIANGLE)
    path = folder / "fence.bin"
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] + bytes([whole[-1] ^ damaged]))
    return path


def test_a_damaged_file_is_told_to_the_operators(started: Callable[..., Craft], tmp_path: Path) -> None:
    fence, parameters = keep_fence(tmp_path, damaged=True), tmp_path / PARAMETER_FILE
    parameters.write_bytes(b"rubbish")
    craft = started()
    craft.wait(1.0)
    told = "".join(craft.texts)  # a long text comes in parts
    assert f"Storage: {parameters}: it has no checksum; starting with the defaults" in told
    assert f"Storage: {fence}: " in told and told.endswith("; starting without it")
    severities = {x.severity for x in craft.heard if x.get_type() == "STATUSTEXT"}
    assert severities == {m.MAV_SEVERITY_CRITICAL}


def test_without_the_fence_that_was_stored_the_vehicle_is_not_armed(
    started: Callable[..., Craft], tmp_path: Path
) -> None:
    keep_fence(tmp_path, damaged=True)
    craft = started()
    craft.wait(1.0)
    assert craft.command(ARM, 1.0) == m.MAV_RESULT_DENIED
    craft.tick()
    assert "Arming denied: the stored fence is damaged; upload it again, or clear it" in "".join(craft.texts)
    assert not craft.onboard.armed


def test_with_it_the_vehicle_is_armed(started: Callable[..., Craft], tmp_path: Path) -> None:
    keep_fence(tmp_path, damaged=False)
    craft = started()
    craft.wait(1.0)
    assert craft.command(ARM, 1.0) == ACCEPTED
    assert craft.flight.area.fence
    assert craft.texts == []


@pytest.mark.parametrize(
    ("options", "told"), [(("--allow-setup-signing",), ON), ((), NOT_TAKEN)], ids=["allowed", "else"]
)
def test_a_first_key_is_taken_from_the_air_where_that_is_allowed(
    started: Callable[..., Craft], options: tuple[str, ...], told: str
) -> None:
    craft = started(*options)
    craft.wait(1.0)
    craft.send(m.MAVLink_setup_signing_message(1, 1, list(KEY), 0))
    craft.wait(0.1)
    assert told in "".join(craft.texts)


@pytest.mark.parametrize(
    ("links", "text"),
    [
        (
            ([("127.0.0.1", 14550), ("10.0.0.2", 14550)], [("127.0.0.1", 14540)], None),
            "sends to ground stations at UDP 127.0.0.1:14550, 10.0.0.2:14550 "
            "and API clients at UDP 127.0.0.1:14540",
        ),
        (
            ([], [("127.0.0.1", 14540)], ("127.0.0.1", 5760)),
            "sends to API clients at UDP 127.0.0.1:14540, listens on TCP 127.0.0.1:5760",
        ),
        (([], [], None), "no link to a ground station"),
    ],
)
def test_where_a_ground_station_meets_it_is_told(links: Any, text: str) -> None:
    assert program.links_text(*links) == text


def test_links_and_storage_are_told_at_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Ended(program.Program):
        def report_problems(self, troubles: list[str]) -> None:
            raise Stop

    monkeypatch.setattr(program, "Program", Ended)
    interrupt = signal.getsignal(signal.SIGINT)
    options = ["--storage", str(tmp_path), "--ground-lockstep", str(port := free_port())]
    result = CliRunner().invoke(main, options)
    signal.signal(signal.SIGINT, interrupt)
    told = f"autopilot: sends to ground stations at UDP 127.0.0.1:{port}; storage {tmp_path}\n"
    assert told in result.stdout
