"""`gcs identify` and `gcs replay` from their arguments to record, table and picture."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gcs.errors import InputError, input_error, write_error
from gcs.folders import TLOG_FILE
from gcs.shell.display import StepDisplay, notify_if_slow

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from gcs.recorded.column_map import ColumnMap
    from gcs.recorded.estimates import Estimates, FilterRows
    from gcs.recorded.identification import Identified
    from gcs.recorded.load_model import LoadModel
    from gcs.recorded.motion import Motion

REPLAYS_FOLDER = Path("replays")
_READING_TEXT = "reading the recording"
_MAX_DISTANCE_M = 200.0  # of a load from its vehicle: cables are shorter
PLUMBLINE_MAP = "telemetry"  # column map of Plumbline's own logs


def identify(path: Path, columns: str | None, quiet: bool = False) -> dict[str, Any]:
    """The properties of cable, load and vehicle that the recording determines, with half the widths of their
    95 % intervals, and those that it does not determine."""
    from gcs.recorded.identification import (
        MIN_DURATION_S,
        NoLoadError,
        TooLittleMotionError,
        identify_load,
        identify_vehicle,
        length_warning,
        map_warning,
        tracked_length,
        wind_warning,
    )

    path = find_recording(path)
    with notify_if_slow(_READING_TEXT, quiet):
        column_map, motion, model = _read(path, columns)
    _require_load(path, motion)
    with StepDisplay("fitting predictions of the load", quiet, long=True) as display:
        duration_s = float(motion.time_s[-1] - motion.time_s[0])
        if duration_s < MIN_DURATION_S:
            raise InputError(
                f"{path}: carries the load for {duration_s:.1f} s; at least {MIN_DURATION_S:.0f} s are "
                "needed to identify anything"
            )
        try:
            identify_vehicle(motion, model)  # too little motion is reported before the load is fitted
            load = identify_load(motion, model, column_map.identify.parameters, display.update)
            known = {one.name: one.value for one in load if one.is_determined}
            vehicle = identify_vehicle(motion, model._replace(**known))
        except (NoLoadError, TooLittleMotionError) as error:
            raise InputError(f"{path}: {length_warning(motion) or error}") from None
        found: list[Identified] = [tracked_length(motion, column_map.attachment.below_m), *load, *vehicle]
    return {
        **_rows_record(path, motion),
        "identified": {one.name: {"value": one.value, "half_width": one.half_width} for one in found},
        "not_told": [one.name for one in found if not one.is_determined],
        "doubt": length_warning(motion) or map_warning(vehicle) or wind_warning(motion, model.gravity_m_s2),
    }


def replay(
    path: Path, columns: str | None, out: Path | None, quiet: bool = False
) -> tuple[dict[str, Any], Path]:
    """Estimate the load in a recording; return the scores, and the folder with table and picture."""
    from gcs.recorded.estimates import filter_rows, filtered_estimates, load_position
    from gcs.recorded.identification import (
        MIN_DURATION_S,
        TooLittleMotionError,
        identify_vehicle,
        length_warning,
        map_warning,
    )
    from gcs.recorded.replay_files import (
        PICTURE_FILE,
        TABLE_FILE,
        check_no_other_files,
        write_picture,
        write_table,
    )

    path = find_recording(path)
    folder = out or REPLAYS_FOLDER / name_of(path)
    check_no_other_files(folder)
    with notify_if_slow(_READING_TEXT, quiet):
        _, motion, model = _read(path, columns)
    with StepDisplay("estimating the load", quiet, long=True) as display:
        display.update(0, 0)
        rows = filter_rows(motion, model)
        measured: NDArray[np.bool_] = np.asarray(np.isfinite(motion.load).all(axis=1))
        load_is_measured = bool(measured.all())
        doubt = length_warning(motion) if load_is_measured else _gap_text(measured)
        record: dict[str, Any] = {**_rows_record(path, motion), "doubt": doubt}
        if load_is_measured and not doubt and record["duration_s"] >= MIN_DURATION_S:
            with suppress(TooLittleMotionError):
                record["doubt"] = map_warning(identify_vehicle(motion, model))
        found = filtered_estimates(rows, model, load=False, tilt=True, smoothed=True)
        if load_is_measured:
            record |= _prediction_scores(motion, rows, model, display)
        if measured.any():
            record["pose_alone"] = _pose_alone_scores(motion, model, found)
        load = load_position(motion, model, np.arange(len(motion.time_s)), found.states[:, :2])
        sd = model.length_m * np.sqrt(found.covariances[:, [0, 1], [0, 1]])
        display.update(0, 0, "writing table and picture")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_table(folder / TABLE_FILE, motion, load, sd)
            write_picture(folder / PICTURE_FILE, motion, load, sd)
        except OSError as error:
            raise write_error(error, folder) from None
    return record, folder


def _gap_text(measured: NDArray[np.bool_]) -> str:
    """A line if the load was measured in some rows only."""
    if not measured.any():
        return ""
    missing = int(np.sum(~measured))
    return (
        f"the load was not measured in {missing} of {len(measured)} rows: in the others the estimate by the "
        "pose is scored, but nothing is predicted"
    )


def _prediction_scores(
    motion: Motion, rows: FilterRows, model: LoadModel, display: StepDisplay
) -> dict[str, Any]:
    """Innovations and predictions of a load that was measured in every row."""
    from gcs.recorded.estimates import filtered_estimates
    from gcs.recorded.scoring import HORIZONS_S, score_ahead

    by_load = filtered_estimates(rows, model, load=True, tilt=True)
    scores: dict[str, Any] = {
        "innovations": {
            name: {
                "mean_square_per_axis": float(np.mean(np.abs(each)) / 2.0),
                "refused": int(np.sum(each < 0.0)),
            }
            for name, each in (("load", by_load.squares[:, 0]), ("attitude", by_load.squares[:, 1]))
        }
    }

    def report_progress(done: int, total: int) -> None:
        display.update(done, total, "predicting the load")

    ahead = score_ahead(motion, rows, model, by_load, report_progress)
    for horizon, score in zip(HORIZONS_S, ahead, strict=True):
        scores[f"ahead_{horizon:g}s"] = {"median_m": score.median_m, "inside_95": score.inside}
    return scores


def _pose_alone_scores(motion: Motion, model: LoadModel, by_pose: Estimates) -> dict[str, float]:
    """The scores of smoothed estimates from the pose alone, in the rows in which the load was measured."""
    from gcs.recorded.scoring import score_pose_alone

    pose_alone = score_pose_alone(motion, model, by_pose)
    return {
        "median_m": pose_alone.median_m,
        "nees_per_axis": float(np.nanmean(pose_alone.square) / 2.0),
        "inside_95": pose_alone.inside,
    }


def find_recording(source: Path) -> Path:
    """The given recording; for the folder of a flight, its telemetry log."""
    from gcs.recorded.recording import ACCEPTED_FILES

    if not source.is_dir():
        return source
    if not (source / TLOG_FILE).is_file():
        raise InputError(f"{source}: holds no {TLOG_FILE}; {ACCEPTED_FILES}")
    return source / TLOG_FILE


def name_of(path: Path) -> str:
    """The name of a recording; for a flight, that of its folder, since every log is called flight.tlog."""
    from gcs.recorded.recording import name_of as stem

    return (path.resolve().parent.name if path.name == TLOG_FILE else "") or stem(path)


def _read(path: Path, columns: str | None) -> tuple[ColumnMap, Motion, LoadModel]:
    from gcs.recorded.column_map import MAPS, MapError, load_map
    from gcs.recorded.motion import distances, motion_of
    from gcs.recorded.recording import ACCEPTED_FILES, RecordingError, is_log, is_table, read_recording

    if columns is None and not is_log(path) and path.is_file():
        if not is_table(path):
            raise InputError(f"{path}: no recording of a flight; {ACCEPTED_FILES}")
        raise InputError(f"{path}: say what its columns are by --columns: {MAPS.choice()}")
    try:
        column_map = load_map(columns or PLUMBLINE_MAP)
        if is_log(path) and column_map.vehicle is not None:
            raise InputError(
                f"--columns {columns}: describes rows of numbers by another system of tracking; {path} names "
                "its columns itself: leave --columns out, or name a map without [vehicle]"
            )
        motion = motion_of(read_recording(path, column_map), column_map)
    except MapError as error:
        raise input_error(error) from None
    except RecordingError as error:
        raise InputError(str(error)) from None
    load_distances_m = distances(motion)
    length_m = float(np.nanmedian(load_distances_m)) if np.isfinite(load_distances_m).any() else 0.0
    if length_m > _MAX_DISTANCE_M:
        raise InputError(
            f"{path}: the load would be {length_m:.0f} m from the vehicle; {_MAX_DISTANCE_M:g} m at most: "
            "are positions in m, and in the columns that the map names?"
        )
    if column_map.model.length_m is None and not length_m:
        raise InputError(f"{path}: without measured loads the column map must say model.length_m")
    return column_map, motion, column_map.load_model(length_m)


def _require_load(path: Path, motion: Motion) -> None:
    if not np.isfinite(motion.load).all():
        raise InputError(f"{path}: the load was not measured in every row; nothing can be identified from it")


def _rows_record(path: Path, motion: Motion) -> dict[str, Any]:
    from gcs.recorded.recording import is_log

    times = motion.times
    return {
        "file": str(path),
        "true_states": is_log(path),  # the true states of a simulated flight, not measurements
        "rows": len(motion.time_s),
        "duration_s": float(motion.time_s[-1] - motion.time_s[0]),
        "row_jitter_s": float(np.std(times.offset_s)),
        "breaks": int(np.sum(times.broken)),
    }
