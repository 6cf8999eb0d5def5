"""What a script can do: fly, sweep, read the tables; and what it is told where it is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas
import polars
import pyarrow
import pytest

import plumbline
from missions.model import Land, Mission, Takeoff, Waypoint

STEPS = (Takeoff(0.5), Waypoint(0.0, 0.0, 0.5, hold_s=1.0), Land())
SHORT = Mission("short", "Short", "", (), STEPS)


@pytest.fixture(scope="module")
def flight() -> plumbline.Flight:
    return plumbline.fly(SHORT, sensors="ideal", seed=2, settings={"SIM_ACT_DELAY_MS": 4}, quiet=True)


def test_a_mission_made_in_python_is_flown(flight: plumbline.Flight) -> None:
    assert (flight.outcome, flight.reason, flight.mission) == ("completed", "", SHORT)
    assert flight.summary["mission"] == "short" and flight.summary["seed"] == 2
    assert 0.0 < flight.summary["load_error_max_m"] < 0.05
    assert repr(flight).startswith("<Flight short: completed, load error at most ")


def test_the_same_seed_is_the_same_flight(flight: plumbline.Flight) -> None:
    again = plumbline.fly(SHORT, sensors="ideal", seed=2, settings={"SIM_ACT_DELAY_MS": 4}, quiet=True)
    assert again.tlog == flight.tlog
    assert plumbline.fly(SHORT, sensors="ideal", seed=2, quiet=True).tlog != flight.tlog


def test_telemetry_comes_as_what_is_asked_for(flight: plumbline.Flight) -> None:
    frames = [flight.telemetry(), flight.telemetry("polars"), flight.telemetry("arrow")]
    assert [type(frame) for frame in frames] == [pandas.DataFrame, polars.DataFrame, pyarrow.Table]
    assert len({frame.shape for frame in frames}) == 1
    assert frames[0]["load_true_z_m"].max() == pytest.approx(0.5, abs=0.05)


def test_pictures_and_report(flight: plumbline.Flight, tmp_path: Path) -> None:
    flight.plot("error").save(tmp_path / "error.png")
    assert (tmp_path / "error.png").read_bytes().startswith(b"\x89PNG")
    page = flight.report(tmp_path / "out")
    assert page == tmp_path / "out" / "report.html" and "short" in page.read_text(encoding="utf-8")
    assert (tmp_path / "out" / "flight.tlog").read_bytes() == flight.tlog


def test_progress_is_told_unless_it_is_not_wanted(capsys: pytest.CaptureFixture[str]) -> None:
    plumbline.fly(SHORT, sensors="ideal", quiet=True)
    assert capsys.readouterr().err == ""
    plumbline.fly(SHORT, sensors="ideal")
    assert "gcs: " in capsys.readouterr().err


def test_a_sweep_is_a_table() -> None:
    vary = {"SIM_ACT_DELAY_MS": (0, 12.0)}
    found = plumbline.sweep("hover", vary=vary, seeds=2, sensors="ideal", jobs=1, quiet=True)
    assert found["SIM_ACT_DELAY_MS"].tolist() == [0.0, 0.0, 12.0, 12.0]
    assert found["seed"].tolist() == [1, 2, 1, 2]
    assert found["outcome"].tolist()[:2] == ["completed"] * 2


def test_a_library_that_is_missing_is_named_before_anything_is_flown(
    flight: plumbline.Flight, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("plumbline.frames.find_spec", lambda name: None)
    for call in (lambda: flight.telemetry("polars"), lambda: plumbline.sweep("hover", kind="polars")):
        with pytest.raises(plumbline.Error, match="polars is not installed; pip install polars"):
            call()
    assert capsys.readouterr().err == ""


WRONG: dict[str, tuple[Any, str]] = {
    "mission": (lambda: plumbline.fly("cas-b"), "did you mean case-b?"),
    "law": (lambda: plumbline.fly("hover", law="pid"), "must be one of thesis"),
    "sensors": (lambda: plumbline.fly("hover", sensors="laab"), "did you mean lab?"),
    "vehicle": (lambda: plumbline.fly("hover", vehicle="no.toml"), "no.toml"),
    "name": (lambda: plumbline.fly("hover", settings={"SIM_WIND": 1}), "SIM_WIND: no such parameter"),
    "value": (lambda: plumbline.fly("hover", settings={"SIM_ACT_DELAY_MS": -1}), "SIM_ACT_DELAY_MS"),
    "sweep": (lambda: plumbline.sweep("hover", vary={"SIM_WIND": [1]}), "did you mean SIM_WIND_"),
    "kind": (lambda: plumbline.sweep("hover", kind="csv"), "must be pandas, polars or arrow"),
}


@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_one_line(call: Any, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(plumbline.Error) as told:
        call()
    assert says in str(told.value) and "\n" not in str(told.value)
    assert capsys.readouterr().err == ""


def test_a_picture_that_there_is_not(flight: plumbline.Flight) -> None:
    with pytest.raises(plumbline.Error, match="must be one of overview, track"):
        flight.plot("trak")
