"""`gcs compare` from its arguments to table and page."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from autopilot.shell.atomic_file import write_atomically
from gcs.errors import EXIT_USAGE, GcsError, write_error
from gcs.folders import TLOG_FILE
from gcs.workflows.report import find_log

if TYPE_CHECKING:
    from gcs.analysis.record import FlightMeta
    from gcs.report.compare import Run

MAX_NAME_LENGTH = 100  # of a page, in characters
MAX_RUNS = 12  # so that lines remain distinguishable, on a page of some megabytes
COMPARISONS_FOLDER = Path("comparisons")
_ENDINGS = (".html", ".htm")  # of pages; a page without one gets the first


class CompareError(GcsError):
    """The given flights cannot be compared."""

    exit_code = EXIT_USAGE


def compare(sources: Sequence[Path], out: Path | None) -> tuple[list[Run], Path]:
    """Compare the given flights and write the page; return the flights and the page's path."""
    if not 2 <= len(sources) <= MAX_RUNS:
        text = "one flight was named" if len(sources) == 1 else f"{len(sources)} flights were named"
        raise CompareError(f"{text}; name 2 to {MAX_RUNS} that are to be compared")
    logs = [find_log(source) for source in sources]
    for i, log in enumerate(logs):
        if log.resolve() in [other.resolve() for other in logs[:i]]:
            raise CompareError(f"{sources[i]} is named twice")

    from gcs.report.compare import comparison_page, load_run

    names = _names(sources)
    runs = [load_run(name, log, _meta(log)) for name, log in zip(names, logs, strict=True)]
    for source, run in zip(sources, runs, strict=True):
        if run.record["outcome"] == "no telemetry":
            raise CompareError(f"{source}: holds no telemetry of a Plumbline vehicle")
    page = out or COMPARISONS_FOLDER / f"{_page_name(names, logs)}{_ENDINGS[0]}"
    if page.suffix.lower() not in _ENDINGS:  # a browser would show its text
        page = page.with_name(page.name + _ENDINGS[0])
    text = comparison_page(runs)
    try:
        page.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(page, text.encode())
    except OSError as error:
        raise write_error(error, page, "file") from None
    return runs, page


def _page_name(names: Sequence[str], logs: Sequence[Path]) -> str:
    """RUN-RUN... if that is short enough for the name of a file; else the first, the number of the others,
    and a hash of the logs' paths."""
    joined = "-".join(names).replace("/", "_")
    if len(joined) <= MAX_NAME_LENGTH:
        return joined
    digest = hashlib.sha256("\n".join(str(log.resolve()) for log in logs).encode()).hexdigest()[:8]
    return f"{names[0].replace('/', '_')[-MAX_NAME_LENGTH:]}-and-{len(names) - 1}-more-{digest}"


def _meta(log: Path) -> FlightMeta:
    """The meta.json beside a log that `gcs fly` made; for any other log, nothing is known."""
    from gcs.analysis.record import FlightMeta
    from gcs.report.build import META_FILE, ReportError, load_meta

    if log.name != TLOG_FILE:
        return FlightMeta()
    try:
        return load_meta(log.parent / META_FILE)
    except ReportError as error:
        raise CompareError(str(error)) from None


def _names(sources: Sequence[Path]) -> list[str]:
    """The last part of each path; the whole paths if two of these are the same."""
    short = [source.resolve().name.removesuffix(".tlog") for source in sources]
    return short if len(set(short)) == len(short) else [str(source) for source in sources]
