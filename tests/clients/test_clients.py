"""The programs that people use, in real time against running processes; none of them may complain.

Each flight below is one vehicle with the programs that fly it; two are flown at the same time, faster than
real time. Losses of the link are made by the vehicle, SIM_LOSS_PCT, each way.
"""

from __future__ import annotations

import importlib.util
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.tlog import read_tlog

from .conftest import LOOPBACK, Mavproxy, Place, Stage, Told, Witness, complaints, staged

pytestmark = [
    pytest.mark.processes,
    pytest.mark.xdist_group("clients"),  # one process begins all their flights
    pytest.mark.skipif(
        importlib.util.find_spec("mavsdk") is None or importlib.util.find_spec("dronekit") is None,
        reason="the clients are not installed: pip install -e '.[clients]'",
    ),
]
HOME = Home()
SPEED = 4.0
# MAVProxy takes a millisecond of the wall clock per message, and loses what it has no time for; and a request
# that is lost on the way is repeated by the wall clock, while the vehicle flies on
SLOW = 2.0
SURVEY = Path(__file__).with_name("survey.plan")
FLOWN = [
    "Cable taut, lifting the load",
    "Mission complete, holding",
    "Load on the ground",
    "Landed, disarmed",
]
FAILSAFE = m.PLUMBLINE_PHASE_FAILSAFE
ARMED = "Got COMMAND_ACK: COMPONENT_ARM_DISARM: ACCEPTED"
# A text is sent once, and a busy MAVProxy can miss it; this one it takes from the heartbeats.
DISARMED = "DISARMED"


@pytest.mark.parametrize(
    "line",
    [
        "[05:28:07|Warn ] Timeout: retries exceeded (mavlink_mission_transfer_client.cpp:624)",
        "[05:28:07|Error] Rejecting tune, too short",
        "WARNING:dronekit:Link timeout, no heartbeat in last 5 seconds",
        "Got COMMAND_ACK: DO_SET_MODE: TEMPORARILY_REJECTED",
        "Got MISSION_ACK: TYPE_MISSION: UNSUPPORTED",
        "fence breach",
        "AP: Mission denied while the load is lifted",
    ],
)
def test_what_counts_as_a_complaint(line: str) -> None:
    asked_again = (
        "[03:53:43|Warn ] sending again, retries to do: 5  (MIS_SPEED). (mavlink_parameter_client.cpp:1238)"
    )
    assert complaints(f"all well\n{asked_again}\n{line}\n") == [line]


class Watched(NamedTuple):
    """A flight by MAVSDK while two ground stations watch, one of which vanishes on the way."""

    told: Told
    stays: str  # output of the ground station that stays
    vanishes: str
    witness: Witness
    killed: float  # wall clock, s
    over: float
    log: bytes


@staged
def mavsdk_and_two_ground_stations(stage: Stage) -> Watched:
    stage.begin("--set", "MAV_LOAD_SYS_ID=2", "--set", "MAV_PARAM_INT=1", speed=SLOW)
    stays = stage.mavproxy(f"udpin:{LOOPBACK}:{stage.gcs}")
    vanishes = stage.mavproxy(f"tcp:{LOOPBACK}:{stage.tcp}")
    for program in (stays, vanishes):
        program.expect("parameters (ftp)")
    steps = (
        "ready",
        "telemetry_seen",
        "parameters",
        "missions",
        "fences",
        "arm",
        "disarm",
        "upload",
        "take_off",
    )
    more = (
        "dated",
        "go_to",
        "fly_mission",
        "upload_and_fly",
        "offboard",
        "go_away",
        "come_back",
        "gripper",
        "log",
    )
    finished = stage.program("mavsdk_flight.py", f"udpin://{LOOPBACK}:{stage.api}", *steps, *more)
    stage.wait_for("Cable taut, lifting the load")
    vanishes.type("wp list")
    said = vanishes.end()
    killed = time.monotonic()
    told = finished()
    (log,) = (stage.storage / "card" / "log").glob("*.ulg")
    return Watched(told, stays.end(), said, stage.witness, killed, time.monotonic(), log.read_bytes())


