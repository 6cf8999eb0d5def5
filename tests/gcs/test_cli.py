"""The command line: help and documentation of every command, one line and the right code for any error."""

from __future__ import annotations

import json
import math
import os
import shlex
import shutil
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

import plumbline
from autopilot.vehicle.parameters import definitions as autopilot_definitions
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import encode_steps
from autopilot.wire.tlog import read_tlog
from gcs.cli import COMMANDS, gcs
from gcs.clients import command as command_module
from gcs.errors import EXIT_DONE, EXIT_ERROR, EXIT_INTERRUPTED, EXIT_NOT_MET, EXIT_USAGE, GcsError
from gcs.folders import LOCK_FILE, SUMMARY_FILE, TLOG_FILE, reserved
from gcs.formats.missions import write_foreign
from gcs.shell import session as session_module
from gcs.shell.link import UdpSocket, free_port
from gcs.workflows import readiness as readiness_module
from gcs.workflows import status as status_module
from gcs.workflows import view as view_module
from gcs.workflows.recorded_mission import same_items
from missions.model import Land, Signals, Sine, Takeoff, Term, Waypoint
from sitl.vehicles.sim_parameters import definitions as sim_definitions

ROOT = Path(__file__).resolve().parents[2]


def run(*arguments):
    return CliRunner().invoke(gcs, list(arguments), prog_name="gcs")


def commands():
    """Every command by its words, groups included."""
    context = click.Context(gcs, info_name="gcs")
    for name in gcs.list_commands(context):
        command = gcs.get_command(context, name)
        assert command is not None
        yield (name,), command
        if isinstance(command, click.Group):
            for sub, subcommand in command.commands.items():
                yield (name, sub), subcommand


@pytest.fixture(autouse=True)
def nothing_left_to_compile(monkeypatch):
    """Messages about compiling are tested in test_warmup."""
    monkeypatch.setattr("gcs.workflows.fly.flight_parts", lambda laws: [])
    monkeypatch.setattr("gcs.workflows.in_process_flight.in_process_parts", lambda laws: [])


def one_line(result, code):
    """The error's line, which must be the only output."""
    assert result.exit_code == code, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("gcs: ")
    return lines[0]


# ---- help and documentation


@pytest.mark.parametrize(("words", "command"), list(commands()), ids=lambda value: str(value)[:40])
def test_every_command_has_help_and_stands_in_the_documentation(words, command):
    result = run(*words, "--help")
    assert result.exit_code == EXIT_DONE
    assert command.help and command.help.strip()
    assert all(option.help for option in command.params if isinstance(option, click.Option))
    text = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    if not isinstance(command, click.Group):
        assert f"\ngcs {' '.join(words)}" in text, "an example of it in docs/cli.md"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_summary_is_the_first_line_of_the_help(name):
    command = gcs.get_command(click.Context(gcs), name)
    assert command is not None and command.help is not None
    assert command.help.splitlines()[0] == COMMANDS[name][1]


def test_all_commands_are_listed():
    output = run("--help").stdout
    assert all(f"  {name} " in output for name in COMMANDS)


def test_a_shell_can_complete_words(monkeypatch):
    words = {"_GCS_COMPLETE": "bash_complete", "COMP_WORDS": "gcs sta", "COMP_CWORD": "1"}
    assert "_GCS_COMPLETE=bash_source gcs" in (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")

    def completed(line):
        env = {**words, "COMP_WORDS": f"gcs {line}", "COMP_CWORD": str(len(line.split()))}
        return CliRunner().invoke(gcs, [], prog_name="gcs", env=env).stdout.split()

    assert completed("sta") == ["plain,status", "plain,start"]
    for line, found in (
        ("fly case-b", ["plain,case-b", "plain,case-b-extended"]),
        ("check deli", ["plain,delivery"]),
        ("fly hover --vehicle heavy-", ["plain,heavy-real"]),
        ("sweep hover --sensors lab-r", ["plain,lab-real"]),
        ("fly hover --law th", ["plain,thesis"]),
    ):
        assert completed(line) == [*found, f"file,{line.split()[-1]}"]
    for line, found in (
        ("fly hover --set SIM_WIND", ["SIM_WIND_E=", "SIM_WIND_N=", "SIM_WIND_U="]),
        ("check hover --set mis_rotor", ["MIS_ROTOR_MARG="]),
        ("sweep hover --vary PLB_DELAY", ["PLB_DELAY_TOL="]),
        ("param get VEH_CABLE", ["VEH_CABLE_LEN"]),
        ("param set FS_LOAD_E", ["FS_LOAD_ERR"]),
        ("param list FS_LOAD_E", ["FS_LOAD_ERR"]),
    ):
        assert completed(line) == [f"plain,{name}" for name in found]


def test_every_parameter_can_be_completed_and_without_what_takes_long_to_load():
    known = {*autopilot_definitions().parameters, *sim_definitions().parameters}
    program = """import sys
from gcs.commands.parameter_completion import complete_names
print(*(item.value for item in complete_names(None, None, "")))
print(*{name.partition(".")[0] for name in sys.modules})"""
    told = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout
    names, modules = map(str.split, told.splitlines())
    assert set(names) == known and len(names) == len(known)
    assert not set(modules) & {"numpy", "numba", "pydantic", "pymavlink"}


def test_bash_writes_no_space_behind_a_name_that_a_value_follows():
    source = CliRunner().invoke(gcs, [], prog_name="gcs", env={"_GCS_COMPLETE": "bash_source"}).stdout
    # bash calls doubles: of the program, and of `compopt`, which works only while a word is completed
    doubles = 'compopt() { echo "$@"; }; env() { echo "plain,$1"; }'
    source = source.replace("env COMP_WORDS=", "env $0 COMP_WORDS=")
    script = f'{source}\n{doubles}\n_gcs_completion gcs; echo "${{COMPREPLY[@]}}"'
    for answer, told in (("SIM_WIND_E=", ["-o nospace", "SIM_WIND_E="]), ("status", ["status"])):
        called = subprocess.run(["bash", "-c", script, answer], capture_output=True, text=True, check=True)
        assert called.stdout.splitlines() == told


def test_help_needs_nothing_but_click():
    """The user waits for every module that is loaded before help is shown."""
    program = "import sys, gcs.cli\nprint(*sorted({name.partition('.')[0] for name in sys.modules}))"
    told = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    found = {name for name in told.stdout.split() if name not in sys.stdlib_module_names}
    ours = {name for name in found if (ROOT / name).is_dir()}
    assert ours == {"gcs", "missions"}
    assert not found & {"numpy", "numba", "scipy", "pydantic", "pymavlink", "rich", "pyarrow", "matplotlib"}


def test_version():
    assert run("--version").stdout.startswith("gcs, version ")


# ---- wrong usage


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["fly"], "MISSION"),
        (["flyy"], "flyy"),
        (["fly", "hover", "--sped", "1"], "--sped"),
        (["fly", "hover", "--seed", "-1"], "--seed"),
        (["fly", "hover", "--seed", "one"], "--seed"),
        (["fly", "hover", "--speed", "0"], "--speed"),
        (["fly", "hover", "--speed", "nan"], "--speed"),
        (["fly", "hover", "--lockstep", "--speed", "1"], "exclude each other"),
        (["fly", "hover", "--set", "SIM_WIND_E"], "NAME=VALUE"),
        (["fly", "hover", "--set", "SIM_WIND_E=much"], "must be a number"),
        (["fly", "hover", "--set", "SIM_WIND_E=nan"], "finite"),
        (["fly", "hover", "--set", "=3"], "NAME=VALUE"),
        (["fly", "hover", "--connect", "14550", "--seed", "3"], "--seed is for processes"),
        (["fly", "hover", "--connect", "14550", "--set", "SIM_WIND_E=3"], "--set is for processes"),
        (["fly", "hover", "--log-sensors", "--connect"], "--log-sensors and --connect exclude each other"),
        (["fly", "--connect", "hover"], "must be PORT, HOST:PORT"),
        (["fly", "hover", "--timeout", "0"], "--timeout"),
        (["mode", "backflip"], "hold"),
        (["takeoff", "--altitude", "-2"], "--altitude"),
        (["takeoff", "-1"], "'-1'; must be a number > 0"),
        (["param", "set", "NGC_KX", "nan"], "finite"),
        (["param", "set", "NGC_KX", "x"], "must be a finite number"),
        (["param", "get"], "NAMES"),
        (["status", "--connect", "99999"], "1 ... 65535"),
        (["status", "--sysid", "0"], "1<=x<=255"),
        (["fly", "hover", "--sysid", "2"], "--sysid is that of a running vehicle: add --connect"),
        (["capture", "--duration", "0"], "--duration"),
    ],
)
def test_wrong_usage_is_one_line_and_code_2(arguments, part):
    line = one_line(run(*arguments), EXIT_USAGE)
    assert part in line
    assert "--help" in line


