"""gcs status"""

from __future__ import annotations

from typing import Any

import click

from gcs.commands.options import connect_option, json_option, print_json, print_table
from gcs.shell.link import Address
from gcs.workflows.status import vehicle_status


@click.command("status")
@json_option
@connect_option
def status_command(as_json: bool, address: Address) -> None:
    """Show what the vehicle says of itself."""
    record = vehicle_status(address)
    if as_json:
        print_json(record)
        return
    print_table([(name.replace("_", " "), _shown(value)) for name, value in record.items()])


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.3f}"
    if isinstance(value, list):
        return " | ".join(value) or "-"
    return str(value)
