"""gcs upload, download, clear: the mission on a running vehicle."""

from __future__ import annotations

import math
from typing import Any

import click

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.mission_items import WireItem, encode_mission
from gcs.clients.missions import MissionClear, MissionDownload, MissionUpload
from gcs.commands.options import connect_option, json_option, print_json, print_table
from gcs.flying import vehicle_home
from gcs.link import Address
from gcs.missions_checked import load_checked
from gcs.session import Session


@click.command("upload")
@click.argument("mission")
@click.option("--vehicle", default="bebop", show_default=True, help="Vehicle against which it is checked.")
@click.option("--force", is_flag=True, help="Upload even what the vehicle cannot do.")
@connect_option
def upload_command(mission: str, vehicle: str, force: bool, address: Address) -> None:
    """Put a mission on the vehicle.

    MISSION is a shipped name or the path of a mission file. The old mission stays in force until the new one
    is there whole.
    """
    loaded = load_checked(mission, vehicle, force)
    with Session(address) as session:
        target = session.find()
        items = encode_mission(loaded, vehicle_home(session))
        click.echo(session.run(MissionUpload(target, items), "upload").text)


@click.command("download")
@json_option
@connect_option
def download_command(as_json: bool, address: Address) -> None:
    """Fetch the mission from the vehicle.

    Each line is one mission item as it travels; null and - stand for values that are not given.
    """
    with Session(address) as session:
        operation = MissionDownload(session.find())
        session.run(operation, "download")
        items = operation.items
    if as_json:
        print_json([{"seq": seq, **_record(item)} for seq, item in enumerate(items)])
        return
    header = ("seq", "command", "frame", "p1", "p2", "p3", "p4", "x", "y", "z")
    print_table([_row(seq, item) for seq, item in enumerate(items)], header)


@click.command("clear")
@connect_option
def clear_command(address: Address) -> None:
    """Take the mission off the vehicle."""
    with Session(address) as session:
        click.echo(session.run(MissionClear(session.find())).text)


def _record(item: WireItem) -> dict[str, Any]:
    return {**item._asdict(), "name": _command_name(item.command)}


def _row(seq: int, item: WireItem) -> tuple[str, ...]:
    numbers = (item.param1, item.param2, item.param3, item.param4)
    return (
        str(seq),
        _command_name(item.command),
        str(item.frame),
        *("-" if math.isnan(number) else f"{number:g}" for number in numbers),
        str(item.x),
        str(item.y),
        f"{item.z:g}",
    )


def _command_name(command: int) -> str:
    for enum in ("PLUMBLINE_COMMAND", "MAV_CMD"):
        entry = mavlink.enums[enum].get(command)
        if entry is not None:
            return str(entry.name).removeprefix("MAV_CMD_").removeprefix("PLUMBLINE_")
    return str(command)
