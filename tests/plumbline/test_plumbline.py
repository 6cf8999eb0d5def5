"""What a script can do: fly, sweep, read the tables; and the errors that it gets."""

from __future__ import annotations

import dataclasses
import inspect
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas
import polars
import pyarrow
import pytest

import plumbline
from missions.model import Land, Mission, Signals, Sine, Takeoff, Term, Waypoint

STEPS = (Takeoff(0.5), Waypoint(0.0, 0.0, 0.5, hold_s=1.0), Land())
WILD = Mission(
    "wild",
    "Wild",
    "",
    (),
    (Takeoff(8.0), Signals(20.0, (Term("z", 3.0, 0.0, 5.0, 10.0, 5.0, (Sine(1.5),)),)), Land()),
)
SHORT = Mission("short", "Short", "", (), STEPS)


@pytest.fixture(scope="module")
def flight() -> plumbline.Flight:
    return plumbline.fly(SHORT, sensors="ideal", seed=2, settings={"SIM_ACT_DELAY_MS": 4}, quiet=True)


def test_a_mission_made_in_python_is_flown(flight: plumbline.Flight) -> None:
    assert (flight.outcome, flight.reason, flight.mission) == ("completed", "", SHORT)
    assert flight.summary["mission"] == "short" and flight.summary["seed"] == 2
    assert 0.0 < flight.summary["load_error_max_m"] < 0.05
    assert repr(flight).startswith("<Flight short: completed, load error at most ")