def test_mavsdk_flies(mavsdk_and_two_ground_stations: Callable[[], Watched]) -> None:
    flight = mavsdk_and_two_ground_stations()
    told = flight.told.value
    assert complaints(flight.told.output) == []
    assert told["version"] == [1, 15]
    assert told["parameters"] == {"real": True, "whole": True}
    assert told["progress"] == [0, 1, 2, 3]
    # texts about a busy machine do not concern the client
    busy = ("Machine busy", "Mission begins when its paths are prepared")
    texts = [text for text in told["texts"] if not text.startswith(busy)]
    once, complete, *landed = FLOWN
    assert texts == [once, complete, complete, *landed, "Load released", "Load taken"]
    assert "again" not in told
    # all else is flown at 2.5 m and below; the return at the height that was set
    assert max(place[2] for _, place in flight.witness.load) == pytest.approx(3.0, abs=0.05)
    result, size, path, name = told["log"]
    assert (result, size) == ("SUCCESS", len(flight.log))
    assert Path(path).read_bytes() == flight.log
    assert name.endswith(".ulg")


def test_a_ground_station_that_vanishes_disturbs_nobody(
    mavsdk_and_two_ground_stations: Callable[[], Watched],
) -> None:
    flight = mavsdk_and_two_ground_stations()
    assert complaints(flight.stays) == complaints(flight.vanishes) == []
    assert "COMMAND_ACK" not in flight.stays, "an answer to somebody else"
    assert DISARMED in flight.stays.partition("TAKEOFF>")[2]
    assert [text for text in flight.witness.texts if complaints(text)] == []
    assert FAILSAFE not in flight.witness.phases
    # measured 3.5 mm, with motion capture
    assert flight.witness.worst_error() < 0.015
    of_wall, of_vehicle = flight.witness.longest_silence(flight.killed - 5.0, flight.over)
    assert of_vehicle < 0.1, "ATTITUDE comes 25 times in a second of the vehicle's clock"
    # a busy machine delays all, measured 1.0 s; a wait for the vanished station would last for ever
    assert of_wall < 5.0


@staged
def mavsdk_turns_and_winches(stage: Stage) -> tuple[Told, Witness]:
    stage.begin(speed=SPEED)
    steps = ("ready", "take_off", "winch", "yaw", "accelerate", "body_rates", "follow", "come_back")
    finished = stage.program("mavsdk_flight.py", f"udpin://{LOOPBACK}:{stage.api}", *steps)
    return finished(), stage.witness


def test_mavsdk_turns_the_nose_works_the_winch_and_leads_the_load(
    mavsdk_turns_and_winches: Callable[[], tuple[Told, Witness]],
) -> None:
    told, witness = mavsdk_turns_and_winches()
    # the last output of the plug-in is about an action that no winch here performs
    assert [line for line in complaints(told.output) if "action (param2) 4 is not offered" not in line] == []
    assert "UNSUPPORTED" in told.value["deliver"]
    assert {1, m.MAV_COMP_ID_WINCH} <= set(told.value["components"])
    assert FAILSAFE not in witness.phases


@staged
def mavsdk_over_a_bad_link(stage: Stage) -> tuple[Told, Witness]:
    stage.begin("--set", "SIM_LOSS_PCT=30", speed=SLOW)
    steps = ("ready", "upload", "arm", "fly_mission", "land")
    finished = stage.program("mavsdk_flight.py", f"udpin://{LOOPBACK}:{stage.api}", *steps)
    return finished(), stage.witness


def test_mavsdk_flies_a_mission_over_a_link_that_loses_a_third(
    mavsdk_over_a_bad_link: Callable[[], tuple[Told, Witness]],
) -> None:
    told, witness = mavsdk_over_a_bad_link()
    # an item of two seconds is reported by three messages, all of which are lost in one flight of forty
    assert {0, 3} <= set(told.value["progress"]) <= {0, 1, 2, 3}
    assert FAILSAFE not in witness.phases
    # MAVSDK's complaints about lost messages are true; there may be no others
    about_loss = ("timeout", "timed out", "retry", "retries", "resend", "lost")
    other = [line for line in complaints(told.output) if not any(word in line.lower() for word in about_loss)]
    assert other == []


class Surveyed(NamedTuple):
    """A survey of QGroundControl, flown by `gcs`."""

    uploaded: str
    kept: str
    down: dict[str, Any]
    items: list[dict[str, Any]]
    witness: Witness


