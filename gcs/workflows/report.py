"""The report, as the commands make and show it."""

from __future__ import annotations

from pathlib import Path

from gcs.analysis.record import FlightMeta, Record
from gcs.errors import GcsError
from gcs.shell.display import StepDisplay


def make_report(tlog: Path, out: Path, meta: FlightMeta | None, quiet: bool) -> Record:
    """Make it in `out`; without `meta`, what stands in meta.json beside the log is taken."""
    from gcs.report.build import ReportError, build_report

    with StepDisplay("report", quiet) as display:
        try:
            return build_report(tlog, out, meta, display.update)
        except ReportError as error:
            raise GcsError(str(error)) from None
        except OSError as error:
            raise GcsError(f"{error.filename or out}: {error.strerror}") from None


def print_record(record: Record) -> None:
    """The record as a table on stdout."""
    from rich.console import Console

    from gcs.report.table import record_table

    Console().print(record_table(record))
