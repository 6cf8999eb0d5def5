"""Making and showing the report, for the commands."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from autopilot.wire.tlog import read_tlog, write_common
from autopilot.wire.ulog import MAGIC
from gcs.errors import GcsError, InputError, disk_problem, write_error
from gcs.folders import (
    PAGE_FILE,
    PLAN_FILE,
    REPEATS_FOLDER,
    SUMMARY_FILE,
    TLOG_FILE,
    check_no_other_results,
    make_folder,
    reserved,
)
from gcs.shell.display import StepDisplay

if TYPE_CHECKING:
    from gcs.analysis.record import FlightMeta, Record


def make_report(
    tlog: Path,
    out: Path,
    meta: FlightMeta | None,
    quiet: bool,
    on_record: Callable[[Record], None] | None = None,
    pictures: Sequence[str] = (),
    check: Callable[[Record], None] | None = None,
) -> Record:
    """Make the report in `out`; without `meta`, meta.json beside the log is used. `on_record` is called with
    the record before anything is drawn. `pictures`: the formats of all pictures; none: only
    that of the page.
    `check` is called with the record before anything is written, and may raise an error."""
    from gcs.report.build import ReportError, build_report

    with StepDisplay("report", quiet) as display:
        try:
            return build_report(tlog, out, meta, display.update, on_record, pictures, check)
        except ReportError as error:
            raise InputError(str(error)) from None
        except OSError as error:
            raise _report_error(error, tlog, out) from None


def _report_error(error: OSError, tlog: Path, out: Path) -> GcsError:
    """The error that the report cannot be written; if the disk is full, also what is kept, and how to make
    the report later."""
    if not disk_problem(error):
        return write_error(error, error.filename or out)
    kept = [str(tlog)] if tlog.is_file() else []
    if _is_complete(out / SUMMARY_FILE):
        kept.append(str(out / SUMMARY_FILE))
    arguments = (
        shlex.quote(str(out)) if tlog == out / TLOG_FILE else shlex.join([str(tlog), "--out", str(out)])
    )
    return GcsError(
        f"{out}: the report cannot be written: {disk_problem(error)}; kept are {' and '.join(kept)}; "
        f"make it when there is space: gcs report {arguments}"
    )


def _is_complete(summary: Path) -> bool:
    try:
        return bool(json.loads(summary.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return False


def find_log(source: Path) -> Path:
    """The given log, or the log in the given directory."""
    tlog = source / TLOG_FILE if source.is_dir() else source
    allowed = f"must be a .tlog, or a directory that holds {TLOG_FILE}"
    if not tlog.exists() and (source / PLAN_FILE).exists():
        raise InputError(
            f"{source}: holds a sweep, which keeps no telemetry; its {PAGE_FILE} compares its flights, and "
            f"gcs sweep --reports repeats those that stand out in {source / REPEATS_FOLDER}"
        )
    if not tlog.is_file():
        raise InputError(f"{tlog}: {'not a file' if tlog.exists() else 'no such file'}; {allowed}")
    if next(read_tlog(tlog), None) is None:
        with tlog.open("rb") as file:
            is_ulog = file.read(len(MAGIC)) == MAGIC
        if is_ulog and (tlog.parent / TLOG_FILE).is_file():
            allowed = f"give {tlog.parent / TLOG_FILE}"
        found = "is a ULog, which holds no telemetry" if is_ulog else "holds no telemetry"
        raise InputError(f"{tlog}: {found}; {allowed}")
    return tlog


def meta_beside(tlog: Path) -> FlightMeta:
    """The contents of meta.json beside the log; without such a file, nothing is known."""
    from gcs.report.build import META_FILE, ReportError, load_meta

    try:
        return load_meta(tlog.parent / META_FILE)
    except ReportError as error:
        raise InputError(str(error)) from None


@contextmanager
def remade_report(
    source: Path, out: Path | None, quiet: bool, pictures: Sequence[str] = ()
) -> Iterator[tuple[Record, Path]]:
    """Make the report of a log, or of the directory that contains it, again: the record and the report's
    directory, which is locked against other writers until the end."""
    tlog = find_log(source)
    default_folder = tlog.with_suffix("") if tlog.suffix else tlog.with_name(f"{tlog.name}-report")
    folder = out or (tlog.parent if tlog.name == TLOG_FILE else default_folder)
    reported = (folder / SUMMARY_FILE).exists()
    check_no_other_results(folder, TLOG_FILE, () if reported else (PAGE_FILE,))
    holds_log = (folder / TLOG_FILE).exists()
    if holds_log and not (folder / TLOG_FILE).samefile(tlog):
        raise InputError(f"{folder}: holds another flight; name another folder by --out")
    check = partial(_check_same_flight, folder) if out and reported and not holds_log else None
    make_folder(folder)
    with reserved(folder):
        yield make_report(tlog, folder, None, quiet, pictures=pictures, check=check), folder


_MEASURED = ("recorded_s", "samples", "load_error_max_m", "rotor_force_max_n")  # distinguish flights


def _check_same_flight(folder: Path, record: Record) -> None:
    """InputError if the folder contains the report of another flight, whose log is elsewhere."""
    try:
        earlier = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))
        is_same = all(earlier[name] == record[name] for name in _MEASURED)
    except (OSError, ValueError, TypeError, KeyError):
        is_same = False
    if not is_same:
        raise InputError(f"{folder}: holds the report of another flight; name another folder by --out")


def make_mcap(source: Path, folder: Path) -> Path:
    """Write flight.mcap of a log into the directory of its report."""
    from gcs.report.build import ReportError, build_mcap

    try:
        return build_mcap(find_log(source), folder)
    except ReportError as error:
        raise InputError(str(error)) from None
    except OSError as error:
        raise write_error(error, error.filename or folder) from None


def make_common(source: Path, folder: Path) -> Path:
    """Write flight.common.tlog of a log: the log without the private dialect."""
    from gcs.report.build import COMMON_FILE

    path = folder / COMMON_FILE
    try:
        write_common(find_log(source), path)
    except OSError as error:
        raise write_error(error, error.filename or path) from None
    return path


def print_record(record: Record) -> None:
    """Print the record as a table to stdout."""
    from rich.console import Console

    from gcs.report.table import record_table

    Console().print(record_table(record))
