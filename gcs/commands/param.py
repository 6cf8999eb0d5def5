"""gcs param get|set|list|save|load"""

from __future__ import annotations

from pathlib import Path

import click

from gcs.commands.options import OUTPUT_FILE, FiniteType, connect_option, json_option, print_json, print_table
from gcs.commands.parameter_completion import complete_names
from gcs.errors import GcsError
from gcs.shell.link import Address
from gcs.workflows.parameters import (
    get_parameters,
    list_parameters,
    load_parameters,
    save_parameters,
    set_parameter,
)


@click.group("param")
def param_command() -> None:
    """Read and write parameters.

    Every gain, mass, rate and limit of the autopilot is a parameter (docs/parameters.md).
    """


@param_command.command("list")
@click.argument("pattern", default="*", shell_complete=complete_names)
@json_option
@connect_option
def list_command(pattern: str, as_json: bool, address: Address) -> None:
    """List parameters with their values.

    PATTERN selects some of them, e.g. 'NGC_*'.
    """
    found = list_parameters(pattern, address)
    if as_json:
        print_json(found)
    else:
        print_table([(name, f"{value:.9g}") for name, value in found.items()])


@param_command.command("get")
@click.argument("names", nargs=-1, required=True, shell_complete=complete_names)
@json_option
@connect_option
def get_command(names: tuple[str, ...], as_json: bool, address: Address) -> None:
    """Read parameters by NAME."""
    found = get_parameters(names, address)
    if as_json:
        print_json(found)
    else:
        print_table([(name, f"{value:.9g}") for name, value in found.items()])


@param_command.command("set", context_settings={"ignore_unknown_options": True})  # -1 is a number here
@click.argument("name", shell_complete=complete_names)
@click.argument("value", type=FiniteType())
@connect_option
def set_command(name: str, value: float, address: Address) -> None:
    """Set parameter NAME to VALUE and verify that it was stored."""
    click.echo(set_parameter(name, value, address))


@param_command.command("save")
@click.argument("file", type=OUTPUT_FILE)
@connect_option
def save_command(file: Path, address: Address) -> None:
    """Save all parameters to FILE.

    If FILE ends in .params, it has QGroundControl's columns, else one line `NAME value` for each parameter,
    as MAVProxy and Mission Planner read them.
    """
    click.echo(f"{save_parameters(file, address)} parameters saved to {file}")


@param_command.command("load")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@connect_option
def load_command(file: Path, address: Address) -> None:
    """Set all parameters in FILE.

    Reads `NAME value` lines (MAVProxy, Mission Planner) and QGroundControl's columns. A parameter that the
    vehicle refuses or does not have is reported, and the others are set.
    """
    done, total = load_parameters(file, address)
    click.echo(f"{done} of {total} parameters set from {file}")
    if done < total:
        others = "; the others are set" if done else ""
        raise GcsError(f"{total - done} of {total} parameters of {file} were refused{others}")
