"""Thousands of flights: `gcs sweep`, whose table is what comes back."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from autopilot.vehicle.parameters import DEFAULT_LAW
from gcs.errors import EXIT_INTERRUPTED, GcsError, InputError
from plumbline.frames import as_frame, check_kind

_SAYS = "gcs: "  # begins the line of a known error


def sweep(
    mission: str | Path,
    *,
    vary: Mapping[str, Iterable[float]] | None = None,
    seeds: int = 1,
    laws: Sequence[str] = (DEFAULT_LAW,),
    sensors: str | Path = "lab",
    vehicle: str | Path = "bebop",
    settings: Mapping[str, float] | None = None,
    jobs: int | None = None,
    scheduler: Any = None,
    out: str | Path | None = None,
    quiet: bool = False,
    kind: str = "pandas",
) -> Any:
    """Fly a mission under every value of what is varied, with every law and the seeds 1 ... `seeds`.

    `mission`, `sensors` and `vehicle`: a shipped name or the path of a file. `vary`: values by the name of a
    parameter of simulator or autopilot; `settings`: parameters that are the same for all flights. `jobs`
    flights are flown at a time, by default one on each core; `scheduler` is the address of a Dask scheduler,
    or a Dask client, that flies them instead. `out`: the directory that keeps table and page (docs/cli.md),
    from which a sweep that was interrupted goes on; by default nothing is kept. Progress is shown on stderr
    unless `quiet`.

    A table with a row for each flight, its columns those of flights.parquet (docs/cli.md): a DataFrame of
    pandas, or of polars, or a table of Arrow, as `kind` says. The flights are flown by a program of their
    own, so a script needs no guard around what it does. `Error` if the sweep cannot be flown.
    """
    check_kind(kind)
    with ExitStack() as stack:
        folder = Path(out or stack.enter_context(tempfile.TemporaryDirectory(prefix="plumbline-")))
        words = [str(mission), "--sensors", str(sensors), "--vehicle", str(vehicle), "--seeds", str(seeds)]
        for law in laws:
            words += ["--law", law]
        for name, values in (vary or {}).items():
            words += ["--vary", f"{name}={','.join(repr(float(value)) for value in values)}"]
        for name, value in (settings or {}).items():
            words += ["--set", f"{name}={float(value)!r}"]
        if jobs is not None:
            words += ["--jobs", str(jobs)]
        if scheduler is not None:
            words += ["--scheduler", _address(scheduler)]
        _run([*words, "--out", str(folder)], quiet)

        from pyarrow import parquet

        return as_frame(parquet.read_table(folder / "flights.parquet"), kind)


def _address(scheduler: Any) -> str:
    """Of a Dask client, or as it was given."""
    found = getattr(scheduler, "scheduler", None)
    return str(scheduler if found is None else found.address)


def _run(words: list[str], quiet: bool) -> None:
    """Run `gcs sweep`; its progress goes to our stderr, and its last word, if it fails, into the error."""
    command = [sys.executable, "-m", "gcs", "sweep", *words, *(["--quiet"] if quiet else [])]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as program:
        assert program.stderr is not None
        said: list[str] = []
        for line in program.stderr:
            said.append(line)
            if len(said) > 1 and not quiet:
                sys.stderr.write(said[-2])
    last = said[-1] if said else ""
    if program.returncode == 0:
        if not quiet:
            sys.stderr.write(last)
        return
    if program.returncode == EXIT_INTERRUPTED:
        raise KeyboardInterrupt
    kind = InputError if program.returncode == InputError.exit_code else GcsError
    raise kind(last.strip().removeprefix(_SAYS) or f"gcs sweep ended with {program.returncode}")
