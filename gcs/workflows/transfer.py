"""Transfer of missions between files and a running vehicle, with fence and rally points if there are any."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import MissionItemError, WireItem, home_item, located_steps
from gcs.clients.missions import AREA_NAMES, MissionDownload, MissionUpload
from gcs.errors import GcsError, RefusedError, input_error
from gcs.foreign_mission import ForeignMission
from gcs.formats.jumps import redirected
from gcs.formats.missions import (
    PLAN_ENDING,
    is_foreign,
    mission_of,
    read_foreign,
    without_home,
    write_foreign,
)
from gcs.formats.plan import Plan
from gcs.mission_files import is_mission_file
from gcs.mission_items import areas_of, home_difference, in_mission_terms, items_of
from gcs.shell.display import notify, notify_if_slow
from gcs.shell.link import Address
from gcs.shell.session import Session
from gcs.workflows.before_flight import CHECKING_TEXT
from gcs.workflows.flyable import load_checked, require_flyable
from gcs.workflows.recorded_mission import same_items
from gcs.workflows.running_flight import vehicle_home
from missions.fileformat import MissionFileError
from missions.fileformat import mission_of as steps_of
from missions.toml_files import FileError
from missions.writing import mission_table, write_toml

_MISSION = mavlink.MAV_MISSION_TYPE_MISSION
_FENCE = mavlink.MAV_MISSION_TYPE_FENCE
_RALLY = mavlink.MAV_MISSION_TYPE_RALLY
MISSION_ENDING = ".toml"


PrintLine = Callable[[str], None]


def upload(
    mission: str, vehicle: str, force: bool, skip: bool, address: Address, print_line: PrintLine
) -> None:
    """Check a mission by name or path for `vehicle` and upload it; `print_line` gets a line for each list."""
    send = checked_upload(mission, vehicle, force, skip, print_line)
    with Session(address) as session:
        session.find_to_command()
        send(session)


def checked_upload(
    mission: str,
    vehicle: str,
    force: bool,
    skip: bool,
    print_line: PrintLine,
    note: PrintLine = notify,
    quiet: bool = False,
) -> Callable[[Session], None]:
    """Read a mission by name or path, and check it for `vehicle`; return a function that uploads it in a
    session. A file of another ground station is checked only in that function, since its positions must be
    judged by the vehicle's home; `note` gets a line for each thing that is not flown as in the file. Unless
    `quiet`, a check that takes long is said."""
    path = Path(mission)
    if is_foreign(path) and not is_mission_file(path):
        plan = read_foreign(path)
        return lambda session: _upload_foreign(
            session, path, plan, vehicle, force, skip, print_line, note, quiet
        )
    with notify_if_slow(CHECKING_TEXT, quiet):
        loaded = load_checked(mission, vehicle, force)

    def send(session: Session) -> None:
        home = vehicle_home(session)
        items = _as_counted(items_of(loaded, home), home, session)
        print_line(session.run(MissionUpload(session.target, items), "upload").text)

    return send


def _upload_foreign(
    session: Session,
    path: Path,
    plan: Plan,
    vehicle: str,
    force: bool,
    skip: bool,
    print_line: PrintLine,
    note: PrintLine,
    quiet: bool,
) -> None:
    mission = mission_of(plan, vehicle_home(session), path.stem)
    if plan.home is not None and (difference := home_difference(plan.home, mission.home)):
        note(f"{path}: {difference}")
    items = _flyable_items(path, mission, skip, note)
    if not force:
        with notify_if_slow(CHECKING_TEXT, quiet):
            require_flyable(mission, vehicle)
    counted = _as_counted(items, mission.home, session)
    # the fence first: the vehicle checks the mission against it
    replaced = []
    for kind, points in areas_of(mission).items():
        text = session.run(MissionUpload(session.target, points, kind)).text
        replaced.append(AREA_NAMES[kind])
        if points:
            print_line(text)
    try:
        print_line(session.run(MissionUpload(session.target, counted), "upload").text)
    except RefusedError as error:
        before = (0,) * (
            len(counted) - len(items)
        )  # the home, which the vehicle counts and the file does not
        numbers = mission.numbers._replace(items=before + mission.numbers.items)
        text = in_mission_terms(str(error), replace(mission, numbers=numbers))
        if replaced:
            text += f"; the vehicle has {path.name}'s {' and '.join(replaced)} now"
        raise RefusedError(text) from None


def _as_counted(items: Sequence[WireItem], home: Home, session: Session) -> Sequence[WireItem]:
    """The items as the vehicle counts them: one that presents itself as ArduPilot takes a waypoint in the
    first place for its home, which is therefore put before it."""
    heartbeat = session.request(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
    takes_home = heartbeat.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    if not takes_home or items[0].command != mavlink.MAV_CMD_NAV_WAYPOINT:
        return items
    return [home_item(home), *redirected(items, lambda target: target + 1)]


def _flyable_items(path: Path, mission: ForeignMission, skip: bool, note: PrintLine) -> tuple[WireItem, ...]:
    """The items to upload; `note` gets what cannot be flown as in the file. GcsError if something must be
    left out without `skip`, or if nothing remains."""
    for line in (*mission.notes, *mission.left_out):
        note(f"{path}: {line}")
    if mission.left_out and not skip:
        count = len(mission.left_out)
        raise GcsError(
            f"{path}: {count} {'thing is' if count == 1 else 'things are'} not flown; --skip uploads the rest"
        )
    if not mission.items:
        raise GcsError(f"{path}: nothing that can be flown; gcs clear deletes the mission on the vehicle")
    return mission.items


def download(address: Address) -> list[WireItem]:
    """The items of the vehicle's mission."""
    with Session(address) as session:
        session.find()
        return _download_items(session, _MISSION)


def download_to(file: Path, address: Address) -> tuple[list[WireItem], str]:
    """Write the vehicle's mission to a mission file, to a .plan file, with fence and rally points, or to a
    .waypoints file; return its items, and what was written in words."""
    with Session(address) as session:
        session.find()
        items = _download_items(session, _MISSION)
        has_areas = file.suffix.lower() == PLAN_ENDING
        fence = _download_items(session, _FENCE) if has_areas else []
        rally = _download_items(session, _RALLY) if has_areas else []
        home = vehicle_home(session)
    if file.suffix.lower() == MISSION_ENDING:
        _write_mission(file, items, home)
    else:
        write_foreign(file, items, home, fence, rally)
    lists = (items, "item"), (fence, "fence item"), (rally, "rally point")
    counts = ((len(one), f"{what}{'s' * (len(one) != 1)}") for one, what in lists if one or one is items)
    return items, ", ".join(f"{count} {what}" for count, what in counts)


def _write_mission(file: Path, items: Sequence[WireItem], home: Home) -> None:
    """Write the steps of the items as a mission file; GcsError if it would give other items."""
    needed = f"{file}: not written: {{}}; {file.with_suffix(PLAN_ENDING).name} would hold all of it"
    counted = without_home(items, home)
    try:
        steps = [one.step for one in located_steps(counted, home)]
        table = mission_table(file.stem, "", (), steps)
        mission = steps_of(table, file.stem, "the mission")
    except (MissionItemError, MissionFileError) as error:
        raise GcsError(needed.format(error)) from None
    if not same_items(items_of(mission, home), counted):
        raise GcsError(needed.format("a mission file has no item for a part of this mission"))
    try:
        write_toml(file, table)
    except FileError as error:
        raise input_error(error) from None


def _download_items(session: Session, kind: int) -> list[WireItem]:
    operation = MissionDownload(session.target, kind)
    session.run(operation, "download")
    return operation.items
