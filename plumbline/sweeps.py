"""Thousands of flights: runs `gcs sweep` and returns its table."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from autopilot.vehicle.parameters import DEFAULT_LAW
from gcs.errors import EXIT_INTERRUPTED, GcsError, InputError
from gcs.workflows.flight_options import own_part_options
from missions.toml_files import FileError
from plumbline.arguments import (
    called_by_scripts,
    errors_for_python,
    file_path,
    items,
    numbers,
    parameter_name,
    positive,
    setting_arguments,
    shown_value,
    values_by_parameter,
    whole_number,
)
from plumbline.frames import as_frame, check_kind
from plumbline.made_files import name_or_path
from plumbline.references import estimator_reference, law_reference, planner_reference

if TYPE_CHECKING:
    from plumbline.missions import Mission
    from plumbline.sensors import Sensors
    from plumbline.vehicles import Vehicle

Values = Iterable[float] | str  # of a varied parameter
_ERROR_PREFIX = "gcs: "  # begins the line of a known error
_STOPPED = (EXIT_INTERRUPTED, *(128 + number for number in (signal.SIGTERM, signal.SIGHUP)))


@called_by_scripts
def sweep(
    mission: str | Path | Mission,
    *,
    vary: Mapping[str, Values] | Mapping[str | tuple[str, ...], Values] | None = None,
    seeds: int | Iterable[int] = 1,
    sample: int | None = None,
    laws: str | type | Sequence[str | type] = (DEFAULT_LAW,),
    estimator: str | type | None = None,
    planner: str | type | None = None,
    sensors: str | Path | Sensors = "lab",
    vehicle: str | Path | Vehicle = "bebop",
    settings: Mapping[str, float] | None = None,
    timeout_s: float | None = None,
    jobs: int | None = None,
    scheduler: Any = None,
    out: str | Path | None = None,
    fresh: bool = False,
    quiet: bool = True,
    kind: str = "pandas",
) -> Any:
    """Fly a mission with every combination of the varied values, every law, and every seed.

    `mission`, `sensors` and `vehicle`: a shipped name, the path of a file, or an object made in Python.
    `vary`: for each varied parameter of simulator or autopilot its values, as a list, or as a text like that
    of `gcs sweep --vary`: "LOW:HIGH:COUNT", or "LOW:HIGH" with `sample`, which draws that many settings
    (Latin hypercube) instead of the whole grid; of a list it draws the listed values, also if there are two.
    Parameters that are a key together, as `("SIM_CABLE_LEN", "VEH_CABLE_LEN")`, have the same value in each
    flight, and the table has the column of the first.
    `seeds`: a number N for the seeds 1 ... N, or a range or list of seeds, as `range(11, 21)` or `[3, 7]`.
    `settings`: parameters that are the same in all flights. `timeout_s`: time limit of each flight in seconds
    of the vehicle's clock; by default one and a half times the expected duration plus a minute.
    `laws`: names, `FILE.py:CLASS`, or classes (docs/laws.md), or one of these alone. `estimator` and
    `planner`: a custom one for all flights, given in the same ways. `jobs`: number of flights at the same
    time, by default one per core; `scheduler`: the address of a Dask scheduler, or a Dask client, that flies
    them instead. `out`: the directory in which table and page are kept (docs/cli.md), and from which an
    interrupted sweep continues, or one with more seeds or values; by default nothing is kept.
    `fresh=True` discards flights that are there already, also those of another sweep. `quiet=False` shows
    progress on stderr. A parameter that has no effect in any flight causes a warning.

    Returns a table with a row for each flight and the columns of flights.parquet (docs/cli.md): a pandas or
    polars DataFrame or an Arrow table, according to `kind`. A separate program flies the flights, so a script
    needs `if __name__ == "__main__"` only if it passes a class of its own. `Error` if the sweep cannot be
    flown.
    """
    with ExitStack() as stack:
        arguments = []
        if out is None:
            out = stack.enter_context(tempfile.TemporaryDirectory(prefix="plumbline-"))
            arguments += ["--table-only"]  # the page would be deleted with the folder
        folder = file_path("out", out)
        classes = folder / "classes"
        arguments += [
            name_or_path("mission", mission),
            "--seeds",
            _seeds(seeds),
        ]
        conditions = _Conditions(
            name_or_path("vehicle", vehicle),
            name_or_path("sensors", sensors),
            [law_reference(law, classes) for law in _laws(laws)],
            setting_arguments(settings),
            _varied(vary),
        )
        arguments += ["--sensors", conditions.sensors, "--vehicle", conditions.vehicle]
        for option, values in (
            ("--law", conditions.laws),
            ("--vary", conditions.varied),
            ("--set", conditions.settings),
        ):
            for value in values:
                arguments += [option, value]
        arguments += own_part_options(
            estimator_reference(estimator, classes), planner_reference(planner, classes)
        )
        if sample is not None:
            arguments += ["--sample", str(whole_number("sample", sample, 1))]
        if timeout_s is not None:
            arguments += ["--timeout", repr(positive("timeout_s", timeout_s))]
        if jobs is not None:
            arguments += ["--jobs", str(whole_number("jobs", jobs, 1))]
        if scheduler is not None:
            arguments += ["--scheduler", _address(scheduler)]
        if fresh:
            arguments += ["--fresh"]
        check_kind(kind)
        with errors_for_python():
            if quiet:  # else `gcs sweep` says so
                _warn_of_unused(conditions, sample is not None)
            _run([*arguments, "--out", str(folder)], quiet)

        from pyarrow import parquet

        from gcs.formats.arrow import path_for_arrow

        return as_frame(parquet.read_table(path_for_arrow(folder / "flights.parquet")), kind)


class _Conditions(NamedTuple):
    """What flights have in common, as the command line writes it."""

    vehicle: str
    sensors: str
    laws: Sequence[str]
    settings: Sequence[str]
    varied: Sequence[str]


def _warn_of_unused(conditions: _Conditions, sampled: bool) -> None:
    """Warn, at the line that called `sweep`, of each parameter that has no effect in any flight. What is
    wrong with vehicle or sensors is left to the sweep."""
    from gcs.sweep.plan_values import parse_varied, varied_values
    from gcs.workflows.flight_options import parse_setting
    from gcs.workflows.unused_settings import unused_settings

    settings = list(map(parse_setting, conditions.settings))
    varied = varied_values([parse_varied(text, sampled) for text in conditions.varied])
    with suppress(FileError):
        lines = unused_settings(conditions.vehicle, conditions.sensors, conditions.laws, [*settings, *varied])
        for name, line in lines.items():
            option = "settings" if name in dict(settings) else "vary"
            warnings.warn(f"{option}: {line}", stacklevel=4)


def _varied(vary: Any) -> list[str]:
    """Varied parameters with their values, as the command line writes them; or `Error`."""
    together = {}
    if isinstance(vary, Mapping):
        together = {key: values for key, values in vary.items() if isinstance(key, tuple) and key}
        vary = {key: values for key, values in vary.items() if key not in together}
    example = "{'SIM_WIND_E': [0, 3]}"
    texts = [
        f"{name}={_values(name, values)}"
        for name, values in values_by_parameter("vary", vary, example).items()
    ]
    for key, values in together.items():
        names = "=".join(parameter_name("vary", name) for name in key)
        texts.append(f"{names}={_values(names, values)}")
    return texts


def _values(name: str, values: Any) -> str:
    """The values of a varied parameter, as the command line writes them."""
    if isinstance(values, str):
        return values
    return ",".join(map(repr, numbers(f"vary[{name!r}]", values)))


def _seeds(seeds: Any) -> str:
    """The seeds, as the command line writes them; or `Error`."""
    from autopilot.shell.options import MAX_SEED
    from gcs.sweep.plan_values import seeds_text

    if not isinstance(seeds, Iterable):
        return str(whole_number("seeds", seeds, 1))
    listed = items("seeds", seeds, "a whole number, 1 or more, or a range or list of seeds")
    if not listed:
        raise GcsError(f"seeds = {shown_value(seeds)}; must be one seed at least")
    return seeds_text([whole_number(f"seeds[{i}]", one, 0, MAX_SEED) for i, one in enumerate(listed)])


def _laws(laws: str | type | Sequence[str | type]) -> Sequence[str | type]:
    if isinstance(laws, str | type):
        return [laws]
    wanted = f"a law or a list of laws, as [{DEFAULT_LAW!r}]"
    if not (found := items("laws", laws, wanted)):
        raise GcsError(f"laws = {laws!r}; must be {wanted}")
    return found


def _address(scheduler: Any) -> str:
    """The address of a Dask client's scheduler, or the given address."""
    found = getattr(getattr(scheduler, "scheduler", None), "address", scheduler)
    if not isinstance(found, str) or not found:
        raise GcsError(
            f"scheduler = {shown_value(scheduler)}; must be a Dask client or an address, as tcp://HOST:8786"
        )
    return found


