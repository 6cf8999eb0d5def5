"""gcs upload, download, clear: the mission on a running vehicle."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, encode_mission
from gcs.clients.missions import MissionClear, MissionDownload, MissionUpload
from gcs.commands.options import connect_option, json_option, print_json, print_table, vehicle_option
from gcs.errors import GcsError
from gcs.formats.items import command_name
from gcs.formats.missions import PLAN_ENDING, Judged, is_foreign, judge, read_foreign, write_foreign
from gcs.shell.display import say
from gcs.shell.link import Address
from gcs.shell.session import Session
from gcs.workflows.check_mission import check_items, load_checked
from gcs.workflows.fly import vehicle_home

_MISSION = mavlink.MAV_MISSION_TYPE_MISSION
_FENCE = mavlink.MAV_MISSION_TYPE_FENCE
_RALLY = mavlink.MAV_MISSION_TYPE_RALLY


@click.command("upload")
@click.argument("mission")
@vehicle_option("Vehicle against which it is checked")
@click.option("--force", is_flag=True, help="Upload even what the vehicle cannot do.")
@click.option(
    "--skip", is_flag=True, help="Upload a .plan or .waypoints file without what is not flown of it."
)
@connect_option
def upload_command(mission: str, vehicle: str, force: bool, skip: bool, address: Address) -> None:
    """Put a mission on the vehicle.

    MISSION is a shipped name, the path of a mission file, or a .plan or .waypoints file of another ground
    station. The old mission stays in force until the new one is there whole. A .plan replaces fence and rally
    points too, as it does from QGroundControl.
    """
    path = Path(mission)
    if is_foreign(path):
        plan = read_foreign(path)
        with Session(address) as session:
            target = session.find()
            items = _flown(path, judge(plan, home := vehicle_home(session)), skip)
            if not force:
                check_items(path.name, items, home, vehicle)
            # the fence first: the vehicle judges the mission by it
            for kind, area in ((_FENCE, plan.fence), (_RALLY, plan.rally)):
                if area is not None:
                    text = session.run(MissionUpload(target, area, kind)).text
                    if area:
                        click.echo(text)
            click.echo(session.run(MissionUpload(target, items), "upload").text)
        return
    loaded = load_checked(mission, vehicle, force)
    with Session(address) as session:
        target = session.find()
        items = encode_mission(loaded, vehicle_home(session))
        click.echo(session.run(MissionUpload(target, items), "upload").text)


def _flown(path: Path, judged: Judged, skip: bool) -> tuple[WireItem, ...]:
    """The items to upload; what is not done is told, and what is left out is an error unless it may be."""
    for line in (*judged.kept, *judged.left_out):
        say(f"{path}: {line}")
    if judged.left_out and not skip:
        count = len(judged.left_out)
        raise GcsError(
            f"{path}: {count} {'thing is' if count == 1 else 'things are'} not flown; --skip goes on"
        )
    if not judged.items:
        raise GcsError(f"{path}: nothing that can be flown; gcs clear takes the mission off the vehicle")
    return judged.items


@click.command("download")
@click.argument("file", required=False, type=click.Path(dir_okay=False, path_type=Path))
@json_option
@connect_option
def download_command(file: Path | None, as_json: bool, address: Address) -> None:
    """Fetch the mission from the vehicle.

    Each line is one mission item as it travels; null and - stand for values that are not given. With FILE,
    which ends in .plan or .waypoints, it is written for other ground stations, a .plan with fence and rally
    points.
    """
    if file is not None and not is_foreign(file):
        raise click.BadParameter(f"{file}; must end in .plan or .waypoints", param_hint="FILE")
    with Session(address) as session:
        target = session.find()
        items, fence, rally = (
            _fetched(session, MissionDownload(target, kind))
            if kind == _MISSION or (file is not None and file.suffix.lower() == PLAN_ENDING)
            else []
            for kind in (_MISSION, _FENCE, _RALLY)
        )
        home = vehicle_home(session) if file is not None else Home()
    if file is not None:
        write_foreign(file, items, home, fence, rally)
        if not as_json:
            click.echo(f"{len(items)} items written to {file}")
            return
    if as_json:
        print_json([{"seq": seq, **_record(item)} for seq, item in enumerate(items)])
        return
    header = ("seq", "command", "frame", "p1", "p2", "p3", "p4", "x", "y", "z")
    print_table([_row(seq, item) for seq, item in enumerate(items)], header)


def _fetched(session: Session, operation: MissionDownload) -> list[WireItem]:
    session.run(operation, "download")
    return operation.items


@click.command("clear")
@connect_option
def clear_command(address: Address) -> None:
    """Take the mission off the vehicle."""
    with Session(address) as session:
        click.echo(session.run(MissionClear(session.find())).text)


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