def test_a_law_that_there_is_not_is_one_line_with_those_that_there_are():
    line = one_line(run("fly", "hover", "--law", "magic"), EXIT_USAGE)
    assert "must be thesis, lqr, plumbline, or a file as my_law.py:MyLaw" in line


# ---- known errors


@pytest.mark.parametrize("command", ["fly", "check", "upload"])
def test_an_unknown_mission_is_wrong_usage_and_the_nearest_is_named(command):
    line = one_line(run(command, "case-z"), EXIT_USAGE)
    assert line.startswith("gcs: unknown mission 'case-z'; did you mean case-c? shipped: case-a, case-b,")


def test_what_holds_no_telemetry_makes_no_report(tmp_path):
    source = tmp_path / "flight.parquet"
    source.write_bytes(b"PAR1" + bytes(range(256)) * 50)
    assert "holds no telemetry" in one_line(run("report", str(source)), EXIT_USAGE)
    assert [path.name for path in tmp_path.iterdir()] == ["flight.parquet"]
    onboard = tmp_path / "flight.ulg"
    onboard.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(100))
    line = one_line(run("report", str(onboard)), EXIT_USAGE)
    assert "is a ULog, which holds no telemetry; must be a .tlog" in line
    (tmp_path / "flight.tlog").touch()
    line = one_line(run("report", str(onboard)), EXIT_USAGE)
    assert line.endswith(f"is a ULog, which holds no telemetry; give {tmp_path / 'flight.tlog'}")


def test_no_flight_is_reported_of_a_folder_of_a_sweep(tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text("{}")
    for words in (("report", str(tmp_path)), ("compare", str(tmp_path), str(tmp_path))):
        text = one_line(run(*words), EXIT_USAGE)
        assert "holds a sweep, which keeps no telemetry" in text
        assert f"gcs sweep --reports repeats those that stand out in {tmp_path / 'flights'}" in text


def test_a_height_is_given_either_way_and_once():
    assert "give one" in one_line(run("takeoff", "5", "--altitude", "5"), EXIT_USAGE)


@pytest.mark.parametrize("command", ["fly", "check", "upload", "sweep"])
@pytest.mark.parametrize(
    ("mission", "part"),
    [
        ("nowhere/x.toml", "nowhere/x.toml: no such file"),
        ("nowhere.txt", "nowhere.txt: no such file"),
        ("case-z.toml", "case-z.toml: no such file; did you mean the shipped case-c?"),
        ("folder", "folder: is a folder; must be a file"),
        ("folder/", "folder/: is a folder; must be a file"),
        ("bad.toml", "items[0].altitude_m"),
        ("torn.toml", "not TOML"),
        ("nan.toml", "finite"),
        ("deep.toml", "nested too deeply"),
        ("long.toml", "long.toml: a number has too many digits"),
        ("pipe.toml", "a device or a pipe"),
        ("/dev/zero", "a device or a pipe"),
    ],
)
def test_a_bad_mission_is_one_line_and_code_2(tmp_path, monkeypatch, command, mission, part):
    monkeypatch.chdir(tmp_path)
    text = (
        'title = "t"\ndescription = "d"\n'
        '[[items]]\ntype = "takeoff"\naltitude_m = {}\n[[items]]\ntype = "land"\n'
    )
    Path("folder").mkdir()
    Path("bad.toml").write_text(text.format(-2.0))
    Path("nan.toml").write_text(text.format("nan"))
    Path("torn.toml").write_text("[[items")
    Path("long.toml").write_text("a = " + "9" * 5000)
    Path("deep.toml").write_text("a = " + "[" * 5000 + "]" * 5000)
    os.mkfifo("pipe.toml")
    before = sorted(tmp_path.iterdir())
    assert part in one_line(run(command, mission), EXIT_USAGE)
    assert sorted(tmp_path.iterdir()) == before, "nothing is left behind"


def test_what_four_rotors_cannot_fly_is_refused_with_limit_and_excess(tmp_path):
    mission = tmp_path / "wild.toml"
    mission.write_text(
        'title = "t"\ndescription = "d"\nassumptions = []\n'
        '[[items]]\ntype = "takeoff"\naltitude_m = 8.0\n'
        '[[items]]\ntype = "signals"\nduration_s = 20.0\n'
        '[[items.terms]]\naxis = "z"\namplitude_m = 3.0\nrise_s = 5.0\nhold_s = 10.0\nfall_s = 5.0\n'
        "[[items.terms.factors]]\nperiod_s = 1.5\n"
        '[[items]]\ntype = "land"\n'
    )
    refused = run("fly", str(mission), "--out", str(tmp_path / "out"), "--quiet")
    assert (refused.exit_code, refused.stdout) == (EXIT_ERROR, "")
    where = f"{mission}:7: items[1] (signals)"
    head = f"gcs: wild cannot be flown by vehicle bebop; --force tries: {where}: at 4.9 s "
    assert refused.stderr.splitlines()[-1].startswith(head)
    assert not (tmp_path / "out").exists()
    told = run("fly", str(mission), "--out", str(tmp_path / "out")).stderr
    assert "cannot be flown" in told and "starting" not in told
    checked = run("check", str(mission))
    assert checked.exit_code == EXIT_ERROR
    assert checked.stdout.strip()


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (None, "no-such.toml"),
        ("quad_mass_kg = [", "not TOML"),
        ('quad_mass_kg = "heavy"', "must be a number"),
    ],
)
def test_a_bad_vehicle_file_is_a_line_for_each_mistake(tmp_path, text, part):
    path = tmp_path / "no-such.toml"
    if text is not None:
        path.write_text(text)
    refused = run("check", "hover", "--vehicle", str(path))
    assert (refused.exit_code, refused.stdout) == (EXIT_USAGE, "")
    lines = refused.stderr.splitlines()
    assert all(line.startswith(f"gcs: {path}") for line in lines)
    assert [line for line in lines if part in line] == lines[:1]