@contextmanager
def _stopped_with_us(program: subprocess.Popen[str]) -> Iterator[None]:
    """Stop the sweep if this context is left by an exception, as by a SIGINT that only this process receives.

    The sweep ends and stores the flights in the air, as after Ctrl-C in its terminal; another exception
    meanwhile ends it at once. Its workers end with it.
    """
    try:
        yield
    except BaseException:
        try:
            # unlike a second SIGINT it abandons nothing if the terminal has already sent one to all
            ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # nohup
            program.send_signal(signal.SIGTERM if ignored else signal.SIGHUP)
            program.communicate()
        except BaseException:
            program.kill()
            raise
        raise


def _run(arguments: list[str], quiet: bool) -> None:
    """Run `gcs sweep`. Its progress goes to our stderr, and so does, even if `quiet`, all that a law prints.
    If the sweep fails, its last message becomes the text of the error."""
    from gcs.shell.processes import end_with_parent

    command = [sys.executable, "-P", "-m", "gcs", "sweep", *arguments, *(["--quiet"] if quiet else [])]
    with subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=end_with_parent(signal.SIGTERM),  # noqa: PLW1509, it only calls the kernel
    ) as program:
        assert program.stderr is not None
        messages: list[str] = []
        other_lines: list[str] = []
        with _stopped_with_us(program):
            for line in program.stderr:
                if not line.startswith(_ERROR_PREFIX):
                    other_lines.append(line)
                    sys.stderr.write(line)
                    continue
                messages.append(line)
                if len(messages) > 1 and not quiet:
                    sys.stderr.write(messages[-2])
            program.wait()
    last = messages[-1] if messages else ""
    # without progress, each message is an error; a program that crashes leaves a last line of its traceback
    errors = (messages if quiet else [last]) if messages else other_lines[-1:]
    if program.returncode == 0:
        if not quiet:
            sys.stderr.write(last)
        return
    if program.returncode in _STOPPED:
        raise KeyboardInterrupt
    kind = InputError if program.returncode == InputError.exit_code else GcsError
    reason = "; ".join(line.strip().removeprefix(_ERROR_PREFIX) for line in errors if line.strip())
    raise kind(reason or f"gcs sweep ended with {program.returncode}")
