"""A flight of our own simulator, with known truth: identified, replayed, estimated from the vehicle alone."""

from __future__ import annotations

import json
from functools import cache
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from autopilot.vehicle.file import load_vehicle
from autopilot.wire.tlog import TlogWriter
from gcs.cli import gcs
from gcs.closed_loop import Conditions, fly
from gcs.commands.options import display_name
from gcs.errors import EXIT_USAGE
from gcs.recorded.column_map import load_map
from gcs.recorded.estimates import filter_rows, filtered_estimates
from gcs.recorded.identification import (
    Identified,
    identify_load,
    identify_vehicle,
    length_warning,
    map_warning,
    wind_warning,
)
from gcs.recorded.motion import motion_of
from gcs.recorded.recording import Recording, read_recording
from gcs.recorded.scoring import score_ahead
from gcs.shell import display as display_module
from gcs.workflows.recorded import name_of
from missions.fileformat import load_mission
from missions.model import Delay, Land, Mission, Takeoff

SMOOTHING = (
    4e-4  # relative error of parameters of the vehicle by smoothing, which the intervals do not include
)


def flown_mission(mission: str, folder: Path, **settings: float) -> Path:
    path = folder / "flight.tlog"
    with path.open("wb") as file:
        outcome = fly(load_mission(mission), Conditions(settings=settings), TlogWriter(file))
    assert outcome.name == "completed"
    return path


@cache
def recorded(path: Path) -> Recording:
    """The recording in a log of this module: each is read once, which takes longer than what follows."""
    found = read_recording(path, load_map("telemetry"))
    for column in found[1:]:
        if column is not None:
            column.flags.writeable = False
    return found


@pytest.fixture(autouse=True)
def read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcs.recorded.recording.read_recording", lambda path, columns: recorded(path))


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flown_mission("case-b", tmp_path_factory.mktemp("flight"))


@pytest.fixture(scope="module")
def circled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flown_mission("case-c", tmp_path_factory.mktemp("circled"))


@pytest.mark.parametrize("flight", ["flown", "circled"])
def test_length_mass_and_drag_of_the_truth_are_identified(
    flight: str, request: pytest.FixtureRequest
) -> None:
    path = request.getfixturevalue(flight)
    result = CliRunner().invoke(gcs, ["identify", str(path), "--json"], prog_name="gcs")
    found = json.loads(result.stdout)["identified"]
    truth = load_vehicle("bebop")
    assert found["tracked_length_m"]["value"] == pytest.approx(truth.cable_length_m, abs=1e-6)
    # the single precision of the telemetry amounts to about a micrometre
    assert found["length_m"]["value"] == pytest.approx(truth.cable_length_m, abs=1e-5)
    known = {
        "mass_ratio": truth.load_mass_kg / truth.quad_mass_kg,
        "drag_per_m": truth.load_drag_quadratic_n_s2_m2 / truth.load_mass_kg,
    }
    for name, value in known.items():
        width = found[name]["half_width"]
        assert found[name]["value"] == pytest.approx(value, abs=width + SMOOTHING * value)
        assert width < 0.01 * value


def test_the_push_of_a_strong_wind_is_identified(tmp_path: Path) -> None:
    wind_m_s, columns, truth = 14.0, load_map("telemetry"), load_vehicle("bebop")
    motion = motion_of(recorded(flown_mission("case-b", tmp_path, SIM_WIND_N=wind_m_s)), columns)
    found = identify_load(motion, columns.load_model(truth.cable_length_m), columns.identify.parameters)
    length, _, push_x, push_y = found
    push_m_s2 = truth.load_drag_quadratic_n_s2_m2 * wind_m_s**2 / truth.load_mass_kg
    assert push_y.value == pytest.approx(push_m_s2, abs=push_y.half_width)
    assert push_y.half_width < 0.02 * push_m_s2
    assert push_x.value == pytest.approx(0.0, abs=1e-3)
    assert length.value == pytest.approx(truth.cable_length_m, abs=1e-3)


def test_the_length_is_a_distance_and_shows_no_wrong_clock(flown: Path) -> None:
    """It is the one that predicts positions best, and is named so."""
    recording, columns = recorded(flown), load_map("telemetry")
    motion = motion_of(recording._replace(time_s=1.2 * recording.time_s), columns)
    length = load_vehicle("bebop").cable_length_m
    (found,) = identify_load(motion, columns.load_model(length), ["length_m"])
    assert found.value == pytest.approx(length, rel=0.01)
    shown = CliRunner().invoke(gcs, ["identify", str(flown)], prog_name="gcs").stdout
    assert "by the predicted positions" in shown and "by the swing" not in shown