def test_no_vehicle_is_one_line_after_the_stated_time(monkeypatch):
    monkeypatch.setattr(session_module, "FIND_S", 0.1)
    port = free_port()
    line = one_line(run("arm", "--connect", str(port)), EXIT_ERROR)
    assert f"127.0.0.1:{port} within 0.1 s" in line


def test_a_busy_port_is_one_line():
    taken = UdpSocket()
    port = taken.address.rpartition(":")[2]
    line = one_line(run("arm", "--connect", port), EXIT_ERROR)
    taken.close()
    assert f"127.0.0.1:{port} is in use" in line


def test_a_file_that_cannot_be_written_is_told_before_the_report_is_made(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap_protobuf.writer", None)
    line = one_line(run("report", str(tmp_path), "--mcap"), EXIT_ERROR)
    assert line == "gcs: flight.mcap needs more libraries: pip install -e '.[mcap]' in the clone of Plumbline"


def test_a_report_of_nothing_is_one_line(tmp_path):
    assert "flight.tlog" in one_line(run("report", str(tmp_path)), EXIT_USAGE)


def test_an_output_that_cannot_be_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    line = one_line(run("fly", "hover", "--out", str(tmp_path / "file" / "x")), EXIT_USAGE)
    assert "--out" in line


# ---- missions without a vehicle


def test_shipped_missions_are_listed():
    names = {"case-a", "case-b", "case-b-extended", "case-c", "hover", "square"}
    assert names <= {line.split()[0] for line in run("missions").stdout.splitlines()}
    listed = json.loads(run("missions", "--json").stdout)
    assert names <= {mission["name"] for mission in listed}
    assert all(mission["title"] and mission["description"] for mission in listed)


def test_check_says_that_it_can_be_flown():
    result = run("check", "square", "--json")
    assert result.exit_code == EXIT_DONE
    told = json.loads(result.stdout)
    ways = [(path.pop("item"), path.pop("kind")) for path in told["paths"]]
    assert ways == [(0, "takeoff"), *((item, "waypoint") for item in (2, 3, 4, 5))]
    assert all(
        0.9 < path["tension_low_n"] < 1.0 and 3.0 < path["duration_s"] < 10.0 for path in told.pop("paths")
    )
    assert 52.0 < told.pop("expected_s") < 67.0  # it takes 55 s
    assert told.pop("time_limit_s") > 138.0
    assert 14.0 < told.pop("wind_limit_m_s") < 15.0
    assert told.pop("wind_reason") == (
        "vehicle and load are blown along the ground at more than 0.3 m/s, and not armed"
    )
    assert told.pop("battery_left_pct") is None
    assert told == {"mission": "square", "vehicle": "bebop", "violations": [], "warnings": [], "refusals": []}


def test_check_tells_how_signals_will_be_flown():
    told = json.loads(run("check", "case-a", "--json").stdout)
    lift, path = told["paths"]
    assert (lift["kind"], path["item"], path["kind"]) == ("takeoff", 2, "signals")
    # measured 11.3 mm and 0.86 ... 1.37 N
    assert 0.001 < path["distance_m"] < 0.013
    assert 0.8 < path["rotor_low_n"] < path["rotor_high_n"] < 1.45


def test_check_refuses_a_load_dragged_along_the_ground(tmp_path):
    file = tmp_path / "low.toml"
    file.write_text(
        'title = "Low"\n[[items]]\ntype = "takeoff"\naltitude_m = 0.01\n[[items]]\ntype = "land"\n'
    )
    result = run("check", str(file))
    assert result.exit_code == EXIT_ERROR
    assert "0.01 m above the ground" in result.stdout


# ---- a running vehicle


def test_single_commands(live):
    vehicle, port = live
    assert run("arm", "--connect", port).stdout == "arm: accepted\n"
    assert vehicle.armed
    for words in (["takeoff", "--altitude", "2"], ["pause"], ["resume"], ["land"], ["mode", "hold"]):
        result = run(*words, "--connect", port)
        assert (result.exit_code, result.stderr) == (EXIT_DONE, ""), result.output
    by_command = {message.command: message for message in vehicle.commands}
    assert by_command[mavlink.MAV_CMD_NAV_TAKEOFF].param7 == 2.0
    assert run("takeoff", "3", "--connect", port).exit_code == EXIT_DONE
    by_command = {message.command: message for message in vehicle.commands}
    assert by_command[mavlink.MAV_CMD_NAV_TAKEOFF].param7 == 3.0
    mode = by_command[mavlink.MAV_CMD_DO_SET_MODE]
    assert (mode.param1, mode.param2, mode.param3) == (129.0, 4.0, 3.0)
    assert run("winch", "-0.25", "--speed", "0.5", "--connect", port).stdout == "winch: accepted\n"
    winch = vehicle.commands[-1]
    assert (winch.command, winch.param2, winch.param3, winch.param4) == (42600, 1.0, -0.25, 0.5)
    for name, action in (("release", 0.0), ("grab", 1.0)):
        assert run(name, "--connect", port).stdout == f"{name}: accepted\n"
        gripper = vehicle.commands[-1]
        assert (gripper.command, gripper.param1, gripper.param2) == (211, 1.0, action)
    assert run("disarm", "--connect", port).exit_code == EXIT_DONE
    assert not vehicle.armed


def test_a_single_command_is_preceded_by_a_heartbeat(live):
    """The vehicle watches for the loss of a ground station only after it has heard its HEARTBEAT."""
    vehicle, port = live
    heard = []
    vehicle.on_heartbeat = lambda message: heard.append((message.type, len(vehicle.commands)))
    assert run("arm", "--connect", port).stdout == "arm: accepted\n"
    assert heard == [(mavlink.MAV_TYPE_GCS, 0)]


def test_a_vehicle_is_chosen_by_its_system_id(live, monkeypatch):
    vehicle, port = live
    assert run("arm", "--sysid", "1", "--connect", port).stdout == "arm: accepted\n"
    monkeypatch.setattr(session_module, "FIND_S", 1.5)  # its heartbeat comes once a second
    line = one_line(run("disarm", "--connect", port, "--sysid", "3"), EXIT_ERROR)
    assert "no vehicle with system id 3 heard on UDP" in line
    assert "heard there: 1" in line
    assert vehicle.armed


@pytest.mark.parametrize("words", [["resume"], ["mode", "auto"], ["mode", "takeoff"], ["start"]])
def test_what_begins_when_the_vehicle_is_armed_says_so(live, words):
    _, port = live
    result = run(*words, "--connect", port)
    assert result.stdout.endswith("accepted; it begins when the vehicle is armed: gcs arm\n"), result.output
    assert run("arm", "--connect", port).exit_code == EXIT_DONE
    assert run(*words, "--connect", port).stdout.endswith(": accepted\n")


def test_a_start_of_a_mission_under_way_says_that_it_begins_again(live):
    vehicle, port = live
    vehicle.armed, vehicle.mission_state = True, mavlink.MISSION_STATE_ACTIVE
    told = "start: accepted; it was under way, and begins again (gcs resume continues a paused mission)\n"
    assert run("start", "--connect", port).stdout == told
    vehicle.mission_state = mavlink.MISSION_STATE_PAUSED
    assert run("start", "--connect", port).stdout == "start: accepted\n"


@pytest.mark.parametrize(("words", "system"), [([], None), (["--sysid", "2"], 2)])
def test_the_page_shows_all_vehicles_or_the_chosen_one(monkeypatch, words, system):
    def station(**options):
        raise GcsError(f"a station for {options['system']}")

    monkeypatch.setattr(view_module, "Station", station)
    told = one_line(run("view", "--connect", str(free_port()), "--no-open", *words), EXIT_ERROR)
    assert told == f"gcs: a station for {system}"


def test_a_vehicle_without_a_mission_has_no_items(live):
    _, port = live
    assert json.loads(run("status", "--json", "--connect", port).stdout)["mission_items"] == 0


def test_a_refusal_is_one_line_with_the_reason(live):
    vehicle, port = live
    original = vehicle.on_command_long

    def refuse(message):
        vehicle.command_results[message.command] = [mavlink.MAV_RESULT_DENIED]
        original(message)
        vehicle.say("Disarming denied: in the air")

    vehicle.on_command_long = refuse
    line = one_line(run("disarm", "--connect", port), EXIT_ERROR)
    assert line == "gcs: Disarming denied: in the air; --force stops the rotors even in the air"
    assert (
        one_line(run("disarm", "--force", "--connect", port), EXIT_ERROR)
        == "gcs: Disarming denied: in the air"
    )


def test_a_vehicle_that_stops_answering_is_one_line(live, monkeypatch):
    vehicle, port = live
    monkeypatch.setattr(command_module, "RETRY_US", 20_000)
    vehicle.silent_commands = {mavlink.MAV_CMD_NAV_LAND}
    assert "no answer after 10 tries" in one_line(run("land", "--connect", port), EXIT_ERROR)


def test_a_mission_goes_up_comes_down_and_is_cleared(live):
    vehicle, port = live
    result = run("upload", "square", "--connect", port)
    assert result.exit_code == EXIT_DONE, result.output
    assert f"{len(vehicle.mission)} items accepted" in result.stdout
    listed = json.loads(run("download", "--json", "--connect", port).stdout)
    assert [item["command"] for item in listed] == [item.command for item in vehicle.mission]
    assert listed[0]["name"] == "NAV_TAKEOFF"
    assert "NAV_LAND" in run("download", "--connect", port).stdout
    assert run("clear", "--connect", port).exit_code == EXIT_DONE
    assert vehicle.mission == []


def plan_of(*items):
    entries = [
        {
            "type": "SimpleItem",
            "autoContinue": True,
            "command": command,
            "doJumpId": i,
            "frame": 3,
            "params": params,
        }
        for i, (command, params) in enumerate(items, start=1)
    ]
    fence = {"version": 2, "circles": [], "polygons": []}
    return {"fileType": "Plan", "version": 1, "mission": {"version": 2, "items": entries}, "geoFence": fence}


@pytest.mark.parametrize("ending", [".plan", ".waypoints"])
def test_a_plan_goes_up_and_comes_down_equal(live, tmp_path, ending):
    vehicle, port = live
    file, back = tmp_path / "in.plan", tmp_path / f"out{ending}"
    place = [0.1, 0, 0, None, 47.397745, 8.5455941, 3.25]
    plan = plan_of(
        (22, [0, 0, 0, None, 47.397742, 8.545594, 2.5]), (16, place), (21, [0, 0, 0, None, 0, 0, 0])
    )
    file.write_text(json.dumps(plan))
    result = run("upload", str(file), "--connect", port)
    assert result.exit_code == EXIT_DONE, result.output
    assert "3 items accepted" in result.stdout
    first = list(vehicle.mission)
    assert "3 items written" in run("download", str(back), "--connect", port).stdout
    if ending == ".plan":
        assert json.loads(back.read_text())["mission"]["items"] == plan["mission"]["items"]
    assert run("upload", str(back), "--connect", port).exit_code == EXIT_DONE
    assert repr(vehicle.mission) == repr(first)


@pytest.mark.parametrize("name", ["square", "case-b", "load-attitude", "delivery", "eight"])
def test_a_mission_comes_down_as_a_file_that_goes_up_again(live, tmp_path, name):
    vehicle, port = live
    file, back = tmp_path / f"{name}.toml", tmp_path / "back.toml"
    if name == "eight":
        turn = np.linspace(0.0, 1.0, 1001)
        phase = 2.0 * np.pi * turn**4 * (35.0 - 84.0 * turn + 70.0 * turn**2 - 20.0 * turn**3)
        rows = np.column_stack([12.0 * turn, np.sin(phase), 0.5 * np.sin(2.0 * phase), 0.0 * turn]).round(4)
        plumbline.Mission(
            name, [plumbline.Takeoff(1.5), plumbline.Trajectory.through(rows), plumbline.Land()]
        ).save(file)
    assert run("upload", str(file) if file.exists() else name, "--connect", port).exit_code == EXIT_DONE
    first = list(vehicle.mission)
    done = run("download", str(back), "--connect", port)
    assert done.exit_code == EXIT_DONE, done.stderr
    assert done.stdout == f"{len(first)} items written to {back}\n"
    assert run("clear", "--connect", port).exit_code == EXIT_DONE
    assert run("upload", str(back), "--connect", port).exit_code == EXIT_DONE
    assert same_items(vehicle.mission, first)


def test_a_mission_that_comes_from_a_plan_is_written_to_a_mission_file(live, tmp_path):
    """Its places are in the frame of whole degrees, 3, where a mission file has 6."""
    vehicle, port = live
    plan, back = tmp_path / "back.plan", tmp_path / "back.toml"
    for words in (("upload", "square"), ("download", str(plan)), ("upload", str(plan))):
        assert run(*words, "--connect", port).exit_code == EXIT_DONE
    assert {item.frame for item in vehicle.mission} >= {3}
    assert run("download", str(back), "--connect", port).exit_code == EXIT_DONE
    first = list(vehicle.mission)
    assert run("upload", str(back), "--connect", port).exit_code == EXIT_DONE
    assert vehicle.mission != first and same_items(vehicle.mission, first)


def test_a_mission_with_items_that_mission_files_do_not_have_is_not_written_to_one(live, tmp_path):
    _, port = live
    file, back = tmp_path / "in.plan", tmp_path / "back.toml"
    plan = plan_of(
        (22, [0, 0, 0, None, 47.397742, 8.545594, 2.5]),
        (115, [90.0, 0, 0, 0, 0, 0, 0]),
        (16, [0, 0, 0, None, 47.397745, 8.5455941, 3.25]),
        (21, [0, 0, 0, None, 0, 0, 0]),
    )
    file.write_text(json.dumps(plan))
    assert run("upload", str(file), "--connect", port).exit_code == EXIT_DONE
    told = one_line(run("download", str(back), "--connect", port), EXIT_ERROR)
    assert "not written: a mission file has no item for a part" in told and "back.plan would hold" in told
    assert not back.exists()


def test_what_of_a_plan_is_not_flown_is_told_and_skipped_only_if_asked(live, tmp_path):
    vehicle, port = live
    file = tmp_path / "in.plan"
    take_off = (22, [0, 0, 0, None, 47.397742, 8.545594, 2.5])
    plan = plan_of(take_off, (84, [2, 0, 0, 0, 47.397745, 8.5455941, 3]), (2000, [0] * 7))
    plan["geoFence"]["circles"] = [
        {"version": 1, "inclusion": True, "circle": {"center": [47.3977, 8.5456], "radius": 9.5}}
    ]
    file.write_text(json.dumps(plan))
    result = run("upload", str(file), "--connect", port)
    assert result.exit_code == EXIT_ERROR
    lines = result.stderr.splitlines()
    assert len(lines) == 3
    assert "IMAGE_START_CAPTURE (2000): kept on the vehicle but not done" in lines[0]
    assert "NAV_VTOL_TAKEOFF (84)" in lines[1]
    assert "--skip" in lines[2]
    assert vehicle.mission == []
    assert vehicle.areas == {}
    result = run("upload", str(file), "--skip", "--connect", port)
    assert result.exit_code == EXIT_DONE
    assert "fence: 1 item accepted" in result.stdout
    assert [item.command for item in vehicle.mission] == [22, 2000]
    assert [item.command for item in vehicle.areas[1]] == [5003]
    back = tmp_path / "back.plan"
    done = run("download", str(back), "--connect", port)
    assert done.stdout == f"2 items, 1 fence item written to {back}\n"
    assert json.loads(back.read_text())["geoFence"] == plan["geoFence"]


@pytest.mark.parametrize("autopilot", [mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA])
def test_a_waypoint_in_the_first_place_is_not_taken_for_the_home(live, tmp_path, autopilot):
    """ArduPilot's item 0 is the home."""
    vehicle, port = live
    vehicle.autopilot = autopilot
    file = tmp_path / "in.plan"
    places = [(16, [0, 0, 0, None, 47.397745 + 1e-5 * k, 8.5455941, 3.25]) for k in range(2)]
    file.write_text(json.dumps(plan_of(*places, (177, [1, 2, 0, 0, 0, 0, 0]))))
    assert run("upload", str(file), "--connect", port).exit_code == EXIT_DONE
    found = [(item.command, item.param1) for item in vehicle.mission]
    if autopilot == mavlink.MAV_AUTOPILOT_PX4:
        assert found == [(16, 0.0), (16, 0.0), (177, 0.0)]
    else:
        assert found == [(16, 0.0), (16, 0.0), (16, 0.0), (177, 1.0)]
        assert vehicle.mission[0].z == 0.0


@pytest.mark.parametrize(
    ("autopilot", "refused_item"), [(mavlink.MAV_AUTOPILOT_PX4, 2), (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 3)]
)
@pytest.mark.parametrize(("ending", "number"), [(".plan", 2), (".waypoints", 3)])
def test_a_refused_item_has_its_number_in_the_file(live, tmp_path, autopilot, refused_item, ending, number):
    vehicle, port = live
    vehicle.autopilot, vehicle.refuse_item = autopilot, refused_item
    file = tmp_path / f"in{ending}"
    write_foreign(file, encode_steps([Waypoint(float(k), 0.0, 2.0) for k in range(3)], Home()), Home())
    result = run("upload", str(file), "--force", "--connect", port)
    assert result.exit_code == EXIT_ERROR
    assert result.stderr.startswith(f"gcs: upload: item {number} refused: ")


def test_a_refused_mission_of_a_plan_says_that_its_fence_was_taken(live, tmp_path):
    vehicle, port = live
    file = tmp_path / "in.plan"
    plan = plan_of((22, [0, 0, 0, None, 47.397742, 8.545594, 2.5]), (21, [0, 0, 0, None, 0, 0, 0]))
    plan["geoFence"]["circles"] = [
        {"version": 1, "inclusion": True, "circle": {"center": [47.3977, 8.5456], "radius": 9.5}}
    ]
    file.write_text(json.dumps(plan))
    vehicle.refuse_item = 1
    result = run("upload", str(file), "--connect", port)
    assert result.exit_code == EXIT_ERROR
    assert result.stderr.endswith("the vehicle has in.plan's fence now\n")
    assert [item.command for item in vehicle.areas[1]] == [5003]


def test_a_plan_beyond_the_vehicle_is_refused_unless_forced(live, tmp_path):
    _, port = live
    file = tmp_path / "in.plan"
    fast = Term("z", 2.0, 0.0, 1.0, None, 0.0, (Sine(0.5),))  # falls faster than gravity
    items = encode_steps((Takeoff(3.0), Signals(5.0, (fast,)), Land()), Home())
    write_foreign(file, items, Home())
    refused = run("upload", str(file), "--connect", port)
    assert (refused.exit_code, refused.stdout) == (EXIT_ERROR, "")
    head, end, fall = refused.stderr.splitlines()
    assert head == "gcs: in cannot be flown by vehicle bebop; --force tries:"
    assert end.startswith("gcs: items[3] (signals): at 5.0 s, its end, the load still moves at ")
    assert "the load would have to fall" in fall
    assert run("upload", str(file), "--force", "--connect", port).exit_code == EXIT_DONE


def test_bad_files_of_others_are_one_line(tmp_path):
    file = tmp_path / "in.plan"
    assert "no such file" in one_line(run("upload", str(file)), EXIT_USAGE)
    file.write_bytes(b"\xff\xfe")
    assert "not a text file" in one_line(run("upload", str(file)), EXIT_USAGE)
    file.write_text("{}")
    assert "fileType" in one_line(run("upload", str(file)), EXIT_USAGE)
    assert "must end in .plan" in one_line(run("download", str(tmp_path / "x.csv")), EXIT_USAGE)


def test_a_delay_that_may_be_meant_in_seconds_is_set_and_told(live):
    vehicle, port = live
    vehicle.parameters["SIM_ACT_DELAY_MS"] = 0.0
    result = run("param", "set", "SIM_ACT_DELAY_MS", "0.5", "--connect", port)
    assert (result.exit_code, result.stdout) == (EXIT_DONE, "SIM_ACT_DELAY_MS = 0.5\n")
    assert result.stderr == "gcs: SIM_ACT_DELAY_MS = 0.5 is in milliseconds; 500 if 0.5 s is meant\n"


def test_parameters(live, tmp_path):
    vehicle, port = live
    assert run("param", "set", "p001", "0.1", "--connect", port).stdout == "P001 = 0.1\n"
    assert json.loads(run("param", "get", "P001", "p002", "--json", "--connect", port).stdout) == {
        "P001": 0.1,
        "P002": 2.0,
    }
    listed = json.loads(run("param", "list", "P01*", "--json", "--connect", port).stdout)
    assert list(listed) == [f"P01{digit}" for digit in range(10)]
    unknown = "NOPE: no such parameter; names begin with one of "
    assert unknown in one_line(run("param", "get", "NOPE", "--connect", port), EXIT_ERROR)
    assert unknown in one_line(run("param", "set", "NOPE", "1", "--connect", port), EXIT_ERROR)
    near = "P01: no such parameter; did you mean P"
    assert near in one_line(run("param", "get", "P01", "--connect", port), EXIT_ERROR)
    assert "matches" in one_line(run("param", "list", "X*", "--connect", port), EXIT_ERROR)

    file = tmp_path / "all.params"
    assert run("param", "save", str(file), "--connect", port).exit_code == EXIT_DONE
    assert "1\t1\tP001\t0.1\t9\n" in file.read_text()
    assert run("param", "save", str(tmp_path / "all.parm"), "--connect", port).exit_code == EXIT_DONE
    assert "P001             0.1\n" in (tmp_path / "all.parm").read_text()
    before = dict(vehicle.parameters)
    vehicle.parameters.update(P001=5.0, P100=7.0)
    assert run("param", "load", str(file), "--connect", port).stdout.startswith("120 of 120 parameters set")
    assert vehicle.parameters == before
    file.write_text("P001 one\n")
    assert "must be NAME value" in one_line(run("param", "load", str(file), "--connect", port), EXIT_USAGE)
    for empty in ("", "# nothing\n\n"):
        file.write_text(empty)
        told = one_line(run("param", "load", str(file), "--connect", port), EXIT_USAGE)
        assert told == f"gcs: {file}: has no parameters; must have lines NAME value"
    file.write_text("P001 3\nNOPE 1\nP002 4\n")
    result = run("param", "load", str(file), "--connect", port)
    assert (result.exit_code, result.stdout) == (EXIT_ERROR, f"2 of 3 parameters set from {file}\n")
    each, total = result.stderr.splitlines()
    assert each.startswith("gcs: NOPE: no such parameter; ")
    assert total == f"gcs: 1 of 3 parameters of {file} were refused; the others are set"
    assert (vehicle.parameters["P001"], vehicle.parameters["P002"]) == (3.0, 4.0)
    file.write_text("NOPE 1\n")
    result = run("param", "load", str(file), "--connect", port)
    assert result.stderr.splitlines()[-1] == f"gcs: 1 of 1 parameters of {file} were refused"


@pytest.mark.parametrize("program", ["gcs missions", "sitl --help", "autopilot --help"])
@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_program_that_is_started_without_streams_does_its_work(program, closed):
    command = f"exec {shlex.quote(sys.executable)} -m {program} {closed}"
    assert subprocess.run(["sh", "-c", command], check=False, capture_output=True).returncode == EXIT_DONE


def test_status(live, monkeypatch):
    vehicle, port = live
    monkeypatch.setattr(status_module, "LISTEN_S", 0.3)
    monkeypatch.setattr(status_module, "RECALL_S", 0.05)
    vehicle.started_us = 0
    record = json.loads(run("status", "--json", "--connect", port).stdout)
    assert record["mode"] == "hold"
    assert record["armed"] is False
    assert record["load_error_m"] == pytest.approx(0.005)
    assert "mode" in run("status", "--connect", port).stdout


def test_status_ends_when_all_has_come(live, monkeypatch):
    vehicle, port = live
    listen_s, ended = 60.0, []
    monkeypatch.setattr(status_module, "LISTEN_S", listen_s)
    monkeypatch.setattr(session_module, "TRUTH_S", 0.1)
    watch = session_module.Session.watch

    def watched(session, done, seconds, *rest):
        found = watch(session, done, seconds, *rest)
        if seconds == listen_s:
            ended.append(found)
        return found

    monkeypatch.setattr(session_module.Session, "watch", watched)
    vehicle.kept_texts = [(mavlink.MAV_SEVERITY_WARNING, "[1/1, 3.0 s ago] Machine busy")]

    def tell(scripted, t):
        scripted.tell_load(1.0, 2.0, 0.5)
        scripted.send(mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND))

    vehicle.script, vehicle.started_us = tell, 0
    record = json.loads(run("status", "--json", "--connect", port).stdout)
    assert ended == [True], "all had come before the time was over"
    assert (record["landed"], record["load_up_m"], len(record["texts"])) == ("on the ground", 0.5, 1)


