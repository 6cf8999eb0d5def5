"""Requirements on a run: read, judged, printed, and as a test report."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner

from gcs.cli import gcs
from gcs.clients.flight import Outcome
from gcs.errors import GcsError, InputError
from gcs.workflows.fly import Flight
from gcs.workflows.requirements import (
    check_requirements,
    junit_on_error,
    parse_requirements,
    report_verdicts,
    uncovered_failures,
)

KEYS = ("load_error_max_m", "outcome", "slack_events")
RECORD = {"load_error_max_m": 0.004, "outcome": "completed", "slack_events": None}


@pytest.mark.parametrize(
    ("text", "is_met"),
    [
        ("load_error_max_m < 0.01", True),
        ("load_error_max_m<=0.004", True),
        ("load_error_max_m < 0.004", False),
        ("load_error_max_m > 4e-3", False),
        ("load_error_max_m >= 0.004", True),
        ("load_error_max_m != 0.004", False),
        ("outcome == completed", True),
        ("outcome == 'completed'", True),
        ("outcome != completed", False),
        ("outcome == 3", False),
        ("load_error_max_m == small", False),
        ("slack_events == 0", False),  # not known
        ("slack_events != 0", False),
    ],
)
def test_a_requirement_is_met_or_not(text: str, is_met: bool) -> None:
    (verdict,) = check_requirements(parse_requirements([text], KEYS, "gcs fly --json"), RECORD)
    assert verdict.is_met is is_met


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("load_error_max_m", "must be KEY SIGN VALUE"),
        ("load_error_max_m <", "must be KEY SIGN VALUE"),
        ("< 3", "must be KEY SIGN VALUE"),
        ("", "must be KEY SIGN VALUE"),
        ("load_eror_max_m < 1", "did you mean load_error_max_m? all are listed by gcs fly --json"),
        ("nothing_like_it < 1", "no figure nothing_like_it; there are load_error_max_m, outcome"),
        ("outcome < completed", "a word is compared with == or !="),
        ("load_error_max_m < nan", "nothing compares to nan"),
    ],
)
def test_what_is_no_requirement_is_refused_with_what_to_write(text: str, says: str) -> None:
    with pytest.raises(InputError) as told:
        parse_requirements([text], KEYS, "gcs fly --json")
    assert says in str(told.value) and repr(text) in str(told.value)


def test_a_figure_that_there_is_not_is_told_with_a_possible_reason() -> None:
    (verdict,) = check_requirements(parse_requirements(["slack_events == 0"], KEYS, "gcs fly --json"), RECORD)
    assert verdict.line.startswith("required slack_events == 0; found not known; this run has no such figure")


@pytest.mark.parametrize(
    ("required", "completed", "told"),
    [
        (["load_error_max_m < 1"], 1, True),
        (["load_error_max_m < 1"], 4, False),
        (["load_error_max_m < 1", "completed == 1"], 1, False),
        (["failed < 4"], 1, False),
        (["completed_fraction > 0.2"], 1, False),
        (["completed_low_95 > 0.2"], 1, False),
        ([], 1, False),
    ],
)
def test_lost_flights_that_nothing_judges_are_told(required: list[str], completed: int, told: bool) -> None:
    keys = ("load_error_max_m", "completed", "failed", "completed_fraction", "completed_low_95")
    line = uncovered_failures(parse_requirements(required, keys, "gcs sweep --json"), 4, completed)
    assert ('judges the 1 completed of 4 flights; add --require "completed == 4"' in line) == told
    assert told or not line


def test_a_command_refuses_it_before_it_flies() -> None:
    for command in ("fly", "sweep"):
        result = CliRunner().invoke(gcs, [command, "hover", "--require", "no_such < 1"], prog_name="gcs")
        assert result.exit_code == 2 and "no figure no_such" in result.output


def test_a_mistyped_figure_is_told_with_those_that_are_near_and_no_list_of_all() -> None:
    words = ["fly", "hover", "--require", "load_error_mx_m < 1"]
    (line,) = CliRunner().invoke(gcs, words, prog_name="gcs").stderr.splitlines()
    told = "no figure load_error_mx_m; did you mean load_error_max_m or load_error_"
    assert told in line and line.endswith("? all are listed by gcs fly --json and docs/report.md")
    assert len(line) < 240


def test_what_was_missed_is_told_and_stands_in_the_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    junit = tmp_path / "deep" / "report.xml"
    texts = ["load_error_max_m < 0.001", "outcome == completed"]
    assert not report_verdicts(
        "run",
        junit,
        "completed",
        2.5,
        check_requirements(parse_requirements(texts, KEYS, "gcs fly --json"), RECORD),
    )
    assert capsys.readouterr().err == "gcs: required load_error_max_m < 0.001; found 0.004\n"
    (suite,) = ET.parse(junit).getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("time")) == ("3", "1", "2.500")
    failed = {case.get("name"): [fault.get("message") for fault in case] for case in suite}
    assert failed == {
        "completed": [],
        "load_error_max_m < 0.001": ["required load_error_max_m < 0.001; found 0.004"],
        "outcome == completed": [],
    }


def test_a_flight_that_was_lost_fails_in_the_report(tmp_path: Path) -> None:
    junit = tmp_path / "report.xml"
    assert report_verdicts("run", junit, "diverged", 1.0, [], "it fell")
    (suite,) = ET.parse(junit).getroot()
    assert [fault.get("message") for case in suite for fault in case] == ["outcome diverged: it fell"]


def test_a_run_that_does_not_come_about_is_an_error_in_the_report(tmp_path: Path) -> None:
    junit = tmp_path / "report.xml"
    with pytest.raises(GcsError, match="no\x1bport"), junit_on_error("run", junit):
        raise GcsError("no\x1bport")
    (suite,) = ET.parse(junit).getroot()
    assert suite.get("errors") == "1"
    assert [fault.get("message") for case in suite for fault in case] == ["no port"]


def test_a_report_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(GcsError, match=r"--junit .*file/report.xml: File exists"):
        report_verdicts("run", tmp_path / "file" / "report.xml", "completed", 1.0, [])


@pytest.fixture
def one_after_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sweeps fly in this process."""

    @contextmanager
    def here(_: int) -> Iterator[tuple[Executor, int]]:
        with ThreadPoolExecutor(1) as executor:
            yield executor, 1

    monkeypatch.setattr("gcs.workflows.sweep.local_processes", here)


