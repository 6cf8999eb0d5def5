"""The flight software is compiled in parts, by several processes, and errors are reported."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

import plumbline
from autopilot.shell.compiling import Part
from gcs.cli import gcs
from gcs.errors import GcsError, StoppedError
from gcs.shell.display import CompileDisplay
from gcs.sweep.warmup import sweep_parts
from gcs.workflows.warmup import flight_parts, vehicle_parts, warm_up

SOURCE = Path(__file__)


def part(mark: str, statement: str, cost_s: float = 1.0) -> Part:
    """A part that runs a statement with a program of the standard library."""
    return Part(f"the {mark}", "timeit", ("-n", "1", "-r", "1", statement), SOURCE, mark, cost_s)


@pytest.fixture(autouse=True)
def nothing_compiled(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")


def test_a_flight_needs_its_law_alone():
    marks = [part.mark for part in flight_parts(["lqr"])]
    assert set(marks) == {"tick", "law-lqr", "messages", "paths", "world", "check", "report"}
    both = [part.mark for part in flight_parts(["lqr", "thesis"])]
    assert sorted(both) == sorted({*marks, "law-thesis"})


def test_a_cable_of_links_is_compiled_before_its_flight(tmp_path):
    assert vehicle_parts("bebop", [("SIM_WIND_E", 2.0)]) == []
    assert [part.mark for part in vehicle_parts("bebop", [("SIM_CBL_LINKS", 10.0)])] == ["cable"]
    made = tmp_path / "made.toml"
    made.write_text('believed = "bebop"\ncable_links = 8\n')
    assert [part.mark for part in vehicle_parts(str(made), [])] == ["cable"]
    assert vehicle_parts(str(made), [("SIM_CBL_LINKS", 0.0)]) == []


def test_a_sweep_needs_no_report_but_flights_of_its_own():
    marks = [part.mark for part in sweep_parts(["lqr", "thesis"])]
    fly = {"tick", "law-lqr", "law-thesis", "messages", "paths", "world"}
    assert sorted(marks) == sorted({*fly, "alone"})


def test_who_sweeps_can_have_eight_flights_at_once_compiled_beforehand(monkeypatch):
    asked = []
    monkeypatch.setattr("gcs.workflows.warmup.warm_up", lambda parts, quiet: asked.extend(parts))
    assert CliRunner().invoke(gcs, ["warmup", "--law", "lqr", "--sweeps"]).exit_code == 0
    marks = [part.mark for part in asked]
    fly = {part.mark for part in flight_parts(["lqr"])}
    assert sorted(marks) == sorted({*fly, "here", "alone", "lanes-lqr"})
    asked.clear()
    assert CliRunner().invoke(gcs, ["warmup", "--all"]).exit_code == 0
    assert not [part.mark for part in asked if part.mark.startswith(("alone", "lanes"))]


def test_what_is_compiled_is_not_compiled_again_and_the_longest_part_comes_first(tmp_path):
    marks = tmp_path / "compiled"
    parts = [
        part(name, f"open({str(marks)!r}, 'a').write('{name} ')", cost_s)
        for name, cost_s in (("paths", 1.0), ("tick", 9.0), ("world", 3.0))
    ]
    parts[2].mark_done()
    warm_up(parts, quiet=True)
    assert sorted(marks.read_text().split()) == ["paths", "tick"]
    warm_up(parts, quiet=True)
    assert len(marks.read_text().split()) == 2


def load_of(monkeypatch, others):
    """Pretend that so many other processes want a core."""
    monkeypatch.setattr(os, "getloadavg", lambda: (float(others), 0.0, 0.0), raising=False)


def test_more_time_is_told_where_others_want_the_cores(tmp_path, capsys, monkeypatch):
    load_of(monkeypatch, 1000)
    warm_up([part("only", "pass")])
    (more,) = re.search(
        r" after 0 s, about (\d+) (?:s|min) more$", capsys.readouterr().err.splitlines()[1]
    ).groups()
    assert int(more) > 3


def test_all_parts_run_and_are_marked(tmp_path, capsys, monkeypatch):
    load_of(monkeypatch, 0)
    parts = [part(name, f"open({str(tmp_path / name)!r}, 'w')") for name in ("first", "second", "third")]
    warm_up(parts)
    assert all((tmp_path / name).exists() for name in ("first", "second", "third"))
    assert all(one.ready for one in parts)
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("gcs: compiling the flight software, once: 3 parts, about ")
    assert re.search(r"3 of 3 parts remain after 0 s, about [123] s more$", said[1])
    ended = [line.split(" in ") for line in said if line.startswith("gcs: compiled ")]
    assert sorted(title for title, _ in ended) == [
        f"gcs: compiled the {n}" for n in ("first", "second", "third")
    ]
    assert [after.split("; ")[1].split(" after ")[0] for _, after in ended] == [
        "2 of 3 parts remain",
        "1 of 3 parts remain",
        "that was the last part",
    ]


def test_a_single_part_is_named(capsys):
    warm_up([part("world", "pass", 10.0)])
    first = capsys.readouterr().err.splitlines()[0]
    assert first == "gcs: compiling the flight software, once: the world, about 10 s on an idle machine"


def test_nothing_is_said_where_nothing_is_to_be_done(capsys):
    warm_up([])
    assert capsys.readouterr().err == ""


def test_a_part_that_fails_is_told_with_its_last_words_and_not_marked():
    good = part("good", "pass")
    bad = part("bad", "raise SystemExit('no compiler')")
    with pytest.raises(GcsError, match=r"the bad cannot be compiled: .*no compiler"):
        warm_up([bad, good], quiet=True)
    assert not bad.ready


def test_a_stop_ends_it_at_once():
    endless = part("endless", "import signal; signal.pause()")
    with pytest.raises(StoppedError, match="stopped while the flight software was compiled"):
        warm_up([endless], quiet=True, stopped=lambda: True)
    assert not endless.ready


def test_what_is_compiled_is_told_kernel_by_kernel(capsys):
    with CompileDisplay(quiet=False) as display:
        display.update(
            {"the paths": "autopilot.trajectory.splines.sample", "the report": ""}, 2, 5, "2 of 5 remain"
        )
    kernels = "the paths (autopilot.trajectory.splines.sample), the report"
    assert capsys.readouterr().err == f"gcs: compiling {kernels}; 2 of 5 remain\n"


@pytest.fixture
def unwritable(tmp_path, monkeypatch):
    """The folder of machine code, which cannot be made."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    return tmp_path / "file" / "plumbline" / "kernels"


