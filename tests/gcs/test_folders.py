"""Folders of flights: each flight has its own, even if several begin at the same time."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path

import pytest
from click.testing import CliRunner

from gcs.cli import gcs
from gcs.errors import EXIT_USAGE, GcsError, InputError, disk_problem, write_error
from gcs.folders import (
    LOCK_FILE,
    PAGE_FILE,
    PLAN_FILE,
    RESULTS_FILE,
    SUMMARY_FILE,
    TLOG_FILE,
    check_no_other_results,
    fresh_folder,
    reserved,
)
from gcs.workflows.flight_folder import UNFLOWN_FILE, FlightFolder
from gcs.workflows.report import make_report, remade_report
from tests.doubles import recorded_flights


def arrow_on_a_full_disk(_: Path) -> None:
    raise OSError(errno.ENOSPC, "Error writing bytes to file. Detail: [errno 28] No space left on device")


def test_flights_that_begin_in_one_second_have_folders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with ThreadPoolExecutor(8) as pool:
        folders = list(pool.map(fresh_folder, ["hover"] * 40))
    assert len(set(folders)) == 40
    assert all(folder.is_dir() and folder.name.startswith("hover-") for folder in folders)


def remake(log: Path, out: Path | None) -> None:
    with remade_report(log, out, quiet=True):
        pass


def test_where_no_folder_can_be_made_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "flights").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match=r"flights: File exists; name another folder by --out$"):
        fresh_folder("hover")


def test_of_two_flights_into_one_folder_the_first_has_it(tmp_path: Path) -> None:
    writer = "a flight or capture is in progress, or a report is being written,"
    in_progress = f"^{tmp_path}: {writer} there; wait until it has ended, or name another folder by --out$"
    with FlightFolder(tmp_path, overwrite=False) as folder:
        (tmp_path / TLOG_FILE).write_bytes(b"of the first")
        for overwrite in (False, True):
            with pytest.raises(InputError, match=in_progress):
                FlightFolder(tmp_path, overwrite).__enter__()
        folder.keep()
        folder.unlock()  # the page of the flight may still be open
        with pytest.raises(GcsError, match="holds a flight already"):
            FlightFolder(tmp_path, overwrite=False).__enter__()
        assert (tmp_path / TLOG_FILE).read_bytes() == b"of the first"
        with FlightFolder(tmp_path, overwrite=True) as second:
            second.keep()


def test_no_report_is_written_where_a_flight_is_in_progress(tmp_path: Path) -> None:
    with FlightFolder(tmp_path, overwrite=False) as folder:
        recorded_flights.flight(1.0, recorded_flights.still).write(tmp_path / TLOG_FILE)
        with pytest.raises(InputError, match=": a flight or capture is in progress"):
            remake(tmp_path, None)
        folder.keep()
    assert {path.name for path in tmp_path.iterdir()} == {TLOG_FILE, LOCK_FILE}


def test_the_folder_of_a_report_is_locked_until_the_files_that_follow_it_are_written(tmp_path: Path) -> None:
    recorded_flights.flight(1.0, recorded_flights.still).write(tmp_path / TLOG_FILE)
    with remade_report(tmp_path, None, quiet=True), pytest.raises(InputError, match="in progress"):
        FlightFolder(tmp_path, overwrite=True).__enter__()
    with FlightFolder(tmp_path, overwrite=True):
        pass


def test_a_single_file_is_locked_by_another_one_that_is_deleted(tmp_path: Path) -> None:
    file, other, writer = tmp_path / "a.tlog", tmp_path / "b.tlog", "another gcs capture is writing"
    expected = f"^{file}: {writer} there; wait until it has ended, or name another file by --out$"
    with reserved(file, writer), reserved(other, writer), pytest.raises(InputError, match=expected):
        reserved(file, writer).__enter__()
    assert not list(tmp_path.iterdir())


def test_a_folder_whose_writer_was_killed_is_free(tmp_path: Path) -> None:
    hold = "import sys; from pathlib import Path; from gcs.folders import reserved\n"
    hold += "with reserved(Path(sys.argv[1])): print('locked', flush=True); sys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", hold, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"locked\n"
        with pytest.raises(InputError, match="in progress"):
            reserved(tmp_path).__enter__()
        writer.kill()
    with reserved(tmp_path):
        pass


def test_of_a_flight_that_is_overwritten_nothing_is_left_beside_the_new_one(tmp_path: Path) -> None:
    ours = [TLOG_FILE, SUMMARY_FILE, PAGE_FILE, "meta.json", "flight.parquet", "flight.ulg", "flight.mcap"]
    ours += ["flight.common.tlog", "sitl.log", "autopilot.log", "overview.png", "track.png", "tension.png"]
    for name in [*ours, "notes.txt"]:
        (tmp_path / name).write_text("of the earlier flight", encoding="utf-8")
    with pytest.raises(KeyboardInterrupt), FlightFolder(tmp_path, overwrite=True):
        (tmp_path / TLOG_FILE).write_bytes(b"telemetry")
        raise KeyboardInterrupt
    assert {path.name for path in tmp_path.iterdir()} == {TLOG_FILE, LOCK_FILE, "notes.txt"}


def test_the_report_of_a_log_does_not_take_the_place_of_another_flights(tmp_path: Path) -> None:
    logs = [tmp_path / name / TLOG_FILE for name in ("one", "other")]
    for seconds, log in enumerate(logs, start=1):
        log.parent.mkdir()
        recorded_flights.flight(float(seconds), recorded_flights.still).write(log)
    with pytest.raises(InputError, match=r"other: holds another flight; name another folder by --out$"):
        remake(logs[0], tmp_path / "other")
    assert list((tmp_path / "other").iterdir()) == [logs[1]]


def test_the_report_of_a_log_does_not_take_the_place_of_another_logs(tmp_path: Path) -> None:
    logs, out = [tmp_path / "one.tlog", tmp_path / "other.tlog"], tmp_path / "report"
    for seconds, log in enumerate(logs, start=1):
        recorded_flights.flight(float(seconds), recorded_flights.still).write(log)
    for _ in range(2):  # the same log may be reported again
        remake(logs[0], out)
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    with pytest.raises(InputError, match=r"report: holds the report of another flight; name another folder"):
        remake(logs[1], out)
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before
    (out / SUMMARY_FILE).unlink()
    with pytest.raises(
        InputError, match=r"holds a report\.html that is not of a flight; name another folder"
    ):
        remake(logs[0], out)


def test_what_was_recorded_outlives_two_interrupts(tmp_path: Path) -> None:
    def interrupted(telemetry: bytes) -> None:
        with FlightFolder(tmp_path / "out", overwrite=False):
            (tmp_path / "out" / "flight.tlog").write_bytes(telemetry)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted(b"")
    assert not (tmp_path / "out").exists(), "nothing was"
    with pytest.raises(KeyboardInterrupt):
        interrupted(b"telemetry")
    assert (tmp_path / "out" / "flight.tlog").read_bytes() == b"telemetry"


@pytest.mark.parametrize("telemetry", [b"", b"telemetry"])
def test_on_a_full_disk_it_is_told_what_is_kept_and_what_reads_it(tmp_path: Path, telemetry: bytes) -> None:
    out, tlog = tmp_path / "out", tmp_path / "out" / TLOG_FILE
    with pytest.raises(GcsError) as error, FlightFolder(out, overwrite=False):
        tlog.write_bytes(telemetry)
        raise OSError(errno.ENOSPC, "full")
    kept = f"9 bytes of telemetry are kept in {tlog}; gcs report {out} reads them"
    told = kept if telemetry else "no telemetry could be kept"
    assert str(error.value) == f"{out}: no space left on device; {told}"
    assert out.exists() == bool(telemetry)


@pytest.mark.parametrize("telemetry", [b"", b"telemetry"])
def test_a_folder_into_which_nothing_was_flown_is_free_for_the_next_flight(
    tmp_path: Path, telemetry: bytes
) -> None:
    with FlightFolder(tmp_path / "out", overwrite=False) as folder:
        (tmp_path / "out" / TLOG_FILE).write_bytes(telemetry)
        if telemetry:
            assert folder.set_aside().read_bytes() == telemetry
    assert (tmp_path / "out").exists() == bool(telemetry)
    with FlightFolder(tmp_path / "out", overwrite=False):
        pass
    assert not telemetry or (tmp_path / "out" / UNFLOWN_FILE).read_bytes() == telemetry


@pytest.mark.parametrize("abandoned", [False, True])
def test_a_flight_leaves_no_telemetry_of_an_earlier_attempt_beside_its_own(
    tmp_path: Path, abandoned: bool
) -> None:
    with FlightFolder(tmp_path, overwrite=False) as folder:
        folder.set_aside()
    expected = pytest.raises(KeyboardInterrupt) if abandoned else nullcontext()
    with expected, FlightFolder(tmp_path, overwrite=True) as folder:
        (tmp_path / TLOG_FILE).write_bytes(b"telemetry")
        if abandoned:
            raise KeyboardInterrupt
        folder.keep()
    assert {path.name for path in tmp_path.iterdir()} == {TLOG_FILE, LOCK_FILE}


@pytest.mark.parametrize(
    ("command", "others"),
    [
        ("fly hover", PLAN_FILE),
        ("fly hover", TLOG_FILE),
        ("fly hover", SUMMARY_FILE),
        ("sweep hover", TLOG_FILE),
        ("sweep hover", PLAN_FILE),
        ("experiments thesis", TLOG_FILE),
    ],
)
def test_a_folder_that_holds_other_results_is_wrong_input_of_every_command(
    tmp_path: Path, command: str, others: str
) -> None:
    (tmp_path / others).write_text('{"origin": {}}', encoding="utf-8")
    result = CliRunner().invoke(gcs, [*command.split(), "--out", str(tmp_path)], prog_name="gcs")
    assert (result.exit_code, "holds" in result.stderr) == (EXIT_USAGE, True)


@pytest.mark.parametrize(
    ("there", "kind", "told"),
    [
        (PLAN_FILE, TLOG_FILE, "holds a sweep; name another"),
        (TLOG_FILE, PLAN_FILE, "holds a flight; name another"),
        (RESULTS_FILE, PLAN_FILE, "holds the thesis's experiments; name another"),
        (PAGE_FILE, PLAN_FILE, "holds a report.html that is not of a sweep; name another"),
    ],
)
def test_results_of_one_kind_do_not_take_the_place_of_others(
    tmp_path: Path, there: str, kind: str, told: str
) -> None:
    (tmp_path / there).write_text("theirs", encoding="utf-8")
    with pytest.raises(GcsError, match=told):
        check_no_other_results(tmp_path, kind, (PAGE_FILE,))


def test_a_flight_leaves_a_sweep_and_files_of_others_as_they_are(tmp_path: Path) -> None:
    for name in (SUMMARY_FILE, PLAN_FILE):
        (tmp_path / name).write_text("theirs", encoding="utf-8")
        with pytest.raises(GcsError, match="holds a "):
            FlightFolder(tmp_path, overwrite=name == PLAN_FILE).__enter__()
        assert [file.name for file in tmp_path.iterdir()] == [name]
        (tmp_path / name).unlink()


def test_a_folder_that_is_written_into_is_not_anothers(tmp_path: Path) -> None:
    writer = "another sweep is writing"
    in_use = reserved(tmp_path, writer)
    with in_use, pytest.raises(InputError, match=f"^{tmp_path}: another sweep is writing there; "):
        reserved(tmp_path, writer).__enter__()
    with reserved(tmp_path, writer):
        pass


def test_a_full_disk_is_told_by_the_systems_word_whoever_writes() -> None:
    with pytest.raises(OSError) as error:
        arrow_on_a_full_disk(Path())
    assert disk_problem(error.value) == "no space left on device"


@pytest.mark.parametrize("whole", [True, False])
def test_a_report_that_has_no_place_says_what_is_kept_and_how_to_make_it_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: bool
) -> None:
    tlog, summary = tmp_path / TLOG_FILE, tmp_path / SUMMARY_FILE
    tlog.touch()

    def full(*_: object) -> None:
        summary.write_text('{"outcome": 1}' if whole else '{"out', encoding="utf-8")
        arrow_on_a_full_disk(tmp_path)

    monkeypatch.setattr("gcs.report.build.build_report", full)
    with pytest.raises(GcsError, match="no space left on device") as error:
        make_report(tlog, tmp_path, None, quiet=True)
    said = str(error.value)
    assert said.endswith(f"make it when there is space: gcs report {tmp_path}")
    assert f"kept are {tlog}" in said
    assert (str(summary) in said) == whole


@pytest.mark.parametrize("command", ["fly hover", "sweep hover"])
def test_a_working_folder_that_is_not_writable_is_wrong_input_and_no_option_is_blamed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("flights", "sweeps"):
        (tmp_path / name).touch()  # a file in place of the folder, because root may write everywhere
    result = CliRunner().invoke(gcs, command.split(), prog_name="gcs")
    assert result.exit_code == EXIT_USAGE
    last = result.stderr.splitlines()[-1]
    assert last.endswith("name another folder by --out")
    assert "--out" not in last.removesuffix("by --out")


@pytest.mark.parametrize(("number", "kind"), [(errno.EROFS, InputError), (errno.ENOSPC, GcsError)])
def test_what_cannot_be_written_says_to_name_another(number: int, kind: type[GcsError]) -> None:
    found = write_error(OSError(number, "wrapped by a library"), "replays/case-b")
    assert type(found) is kind
    assert str(found).startswith(f"replays/case-b: {os.strerror(number)}; ")
    assert str(found).endswith("name another folder by --out")
