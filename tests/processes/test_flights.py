"""Flights through three real processes over UDP, as a user flies them."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import plumbline
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import encode_steps
from gcs.formats.missions import write_foreign
from missions.model import ReturnHome, Takeoff, Waypoint
from tests.doubles.recorded_flights import STABLE_KEYS

pytestmark = pytest.mark.processes
Gcs = Callable[..., "subprocess.CompletedProcess[str]"]

FILES = ("flight.tlog", "flight.ulg", "flight.parquet", "summary.json", "report.html", "overview.png")


def test_a_flight_over_udp_leaves_the_log_of_the_same_flight_in_one_process(gcs: Gcs, tmp_path: Path) -> None:
    out = tmp_path / "out"
    flown = gcs("fly", "hover", "--sensors", "lab", "--seed", "7", "--out", str(out), "--json")
    assert flown.returncode == 0, flown.stderr
    record = json.loads(flown.stdout)
    assert record.keys() >= STABLE_KEYS
    assert record["outcome"] == "completed"
    assert record == json.loads((out / "summary.json").read_text())
    for name in FILES:
        assert (out / name).stat().st_size > 0, name

    flight = plumbline.fly("hover", sensors="lab", seed=7, quiet=True)
    assert (out / "flight.tlog").read_bytes() == flight.tlog
    of_the_machine = ("wall_s", "real_time_factor", "report_dir")
    assert {k: v for k, v in flight.summary.items() if k not in of_the_machine} == {
        k: v for k, v in record.items() if k not in of_the_machine
    }


def test_the_readings_of_a_flight_over_udp_are_those_of_the_same_flight_in_one_process(
    gcs: Gcs, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    flown = gcs("fly", "hover", "--sensors", "field", "--log-sensors", "--out", str(out), "--quiet")
    assert (flown.returncode, flown.stderr) == (0, "gcs: hover: completed\n")
    assert not (out / "sensors.log").exists()
    flight = plumbline.fly("hover", sensors="field", log_sensors=True)
    flight.report(tmp_path / "here")
    assert (out / "flight.tlog").read_bytes() == flight.tlog
    files = sorted(file.name for file in (out / "sensors").iterdir())
    assert len(files) == len(flight.calibration["sensors"]) + 4  # speeds of rotors, truth, calibration, ULog
    for name in files:
        assert (out / "sensors" / name).read_bytes() == (tmp_path / "here" / "sensors" / name).read_bytes(), (
            name
        )


def test_a_plan_of_another_ground_station_leaves_the_log_of_the_same_flight_in_one_process(
    gcs: Gcs, tmp_path: Path
) -> None:
    """Also with a home that simulator and autopilot do not have by default."""
    path, out = tmp_path / "survey.plan", tmp_path / "out"
    home = Home(-33.9, 18.4, 60.0)
    write_foreign(path, encode_steps((Takeoff(0.5), Waypoint(0.4, 0.0, 0.5), ReturnHome()), home), home)
    flown = gcs("fly", str(path), "--out", str(out), "--quiet")
    assert (flown.returncode, flown.stderr) == (0, f"gcs: {path}: completed\n")
    assert (out / "flight.tlog").read_bytes() == plumbline.fly(path).tlog


def test_what_four_rotors_lose_is_reported_as_diverged(gcs: Gcs, tmp_path: Path) -> None:
    out = tmp_path / "out"
    flown = gcs("fly", "case-a", "--law", "thesis", "--sensors", "ideal", "--out", str(out), "--json")
    assert flown.returncode == 3, flown.stderr
    assert json.loads(flown.stdout)["outcome"] == "diverged"
    assert (out / "report.html").stat().st_size > 0


def test_losses_on_the_ground_link_do_not_lose_the_flight(gcs: Gcs, tmp_path: Path) -> None:
    out = tmp_path / "out"
    loss = ("--set", "SIM_LOSS_PCT=20")
    flown = gcs("fly", "hover", "--sensors", "ideal", *loss, "--out", str(out), "--json")
    assert flown.returncode == 0, flown.stderr
    assert json.loads(flown.stdout)["outcome"] == "completed"


def test_a_quiet_flight_says_one_line(gcs: Gcs, tmp_path: Path) -> None:
    flown = gcs("fly", "hover", "--sensors", "ideal", "--out", str(tmp_path / "out"), "--quiet")
    assert (flown.returncode, flown.stdout, flown.stderr) == (0, "", "gcs: hover: completed\n")


def test_a_disk_that_is_full_is_one_line_and_what_was_captured_is_kept(gcs: Gcs, tmp_path: Path) -> None:
    out = tmp_path / "out"
    flown = gcs("fly", "hover", "--sensors", "ideal", "--out", str(out), "--quiet", file_bytes=500_000)
    assert flown.returncode == 1
    kept = f"500000 bytes of telemetry are kept in {out / 'flight.tlog'}; gcs report {out} reads them"
    assert flown.stderr == f"gcs: {out}: file too large; {kept}\n"
    assert (out / "flight.tlog").stat().st_size == 500_000
