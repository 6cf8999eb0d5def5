"""gcs param get|set|list|save|load"""

from __future__ import annotations

import fnmatch
import math
from pathlib import Path

import click

from autopilot.wire.parameter_table import ParameterError, parse_text
from gcs.clients.operation import Target
from gcs.clients.parameter_transfer import ParameterGet, ParameterList, ParameterSet
from gcs.commands.options import connect_option, json_option, print_json, print_table
from gcs.errors import GcsError, RefusedError
from gcs.formats.params import QGC_ENDING, lines_of, qgc_of
from gcs.shell.display import StepDisplay, say
from gcs.shell.link import Address
from gcs.shell.session import Session


@click.group("param")
def param_command() -> None:
    """Read and write parameters.

    Names are those of the vehicle: every gain, mass, rate and limit that its autopilot knows.
    """


@param_command.command("list")
@click.argument("pattern", default="*")
@json_option
@connect_option
def list_command(pattern: str, as_json: bool, address: Address) -> None:
    """List parameters with their values.

    PATTERN picks some, e.g. 'NGC_*'.
    """
    values = _all(address)
    found = {n: v for n, v in values.items() if fnmatch.fnmatchcase(n, pattern.upper())}
    if not found:
        raise GcsError(f"none of the vehicle's {len(values)} parameters matches {pattern!r}")
    if as_json:
        print_json(found)
    else:
        print_table([(name, f"{value:.9g}") for name, value in found.items()])


@param_command.command("get")
@click.argument("names", nargs=-1, required=True)
@json_option
@connect_option
def get_command(names: tuple[str, ...], as_json: bool, address: Address) -> None:
    """Read one parameter or more by NAME."""
    found = {}
    with Session(address) as session:
        target = session.find()
        for name in names:
            operation = ParameterGet(target, name.upper())
            session.run(operation, name)
            found[name.upper()] = operation.value
    if as_json:
        print_json(found)
    else:
        print_table([(name, f"{value:.9g}") for name, value in found.items()])


@param_command.command("set")
@click.argument("name")
@click.argument("value", type=float)
@connect_option
def set_command(name: str, value: float, address: Address) -> None:
    """Set parameter NAME to VALUE, and see that it was stored."""
    if not math.isfinite(value):
        raise click.BadParameter(f"{value}; must be a finite number", param_hint="VALUE")
    with Session(address) as session:
        operation = ParameterSet(session.find(), name.upper(), value)
        click.echo(session.run(operation, name).text)


@param_command.command("save")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@connect_option
def save_command(file: Path, address: Address) -> None:
    """Save all parameters to FILE.

    QGroundControl's columns if FILE ends in .params, else one `NAME value` line each, as MAVProxy and Mission
    Planner read them.
    """
    with Session(address) as session:
        target = session.find()
        values = _listed(session, target)
    is_qgc = file.suffix.lower() == QGC_ENDING
    text = qgc_of(values, target) if is_qgc else lines_of(values)
    partial = file.with_name(file.name + ".part")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(file)
    except OSError as error:
        raise GcsError(f"{file}: cannot be written: {error.strerror}") from None
    click.echo(f"{len(values)} parameters saved to {file}")


@param_command.command("load")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@connect_option
def load_command(file: Path, address: Address) -> None:
    """Set all parameters that FILE holds.

    Reads `NAME value` lines (MAVProxy, Mission Planner) and QGroundControl's columns. A parameter that the
    vehicle refuses is named, and the others are set all the same.
    """
    try:
        values = parse_text(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise GcsError(f"{file}: cannot be read: {reason}") from None
    except ParameterError as error:
        raise GcsError(f"{file}: {error}") from None
    refused = 0
    with Session(address) as session, StepDisplay("parameters") as display:
        target = session.find()
        for done, (name, value) in enumerate(values.items()):
            display.update(done, len(values))
            try:
                session.run(ParameterSet(target, name, value))
            except RefusedError as error:
                refused += 1
                say(str(error))
    click.echo(f"{len(values) - refused} of {len(values)} parameters set from {file}")
    if refused:
        raise GcsError(f"{refused} of {len(values)} parameters of {file} were refused")


def _all(address: Address) -> dict[str, float]:
    with Session(address) as session:
        return _listed(session, session.find())


def _listed(session: Session, target: Target) -> dict[str, float]:
    operation = ParameterList(target)
    session.run(operation, "parameters")
    return operation.values
