"""Reading a recorded flight: rows of numbers, or a telemetry log of Plumbline."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Collection
from io import BufferedIOBase
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs.analysis.tracks import Telemetry
from gcs.folders import TLOG_FILE
from gcs.recorded.column_map import ColumnMap
from gcs.recorded.smoothing import Floats

MIN_ROWS = 200
_MAX_BYTES = 2**30
_MAX_ROW_BYTES = 2**16  # bytes
_UNIX_US = range(10**15, 10**16)  # us since 1970, of any year from 2001 to 2286
_FRAME_STARTS = (b"\xfd", b"\xfe")  # first byte of a MAVLink frame
_MIN_STEP_S, _MAX_STEP_S = 1e-4, 0.5  # between rows
_UNIT_TOLERANCE = 0.1  # by which the length of a quaternion may differ from 1
_LIFTED_M = 0.05  # above the lowest place of the load: a log begins and ends on the ground


# what `gcs identify` and `gcs replay` read
ACCEPTED_FILES = (
    f"must be a flight's folder (with its {TLOG_FILE}), a telemetry log (.tlog), or rows of comma-separated "
    "numbers (.csv, .csv.gz)"
)


class RecordingError(ValueError):
    """What is wrong with the file, in one line, beginning with its name."""


class Recording(NamedTuple):
    """Rows in order; world z up, SI units."""

    name: str
    time_s: Floats | None  # (n,), None if rows have no time
    position: Floats  # (n, 3) of the vehicle
    quaternion_xyzw: Floats  # (n, 4) of the vehicle, body to world
    load: Floats  # (n, 3); nan where it was not measured


def read_recording(path: Path, columns: ColumnMap) -> Recording:
    """The recording in a file; RecordingError if the file has none."""
    try:
        if not path.is_file():
            raise RecordingError(
                f"{path}: {'not a file' if path.exists() else 'no such file'}; {ACCEPTED_FILES}"
            )
        found = _read_log(path) if is_log(path) else _read_table(path, columns)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from None
    return _valid_rows(found, path)


def name_of(path: Path) -> str:
    """The file's name without its suffix, or `.gz` and the one before."""
    return path.name.removesuffix(".gz").rsplit(".", 1)[0]


def is_log(path: Path) -> bool:
    """Whether it is a telemetry log, of a simulated flight, and not rows of numbers: judged by its name, or
    by a time of 8 bytes and a frame at its beginning."""
    if path.suffix == ".tlog" or not path.is_file():  # a pipe may have no end
        return path.suffix == ".tlog"
    try:
        with path.open("rb") as file:
            head = file.read(9)
    except OSError:
        return False
    return int.from_bytes(head[:8]) in _UNIX_US and head[8:] in _FRAME_STARTS


def is_table(path: Path) -> bool:
    """Whether a file begins with rows of comma-separated numbers, after one line of headings at most."""
    return any(_is_row(line) for line in _first_lines(path))


def _first_lines(path: Path) -> tuple[bytes, bytes]:
    """The first two lines; empty if they cannot be read."""
    try:
        with _open(path) as file:
            return file.readline(_MAX_ROW_BYTES), file.readline(_MAX_ROW_BYTES)
    except (OSError, EOFError, zlib.error):  # the last two: a truncated archive
        return b"", b""


def _open(path: Path) -> BufferedIOBase:
    return gzip.open(path) if path.suffix == ".gz" else path.open("rb")


def _is_row(line: bytes) -> bool:
    cells = line.split(b",")
    return len(cells) > 1 and all(_is_number(cell or b"nan") for cell in cells)


def _has_number(line: bytes) -> bool:
    return any(_is_number(cell) for cell in line.split(b","))


def _is_number(cell: bytes) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _first_non_number(path: Path, headings: int, missing: Collection[str]) -> str:
    """The place of the first cell that is neither a number nor one of the words for a `missing` one; empty if
    there is none."""
    with _open(path) as file:
        for number, line in enumerate(file, start=1):
            for cell in line.split(b",") if number > headings else ():
                word = cell.decode(errors="replace").strip(' \t\r\n"')
                if not (word in missing or _is_number(word.encode())):
                    is_heading = number == headings + 1 and not _has_number(line)
                    hint = "; one line of headings can be skipped, no more" if is_heading else ""
                    return f"line {number}: {word[:40]!r} is not a number{hint}"
    return ""