def test_figures_that_only_the_simulator_knows_are_missed_with_the_option_that_gives_them(live, monkeypatch):
    _, port = live
    monkeypatch.setattr(status_module, "LISTEN_S", 0.3)
    monkeypatch.setattr(session_module, "TRUTH_S", 0.1)
    nobody = free_port()
    result = run("status", "--json", "--connect", port, "--truth", str(nobody))
    assert json.loads(result.stdout)["rate_hz"] is None
    assert (
        "no rate, lateness and missed ticks of the simulator: no simulator sends its truth to "
        f"UDP 127.0.0.1:{nobody}; --truth PORT names the port to which the vehicle's simulator sends it "
        "(sitl --truth HOST:PORT)"
    ) in result.stderr
    assert "--truth is that of a running simulator: add --connect" in one_line(
        run("fly", "hover", "--truth", "14561"), EXIT_USAGE
    )
    with closing(UdpSocket(port=nobody)):
        busy = one_line(run("capture", "--connect", port, "--truth", str(nobody)), EXIT_ERROR)
    assert f"--truth: UDP 127.0.0.1:{nobody} is in use by another program" in busy


def test_what_was_said_before_is_had_afterwards(live, monkeypatch):
    vehicle, port = live
    monkeypatch.setattr(status_module, "LISTEN_S", 0.3)
    vehicle.kept_texts = [
        (mavlink.MAV_SEVERITY_CRITICAL, "[1/3, 42.0 s ago] tilt 122 deg"),
        (mavlink.MAV_SEVERITY_INFO, "[2/3, 7.5 s ago] Armed"),
        (mavlink.MAV_SEVERITY_WARNING, "[3/3, 3.0 s ago] Machine busy"),
    ]
    shown = run("status", "--connect", port).stdout.splitlines()[-2:]
    assert [line.split()[-3:] for line in shown] == [["tilt", "122", "deg"], ["warning", "Machine", "busy"]]
    assert "42." in shown[0] and "critical" in shown[0]
    texts = json.loads(run("texts", "--json", "--connect", port).stdout)
    assert [(one["severity"], one["text"]) for one in texts] == [
        ("critical", "tilt 122 deg"),
        ("info", "Armed"),
        ("warning", "Machine busy"),
    ]
    assert [one["age_s"] for one in texts] == pytest.approx([42.0, 7.5, 3.0], abs=1.0)


