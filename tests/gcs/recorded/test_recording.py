"""Recordings and column maps as files: what is read, and the one line that says what is wrong."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from gcs.cli import gcs
from gcs.recorded.column_map import MAPS, MapError, load_map
from gcs.recorded.recording import RecordingError, is_table, read_recording

MAP = """
time = 0
[vehicle]
position = [1, 2, 3]
quaternion = [4, 5, 6, 7]
[load]
position = [8, 9, 10]
[model]
mass_ratio = 0.2
"""
ROW = "{:.2f},0,0,2,1,0,0,0,0,0,1\n"


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(gcs, [str(one) for one in arguments], prog_name="gcs")


def rows(count: int = 300) -> str:
    return "".join(ROW.format(0.05 * k) for k in range(count))


@pytest.fixture
def columns(tmp_path: Path) -> Path:
    path = tmp_path / "map.toml"
    path.write_text(MAP, encoding="utf-8")
    return path


def test_columns_are_taken_as_the_map_says(tmp_path: Path, columns: Path) -> None:
    path = tmp_path / "flight.csv.gz"
    path.write_bytes(gzip.compress(rows().encode(), mtime=0))
    found = read_recording(path, load_map(columns))
    assert found.name == "flight"
    assert found.time_s is not None
    assert found.time_s[:3] == pytest.approx([0.0, 0.05, 0.1])
    assert found.position[7] == pytest.approx([0.0, 0.0, 2.0])
    assert found.quaternion_xyzw[7] == pytest.approx([0.0, 0.0, 0.0, 1.0])  # w first in the file
    assert found.load[7] == pytest.approx([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "not rows of comma-separated numbers"),
        (b"\x00\xff\xfe" * 100, "not rows of comma-separated numbers"),
        (b"a,b,c\n" * 300, "line 2: 'a' is not a number; one line of headings can be skipped, no more"),
        (b"a,b,c\n" + b"1,2,note\n" * 300, "numbers: line 2: 'note' is not a number"),
        (b"a,b,c\n", "numbers: a line of headings and no rows"),
        (
            b"t" + b",x" * 10 + b"\ns" + b",m" * 10 + b"\n" + rows().encode(),
            "line 2: 's' is not a number; one line",
        ),
        (b"t,x\n" + rows().encode() + b"NA" + b",y" * 10, "line 302: 'y' is not a number"),
        (rows().replace("0,0,2", "o,0,2", 1).encode(), "line 1: 'o' is not a number"),
        (b"1,2,3\n" * 300, "3 columns; the column map asks for column 10"),
        (rows(20).encode(), "20 rows of 20 with a position and a unit quaternion"),
        (rows().replace(",2,1,0,0,0,", ",2,0,0,0,0,").encode(), "0 rows of 300"),
        (rows().encode() + ROW.format(1.0).encode(), "times do not increase"),
        (rows().encode() + b"1,2\n", "not rows of comma-separated numbers"),
    ],
)
@pytest.mark.parametrize("command", ["identify", "replay"])
def test_a_broken_file_is_told_in_one_line(
    tmp_path: Path, columns: Path, command: str, content: bytes, says: str
) -> None:
    path = tmp_path / "flight.csv"
    path.write_bytes(content)
    result = run(command, path, "--columns", columns)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"gcs: {path}: ")
    assert says in line


@pytest.mark.parametrize("name", ["flight.csv", "flight.csv.gz"])
def test_a_line_of_headings_is_skipped(tmp_path: Path, columns: Path, name: str) -> None:
    path = tmp_path / name
    content = b"time,x,y,z\n" + rows().encode()
    path.write_bytes(gzip.compress(content, mtime=0) if name.endswith(".gz") else content)
    found = read_recording(path, load_map(columns))
    assert found.time_s is not None
    assert (len(found.time_s), found.time_s[0]) == (300, 0.0)


def test_a_torn_archive_and_a_file_that_is_not_there(tmp_path: Path, columns: Path) -> None:
    torn = tmp_path / "flight.csv.gz"
    torn.write_bytes(gzip.compress(rows().encode(), mtime=0)[:100])
    for path in (torn, tmp_path / "nothing.csv", tmp_path, tmp_path / "nothing.tlog"):
        with pytest.raises(RecordingError, match=str(path)):
            read_recording(path, load_map(columns))


def test_rows_need_a_map(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    path.write_text(rows(), encoding="utf-8")
    result = run("identify", path)
    assert result.exit_code == 2
    assert "--columns: motion-capture, telemetry or a file" in result.stderr
    assert "no [vehicle]" in run("identify", path, "--columns", "telemetry").stderr


@pytest.mark.parametrize("command", ["identify", "replay"])
@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("README.md", b"# Plumbline\nSays, with commas, how it is used\n"),
        ("flight.parquet", b"PAR1\x15\x04\x15," * 50),
        ("case-b.toml", b'name = "case-b"\n'),
        ("torn.csv.gz", gzip.compress(rows().encode(), mtime=0)[:12]),
        ("empty.csv", b""),
    ],
)
def test_a_file_of_another_kind_is_not_asked_for_its_columns(
    tmp_path: Path, command: str, name: str, content: bytes
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    result = run(command, path)
    assert result.exit_code == 2
    assert f"{path}: no recording of a flight; must be a flight's folder" in result.stderr
    assert "--columns" not in result.stderr


def test_a_table_with_headings_is_a_table(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv.gz"
    path.write_bytes(gzip.compress(b"t,x,y\n0.0,1,2\n"))
    assert is_table(path)


@pytest.mark.parametrize("command", ["identify", "replay"])
def test_a_flight_is_named_by_its_folder(tmp_path: Path, command: str) -> None:
    result = run(command, tmp_path)
    assert result.exit_code == 2
    assert f"{tmp_path}: holds no flight.tlog; must be a flight's folder" in result.stderr
    (tmp_path / "flight.tlog").write_bytes(b"")
    assert f"gcs: {tmp_path / 'flight.tlog'}: " in run(command, tmp_path).stderr


def test_a_map_of_rows_of_numbers_is_not_for_a_telemetry_log(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"")
    result = run("identify", path, "--columns", "motion-capture")
    assert result.exit_code == 2
    assert f"{path} names its columns itself: leave --columns out" in result.stderr


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (MAP.replace("quaternion =", "quaternions ="), "unknown key; write quaternion"),
        (MAP.replace("[1, 2, 3]", "[1, 2]"), "vehicle.position"),
        (MAP.replace("[1, 2, 3]", "[1, 2, 2]"), "vehicle.position[2] = 2; is vehicle.position[1] already"),
        (MAP.replace("time = 0", "time = 0.5"), "time = 0.5; must be a whole number"),
        (MAP.replace("[1, 2, 3]", '["x", 2, 3]'), 'vehicle.position[0] = "x"; must be a whole number'),
        (MAP.replace("time = 0", "time = 0\nrate_hz = 30"), "has both time and rate_hz"),
        (MAP.replace("mass_ratio = 0.2", "mass_ratio = -1"), "model.mass_ratio = -1"),
        (MAP + "[identify]\nparameters = ['mass']\n", "identify.parameters[0]"),
    ],
)
def test_a_wrong_map_is_told(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "map.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(MapError) as error:
        load_map(path)
    assert says in str(error.value)


@pytest.mark.parametrize("name", MAPS.names())
def test_shipped_maps_are_read(name: str) -> None:
    assert np.isfinite(load_map(name).load_model(1.0)).all()


def test_what_the_map_gets_wrong_is_told_in_one_line(tmp_path: Path, columns: Path) -> None:
    path = tmp_path / "flight.csv"
    path.write_text("".join(ROW.format(50.0 * k) for k in range(300)), encoding="utf-8")  # ms
    for command in ("identify", "replay"):
        told = run(command, path, "--columns", columns).stderr
        assert told.startswith(f"gcs: {path}: rows would be 50 s apart; ") and told.count("\n") == 1
    far = MAP.replace("[load]", "[attachment]\nbelow_m = 700.0\n[load]")
    columns.write_text(far, encoding="utf-8")
    path.write_text(rows(), encoding="utf-8")
    told = run("identify", path, "--columns", columns).stderr
    assert told.startswith(f"gcs: {path}: the load would be 699 m from the vehicle") and told.count("\n") == 1


def test_a_pipe_is_not_read(tmp_path: Path, columns: Path) -> None:
    path = tmp_path / "flight.csv"
    os.mkfifo(path)
    for command in ("identify", "replay"):
        for words in ((), ("--columns", columns)):
            assert f"gcs: {path}: not a file; must be" in run(command, path, *words).stderr


def test_of_a_recording_with_a_break_everywhere_nothing_is_said_to_be_predicted(
    tmp_path: Path, columns: Path
) -> None:
    path = tmp_path / "flight.csv"
    times = [0.4 * k + 1.5 * (k // 4) for k in range(300)]  # never 2 s without a break
    path.write_text("".join(ROW.format(time) for time in times), encoding="utf-8")
    result = run("replay", path, "--columns", columns, "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert "predicted 2 s ahead: nothing; no stretch without a break is so long" in result.stdout
