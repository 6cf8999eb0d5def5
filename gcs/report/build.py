"""Builds the report of a flight from its .tlog: a directory of files, and the record."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

from autopilot.shell.atomic_file import write_atomically
from gcs.analysis.record import FlightMeta, Record, flight_record
from gcs.analysis.samples import Samples, samples_of
from gcs.analysis.telemetry import load_telemetry
from gcs.folders import PAGE_FILE, SENSOR_LOG, SENSORS_FOLDER, SUMMARY_FILE

META_FILE = "meta.json"
PARQUET_FILE = "flight.parquet"
MCAP_FILE, COMMON_FILE = "flight.mcap", "flight.common.tlog"

# steps done, steps in total, name of the next step
Progress = Callable[[int, int, str], None]


class ReportError(ValueError):
    """No report can be made from the user's files; one line says which file, why, and what to do."""


def load_meta(path: Path) -> FlightMeta:
    """The contents of a meta.json; if there is no such file, a FlightMeta in which nothing is known."""
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return FlightMeta()
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ReportError(
            f"{path}: {error}; must be JSON: mend it, or delete it to report without"
        ) from error
    if not isinstance(values, dict):
        raise ReportError(f"{path}: found a {type(values).__name__}; must be an object of named values")
    return FlightMeta.from_json(values)


def build_report(
    tlog_path: Path,
    out_dir: Path,
    meta: FlightMeta | None = None,
    progress: Progress | None = None,
    figures: Callable[[Record], None] | None = None,
    picture_formats: Sequence[str] = (),
    check: Callable[[Record], None] | None = None,
) -> Record:
    """Writes summary.json, meta.json, flight.parquet, overview.png and report.html; returns the record.

    `figures` is called with the record as soon as it is complete, before the steps that take longer. `meta`,
    if given, is that of a new flight, and an earlier report in the directory is deleted; otherwise meta.json
    beside the log is read. A log that is truncated, empty or of a lost flight gives a record too, with None
    for what cannot be known. All pictures are drawn in each of `picture_formats` (png, pdf, svg);
    without any: only that of the page.
    `check` is called with the record before anything is written, and may raise an error.
    """
    from gcs.report.draw import Drawing
    from gcs.report.plots import PICTURES, View

    report_progress = progress or (lambda done, total, text: None)
    if not tlog_path.is_file():
        raise ReportError(f"{tlog_path}: no such file; give a .tlog that `gcs fly` or `gcs capture` wrote")
    out_dir.mkdir(parents=True, exist_ok=True)
    if meta is None:
        meta = load_meta(tlog_path.parent / META_FILE)
    else:
        delete_report(out_dir)

    pictures = list(PICTURES[:1])  # the page contains it
    wanted = (picture.as_format(one) for one in picture_formats for picture in PICTURES)
    pictures += (picture for picture in wanted if picture.file != pictures[0].file)
    sensor_log = out_dir / SENSOR_LOG
    steps = [PARQUET_FILE, SENSORS_FOLDER] if sensor_log.is_file() else [PARQUET_FILE]
    remaining = ["reading telemetry", *steps, *(picture.file for picture in pictures), PAGE_FILE]
    total = len(remaining)

    def done(step: str) -> None:
        remaining.remove(step)
        report_progress(total - len(remaining), total, remaining[0] if remaining else "done")

    report_progress(0, total, remaining[0])
    with Drawing(out_dir, pictures) as drawing:
        telemetry = load_telemetry(tlog_path)
        samples = samples_of(telemetry)
        record = flight_record(telemetry, meta, samples)
        if check is not None:
            check(record)
        record["report_dir"] = str(out_dir)
        write_meta(out_dir, meta)
        _write_json(out_dir / SUMMARY_FILE, record)
        done(remaining[0])
        if figures is not None:
            figures(record)
        drawing.start_drawing(View(telemetry, samples, record, meta))

        from gcs.analysis.parquet import write_flight
        from gcs.report.html import render_page
        from gcs.report.replay import replay_of
        from gcs.report.settings import changed_settings

        # the path of the directory is not a property of the flight
        metadata = {**meta.to_json(), "record": {k: v for k, v in record.items() if k != "report_dir"}}
        write_flight(out_dir / PARQUET_FILE, telemetry, samples, metadata)
        done(PARQUET_FILE)
        if SENSORS_FOLDER in steps:
            _write_readings(sensor_log, out_dir / SENSORS_FOLDER, samples)
            done(SENSORS_FOLDER)
        replay = replay_of(telemetry, samples, meta)
        drawing.finish(lambda picture: done(picture.file))
    page = render_page(record, meta, replay, changed_settings(telemetry, meta), out_dir)
    write_atomically(out_dir / PAGE_FILE, page.encode())
    done(PAGE_FILE)
    return record


def _write_readings(log: Path, folder: Path, samples: Samples) -> None:
    """Make tables of the readings until the end of the telemetry, and delete their log."""
    from gcs.analysis.readings import readings_of, write_readings

    write_readings(folder, readings_of(log.read_bytes(), samples.end_s))
    log.unlink()


def delete_report(directory: Path) -> None:
    """Delete the report of an earlier flight, including files that were made on demand."""
    from gcs.analysis.readings import delete_readings
    from gcs.report.plots import PICTURE_FORMATS, PICTURES

    files = (SUMMARY_FILE, META_FILE, PARQUET_FILE, PAGE_FILE, MCAP_FILE, COMMON_FILE)
    pictures = (picture.as_format(one).file for picture in PICTURES for one in PICTURE_FORMATS)
    for name in (*files, *pictures):
        (directory / name).unlink(missing_ok=True)
    delete_readings(directory / SENSORS_FOLDER)


def build_mcap(tlog_path: Path, out_dir: Path, meta: FlightMeta | None = None) -> Path:
    """Writes flight.mcap from a log; returns its path."""
    from gcs.analysis.mcap import Layout, write_mcap
    from gcs.report.replay import layout_of

    meta = load_meta(tlog_path.parent / META_FILE) if meta is None else meta
    telemetry = load_telemetry(tlog_path)
    layout = layout_of(meta.vehicle)
    rotor_positions = tuple((x, -y) for x, y, _ in (rotor["position"] for rotor in layout["rotors"]))
    out_dir.mkdir(parents=True, exist_ok=True)
    path = out_dir / MCAP_FILE
    write_mcap(path, telemetry, samples_of(telemetry), Layout(rotor_positions, layout["load_radius"]))
    return path


def write_meta(directory: Path, meta: FlightMeta) -> None:
    """Write meta.json of a flight into the directory of its report."""
    _write_json(directory / META_FILE, meta.to_json())


def _write_json(path: Path, values: Record) -> None:
    text = json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    write_atomically(path, text.encode())