def test_nothing_is_said_of_a_load_that_the_vehicle_does_not_see(live, monkeypatch):
    vehicle, port = live
    monkeypatch.setattr(status_module, "LISTEN_S", 0.3)
    monkeypatch.setattr(status_module, "RECALL_S", 0.05)
    vehicle.script = lambda scripted, t: scripted.tell_load(1.0, 2.0, 0.0, tension_n=math.nan)
    vehicle.started_us = 0
    record = json.loads(run("status", "--json", "--connect", port).stdout)
    keys = ("load_east_m", "load_north_m", "load_up_m", "cable_tension_n", "cable_taut")
    assert [record[key] for key in keys] == [None] * 5
    shown = run("status", "--connect", port).stdout
    assert [line.split() for line in shown.splitlines() if "taut" in line] == [["cable", "taut", "-"]]


def test_of_a_vehicle_that_keeps_no_texts_those_are_shown_that_are_heard(live, monkeypatch):
    vehicle, port = live
    monkeypatch.setattr(status_module, "LISTEN_S", 0.3)
    vehicle.command_results[mavlink.MAV_CMD_REQUEST_MESSAGE] = [mavlink.MAV_RESULT_UNSUPPORTED]
    vehicle.script = lambda scripted, t: scripted.say("said just now")
    vehicle.started_us = 0
    record = json.loads(run("status", "--json", "--connect", port).stdout)
    assert record["texts"][0]["text"] == "said just now"