def test_a_script_hears_nothing_but_a_warning_of_what_may_not_be_meant(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with pytest.warns(
        UserWarning, match="settings: SIM_ACT_DELAY_MS = 0.004 is in milliseconds; 4 if"
    ) as told:
        plumbline.fly(SHORT, sensors="ideal", settings={"SIM_ACT_DELAY_MS": 0.004})
    assert told[0].filename == __file__
    plumbline.sweep("hover", sensors="ideal", jobs=1, kind="arrow")
    assert capfd.readouterr() == ("", "")
    plumbline.fly(SHORT, sensors="ideal", quiet=False)
    assert "gcs: " in capfd.readouterr().err


def test_the_same_seed_is_the_same_flight(flight: plumbline.Flight) -> None:
    again = plumbline.fly(SHORT, sensors="ideal", seed=2, settings={"SIM_ACT_DELAY_MS": 4}, quiet=True)
    assert again.tlog == flight.tlog
    assert plumbline.fly(SHORT, sensors="ideal", seed=2, quiet=True).tlog != flight.tlog


def test_the_figures_do_not_depend_on_the_system_id_of_the_vehicle(flight: plumbline.Flight) -> None:
    settings = {"SIM_ACT_DELAY_MS": 4, "MAV_SYS_ID": 3}
    third = plumbline.fly(SHORT, sensors="ideal", seed=2, settings=settings, quiet=True)
    timing = {"wall_s", "real_time_factor", "settings"}
    figures, expected = ({k: v for k, v in f.summary.items() if k not in timing} for f in (third, flight))
    assert figures == expected
    assert third.telemetry("arrow").equals(flight.telemetry("arrow"))


def test_telemetry_comes_as_what_is_asked_for(flight: plumbline.Flight) -> None:
    frames = [flight.telemetry(), flight.telemetry("polars"), flight.telemetry("arrow")]
    assert [type(frame) for frame in frames] == [pandas.DataFrame, polars.DataFrame, pyarrow.Table]
    assert len({frame.shape for frame in frames}) == 1
    assert frames[0]["load_true_z_m"].max() == pytest.approx(0.5, abs=0.05)


def test_pictures_and_report(flight: plumbline.Flight, tmp_path: Path) -> None:
    flight.plot("error").save(tmp_path / "error.png")
    assert (tmp_path / "error.png").read_bytes().startswith(b"\x89PNG")
    flight.plot("error").save(tmp_path / "error.PDF")
    assert (tmp_path / "error.PDF").read_bytes().startswith(b"%PDF")
    page = flight.report(tmp_path / "out")
    assert page == tmp_path / "out" / "report.html" and "short" in page.read_text(encoding="utf-8")
    assert (tmp_path / "out" / "flight.tlog").read_bytes() == flight.tlog


def test_a_recorded_flight_is_read(flight: plumbline.Flight, tmp_path: Path) -> None:
    flight.report(tmp_path)
    found = plumbline.Flight.load(tmp_path)
    assert (found.tlog, found.outcome, found.reason) == (flight.tlog, "completed", "")
    # files keep nine digits of the wall time, from which the factor is computed
    factor = pytest.approx(flight.summary["real_time_factor"], rel=1e-8)
    assert found.summary == {**flight.summary, "real_time_factor": factor}
    assert repr(found) == repr(flight)
    assert found.settings == flight.settings == {"SIM_ACT_DELAY_MS": 4}
    assert found.telemetry().equals(flight.telemetry())
    assert found.plot("error").png == flight.plot("error").png
    assert found.report(tmp_path / "again").read_bytes() == (tmp_path / "report.html").read_bytes()


def test_the_mission_of_a_recorded_flight_is_that_which_was_flown(
    flight: plumbline.Flight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    flight.report("made")
    found = plumbline.Flight.load("made").mission
    assert found is not None and (found.name, found.title) == (SHORT.name, SHORT.title)
    assert [type(step) for step in found.steps] == [type(step) for step in SHORT.steps]
    for step, flown in zip(found.steps, SHORT.steps, strict=True):
        known, expected = vars_of(step), vars_of(flown)
        assert known == pytest.approx(expected, abs=0.01)  # 1e-7 degrees
    assert plumbline.fly(found, sensors="ideal", seed=2).outcome == "completed"

    mine = plumbline.Mission.of(SHORT)
    mine.save("short.toml")
    flown_file = plumbline.fly("short.toml", sensors="ideal", seed=2)
    flown_file.report("file")
    assert plumbline.Flight.load("file").mission == flown_file.mission
    mine.replace(steps=STEPS[::2]).save("short.toml")  # changed since
    again = plumbline.Flight.load("file").mission
    assert again is not None and again.steps == found.steps


def vars_of(step: object) -> dict[str, float]:
    """The numbers of a step."""
    values = dataclasses.asdict(step)  # type: ignore[call-overload]
    return {name: value for name, value in values.items() if isinstance(value, float | int)}


def test_a_shipped_mission_of_a_recorded_flight_is_the_shipped_one(tmp_path: Path) -> None:
    flown = plumbline.fly("case-a", sensors="ideal")
    flown.report(tmp_path)
    assert plumbline.Flight.load(tmp_path).mission == flown.mission


def test_a_log_with_nothing_beside_it_is_read(flight: plumbline.Flight, tmp_path: Path) -> None:
    log = tmp_path / "captured.tlog"
    log.write_bytes(flight.tlog)
    found = plumbline.Flight.load(str(log))
    assert (found.outcome, found.reason, found.summary["mission"]) == ("completed", "", None)
    assert found.settings == {}
    assert repr(found).startswith("<Flight of an unknown mission: completed, load error at most ")
    assert found.mission is not None and len(found.mission.steps) == len(SHORT.steps)


def test_what_holds_no_flight_is_told(tmp_path: Path) -> None:
    for write, told in (
        (
            lambda: None,
            f"{tmp_path}/flight.tlog: no such file; must be a .tlog, or a directory that holds fli",
        ),
        ((tmp_path / "flight.tlog").touch, f"{tmp_path}/flight.tlog: holds no telemetry; must be a .tlog"),
    ):
        write()
        with pytest.raises(plumbline.Error) as error:
            plumbline.Flight.load(tmp_path)
        assert str(error.value).startswith(told)


def test_a_broken_meta_file_is_told(flight: plumbline.Flight, tmp_path: Path) -> None:
    flight.report(tmp_path)
    (tmp_path / "meta.json").write_text("[", encoding="utf-8")
    with pytest.raises(plumbline.Error, match=r"meta\.json: .*; must be JSON: mend it, or delete it"):
        plumbline.Flight.load(tmp_path)


def test_a_report_replaces_another_flight_only_when_asked(flight: plumbline.Flight, tmp_path: Path) -> None:
    log, out = tmp_path / "flight.tlog", tmp_path
    log.touch()
    flight.report(out)
    flight.report(out)
    log.write_bytes(flight.tlog[:-1])
    with pytest.raises(plumbline.Error) as told:
        flight.report(out)
    assert str(told.value) == (
        f"report out: {out} holds another flight; name another folder, or give overwrite=True"
    )
    assert log.read_bytes() == flight.tlog[:-1]
    flight.report(out, overwrite=True)
    assert log.read_bytes() == flight.tlog


def test_a_report_of_the_same_flight_keeps_every_file_of_it_and_one_of_another_none(
    flight: plumbline.Flight, tmp_path: Path
) -> None:
    flight.report(tmp_path)
    kept = ("flight.ulg", "autopilot.log", "sitl.log", "flight.mcap", "flight.common.tlog", "error.png")
    for name in kept:
        (tmp_path / name).write_bytes(b"of this flight")
    plumbline.Flight.load(tmp_path).report(tmp_path)
    assert {(tmp_path / name).read_bytes() for name in kept} == {b"of this flight"}

    other = plumbline.fly(SHORT, sensors="ideal", seed=3, quiet=True)
    other.report(tmp_path, overwrite=True)
    assert not [name for name in kept if (tmp_path / name).exists()]
    assert plumbline.Flight.load(tmp_path).tlog == other.tlog


def test_a_report_where_the_log_is_a_folder(flight: plumbline.Flight, tmp_path: Path) -> None:
    (tmp_path / "flight.tlog").mkdir()
    with pytest.raises(plumbline.Error, match=r"flight\.tlog: Is a directory; name another folder$"):
        flight.report(tmp_path)


@pytest.mark.usefixtures("swept_here")
def test_a_sweep_is_a_table() -> None:
    vary = {"SIM_ACT_DELAY_MS": (0, 12.0)}
    found = plumbline.sweep("hover", vary=vary, seeds=range(1, 3), sensors="ideal", jobs=1, quiet=True)
    assert found["SIM_ACT_DELAY_MS"].tolist() == [0.0, 0.0, 12.0, 12.0]
    assert found["seed"].tolist() == [1, 2, 1, 2]
    assert found["outcome"].tolist()[:2] == ["completed"] * 2


@pytest.mark.usefixtures("swept_here")
def test_a_sweep_takes_one_law_as_a_flight_does() -> None:
    found = plumbline.sweep("hover", laws="lqr", sensors="ideal", jobs=1)
    assert found["law"].tolist() == ["lqr"]


@pytest.mark.usefixtures("swept_here")
def test_settings_that_are_drawn() -> None:
    vary: Mapping[str | tuple[str, ...], str | Sequence[float]] = {
        ("SIM_LOAD_MASS", "veh_load_mass"): "0.06:0.08",
        "SIM_ACT_DELAY_MS": [0, 12],
    }
    found = plumbline.sweep("hover", vary=vary, sample=3, sensors="ideal", jobs=1)
    assert found["SIM_LOAD_MASS"].between(0.06, 0.08).all() and found["SIM_LOAD_MASS"].nunique() == 3
    assert set(found["SIM_ACT_DELAY_MS"]) == {0.0, 12.0} and "VEH_LOAD_MASS" not in found
    assert found["load_error_max_m"].max() < 0.01  # a wrong mass costs more


def test_a_library_that_is_missing_is_named_before_anything_is_flown(
    flight: plumbline.Flight, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("plumbline.frames.find_spec", lambda name: None)
    for call in (lambda: flight.telemetry("polars"), lambda: plumbline.sweep("hover", kind="polars")):
        with pytest.raises(plumbline.Error, match="polars is not installed; pip install polars"):
            call()
    for call in (flight.telemetry, lambda: plumbline.sweep("hover")):
        with pytest.raises(
            plumbline.Error,
            match=r"pandas is not .*; pip install -e '.\[pandas\]' in the clone of Plumbline, or",
        ):
            call()
    with pytest.raises(plumbline.Error, match="seeds = 0"):
        plumbline.sweep("hover", seeds=0)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: plumbline.sweep("hover", law="lqr"), "sweep: no argument 'law'; did you mean laws? must be"),
        (lambda: plumbline.fly("hover", setings={}), "fly: no argument 'setings'; did you mean settings?"),
        (
            lambda: plumbline.connect(timeout=3.0),
            "did you mean timeout_s? must be one of address, sysid, timeout_s",
        ),
    ],
)
def test_an_argument_that_there_is_not_is_told_with_the_nearest(call: Callable[[], Any], says: str) -> None:
    with pytest.raises(TypeError) as told:
        call()
    assert says in str(told.value)
    assert inspect.signature(plumbline.fly).parameters["law"].default == "plumbline"


