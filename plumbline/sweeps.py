"""Thousands of flights: `gcs sweep`, whose table is what comes back."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from autopilot.vehicle.parameters import DEFAULT_LAW
from gcs.errors import EXIT_INTERRUPTED, GcsError, InputError
from gcs.workflows.flight_options import own_words
from plumbline.arguments import (
    by_parameter,
    file_path,
    items,
    knows_its_arguments,
    numbers,
    setting_words,
    shown,
    told_in_python,
    whole,
)
from plumbline.frames import as_frame, check_kind
from plumbline.made_files import name_or_path
from plumbline.references import estimator_reference, law_reference, planner_reference

if TYPE_CHECKING:
    from plumbline.missions import Mission
    from plumbline.sensors import Sensors
    from plumbline.vehicles import Vehicle

_SAYS = "gcs: "  # begins the line of a known error


@knows_its_arguments
def sweep(
    mission: str | Path | Mission,
    *,
    vary: Mapping[str, Iterable[float] | str] | None = None,
    seeds: int = 1,
    sample: int | None = None,
    laws: Sequence[str] = (DEFAULT_LAW,),
    estimator: str | None = None,
    planner: str | None = None,
    sensors: str | Path | Sensors = "lab",
    vehicle: str | Path | Vehicle = "bebop",
    settings: Mapping[str, float] | None = None,
    jobs: int | None = None,
    scheduler: Any = None,
    out: str | Path | None = None,
    quiet: bool = True,
    kind: str = "pandas",
) -> Any:
    """Fly a mission under every value of what is varied, with every law and the seeds 1 ... `seeds`.

    `mission`, `sensors` and `vehicle`: a shipped name, the path of a file, or one made in Python. `vary`:
    values by the name of a parameter of simulator or autopilot, in a list or in a text as of `gcs sweep
    --vary`: "LOW:HIGH:COUNT", or "LOW:HIGH" with `sample`, which draws that many settings (Latin hypercube)
    instead of all of the grid. `settings`: parameters that are the same for all flights. `estimator` and
    `planner`: one of your own, as `FILE.py:CLASS`, of all flights. `jobs` flights are flown at a time, by
    default one on each core; `scheduler` is the address of a Dask scheduler, or a Dask client, that flies
    them instead. `out`: the directory that keeps table and page (docs/cli.md), from which a sweep that was
    interrupted goes on; by default nothing is kept. `quiet=False` shows progress on stderr.

    A table with a row for each flight, its columns those of flights.parquet (docs/cli.md): a DataFrame of
    pandas, or of polars, or a table of Arrow, as `kind` says. The flights are flown by a program of their
    own, so a script needs no guard around what it does. `Error` if the sweep cannot be flown.
    """
    with ExitStack() as stack:
        words = []
        if out is None:
            out = stack.enter_context(tempfile.TemporaryDirectory(prefix="plumbline-"))
            words += ["--table-only"]  # nobody would see the page
        folder = file_path("out", out)
        words += [
            name_or_path("mission", mission),
            "--seeds",
            str(whole("seeds", seeds, 1)),
        ]
        words += ["--sensors", name_or_path("sensors", sensors)]
        words += ["--vehicle", name_or_path("vehicle", vehicle)]
        for law in _laws(laws):
            words += ["--law", law_reference(law)]
        words += own_words(estimator_reference(estimator), planner_reference(planner))
        for name, values in by_parameter("vary", vary, "{'SIM_WIND_E': [0, 3]}").items():
            words += ["--vary", f"{name}={_values(name, values)}"]
        if sample is not None:
            words += ["--sample", str(whole("sample", sample, 1))]
        for setting in setting_words(settings):
            words += ["--set", setting]
        if jobs is not None:
            words += ["--jobs", str(whole("jobs", jobs, 1))]
        if scheduler is not None:
            words += ["--scheduler", _address(scheduler)]
        check_kind(kind)
        with told_in_python():
            _run([*words, "--out", str(folder)], quiet)

        from pyarrow import parquet

        return as_frame(parquet.read_table(folder / "flights.parquet"), kind)


def _values(name: str, values: Any) -> str:
    """Those that a parameter takes, as the command line writes them."""
    if isinstance(values, str):
        return values
    return ",".join(map(repr, numbers(f"vary[{name!r}]", values)))


def _laws(laws: Sequence[str]) -> Sequence[str]:
    wanted = f"a list of laws, as [{DEFAULT_LAW!r}]"
    if not (found := items("laws", laws, wanted)):
        raise GcsError(f"laws = {laws!r}; must be {wanted}")
    return found


def _address(scheduler: Any) -> str:
    """Of a Dask client, or as it was given."""
    found = getattr(getattr(scheduler, "scheduler", None), "address", scheduler)
    if not isinstance(found, str) or not found:
        raise GcsError(
            f"scheduler = {shown(scheduler)}; must be a Dask client or an address, as tcp://HOST:8786"
        )
    return found


def _run(words: list[str], quiet: bool) -> None:
    """Run `gcs sweep`; its progress goes to our stderr, and its last word, if it fails, into the error. So
    does what a law prints that flies there, however quiet."""
    command = [sys.executable, "-P", "-m", "gcs", "sweep", *words, *(["--quiet"] if quiet else [])]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as program:
        assert program.stderr is not None
        said: list[str] = []
        others: list[str] = []
        for line in program.stderr:
            if not line.startswith(_SAYS):
                others.append(line)
                sys.stderr.write(line)
                continue
            said.append(line)
            if len(said) > 1 and not quiet:
                sys.stderr.write(said[-2])
    last = said[-1] if said else ""
    # without progress, all that is said is what is wrong; a program that breaks down says it in its own way
    told = (said if quiet else [last]) if said else others[-1:]
    if program.returncode == 0:
        if not quiet:
            sys.stderr.write(last)
        return
    if program.returncode == EXIT_INTERRUPTED:
        raise KeyboardInterrupt
    kind = InputError if program.returncode == InputError.exit_code else GcsError
    wrong = "; ".join(line.strip().removeprefix(_SAYS) for line in told if line.strip())
    raise kind(wrong or f"gcs sweep ended with {program.returncode}")