def test_arming_waits_for_a_vehicle_that_is_not_ready_yet_and_says_for_what(live):
    vehicle, port = live
    vehicle.ready_from_us = 1_000_000
    result = run("arm", "--connect", port)
    assert (result.exit_code, result.stdout) == (EXIT_DONE, "arm: accepted\n")
    assert result.stderr == "gcs: waiting: Not ready to arm: load position not settled\n"
    assert vehicle.armed
    assert vehicle.now_us >= vehicle.ready_from_us


def test_arming_waits_no_longer_than_it_says(live, monkeypatch):
    vehicle, port = live
    monkeypatch.setattr(readiness_module, "READY_S", 0.2)
    vehicle.ready = False
    vehicle.command_results[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = [mavlink.MAV_RESULT_DENIED]
    result = run("arm", "--connect", port)
    assert result.exit_code == EXIT_ERROR
    assert "arm: denied" in result.stderr.splitlines()[-1]
    forced = run("arm", "--force", "--connect", port)
    assert (forced.exit_code, forced.stderr) == (EXIT_DONE, "")


@pytest.mark.parametrize(
    ("arguments", "east_m", "north_m", "up_m", "speed", "distance_m"),
    [
        (("3", "-1.5"), 3.0, -1.5, None, -1.0, 2.7),  # from (2, 1, 2): hypot(1, 2.5)
        (("-3", "1.5", "3", "--speed", "0.5"), -3.0, 1.5, 3.0, 0.5, 5.1),  # sqrt(25 + 0.25 + 1)
        (("1", "0", "0.5", "--frame", "load"), 3.0, 1.0, 2.5, -1.0, 1.1),  # hypot(1, 0.5)
    ],
)
def test_the_load_is_sent_to_a_place(live, arguments, east_m, north_m, up_m, speed, distance_m):
    vehicle, port = live
    vehicle.script = lambda scripted, t: scripted.tell_load(east_m=2.0, north_m=1.0, up_m=2.0)
    vehicle.started_us = 0
    result = run("goto", *arguments, "--connect", port)
    told = f"goto: accepted; {distance_m} m to go\n"
    assert (result.exit_code, result.stdout) == (EXIT_DONE, told), result.output
    sent = vehicle.commands[-1]
    assert (sent.command, sent.param1) == (mavlink.MAV_CMD_DO_REPOSITION, speed)
    east, north, _ = enu_from_geodetic(sent.x, sent.y, 0, Home())
    assert (east, north) == pytest.approx((east_m, north_m), abs=0.02)
    assert sent.frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    assert sent.z == pytest.approx(up_m, abs=1e-3) if up_m is not None else math.isnan(sent.z)


def test_a_place_that_is_none_is_wrong_usage():
    assert "must be a finite number" in one_line(run("goto", "1", "north"), EXIT_USAGE)
    assert "must be a finite number" in one_line(run("goto", "1", "nan"), EXIT_USAGE)


def test_a_mode_is_named_in_any_case_and_one_that_is_none_is_told_with_all(live):
    vehicle, port = live
    vehicle.armed = True
    result = run("mode", "Hold", "--connect", port)
    assert (result.exit_code, result.stdout) == (EXIT_DONE, "mode hold: accepted\n"), result.output
    line = one_line(run("mode", "hover"), EXIT_USAGE)
    assert line.startswith("gcs: Invalid value for 'MODE': 'hover' is not one of 'hold', 'land', ")


def test_the_nearest_command_is_named():
    line = one_line(run("fyl"), EXIT_USAGE)
    assert line == "gcs: No such command 'fyl'; did you mean fly? see gcs --help"
    assert "did you mean" not in one_line(run("zzzzzz"), EXIT_USAGE)


def test_capture(live, tmp_path):
    vehicle, port = live
    path = tmp_path / "new" / "flight.tlog"
    result = run("capture", "--duration", "0.3", "--out", str(path), "--connect", port)
    assert result.exit_code == EXIT_DONE, result.output
    records = list(read_tlog(path))
    assert f"{len(records)} messages" in result.stdout
    assert f"gcs: capturing to {path} for 0.3 s" in result.stderr.splitlines()
    assert {one.system for _, one in records} == {1, 2, 255}
    stamps = [stamp for stamp, _ in records]
    assert stamps == sorted(stamps)
    told = {one.message.param_id for _, one in records if one.id == mavlink.MAVLINK_MSG_ID_PARAM_VALUE}
    assert told == set(vehicle.parameters)


def test_a_log_that_is_there_is_kept_unless_it_may_be_lost(live, tmp_path, monkeypatch):
    _, port = live
    monkeypatch.setattr(session_module, "TRUTH_S", 0.0)
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"earlier")
    words = ["capture", "--duration", "0.1", "--out", str(path), "--connect", port]
    line = one_line(run(*words), EXIT_USAGE)
    assert line == f"gcs: --out {path}: holds a log already; name another, or add --overwrite"
    assert path.read_bytes() == b"earlier"
    assert run(*words, "--overwrite").exit_code == EXIT_DONE
    assert list(read_tlog(path))