WRONG: dict[str, tuple[Any, str]] = {
    "a parameter of a law that does not fly": (
        lambda: plumbline.fly(SHORT, vehicle=plumbline.Vehicle.load("bebop").replace(parameters={"G_K": 3})),
        "or leave G_K out of the vehicle's parameters",
    ),
    "mission": (lambda: plumbline.fly("cas-b"), "did you mean case-b?"),
    "law": (lambda: plumbline.fly("hover", law="pid"), "must be thesis, lqr, plumbline, or a file"),
    "sensors": (lambda: plumbline.fly("hover", sensors="laab"), "did you mean lab?"),
    "vehicle": (lambda: plumbline.fly("hover", vehicle="no.toml"), "no.toml"),
    "rate": (lambda: plumbline.fly("hover", settings={"CTL_RATE_HZ": 333}), "settings: CTL_RATE_HZ = 333 Hz"),
    "name": (lambda: plumbline.fly("hover", settings={"SIM_WIND": 1}), "SIM_WIND: no such parameter"),
    "set": (
        lambda: plumbline.sweep("hover", settings={"SIM_WIND": 1}),
        "settings: SIM_WIND: no such parameter; did you mean SIM_WIND_",
    ),
    "value": (lambda: plumbline.fly("hover", settings={"SIM_ACT_DELAY_MS": -1}), "SIM_ACT_DELAY_MS"),
    "sweep": (lambda: plumbline.sweep("hover", vary={"SIM_WIND": [1]}), "did you mean SIM_WIND_"),
    "seed": (lambda: plumbline.fly("hover", seed=-1), "seed = -1; must be a whole number from 0 to"),
    "half a seed": (lambda: plumbline.fly("hover", seed=1.5), "seed = 1.5; must be a whole number"),  # type: ignore[arg-type]
    "word": (
        lambda: plumbline.fly("hover", settings={"SIM_WIND_E": "fast"}),  # type: ignore[dict-item]
        "settings['SIM_WIND_E'] = 'fast'; must be a finite number",
    ),
    "no number": (
        lambda: plumbline.fly("hover", settings={"SIM_WIND_E": float("nan")}),
        "settings['SIM_WIND_E'] = nan; must be a finite number",
    ),
    "timeout": (lambda: plumbline.fly("hover", timeout_s=0), "timeout_s = 0; must be greater than 0"),
    "no law": (lambda: plumbline.fly("hover", law=3), "law = 3; must be a name"),  # type: ignore[arg-type]
    "no vehicle": (
        lambda: plumbline.fly("hover", vehicle=3),
        "vehicle = 3; must be a name, the path of a file",
    ),  # type: ignore[arg-type]
    "infeasible": (
        lambda: plumbline.fly(WILD),
        "; force=True tries: items[",
    ),
    "fails": (
        lambda: plumbline.fly("hover", planner="plumbline.examples.load_pid:LoadPid"),
        "planner plumbline.examples.load_pid:LoadPid: LoadPid has no method plan",
    ),
    "seeds": (lambda: plumbline.sweep("hover", seeds=0), "seeds = 0; must be a whole number, 1 or more"),
    "a seed": (
        lambda: plumbline.sweep("hover", seeds=[3, 1.5]),  # type: ignore[list-item]
        "seeds[1] = 1.5; must be a whole number from 0 to 9223372036854775807",
    ),
    "a seed twice": (lambda: plumbline.sweep("hover", seeds=[3, 3]), "seeds 3,3: 3 is there twice; each"),
    "jobs": (lambda: plumbline.sweep("hover", jobs=0), "jobs = 0; must be a whole number, 1 or more"),
    "varied": (
        lambda: plumbline.sweep("hover", vary={"SIM_WIND_E": ["fast"]}),  # type: ignore[list-item]
        "vary['SIM_WIND_E'][0] = 'fast'; must be a finite number",
    ),
    "nothing varied": (
        lambda: plumbline.sweep("hover", vary={"SIM_WIND_E": []}),
        "vary['SIM_WIND_E'] is empty; must be a list of one number at least",
    ),
    "a range that is not sampled": (
        lambda: plumbline.sweep("hover", vary={"SIM_ACT_DELAY_MS": "0:3"}),
        "vary SIM_ACT_DELAY_MS=0:3: a range without a count is for sample; append a count, as :7",
    ),
    "no range": (
        lambda: plumbline.sweep("hover", vary={"SIM_ACT_DELAY_MS": "fast"}),
        "vary SIM_ACT_DELAY_MS=fast: ",
    ),
    "sampled from nothing": (
        lambda: plumbline.sweep("hover", sample=3),
        "sample draws the values of vary, and there is none",
    ),
    "no mission": (
        lambda: plumbline.fly(plumbline.Vehicle.load("bebop")),  # type: ignore[arg-type]
        "; must be a name, the path of a file, or a plumbline.Mission",
    ),
    "no list of laws": (
        lambda: plumbline.sweep("hover", laws=3),  # type: ignore[arg-type]
        "laws = 3; must be a law or a list of laws, as ['plumbline']",
    ),
    "no such single law": (lambda: plumbline.sweep("hover", laws="pid"), "law 'pid': no control law of that"),
    "no such law": (lambda: plumbline.sweep("hover", laws=["pid"]), "law 'pid': no control law of that name"),
    "chosen law": (
        lambda: plumbline.sweep("hover", settings={"CTL_LAW": 1}),
        "CTL_LAW is what laws says; give laws instead",
    ),
    "set law": (
        lambda: plumbline.fly("hover", settings={"CTL_LAW": 1}),
        "settings: CTL_LAW is what law names; give law",
    ),
    "out": (lambda: plumbline.sweep("hover", out="/dev/null/x"), "out /dev/null/x: Not a directory"),
    "kind": (lambda: plumbline.sweep("hover", kind="csv"), "must be pandas, polars or arrow"),
}


@pytest.mark.usefixtures("swept_here")
@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_one_line(call: Any, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(plumbline.Error) as told:
        call()
    assert says in str(told.value) and "\n" not in str(told.value)
    assert "--" not in str(told.value)
    assert capsys.readouterr().err == ""


def test_a_report_that_cannot_be_written(flight: plumbline.Flight) -> None:
    with pytest.raises(plumbline.Error, match=r"^/dev/null/x: Not a directory; name another folder$"):
        flight.report("/dev/null/x")


def test_a_picture_that_there_is_not(flight: plumbline.Flight) -> None:
    with pytest.raises(plumbline.Error, match="must be one of overview, track"):
        flight.plot("trak")


def test_a_folder_of_the_same_name_beside_the_script_hides_nothing(tmp_path: Path) -> None:
    """As for a script that lies beside the clone."""
    (tmp_path / "plumbline").mkdir()
    script = tmp_path / "script.py"
    script.write_text("from importlib.util import find_spec; print(find_spec('plumbline').origin)")
    found = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == plumbline.__file__