def _read_table(path: Path, columns: ColumnMap) -> Recording:
    from pyarrow import ArrowInvalid, csv

    if columns.vehicle is None:
        raise RecordingError(
            f"{path}: the column map has no [vehicle]: it says not which columns hold the pose"
        )
    if columns.time is None and columns.rate_hz is None:
        raise RecordingError(f"{path}: the column map says neither time nor rate_hz")
    if path.stat().st_size > _MAX_BYTES:
        raise RecordingError(f"{path}: more than {_MAX_BYTES // 2**20} MiB")
    first, second = _first_lines(path)
    headings = int(bool(first.strip()) and not _has_number(first))
    if headings and not second:
        raise RecordingError(f"{path}: not rows of comma-separated numbers: a line of headings and no rows")
    try:
        table = csv.read_csv(path, csv.ReadOptions(autogenerate_column_names=True, skip_rows=headings))
        values = np.column_stack([np.asarray(column, dtype=np.float64) for column in table.columns])
    except (ArrowInvalid, ValueError, TypeError) as error:
        reason = " ".join(str(error).split())[:200]
        if not isinstance(error, ArrowInvalid):
            reason = _first_non_number(path, headings, csv.ConvertOptions().null_values) or reason
        raise RecordingError(f"{path}: not rows of comma-separated numbers: {reason}") from None
    pose, load = columns.vehicle, columns.load
    order = pose.quaternion if pose.quaternion_order == "xyzw" else [*pose.quaternion[1:], pose.quaternion[0]]
    required = [
        *pose.position,
        *order,
        *(load.position if load else []),
        *([columns.time] if columns.time is not None else []),
    ]
    if max(required) >= values.shape[1]:
        raise RecordingError(
            f"{path}: {values.shape[1]} columns; the column map asks for column {max(required)} "
            "(counted from 0)"
        )
    return Recording(
        name_of(path),
        values[:, columns.time] if columns.time is not None else None,
        values[:, pose.position],
        values[:, order],
        values[:, load.position] if load else np.full((len(values), 3), np.nan),
    )


def _read_log(path: Path) -> Recording:
    from gcs.analysis.telemetry import load_telemetry

    try:
        return recording_of(load_telemetry(path), name_of(path))
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None


def recording_of(telemetry: Telemetry, name: str) -> Recording:
    """The true states of a simulated flight while it carries its load; RecordingError if there are none."""
    from scipy.spatial.transform import Rotation, Slerp

    track, attitude = telemetry.load_truth, telemetry.attitude_truth
    if len(track.time_s) < MIN_ROWS or len(attitude.time_s) < MIN_ROWS:
        raise RecordingError("holds no true states of a simulated flight, or too few")
    within = (track.time_s >= attitude.time_s[0]) & (track.time_s <= attitude.time_s[-1])
    off_ground = track.position_m[:, 2] > np.min(track.position_m[:, 2]) + _LIFTED_M
    carried_rows = _longest_run(within & off_ground & (track.taut > 0))
    if carried_rows.stop - carried_rows.start < MIN_ROWS:
        carried = (
            "is never carried"
            if carried_rows.stop == 0
            else f"is carried for {carried_rows.stop - carried_rows.start} rows"
        )
        raise RecordingError(f"the load {carried} off the ground; at least {MIN_ROWS} rows are needed")
    attitude_at = Slerp(attitude.time_s, Rotation.from_quat(np.roll(attitude.quat_wxyz, -1, axis=1)))
    time, load = track.time_s[carried_rows], track.position_m[carried_rows]
    vehicle = track.vehicle_m[carried_rows]
    return Recording(name, time, vehicle, attitude_at(time).as_quat(), load)


def _longest_run(flags: NDArray[np.bool_]) -> slice:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    starts, ends = edges[0::2], edges[1::2]
    if not len(starts):
        return slice(0, 0)
    k = int(np.argmax(ends - starts))
    return slice(int(starts[k]), int(ends[k]))


def _valid_rows(found: Recording, path: Path) -> Recording:
    """The rows with a valid pose; RecordingError if they are too few or their times are wrong."""
    length = np.linalg.norm(found.quaternion_xyzw, axis=1)
    good = np.isfinite(found.position).all(axis=1) & (np.abs(length - 1.0) < _UNIT_TOLERANCE)
    if found.time_s is not None:
        good &= np.isfinite(found.time_s)
    if good.sum() < MIN_ROWS:
        raise RecordingError(
            f"{path}: {int(good.sum())} rows of {len(good)} with a position and a unit quaternion; "
            f"at least {MIN_ROWS} are needed"
        )
    time = None if found.time_s is None else found.time_s[good]
    kept = Recording(found.name, time, found.position[good], found.quaternion_xyzw[good], found.load[good])
    if kept.time_s is not None and np.any(np.diff(kept.time_s) <= 0.0):
        raise RecordingError(f"{path}: times do not increase from row to row")
    if kept.time_s is not None:
        step_s = float(np.median(np.diff(kept.time_s)))
        if not _MIN_STEP_S <= step_s <= _MAX_STEP_S:
            raise RecordingError(
                f"{path}: rows would be {step_s:.3g} s apart; must be {_MIN_STEP_S:g} to {_MAX_STEP_S:g} s: "
                "are times in s, and in the column that the map names?"
            )
    return kept