@pytest.mark.parametrize("name", [TLOG_FILE, "any.tlog"])
def test_a_log_that_another_program_writes_is_not_captured_into(live, tmp_path, monkeypatch, name):
    _, port = live
    monkeypatch.setattr(session_module, "TRUTH_S", 0.0)
    path = tmp_path / name
    words = ["capture", "--duration", "0.1", "--overwrite", "--out", str(path), "--connect", port]
    locked, kind = (tmp_path, "folder") if name == TLOG_FILE else (path, "file")
    with reserved(locked):
        result = run(*words)
        assert result.exit_code == EXIT_USAGE, result.output
        line = result.stderr.splitlines()[-1]
        assert line.startswith(f"gcs: {locked}: a")
        assert line.endswith(f" there; wait until it has ended, or name another {kind} by --out")
        assert not path.exists()
        beside = [*words[:-3], str(tmp_path / "beside.tlog"), *words[-2:]]
        assert run(*beside).exit_code == EXIT_DONE, "which no one else writes"
    assert run(*words).exit_code == EXIT_DONE


def test_of_a_flight_that_a_capture_replaces_no_report_is_left(live, tmp_path, monkeypatch):
    _, port = live
    monkeypatch.setattr(session_module, "TRUTH_S", 0.0)
    for name in (TLOG_FILE, SUMMARY_FILE, "meta.json", "notes.txt"):
        (tmp_path / name).write_text("of an earlier flight", encoding="utf-8")
    words = ["--out", str(tmp_path / TLOG_FILE), "--overwrite", "--connect", port]
    assert run("capture", "--duration", "0.1", *words).exit_code == EXIT_DONE
    assert {path.name for path in tmp_path.iterdir()} == {TLOG_FILE, LOCK_FILE, "notes.txt"}