def test_drag_and_mass_are_identified_from_few_rows_and_any_guess(circled: Path) -> None:
    recording = recorded(circled)
    every = slice(None, None, 8)  # of 125 rows/s
    few = recording._replace(
        time_s=recording.time_s[every],
        position=recording.position[every],
        quaternion_xyzw=recording.quaternion_xyzw[every],
        load=recording.load[every],
    )
    columns, truth = load_map("telemetry"), load_vehicle("bebop")
    motion = motion_of(few, columns)
    model = columns.load_model(truth.cable_length_m)
    drag = identify_load(motion, model, ["drag_per_m"])[0].value
    assert drag == pytest.approx(truth.load_drag_quadratic_n_s2_m2 / truth.load_mass_kg, rel=2e-3)
    for guess in (0.05, 0.8):
        found = identify_vehicle(motion, model._replace(mass_ratio=guess, drag_per_m=drag))
        vehicle = {one.name: one.value for one in found}
        assert vehicle["mass_ratio"] == pytest.approx(truth.load_mass_kg / truth.quad_mass_kg, rel=4e-3)
        linear = truth.quad_drag_n_s_m / truth.quad_mass_kg
        assert vehicle["vehicle_drag_per_s"] == pytest.approx(linear, rel=0.02)
        square = truth.quad_drag_quadratic_n_s2_m2 / truth.quad_mass_kg
        assert vehicle["vehicle_drag_per_m"] == pytest.approx(square, rel=0.02)


