"""The programs that people use, in real time against running processes; none of them may complain.

Each test starts a vehicle of its own. Loss of the link is the vehicle's own, SIM_LOSS_PCT, each way.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from conftest import Mavproxy, Vehicle

pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(
        importlib.util.find_spec("mavsdk") is None or importlib.util.find_spec("dronekit") is None,
        reason="the clients are not installed: pip install -e '.[clients]'",
    ),
]
Start = Callable[..., "Vehicle"]

# what MAVProxy prints where it, or the vehicle, is not content
UNHAPPY = (
    "fence breach",
    "Failed",
    "failed",
    "Traceback",
    "No such",
    "TIMEOUT",
    "timed out",
    "UNSUPPORTED",
    "DENIED",
)


@pytest.fixture
def told_by(request: pytest.FixtureRequest) -> Callable[..., dict[str, object]]:
    module = request.config.pluginmanager.get_plugin(str(request.path.with_name("conftest.py")))
    return module.told_by  # type: ignore[union-attr, no-any-return]


def test_mavsdk_flies(vehicle: Start, told_by: Callable[..., dict[str, object]]) -> None:
    steps = (
        "ready",
        "telemetry_seen",
        "parameters",
        "missions",
        "upload",
        "take_off",
        "go_to",
        "fly_mission",
    )
    api = vehicle().api
    told = told_by("mavsdk_flight.py", f"udpin://127.0.0.1:{api}", *steps, "offboard", "come_back")
    assert told["complaints"] == []
    assert told["version"] == [1, 15]
    assert told["progress"] == [0, 1, 2, 3]
    assert told["texts"] == [
        "Cable taut, lifting the load",
        "Mission complete, holding",
        "Load on the ground",
        "Landed, disarmed",
    ]


def test_mavsdk_flies_a_mission_over_a_link_that_loses_a_third(
    vehicle: Start, told_by: Callable[..., dict[str, object]]
) -> None:
    api = vehicle("--set", "SIM_LOSS_PCT=30").api
    told = told_by(
        "mavsdk_flight.py", f"udpin://127.0.0.1:{api}", "ready", "upload", "arm", "fly_mission", "land"
    )
    # what MAVSDK says of lost messages is true: they are lost
    assert told["progress"] == [0, 1, 2, 3]


def test_mavproxy_flies(vehicle: Start, mavproxy: Callable[[str], Mavproxy]) -> None:
    started = vehicle()
    program = mavproxy(f"udpin:127.0.0.1:{started.gcs}")
    program.expect("parameters (ftp)")
    program.type("param set MIS_SPEED 1.25")
    # home row, then items, as `wp save` writes them
    rows = [
        "QGC WPL 110",
        "0\t1\t0\t16\t0\t0\t0\t0\t47.397742\t8.545594\t0\t1",
        "1\t0\t3\t22\t0\t0\t0\t0\t47.397742\t8.545594\t1.5\t1",
        "2\t0\t3\t16\t0\t0\t0\t0\t47.397750\t8.545594\t1.5\t1",
        "3\t0\t3\t21\t0\t0\t0\t0\t47.397750\t8.545594\t0\t1",
    ]
    (started.directory / "mission.txt").write_text("\n".join(rows) + "\n")
    program.type(f"wp load {started.directory / 'mission.txt'}")
    program.expect("Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
    program.type("wp list")
    program.expect("Requesting 4 waypoints")
    program.type("param fetch MIS_SPEED")
    program.expect("MIS_SPEED = 1.25")
    program.type("long DO_SET_MODE 129 4 4")
    program.expect("MISSION>")
    program.type("arm throttle")
    program.expect("Got COMMAND_ACK: COMPONENT_ARM_DISARM: ACCEPTED")
    program.expect("Cable taut, lifting the load")
    program.expect("Landed, disarmed", 90.0)
    for word in UNHAPPY:
        assert word not in program.all, program.all


def test_dronekit_flies_an_ardupilot(vehicle: Start, told_by: Callable[..., dict[str, object]]) -> None:
    told = told_by("dronekit_flight.py", f"tcp:127.0.0.1:{vehicle('--set', 'MAV_IDENTITY=1').tcp}")
    assert told["complaints"] == []
    assert told["gps"] == 3


def test_several_clients_of_which_one_vanishes(
    vehicle: Start, mavproxy: Callable[[str], Mavproxy], told_by: Callable[..., dict[str, object]]
) -> None:
    started = vehicle("--set", "MAV_LOAD_SYS_ID=2")
    first = mavproxy(f"udpin:127.0.0.1:{started.gcs}")
    second = mavproxy(f"udpin:127.0.0.1:{started.second_gcs}")
    third = mavproxy(f"tcp:127.0.0.1:{started.tcp}")
    for program in (first, second, third):
        program.expect("parameters (ftp)")
    first.type("arm throttle")
    first.expect("Got COMMAND_ACK: COMPONENT_ARM_DISARM: ACCEPTED")
    first.type("disarm")
    first.expect("DISARMED")
    for program in (first, third):
        program.end()
    told = told_by("mavsdk_flight.py", f"udpin://127.0.0.1:{started.api}", "ready", "take_off", "land")
    assert told["complaints"] == []
    second.expect("Landed, disarmed")
    assert "COMMAND_ACK" not in second.all, "an answer to somebody else"
    for word in UNHAPPY:
        assert word not in second.all, second.all
