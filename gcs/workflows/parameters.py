"""Parameters of a running vehicle: reading, setting, and storing them in files."""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence
from pathlib import Path

from autopilot.shell.atomic_file import write_atomically
from autopilot.wire.parameter_names import unknown_parameter_text
from autopilot.wire.parameter_table import ParameterError, parse_text
from gcs.clients.operation import Result, Target
from gcs.clients.parameter_transfer import ParameterGet, ParameterList, ParameterSet
from gcs.errors import GcsError, InputError, NoVehicleError, RefusedError
from gcs.formats.params import QGC_ENDING, parameter_lines, qgc_parameters
from gcs.shell.display import StepDisplay, notify
from gcs.shell.link import Address
from gcs.shell.session import Session
from missions.text_files import TextFileError, text_of

_ANY_VEHICLE = "bebop"  # parameters have the same units with all vehicles


def list_parameters(pattern: str, address: Address) -> dict[str, float]:
    """Values by name of the parameters that match a shell pattern; GcsError if none does."""
    with Session(address) as session:
        values = _read_all(session, session.find())
    found = {n: v for n, v in values.items() if fnmatch.fnmatchcase(n, pattern.upper())}
    if not found:
        raise GcsError(f"none of the vehicle's {len(values)} parameters matches {pattern!r}")
    return found


def get_parameters(names: Sequence[str], address: Address) -> dict[str, float | None]:
    """Values by name."""
    found: dict[str, float | None] = {}
    with Session(address) as session:
        target = session.find()
        for name in names:
            operation = ParameterGet(target, name.upper())
            exchange(session, operation, name)
            found[name.upper()] = operation.value
    return found


def set_parameter(name: str, value: float, address: Address) -> str:
    """Set one parameter and read it back; return a line on the result. If the value may be unintended, a line
    says so."""
    with Session(address) as session:
        operation = ParameterSet(session.find_to_command(), name.upper(), value)
        done = exchange(session, operation, name).text
    if 0.0 < abs(value) < 1.0:
        from gcs.workflows.flight_inputs import setting_warnings

        for warning in setting_warnings(_ANY_VEHICLE, [(name.upper(), value)]):
            notify(warning)
    return done


def exchange(
    session: Session,
    operation: ParameterGet | ParameterSet,
    label: str = "",
    names: list[str] | None = None,
) -> Result:
    """Carry out a get or a set; if the parameter does not exist, RefusedError names the most similar ones.

    `names`: a list in which the names of the vehicle's parameters are kept between exchanges.
    """
    try:
        return session.run(operation, label)
    except RefusedError:
        if not operation.unknown:
            raise
    known_names = [] if names is None else names
    if not known_names:
        known_names += _read_all(session, session.target)
    raise RefusedError(unknown_parameter_text(operation.name, known_names))


def save_parameters(file: Path, address: Address) -> int:
    """Write all parameters to a file, in the format of its ending; return their number."""
    with Session(address) as session:
        target = session.find()
        values = _read_all(session, target)
    is_qgc = file.suffix.lower() == QGC_ENDING
    text = qgc_parameters(values, target) if is_qgc else parameter_lines(values)
    try:
        write_atomically(file, text.encode())
    except OSError as error:
        raise GcsError(f"{file}: cannot be written: {error.strerror}") from None
    return len(values)


def load_parameters(file: Path, address: Address) -> tuple[int, int]:
    """Set all parameters of a file; return how many were set, and how many it contains. Each refusal is
    printed."""
    try:
        values = parse_text(text_of(file))
    except (TextFileError, ParameterError) as error:
        raise InputError(f"{file}: {error}") from None
    if not values:
        raise InputError(f"{file}: has no parameters; must have lines NAME value")
    refused = 0
    with Session(address) as session, StepDisplay("parameters") as display:
        target = session.find_to_command()
        names: list[str] = []
        for done, (name, value) in enumerate(values.items()):
            display.update(done, len(values))
            try:
                exchange(session, ParameterSet(target, name, value), names=names)
            except RefusedError as error:
                refused += 1
                notify(str(error))
            except NoVehicleError as error:
                raise NoVehicleError(
                    f"{error}; {done - refused} of {len(values)} parameters were set"
                ) from None
    return len(values) - refused, len(values)


def _read_all(session: Session, target: Target) -> dict[str, float]:
    operation = ParameterList(target)
    session.run(operation, "parameters")
    return operation.values
