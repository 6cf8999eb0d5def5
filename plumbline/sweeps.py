"""Thousands of flights: runs `gcs sweep` and returns its table."""

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
    """Fly a mission with every combination of the varied values, every law, and the seeds 1 ... `seeds`.

    `mission`, `sensors` and `vehicle`: a shipped name, the path of a file, or an object made in Python.
    `vary`: for each varied parameter of simulator or autopilot its values, as a list, or as a text like that
    of `gcs sweep --vary`: "LOW:HIGH:COUNT", or "LOW:HIGH" with `sample`, which draws that many settings
    (Latin hypercube) instead of the whole grid; of a list it draws the listed values, also if there are two.
    `settings`: parameters that are the same in all flights.
    `estimator` and `planner`: a custom one for all flights, as `FILE.py:CLASS`. `jobs`: number of flights at
    the same time, by default one per core; `scheduler`: the address of a Dask scheduler, or a Dask client,
    that flies them instead. `out`: the directory in which table and page are kept (docs/cli.md), and from
    which an interrupted sweep continues; by default nothing is kept. `quiet=False` shows progress on stderr.

    Returns a table with a row for each flight and the columns of flights.parquet (docs/cli.md): a pandas or
    polars DataFrame or an Arrow table, according to `kind`. A separate program flies the flights, so a script
    needs no `if __name__ == "__main__"`. `Error` if the sweep cannot be flown.
    """
    with ExitStack() as stack:
        words = []
        if out is None:
            out = stack.enter_context(tempfile.TemporaryDirectory(prefix="plumbline-"))
            words += ["--table-only"]  # the page would be deleted with the folder
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
    """The values of a varied parameter, as the command line writes them."""
    if isinstance(values, str):
        return values
    return ",".join(map(repr, numbers(f"vary[{name!r}]", values)))


def _laws(laws: Sequence[str]) -> Sequence[str]:
    wanted = f"a list of laws, as [{DEFAULT_LAW!r}]"
    if not (found := items("laws", laws, wanted)):
        raise GcsError(f"laws = {laws!r}; must be {wanted}")
    return found


def _address(scheduler: Any) -> str:
    """The address of a Dask client's scheduler, or the given address."""
    found = getattr(getattr(scheduler, "scheduler", None), "address", scheduler)
    if not isinstance(found, str) or not found:
        raise GcsError(
            f"scheduler = {shown(scheduler)}; must be a Dask client or an address, as tcp://HOST:8786"
        )
    return found


def _run(words: list[str], quiet: bool) -> None:
    """Run `gcs sweep`. Its progress goes to our stderr, and so does, even if `quiet`, all that a law prints.
    If the sweep fails, its last message becomes the text of the error."""
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
    # without progress, each message is an error; a program that crashes leaves a last line of its traceback
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
