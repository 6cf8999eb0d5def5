"""gcs upload, download, clear: the mission on a running vehicle."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from autopilot.wire.command_names import command_name
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from gcs.clients.missions import MissionClear
from gcs.commands.options import (
    OUTPUT_FILE,
    connect_option,
    json_option,
    mission_argument,
    print_json,
    print_table,
    vehicle_option,
)
from gcs.formats.missions import is_foreign
from gcs.shell.link import Address
from gcs.shell.session import Session
from gcs.workflows.transfer import MISSION_ENDING, download, download_to, upload

_MISSION = mavlink.MAV_MISSION_TYPE_MISSION
_FENCE = mavlink.MAV_MISSION_TYPE_FENCE
_RALLY = mavlink.MAV_MISSION_TYPE_RALLY


@click.command("upload")
@mission_argument
@vehicle_option("Vehicle against which it is checked")
@click.option(
    "--force", is_flag=True, help="Upload the mission even if it exceeds the limits of the vehicle."
)
@click.option(
    "--skip", is_flag=True, help="Leave out the items of a .plan or .waypoints file that are not flown."
)
@connect_option
def upload_command(mission: str, vehicle: str, force: bool, skip: bool, address: Address) -> None:
    """Upload a mission to the vehicle.

    MISSION is a shipped name, the path of a mission file, or a .plan or .waypoints file of another ground
    station. The old mission stays in force until the new one has arrived completely. A .plan replaces fence
    and rally points too, as an upload from QGroundControl does.
    """
    upload(mission, vehicle, force, skip, address, click.echo)


@click.command("download")
@click.argument("file", required=False, type=OUTPUT_FILE)
@json_option
@connect_option
def download_command(file: Path | None, as_json: bool, address: Address) -> None:
    """Download the mission from the vehicle.

    Each line is one mission item as transferred; null and - stand for values that are not given. With FILE,
    the mission is written as a mission file (.toml) or for other ground stations (.plan, with fence and rally
    points, or .waypoints). An existing FILE is replaced.
    """
    if file is not None and not is_foreign(file) and file.suffix.lower() != MISSION_ENDING:
        raise click.BadParameter(f"{file}; must end in .plan, .waypoints or .toml", param_hint="FILE")
    if file is None:
        items = download(address)
    else:
        items, written = download_to(file, address)
        if not as_json:
            click.echo(f"{written} written to {file}")
            return
    if as_json:
        print_json([{"seq": seq, **_record(item)} for seq, item in enumerate(items)])
        return
    header = ("seq", "command", "frame", "p1", "p2", "p3", "p4", "x", "y", "z")
    print_table([_row(seq, item) for seq, item in enumerate(items)], header)


@click.command("clear")
@connect_option
def clear_command(address: Address) -> None:
    """Delete the mission on the vehicle."""
    with Session(address) as session:
        click.echo(session.run(MissionClear(session.find_to_command())).text)


def _record(item: WireItem) -> dict[str, Any]:
    return {**item._asdict(), "name": command_name(item.command)}


def _row(seq: int, item: WireItem) -> tuple[str, ...]:
    numbers = (item.param1, item.param2, item.param3, item.param4)
    return (
        str(seq),
        command_name(item.command),
        str(item.frame),
        *("-" if math.isnan(number) else f"{number:g}" for number in numbers),
        str(item.x),
        str(item.y),
        f"{item.z:g}",
    )