@pytest.mark.usefixtures("one_after_another")
@pytest.mark.parametrize(
    ("required", "code"),
    [
        (("completed_fraction >= 0.99", "planned == 2", "load_error_max_m < 0.05"), 0),
        (("completed_fraction > 1",), 4),
    ],
)
def test_a_sweep_is_judged_as_a_whole(required: tuple[str, ...], code: int, tmp_path: Path) -> None:
    words = [word for text in required for word in ("--require", text)]
    files = ["--out", str(tmp_path / "out"), "--junit", str(tmp_path / "sweep.xml")]
    result = CliRunner().invoke(gcs, ["sweep", "hover", "--seeds", "2", *words, *files, "--quiet"])
    assert result.exit_code == code, result.output
    suite = ET.parse(tmp_path / "sweep.xml").getroot()[0]
    assert (suite.get("tests"), suite.get("failures")) == (str(1 + len(required)), "1" if code else "0")
    if code:
        assert "required completed_fraction > 1; found 1.0" in result.stderr


@pytest.mark.usefixtures("one_after_another")
def test_a_sweep_whose_lost_flights_nothing_judges_says_so(tmp_path: Path) -> None:
    junit = tmp_path / "sweep.xml"
    words = ["sweep", "hover", "--vary", "SIM_LOAD_MASS=0.1,5", "--table-only", "--quiet"]
    words += ["--require", "load_error_max_m < 0.05", "--out", str(tmp_path / "out"), "--junit", str(junit)]
    result = CliRunner().invoke(gcs, words, prog_name="gcs")
    assert result.exit_code == 0, result.output
    assert "--require judges the 1 completed of 2 flights; add " in result.stderr
    (suite,) = ET.parse(junit).getroot()
    assert [case.get("name") for case in suite] == ["all flights flown", "load_error_max_m < 0.05"]


def test_a_sweep_that_does_not_come_about_is_an_error_of_the_same_test_case(tmp_path: Path) -> None:
    junit = tmp_path / "sweep.xml"
    words = ["sweep", "nowhere", "--junit", str(junit), "--out", str(tmp_path / "out")]
    assert CliRunner().invoke(gcs, words, prog_name="gcs").exit_code == 2
    (suite,) = ET.parse(junit).getroot()
    assert [case.get("name") for case in suite] == ["all flights flown"] and suite.get("errors") == "1"


@pytest.mark.parametrize(
    ("outcome", "stopped", "code"),
    [("completed", False, 4), ("diverged", False, 3), ("interrupted", True, 130), ("lost", False, 1)],
)
def test_a_flight_that_was_not_completed_is_that_whatever_was_required(
    outcome: str, stopped: bool, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = {"load_error_max_m": 1.0, "wall_s": 1.0}
    flight = Flight(Outcome(outcome, "it fell"), record, tmp_path, stopped)
    monkeypatch.setattr("gcs.workflows.fly.fly", lambda *_: flight)
    words = ["fly", "hover", "--quiet", "--require", "load_error_max_m < 0.01"]
    result = CliRunner().invoke(gcs, words, prog_name="gcs")
    assert result.exit_code == code
    assert "required load_error_max_m < 0.01; found 1.0" in result.stderr