def test_what_cannot_be_kept_is_compiled_once_into_a_folder_that_the_children_share(
    unwritable, tmp_path, capsys
):
    seen = tmp_path / "seen"
    parts = [
        part(name, f"import os; print(os.environ['NUMBA_CACHE_DIR'], file=open({str(seen)!r}, 'a'))")
        for name in ("tick", "world")
    ]
    warm_up(parts, quiet=True)
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith(f"gcs: {unwritable}: Not a directory; the machine code cannot be kept there")
    assert "let NUMBA_CACHE_DIR name a folder" in said
    (folder,) = {Path(line) for line in seen.read_text().split()}
    assert folder == Path(os.environ["NUMBA_CACHE_DIR"]) and list(folder.rglob("*-tick"))
    assert all(one.ready for one in parts)
    warm_up([*parts, part("later", "pass")], quiet=True)
    assert capsys.readouterr().err == ""
    assert len(seen.read_text().split()) == 2


def refuse(*_):
    raise GcsError("no flight is needed")


def test_a_script_is_warned_that_machine_code_is_not_kept(unwritable, monkeypatch, capfd):
    monkeypatch.setattr(
        "gcs.workflows.in_process_flight.in_process_parts", lambda laws: [part("tick", "pass")]
    )
    monkeypatch.setattr("gcs.workflows.in_process_flight.check_mission", refuse)
    not_kept = pytest.warns(UserWarning, match="Not a directory; the machine code cannot be kept there")
    with not_kept as told, pytest.raises(plumbline.Error, match="no flight is needed"):
        plumbline.fly("hover", sensors="ideal")
    assert told[0].filename == __file__
    assert capfd.readouterr() == ("", "")


def test_without_any_folder_for_machine_code_nothing_is_compiled(unwritable, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(unwritable))
    with pytest.raises(GcsError, match=r"the machine code cannot be stored: .*let NUMBA_CACHE_DIR name"):
        warm_up([part("tick", "pass")])


def test_who_compiles_beforehand_is_told_that_it_would_be_lost(unwritable, monkeypatch):
    result = CliRunner().invoke(gcs, ["warmup", "--quiet"])
    assert result.exit_code == 1
    told = f"gcs: {unwritable}: Not a directory; the machine code cannot be kept there; to keep it, let "
    assert result.stderr.startswith(told)
    monkeypatch.setattr(Part, "ready", True)
    assert CliRunner().invoke(gcs, ["warmup", "--quiet"]).exit_code == 0, "nothing is to be compiled"