def test_a_capture_goes_to_a_device(live, monkeypatch):
    _, port = live
    monkeypatch.setattr(session_module, "TRUTH_S", 0.0)
    result = run("capture", "--duration", "0.1", "--out", "/dev/null", "--connect", port)
    assert result.exit_code == EXIT_DONE, result.output


def test_a_running_vehicle_that_is_armed_already_leaves_the_folder_to_the_next_flight(
    live, tmp_path, monkeypatch
):
    vehicle, port = live
    monkeypatch.setattr(session_module, "TRUTH_S", 0.0)
    vehicle.armed = True
    out = tmp_path / "out"
    for _ in range(2):
        result = run("fly", "hover", "--connect", port, "--out", str(out))
        assert (result.exit_code, result.stdout) == (EXIT_ERROR, "")
        told = "hover: refused: the vehicle is armed already; land and disarm it first"
        where = f"what the vehicle said is in {out / 'unflown.tlog'}"
        assert result.stderr.splitlines()[-1] == f"gcs: {told}; {where}"
        assert {path.name for path in out.iterdir()} == {"unflown.tlog", LOCK_FILE}


@pytest.mark.parametrize("released", [0, 1])
def test_a_vehicle_that_released_its_load_before_is_told_of(live, tmp_path, monkeypatch, released):
    vehicle, port = live
    monkeypatch.setattr(session_module, "TRUTH_S", 0.0)
    vehicle.armed = True
    receive = vehicle.on_command_long

    def answer(message):
        receive(message)
        if message.param1 == mavlink.MAVLINK_MSG_ID_SIM_BOOT:
            boot = mavlink.MAVLink_sim_boot_message(0, 1, [0.0] * 4, 0.0, 0, released)
            vehicle.out.append(vehicle.dialect_writer.frame(boot))

    vehicle.on_command_long = answer
    result = run("fly", "hover", "--connect", port, "--out", str(tmp_path / "out"))
    assert ("released its load before: it flies the mission without it" in result.stderr) == released


def test_a_command_that_is_stopped_while_it_is_loaded_says_so_in_one_line():
    stopped = """
import sys
class Loading:
    def __getattr__(self, name):
        raise KeyboardInterrupt
sys.modules["gcs.cli"] = Loading()
from gcs.__main__ import main
main()
"""
    found = subprocess.run([sys.executable, "-c", stopped], check=False, capture_output=True, text=True)
    assert (found.returncode, found.stdout, found.stderr) == (EXIT_INTERRUPTED, "", "gcs: stopped\n")


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_flight_stopped_before_the_vehicle_was_armed_leaves_the_folder_to_the_next(
    live, tmp_path, monkeypatch, number, code
):
    vehicle, port = live
    vehicle.ready, asked, tick = False, [], vehicle.tick

    def stop(now_us):
        if vehicle.mission and not asked:
            asked.append(True)
            os.kill(os.getpid(), number)
        return tick(now_us)

    monkeypatch.setattr(vehicle, "tick", stop)
    out = tmp_path / "out"
    result = run("fly", "hover", "--connect", port, "--out", str(out))
    assert (result.exit_code, result.stdout) == (code, "")
    told = f"stopped before the vehicle was armed; what it said is in {out / 'unflown.tlog'}"
    assert result.stderr.splitlines()[-1] == f"gcs: {told}"
    assert {path.name for path in out.iterdir()} == {"unflown.tlog", LOCK_FILE}
    assert (out / "unflown.tlog").stat().st_size > 0


@pytest.mark.parametrize(
    ("refused", "told"),
    [
        ((), "the vehicle holds; gcs land brings it down"),
        ((mavlink.MAV_CMD_DO_PAUSE_CONTINUE,), "the vehicle lands, as it would not hold (pause: "),
        (
            (mavlink.MAV_CMD_DO_PAUSE_CONTINUE, mavlink.MAV_CMD_NAV_LAND),
            "the vehicle may fly on: land: temporarily rejected",
        ),
    ],
)
def test_a_flight_that_times_out_is_reported_whether_the_vehicle_holds_or_not(live, tmp_path, refused, told):
    vehicle, port = live
    for number in refused:
        vehicle.command_results[number] = [mavlink.MAV_RESULT_TEMPORARILY_REJECTED] * 10

    def tautens(scripted, t):
        scripted.phase = mavlink.PLUMBLINE_PHASE_TAUTEN

    vehicle.script = tautens
    out = tmp_path / "out"
    result = run("fly", "hover", "--connect", port, "--out", str(out), "--timeout", "0.2", "--quiet")
    assert result.exit_code == EXIT_NOT_MET, result.output
    assert f"gcs: {told}" in result.stderr
    assert json.loads((out / "summary.json").read_text())["outcome"] == "timeout"


def test_a_running_vehicle_is_flown_and_reported_as_json(live, tmp_path):
    vehicle, port = live

    def flight(scripted, t):
        last = len(scripted.mission) - 1
        scripted.phase, scripted.item = (
            (mavlink.PLUMBLINE_PHASE_LIFT, 0) if t < 0.3 else (mavlink.PLUMBLINE_PHASE_LOWER, last)
        )
        if t > 0.6 and scripted.armed:
            scripted.arm(False)

    vehicle.script = flight
    out = tmp_path / "out"
    result = run("fly", "hover", "--connect", port, "--out", str(out), "--json")
    assert result.exit_code == EXIT_DONE, result.output
    record = json.loads(result.stdout)
    assert record["outcome"] == "completed"
    assert record == json.loads((out / "summary.json").read_text())
    assert {"flight.tlog", "flight.parquet", "summary.json", "report.html"} <= {p.name for p in out.iterdir()}
    again = run("report", str(out), "--json")
    assert again.exit_code == EXIT_DONE, again.output
    assert json.loads(again.stdout) == record
    bare = tmp_path / "capture"  # as gcs capture --out capture leaves it
    shutil.copy(out / "flight.tlog", bare)
    assert run("report", str(bare), "--json").exit_code == EXIT_DONE
    assert (tmp_path / "capture-report" / "report.html").is_file()
    assert record["samples"] == 0  # it is lowered immediately after the lift
    assert f"{out}: holds no moment of a mission with the load in the air" in again.stderr
    sentence = "The figures that need the truth of the simulator are missing: "
    assert record["load_error_max_m"] is None and record["estimator_error_max_m"] is None
    assert sentence in (out / "report.html").read_text()
