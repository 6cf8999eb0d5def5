"""gcs status, gcs texts"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import click

from gcs.commands.options import (
    connect_option,
    display_name,
    json_option,
    print_json,
    print_table,
    truth_option,
)
from gcs.shell.display import notify
from gcs.shell.link import Address
from gcs.workflows.status import vehicle_status, vehicle_texts


@click.command("status")
@json_option
@connect_option
@truth_option
def status_command(as_json: bool, address: Address, truth_at: Address | None) -> None:
    """Show the vehicle's status.

    The latest warnings and errors are listed with their age.
    """
    record = vehicle_status(address, truth_at, as_json)
    if as_json:
        print_json(record)
        return
    texts = record.pop("texts")
    print_table([(display_name(name), _value_text(value)) for name, value in record.items()])
    if texts:
        click.echo()
        print_table(_lines(texts))


@click.command("texts")
@json_option
@connect_option
def texts_command(as_json: bool, address: Address) -> None:
    """List the messages (STATUSTEXT) of the vehicle.

    The vehicle keeps the last 50, each with the time at which it was last sent: progress, warnings, and
    reasons for refused commands.
    """
    texts = vehicle_texts(address)
    if as_json:
        print_json(texts)
    elif texts:
        print_table(_lines(texts))
    else:
        notify("the vehicle has sent no texts yet, or keeps none")


def _lines(texts: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    return [(f"{one['age_s']:.1f} s ago", one["severity"], one["text"]) for one in texts]


def _value_text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:z.3f}" if isinstance(value, float) else str(value)
