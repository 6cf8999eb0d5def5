"""The folder into which the telemetry of a flight is written."""

from __future__ import annotations

import shlex
from contextlib import ExitStack, suppress
from pathlib import Path

from gcs.errors import GcsError, InputError, disk_problem
from gcs.folders import (
    LOCK_FILE,
    PAGE_FILE,
    SUMMARY_FILE,
    TLOG_FILE,
    check_no_other_results,
    make_folder,
    reserved,
)
from gcs.shell.display import notify
from gcs.workflows.vehicle_processes import LOGS

UNFLOWN_FILE = "unflown.tlog"  # telemetry of a vehicle that did not fly


def report_abandoned(tlog: Path) -> None:
    notify(f"report abandoned; the telemetry is in {tlog}")


class FlightFolder:
    """The output directory, from which a flight that is overwritten is deleted; if the new flight fails, our
    files are deleted again. It is locked until then, or until `unlock`."""

    _FILES = (TLOG_FILE, *LOGS)

    def __init__(self, path: Path, overwrite: bool) -> None:
        self._path = path
        self._overwrite = overwrite
        self._kept = False
        self._lock = ExitStack()

    def keep(self) -> None:
        """Keep the flight, and delete the telemetry of an earlier attempt, which is not of this flight."""
        self._kept = True
        (self._path / UNFLOWN_FILE).unlink(missing_ok=True)

    def unlock(self) -> None:
        """Allow others to write into the folder, which is complete."""
        self._lock.close()

    def set_aside(self) -> Path:
        """Keep what was captured under a name that is not a flight's; the next flight may use the folder."""
        self._kept = True
        return (self._path / TLOG_FILE).rename(self._path / UNFLOWN_FILE)

    def __enter__(self) -> FlightFolder:
        make_folder(self._path)
        check_no_other_results(self._path, TLOG_FILE, () if self._overwrite else (SUMMARY_FILE, PAGE_FILE))
        with ExitStack() as lock:
            lock.enter_context(reserved(self._path))
            self._delete_earlier_flight()
            self._lock = lock.pop_all()
        return self

    def _delete_earlier_flight(self) -> None:
        try:
            (self._path / TLOG_FILE).touch(exist_ok=self._overwrite)
        except FileExistsError:
            text = f"--out {self._path}: holds a flight already; name another, or add --overwrite"
            raise InputError(text) from None
        if self._overwrite:
            from gcs.report.build import delete_report

            delete_report(self._path)
            for name in LOGS:
                (self._path / name).unlink(missing_ok=True)

    def __exit__(self, _: object, error: BaseException | None, *__: object) -> None:
        with self._lock:
            self._end(error)

    def _end(self, error: BaseException | None) -> None:
        problem, tlog = disk_problem(error), self._path / TLOG_FILE
        if problem:
            size = tlog.stat().st_size if tlog.exists() else 0
            if not size:
                with suppress(OSError):  # the faulty disk may prevent this too
                    self._clear()
                raise GcsError(f"{self._path}: {problem}; no telemetry could be kept") from None
            raise GcsError(
                f"{self._path}: {problem}; {size} bytes of telemetry are kept in {tlog}; "
                f"gcs report {shlex.quote(str(self._path))} reads them"
            ) from None
        if self._kept:
            return
        if isinstance(error, KeyboardInterrupt) and tlog.exists() and tlog.stat().st_size > 0:
            report_abandoned(tlog)
            self.keep()
            return
        self._clear()

    def _clear(self) -> None:
        for name in self._FILES:
            (self._path / name).unlink(missing_ok=True)
        if [file.name for file in self._path.iterdir()] == [LOCK_FILE]:
            (self._path / LOCK_FILE).unlink()
            self._path.rmdir()