def test_the_load_is_known_from_the_vehicle_alone(flown: Path, tmp_path: Path) -> None:
    asked = ["replay", str(flown), "--out", str(tmp_path / "replay"), "--json"]
    for _ in range(2):  # an earlier replay is replaced
        record = json.loads(CliRunner().invoke(gcs, asked, prog_name="gcs").stdout)
    alone = record["pose_alone"]
    assert alone["median_m"] < 1e-3
    assert alone["inside_95"] > 0.95
    assert record["ahead_5s"]["median_m"] < 5e-3
    table = np.loadtxt(tmp_path / "replay" / "load.csv", delimiter=",", skiprows=1)
    assert len(table) == record["rows"]
    error = np.linalg.norm(table[:, 1:4] - table[:, 6:9], axis=1)
    assert np.median(error) == pytest.approx(alone["median_m"], abs=2e-6)
    assert (tmp_path / "replay" / "load.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["load.csv", "load.png"])
def test_a_replay_does_not_take_the_place_of_files_of_others(flown: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("time,load\n", encoding="utf-8")
    refused = CliRunner().invoke(gcs, ["replay", str(flown), "--out", str(tmp_path)], prog_name="gcs")
    told = f"gcs: {tmp_path}: holds a {name} that is not of a replay; name another folder by --out\n"
    assert (refused.exit_code, refused.stderr) == (EXIT_USAGE, told)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text(encoding="utf-8") == "time,load\n"


def test_a_load_that_was_not_measured_in_every_row_is_scored_in_the_others(
    flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_with_gap(path: Path, columns: Any) -> Any:
        found = recorded(path)
        load = found.load.copy()
        load[1000:1003] = np.nan
        return found._replace(load=load)

    monkeypatch.setattr("gcs.recorded.recording.read_recording", read_with_gap)
    asked = ["replay", str(flown), "--out", str(tmp_path / "replay"), "--json"]
    result = CliRunner().invoke(gcs, asked, prog_name="gcs")
    record = json.loads(result.stdout)
    assert f"not measured in 3 of {record['rows']} rows" in result.stderr
    assert record["pose_alone"]["median_m"] < 1e-3 and record["pose_alone"]["nees_per_axis"] > 0.0
    assert "ahead_5s" not in record


def test_a_long_replay_tells_what_it_is_doing(
    flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock_s = count(0.0, 20.0)  # by which every line is due
    monkeypatch.setattr(display_module.time, "monotonic", lambda: next(clock_s))
    asked = ["replay", str(flown), "--out", str(tmp_path / "replay")]
    lines = CliRunner().invoke(gcs, asked, prog_name="gcs").stderr.splitlines()
    assert lines[0] == "gcs: estimating the load"
    assert lines[-1] == "gcs: writing table and picture"
    assert len(lines) > 10
    assert all(line.startswith("gcs: predicting the load: ") for line in lines[1:-1])


def test_of_many_rows_a_second_not_every_fifteenth_begins_a_prediction(flown: Path) -> None:
    """125 rows/s: predictions that begin 0.1 s apart took a minute more for half an hour of flight."""
    columns = load_map("telemetry")
    motion = motion_of(recorded(flown), columns)
    model = columns.load_model(load_vehicle("bebop").cable_length_m)
    rows = filter_rows(motion, model)
    estimates = filtered_estimates(rows, model, load=True, tilt=True)
    score = score_ahead(motion, rows, model, estimates)[0]
    assert np.diff(rows.time_s[score.rows]) == pytest.approx(0.5, abs=0.02)  # two rows


@pytest.mark.parametrize(("hold_s", "says"), [(1.0, "at least 20 s are needed"), (60.0, "moves too little")])
def test_a_flight_that_tells_nothing_is_told_in_one_line(hold_s: float, says: str, tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    with path.open("wb") as file:
        mission = Mission("still", "", "", (), (Takeoff(0.4), Delay(hold_s), Land()))
        assert fly(mission, Conditions(sensors="ideal"), TlogWriter(file)).name == "completed"
    result = CliRunner().invoke(gcs, ["identify", str(path)], prog_name="gcs")
    assert result.exit_code == EXIT_USAGE
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"gcs: {path}: ") and says in line


def test_a_log_needs_no_ending(flown: Path, tmp_path: Path) -> None:
    bare = tmp_path / "monday"
    bare.write_bytes(flown.read_bytes())
    result = CliRunner().invoke(gcs, ["identify", str(bare), "--json"], prog_name="gcs")
    assert json.loads(result.stdout)["true_states"] is True


def test_a_load_that_was_never_carried_is_told(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    with path.open("wb") as file:
        waits = Mission("waits", "", "", (), (Takeoff(0.4), Land()))
        fly(
            waits,
            Conditions(sensors="ideal"),
            TlogWriter(file),
            lambda onboard, _: onboard.now_us < 2_500_000,
        )
    result = CliRunner().invoke(gcs, ["replay", str(path)], prog_name="gcs")
    assert result.exit_code == EXIT_USAGE
    assert (
        result.stderr
        == f"gcs: {path}: the load is never carried off the ground; at least 200 rows are needed\n"
    )


def test_a_length_that_changes_is_named() -> None:
    rows = np.zeros((100, 3))
    motion = SimpleNamespace(load=rows, attachment=SimpleNamespace(position=np.add(rows, (0.0, 0.0, 0.7))))
    assert length_warning(motion) == ""  # type: ignore[arg-type]
    reeled = np.where(np.arange(100)[:, None] < 50, (0.0, 0.0, 0.0), (0.0, 0.0, 0.2))
    motion.load = reeled
    assert length_warning(motion).startswith("the load is 0.50 to 0.70 m from the vehicle, by a winch or")  # type: ignore[arg-type]


def test_a_load_that_is_blown_aside_casts_doubt_on_the_drags() -> None:
    """Also if the vehicle accelerates: in still air the cable then leans back as much."""
    rows, ahead = np.zeros((100, 3)), np.array((1.0, 0.0, 0.0))
    attachment = SimpleNamespace(position=rows, velocity=rows, acceleration=0.981 * ahead + rows)
    motion = SimpleNamespace(load=rows - 0.1 * ahead - np.array((0.0, 0.0, 1.0)), attachment=attachment)
    assert wind_warning(motion, 9.81) == ""  # type: ignore[arg-type]
    motion.load = motion.load + 0.01 * ahead
    assert wind_warning(motion, 9.81).startswith("the load hangs 0.6 degrees off the vertical")  # type: ignore[arg-type]
    attachment.velocity = rows + ahead
    assert wind_warning(motion, 9.81) == "", "its own speed blows it aside"  # type: ignore[arg-type]


def test_a_tilt_that_does_not_show_the_acceleration_casts_doubt_on_the_map() -> None:
    assert map_warning([Identified("tilt_share", 0.95, 0.05)]) == ""
    assert map_warning([Identified("tilt_share", 0.1, 0.6)]) == ""  # too uncertain to say
    assert map_warning([Identified("tilt_share", 0.001, 0.02)]).startswith("the tilt shows 0.00 of the")


def test_a_flight_goes_by_its_folder_and_any_other_recording_by_its_file(tmp_path: Path) -> None:
    assert name_of(tmp_path / "windy" / "flight.tlog") == "windy"
    assert name_of(tmp_path / "windy" / "run-7.csv.gz") == "run-7"


def test_a_key_is_spoken_with_its_unit() -> None:
    told = {
        "cable_tension_n": "cable tension (N)",
        "late_p99_us": "late p99 (us)",
        "latency_ms": "latency (ms)",
        "drag_n_s_m": "drag (N s/m)",
        "mode": "mode",
    }
    assert {key: display_name(key) for key in told} == told