def _fly_by_hand(program: Mavproxy, directory: Path) -> None:
    program.expect("parameters (ftp)")
    program.insist("param set MIS_SPEED 1.25\nparam fetch MIS_SPEED", "MIS_SPEED = 1.25")
    # home row, then items, as `wp save` writes them
    rows = [
        "QGC WPL 110",
        "0\t1\t0\t16\t0\t0\t0\t0\t47.397742\t8.545594\t0\t1",
        "1\t0\t3\t22\t0\t0\t0\t0\t47.397742\t8.545594\t1.5\t1",
        "2\t0\t3\t16\t0\t0\t0\t0\t47.397750\t8.545594\t1.5\t1",
        "3\t0\t3\t21\t0\t0\t0\t0\t47.397750\t8.545594\t0\t1",
    ]
    (directory / "mission.txt").write_text("\n".join(rows) + "\n")
    program.type(f"wp load {directory / 'mission.txt'}")
    program.expect("Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
    program.insist("wp list", "Requesting 4 waypoints")
    program.type("param set MIS_SPEED 1.5")


@staged
def mavproxy_by_hand(stage: Stage) -> str:
    stage.begin(speed=SLOW)
    program = stage.mavproxy(f"udpin:{LOOPBACK}:{stage.gcs}")
    _fly_by_hand(program, stage.directory)
    program.insist("long DO_SET_MODE 129 4 4", "MISSION>")
    program.insist("arm throttle", ARMED)
    stage.wait_for("Cable taut, lifting the load")
    program.insist("setyaw 0 30 0", "Got COMMAND_ACK: CONDITION_YAW: ACCEPTED")
    program.expect(DISARMED)
    program.insist("ftp list /fs/microsd/log", ".ulg")
    program.insist("log list", "numLogs 1")
    program.type("log download 0 flown.ulg")
    program.expect("Finished downloading flown.ulg")
    return program.end()


def test_mavproxy_flies(mavproxy_by_hand: Callable[[], str]) -> None:
    assert complaints(mavproxy_by_hand()) == []


@staged
def survey(stage: Stage) -> Surveyed:
    stage.begin(speed=SPEED)
    up = stage.run_gcs("upload", str(SURVEY))
    assert up.returncode == 0, up.stderr
    for command in ("start", "arm"):
        done = stage.run_gcs(command)
        assert done.returncode == 0, done.stderr
    stage.wait_for("Landed, disarmed")
    plan = stage.directory / "back.plan"
    for what in (("download", str(plan)), ("download", "--json")):
        done = stage.run_gcs(*what)
        assert done.returncode == 0, done.stderr
    items = json.loads(done.stdout)
    back = json.loads(plan.read_text())
    return Surveyed(up.stdout, up.stderr, back, items, stage.witness)


def _simple_items(plan: dict[str, Any]) -> list[dict[str, Any]]:
    found = []
    for item in plan["mission"]["items"]:
        found += item["TransectStyleComplexItem"]["Items"] if item["type"] == "ComplexItem" else [item]
    return found


def _numbers(values: list[Any]) -> list[float]:
    return [math.nan if value is None else value for value in values]


def test_a_survey_of_qgroundcontrol_is_flown_by_the_load_and_comes_back(
    survey: Callable[[], Surveyed],
) -> None:
    flight, asked = survey(), json.loads(SURVEY.read_text())
    assert "19 items accepted" in flight.uploaded
    (kept,) = flight.kept.splitlines()[-1:]
    assert "DO_SET_CAM_TRIGG_DIST (206): kept on the vehicle but not done" in kept
    assert [text for text in flight.witness.texts if complaints(text)] == []
    assert FAILSAFE not in flight.witness.phases

    wanted = _simple_items(asked)
    places = [_place(item["params"]) for item in wanted if item["command"] == 16]
    assert len(places) == 12
    # the load rests at the first and the last and passes the others; measured 2 mm with motion capture
    assert max(map(flight.witness.nearest, places)) < 0.01

    back = _simple_items(flight.down)
    for ours, theirs in zip(wanted, back, strict=True):
        assert (ours["command"], ours["frame"]) == (theirs["command"], theirs["frame"])
        assert _numbers(theirs["params"]) == pytest.approx(_numbers(ours["params"]), abs=6e-8, nan_ok=True)
    for area, kinds in (("geoFence", ("polygons", "circles")), ("rallyPoints", ("points",))):
        for kind in kinds:
            assert _flat(flight.down[area][kind]) == pytest.approx(_flat(asked[area][kind]), abs=6e-8)


def _place(params: list[float]) -> Place:
    east, north, _ = enu_from_geodetic(round(params[4] * 1e7), round(params[5] * 1e7), 0, HOME)
    return (east, north, params[6])


def _flat(value: Any) -> list[float]:
    """All numbers of a JSON value, in the order of its keys."""
    if isinstance(value, dict):
        return [number for _, inner in sorted(value.items()) for number in _flat(inner)]
    if isinstance(value, list):
        return [number for inner in value for number in _flat(inner)]
    return [float(value)]


def _load_a_loop(program: Mavproxy, directory: Path, *first: str) -> None:
    """Load a mission of three waypoints that begins anew after its end."""
    rows = ["QGC WPL 110", "0\t1\t0\t16\t0\t0\t0\t0\t47.397742\t8.545594\t0\t1", *first]
    for north in (47.397746, 47.397750, 47.397748):
        rows.append(f"{len(rows) - 1}\t0\t3\t16\t0\t0\t0\t0\t{north}\t8.545594\t1.5\t1")
    (directory / "loop.txt").write_text("\n".join(rows) + "\n")
    program.type(f"wp load {directory / 'loop.txt'}")
    program.expect("Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
    program.type("wp loop")
    program.expect("Closed loop on mission")
    # an acknowledgement may still be one of the first upload, or be missed: the mission is read back
    program.expect(f"Loaded {len(rows)} waypoints in")
    program.insist("wp list", f"Requesting {len(rows)} waypoints")


def _ask_for_home_and_the_fence(program: Mavproxy) -> None:
    """MAVProxy does not print that it receives home: see `acknowledged`."""
    program.type("gethome")
    program.insist("param set GF_MAX_HOR_DIST 50", "fence present")
    for command, said in (("disable", "fence disabled"), ("enable", "fence enabled")):
        program.insist(f"fence {command}", said)


def _ahead_m(stage: Stage) -> float:
    """How far along the nose the load is."""
    east, north, _ = stage.witness.load[-1][1]
    return east * math.sin(stage.witness.yaw) + north * math.cos(stage.witness.yaw)


def _push_forward(stage: Stage, program: Mavproxy) -> None:
    """Repeat `velocity`, as often as setpoints must come, until the load has followed along the nose."""
    begin_m = _ahead_m(stage)

    def moved() -> bool:
        program.type("velocity 0.4 0 0")
        return _ahead_m(stage) > begin_m + 0.4

    stage.wait_until(moved)


def _pull_back(stage: Stage, program: Mavproxy) -> None:
    """Hold the stick back with `rc`, which repeats the channels, until the load has followed; let it go."""
    begin_m = _ahead_m(stage)
    program.type("rc set override_hz 50")
    program.type("rc 2 1800")
    program.insist("mode POSHOLD", "POSHOLD>")
    stage.wait_until(lambda: _ahead_m(stage) < begin_m - 0.4)
    program.type("rc clear")


def acknowledged(program: Mavproxy, command: int) -> list[int]:
    """The results of a command, according to MAVProxy's log."""
    heard = (received for _, received in read_tlog(program.directory / "mav.tlog"))
    acks = [one.message for one in heard if one.id == m.MAVLINK_MSG_ID_COMMAND_ACK]
    return [ack.result for ack in acks if ack.command == command]


class Looped(NamedTuple):
    """A flight by MAVProxy: a mission without end, then by `velocity`."""

    mavproxy: str
    home: list[int]
    witness: Witness


@staged
def mavproxy_in_a_loop(stage: Stage) -> Looped:
    stage.begin(speed=SLOW)
    program = stage.mavproxy(f"udpin:{LOOPBACK}:{stage.gcs}")
    program.expect("parameters (ftp)")
    _ask_for_home_and_the_fence(program)
    _load_a_loop(program, stage.directory, "1\t0\t3\t22\t0\t0\t0\t0\t47.397742\t8.545594\t1.5\t1")
    program.insist("long DO_SET_MODE 129 4 4", "MISSION>")
    program.insist("arm throttle", ARMED)
    for item in (4, 2, 3):
        program.expect(f"waypoint {item}")
    for _ in range(3):
        program.type("velocity 0 0 0")
    program.type("long DO_SET_MODE 129 6")
    stage.wait_until(lambda: stage.witness.phases[-1] == m.PLUMBLINE_PHASE_GUIDED)
    _push_forward(stage, program)
    program.type("long DO_SET_MODE 129 4 5")
    program.expect(DISARMED)
    return Looped(program.end(), acknowledged(program, m.MAV_CMD_GET_HOME_POSITION), stage.witness)


def test_mavproxy_flies_a_loop_and_by_velocity(mavproxy_in_a_loop: Callable[[], Looped]) -> None:
    flight = mavproxy_in_a_loop()
    assert complaints(flight.mavproxy) == []
    assert flight.home == [m.MAV_RESULT_ACCEPTED]
    assert FAILSAFE not in flight.witness.phases
    assert [text for text in flight.witness.texts if complaints(text)] == []


class Ardupilot(NamedTuple):
    """DroneKit, and after it MAVProxy, with a vehicle that reports to be an ArduPilot."""

    dronekit: Told
    mavproxy: str
    home: list[int]
    witness: Witness


@staged
def clients_of_ardupilot(stage: Stage) -> Ardupilot:
    stage.begin("--set", "MAV_IDENTITY=1", speed=SLOW)
    dronekit = stage.program("dronekit_flight.py", f"tcp:{LOOPBACK}:{stage.tcp}", "ardupilot")()
    program = stage.mavproxy(f"udpin:{LOOPBACK}:{stage.gcs}")
    program.expect("parameters (ftp)")
    _ask_for_home_and_the_fence(program)
    _load_a_loop(program, stage.directory)
    for name in ("GUIDED", "LOITER", "GUIDED"):
        program.insist(f"mode {name}", f"{name}>")
    program.insist("arm throttle", ARMED)
    program.type("takeoff 1.5")
    program.expect("Got COMMAND_ACK: NAV_TAKEOFF: ACCEPTED")
    stage.wait_until(lambda: stage.witness.phases[-1] == m.PLUMBLINE_PHASE_HOLD)
    program.insist("setyaw 0 30 0", "Got COMMAND_ACK: CONDITION_YAW: ACCEPTED")
    stage.wait_until(lambda: abs(stage.witness.yaw) < 0.05)
    program.insist("mode AUTO", "AUTO>")
    for item in (3, 1, 2):
        program.expect(f"waypoint {item}")
    program.insist("mode LOITER", "LOITER>")
    program.insist("mode GUIDED", "GUIDED>")
    _push_forward(stage, program)
    _pull_back(stage, program)
    program.insist("mode GUIDED", "GUIDED>")
    program.type("guided 47.397745 8.545594 1.5")
    program.insist("mode RTL", "RTL>")
    program.expect(DISARMED)
    said = program.end()
    return Ardupilot(dronekit, said, acknowledged(program, m.MAV_CMD_GET_HOME_POSITION), stage.witness)


def test_dronekit_flies_an_ardupilot(clients_of_ardupilot: Callable[[], Ardupilot]) -> None:
    flight = clients_of_ardupilot()
    assert complaints(flight.dronekit.output) == []
    assert flight.dronekit.value["gps"] == 3
    assert flight.dronekit.value["at first"] == 0
    assert flight.dronekit.value["commands"] == 2


def test_mavproxy_flies_an_ardupilot_by_the_names_of_its_modes(
    clients_of_ardupilot: Callable[[], Ardupilot],
) -> None:
    flight = clients_of_ardupilot()
    assert complaints(flight.mavproxy) == []
    assert flight.home == [m.MAV_RESULT_ACCEPTED]
    assert FAILSAFE not in flight.witness.phases


@staged
def scripts(stage: Stage) -> tuple[Told, Told, Witness]:
    stage.begin(speed=SPEED)
    told = stage.program("pymavlink_flight.py", f"udpin:{LOOPBACK}:{stage.gcs}")()
    return told, stage.program("dronekit_flight.py", f"tcp:{LOOPBACK}:{stage.tcp}", "px4")(), stage.witness


def test_dronekit_flies_a_px4(scripts: Callable[[], tuple[Told, Told, Witness]]) -> None:
    _, told, witness = scripts()
    assert complaints(told.output) == []
    assert told.value["gps"] == 3
    assert FAILSAFE not in witness.phases


def test_a_script_with_pymavlink_flies(scripts: Callable[[], tuple[Told, Told, Witness]]) -> None:
    told, _, witness = scripts()
    assert complaints(told.output) == []
    assert told.value["accepted"] == [0, 0, 0]
    assert told.value["equal"] == [True, True, True]
    assert (told.value["real"], told.value["whole"]) == (1.25, 1.0)
    assert {"OFFBOARD", "LOITER", "MISSION", "RTL"} <= set(told.value["modes"])
    assert told.value["logs"][0] == 1
    assert FAILSAFE not in witness.phases
