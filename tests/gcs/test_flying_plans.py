"""`gcs fly`, `gcs sweep` and `plumbline.fly` with the file of another ground station."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner

import plumbline
from autopilot.onboard.onboard import Onboard
from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, encode_steps
from gcs.cli import gcs
from gcs.clients.flight import FlightClient
from gcs.closed_loop import Conditions, fly
from gcs.errors import EXIT_DONE, EXIT_USAGE, InputError
from gcs.foreign_mission import ForeignMission
from gcs.formats.missions import write_foreign
from gcs.mission_files import is_mission_file, load, read
from gcs.mission_items import at_home, home_difference, items_of
from gcs.sweep.flight import fly as fly_without_wire
from gcs.sweep.flight import start_times
from missions.model import Land, ReturnHome, Step, Takeoff, Waypoint
from sitl.hil import HilSimulator

HOME = Home(-33.9, 18.4, 60.0)  # not where the vehicle is by default
PATH = (Takeoff(0.6), Waypoint(0.5, 0.3, 0.6), ReturnHome())
HEADING_DEG = 90.0  # clockwise from north: east


OURS = 'title = "t"\n[[items]]\ntype = "takeoff"\naltitude_m = 1.0\n[[items]]\ntype = "land"\n'


class NoLog:
    def write(self, unix_us: int, *frames: bytes) -> None:
        pass


def command(number: int, *parameters: float) -> WireItem:
    p1, p2, p3, p4 = (*parameters, 0.0, 0.0, 0.0, 0.0)[:4]
    return WireItem(mavlink.MAV_FRAME_MISSION, number, 0, 1, p1, p2, p3, p4, 0, 0, 0.0)


def place(number: int, param1: float, east_m: float, north_m: float, height_m: float = 0.0) -> WireItem:
    latitude, longitude, _ = geodetic_from_enu((east_m, north_m, 0.0), HOME)
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    return WireItem(frame, number, 0, 1, param1, 0.0, 0.0, 0.0, latitude, longitude, height_m)


def circle(radius_m: float) -> tuple[WireItem, ...]:
    return (place(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, radius_m, 0.0, 0.0),)


CAMERA = command(mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 2.0)
YAW = command(mavlink.MAV_CMD_CONDITION_YAW, HEADING_DEG, 0.0, 0.0, 0.0)
PLACE = place(mavlink.MAV_CMD_NAV_LOITER_TIME, 2.0, 0.2, 0.0, 0.6)
RALLY = (place(mavlink.MAV_CMD_NAV_RALLY_POINT, 0.0, 0.2, 0.0),)


def plan(
    folder: Path,
    steps: Sequence[Step] = PATH,
    fence: tuple[WireItem, ...] = (),
    others: Sequence[WireItem] = (),
    rally: tuple[WireItem, ...] = (),
    name: str = "survey.plan",
) -> Path:
    """A file with these steps; `others` come after the take-off."""
    path = folder / name
    takeoff, *rest = encode_steps(tuple(steps), HOME)
    write_foreign(path, (takeoff, *others, *rest), HOME, fence, rally)
    return path


def test_it_is_flown_at_its_home_with_all_its_items_within_its_fence(tmp_path: Path) -> None:
    mission = load(plan(tmp_path, fence=circle(5.0), others=(CAMERA, YAW), rally=RALLY))
    assert isinstance(mission, ForeignMission)
    kept = []

    def watch(onboard: Onboard, simulator: HilSimulator) -> bool:
        kept[:] = [(onboard, simulator)]
        return True

    assert fly(mission, Conditions(), NoLog(), watch).name == "completed"
    ((onboard, simulator),) = kept
    assert onboard.endpoint.mission.items == mission.items
    assert [one.command for one in mission.items] == [22, 206, 115, 16, 20]
    area = onboard.core.flight.area
    assert len(area.fence.zones) == len(area.rally) == 1
    assert simulator.home == HOME
    assert onboard.core.flight.heading.angle == pytest.approx(0.0, abs=1e-3)  # the vehicle looks east


def test_it_is_not_flown_beyond_its_fence(tmp_path: Path) -> None:
    outcome = fly(load(plan(tmp_path, fence=circle(0.4))), Conditions(), NoLog())
    assert outcome.name == "refused"
    assert outcome.reason.endswith("item 1 leads outside the fence")


def test_what_the_vehicle_says_of_an_item_has_its_number_in_the_file(tmp_path: Path) -> None:
    """A .waypoints file counts the row of the home."""
    path = plan(tmp_path, name="survey.waypoints")
    outcome = fly(load(path), Conditions(settings={"GF_MAX_HOR_DIST": 0.4}), NoLog())
    assert "item 2 leads beyond the fence" in outcome.reason


def test_the_command_says_what_is_not_done_and_leaves_the_telemetry_of_the_same_flight_in_python(
    tmp_path: Path,
) -> None:
    path = plan(tmp_path, others=(CAMERA,))
    with pytest.warns(UserWarning, match="item 1, DO_SET_CAM_TRIGG_DIST") as warned:
        flight = plumbline.fly(path)
    assert (flight.outcome, len(warned)) == ("completed", 1)
    telemetry = flight.telemetry()
    assert telemetry["load_true_x_m"].max() == pytest.approx(0.5, abs=0.02)
    checked = CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs")
    assert "survey: vehicle bebop can fly it" in checked.stdout
    with pytest.warns(UserWarning, match="item 1, DO_SET_CAM_TRIGG_DIST"):
        again = plumbline.fly(flight.mission)  # ends with a return, which no Mission does
    assert again.telemetry().equals(telemetry)


def test_a_sweep_flies_it(tmp_path: Path) -> None:
    path = plan(tmp_path, fence=circle(5.0), others=(CAMERA,))
    arguments = [
        "sweep",
        str(path),
        "--seeds",
        "2",
        "--out",
        str(tmp_path / "sweep"),
        "--jobs",
        "1",
    ]
    flown = CliRunner().invoke(gcs, [*arguments, "--table-only"], prog_name="gcs")
    assert "2 of 2 flights flown, 2 completed" in flown.stdout + flown.stderr
    assert "item 1, DO_SET_CAM_TRIGG_DIST (206): kept on the vehicle but not done" in flown.stderr


@pytest.mark.parametrize(
    ("steps", "others", "lines"),
    [
        (PATH[:2], (), ["does not end on the ground; end it with NAV_LAND or NAV_RETURN_TO_LAUNCH"]),
        (
            PATH,
            (PLACE, command(mavlink.MAV_CMD_DO_JUMP, 1.0, -1.0)),
            ["repeats items without end (DO_JUMP) until a ground station makes an item behind them the "],
        ),
        (
            (*PATH[:2], Land()),
            (place(mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT, 0.0, 0.0, 0.0),),
            ["item 1 (mission.items[1]), NAV_SPLINE_WAYPOINT (82)", "not flown without this; gcs upload "],
        ),
    ],
)
def test_what_does_not_come_down_or_is_not_flown_as_it_stands_there_is_refused(
    steps: Sequence[Step], others: Sequence[WireItem], lines: list[str], tmp_path: Path
) -> None:
    path = plan(tmp_path, steps, others=others)
    with pytest.raises(InputError) as refusal:
        load(path)
    for line, found in zip(lines, refusal.value.lines, strict=True):
        assert found.startswith(f"{path}: {line}")
    for arguments in (["fly", str(path)], ["sweep", str(path)]):
        flown = CliRunner().invoke(gcs, arguments, prog_name="gcs")
        assert flown.exit_code == EXIT_USAGE
        assert flown.stderr == "".join(f"gcs: {line}\n" for line in refusal.value.lines)
    with pytest.raises(plumbline.Error, match=lines[0].partition(";")[0].partition(" (")[0]):
        plumbline.fly(path)


def test_an_empty_plan_and_one_that_a_third_party_autopilot_would_fly_are_refused(tmp_path: Path) -> None:
    empty = tmp_path / "empty.plan"
    write_foreign(empty, (), HOME)
    flown = CliRunner().invoke(gcs, ["fly", str(empty)], prog_name="gcs")
    assert (flown.exit_code, flown.stderr) == (EXIT_USAGE, f"gcs: {empty}: nothing that can be flown\n")
    program = tmp_path / "arducopter"
    program.touch(mode=0o755)
    path = plan(tmp_path)
    arguments = ["fly", str(path), "--autopilot", f"ardupilot={program}"]
    flown = CliRunner().invoke(gcs, arguments, prog_name="gcs")
    assert flown.exit_code == EXIT_USAGE
    assert flown.stderr.startswith(f"gcs: {path}: --autopilot converts mission files of Plumbline")


def test_a_mission_of_python_is_not_made_of_it(tmp_path: Path) -> None:
    path = plan(tmp_path)
    with pytest.raises(plumbline.Error, match="holds more than steps; "):
        plumbline.Mission.load(path)


def test_a_mission_ends_with_its_landing_whatever_follows(tmp_path: Path) -> None:
    path = plan(tmp_path, (*PATH[:2], Land(), Waypoint(3.0, 0.0, 1.0), ReturnHome()))
    mission = load(path)
    assert fly(mission, Conditions(), NoLog()).name == "completed"
    swept = fly_without_wire(mission, Conditions(), start_times(mission, Conditions()))
    assert (swept.outcome, swept.reason) == ("completed", "")
    checked = CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs").stdout
    assert "note: items 3 to 4: not flown; the mission ends with the landing of item 2" in checked
    assert "items[3]" not in checked


def test_from_another_home_it_has_other_heights(tmp_path: Path) -> None:
    """An absolute altitude stays where it is; what a transfer says of the homes is checked beside it."""
    takeoff, waypoint, back = encode_steps(PATH, HOME)
    absolute = waypoint._replace(frame=mavlink.MAV_FRAME_GLOBAL, z=HOME.altitude_m + 2.0)
    path = tmp_path / "survey.plan"
    write_foreign(path, (takeoff, absolute, back), HOME)
    mission = load(path)
    lower = HOME._replace(altitude_m=HOME.altitude_m - 50.0)
    assert [step.altitude_m for step in mission.steps[:2]] == pytest.approx([0.6, 2.0])
    assert [step.altitude_m for step in at_home(mission, lower).steps[:2]] == pytest.approx([0.6, 52.0])
    assert at_home(mission, HOME) is mission
    assert home_difference(HOME, lower).startswith(
        "planned for a home 0 m from the vehicle's and 50 m higher:"
    )
    assert home_difference(HOME, HOME) == ""
    with pytest.raises(InputError, match=r"survey: item 1, from the vehicle's home: "):
        at_home(mission, HOME._replace(altitude_m=HOME.altitude_m + 50.0))


@pytest.mark.parametrize("name", ["x.txt", "x.plan"])
def test_a_mission_file_of_ours_is_one_by_its_content(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(OURS, encoding="utf-8")
    assert not isinstance(load(path), ForeignMission)
    assert not isinstance(read(path), ForeignMission)
    assert is_mission_file(path)
    assert not is_mission_file(plan(tmp_path))
    assert CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs").exit_code == 0


def test_a_flight_that_a_fence_stops_says_so_when_its_time_is_over(tmp_path: Path) -> None:
    """The load settles inside the fence, but would stop beyond it: the vehicle holds."""
    path = plan(tmp_path, (Takeoff(0.6), Waypoint(0.5, 0.0, 0.6), ReturnHome()), fence=circle(0.5004))
    mission, conditions = load(path), Conditions(limit_s=15.0)
    reason = (
        "Fence: would stop outside the fence, holding; not landed after 15 s of flight: still in phase hold"
    )
    outcome = fly(mission, conditions, NoLog())
    assert (outcome.name, outcome.reason) == ("timeout", f"{reason}, item 1")
    swept = fly_without_wire(mission, conditions, start_times(mission, Conditions()))
    assert (swept.outcome, swept.reason) == ("timeout", reason)


class LeavesLoop(FlightClient):
    """Makes an item the present one as soon as another was reached."""

    leave_for, after = 4, 2

    def poll(self, now_us: int) -> list[bytes]:
        datagrams = super().poll(now_us)
        reached = self.view.latest.get("MISSION_ITEM_REACHED")
        if reached is not None and reached.seq == self.after:
            target = self.connection.target
            assert target is not None
            leave = mavlink.MAVLink_mission_set_current_message(*target, self.leave_for)
            datagrams.append(self.connection.frame(leave))
            self.after = -1
        return datagrams

    @property
    def silent_until_us(self) -> int:
        return 0


def test_a_loop_is_left_by_a_ground_station_and_the_mission_ends(tmp_path: Path) -> None:
    loop = (Takeoff(1.0), Waypoint(1.0, 0.0, 1.0), Waypoint(1.0, 1.0, 1.0))
    takeoff, *corners, home, land = encode_steps((*loop, Waypoint(0.0, 0.0, 1.0), Land()), HOME)
    path = tmp_path / "loop.plan"
    write_foreign(path, (takeoff, *corners, command(mavlink.MAV_CMD_DO_JUMP, 1.0, -1.0), home, land), HOME)
    mission = load(path, with_loops=True)
    assert mission.loop_ends == (2,)
    client = LeavesLoop(items_of(mission, HOME), 60.0)
    assert fly(mission, Conditions(), NoLog(), client=client).name == "completed"
    checked = CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs").stdout
    assert "item 3, DO_JUMP (177): repeats without end until a ground station makes an item behind" in checked
    assert "items[4] (waypoint): " in checked


@pytest.mark.parametrize("released_in_loop", [True, False])
def test_it_is_told_that_a_loop_which_releases_the_load_goes_on_without_it(
    tmp_path: Path, released_in_loop: bool
) -> None:
    steps = (Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), Waypoint(1.0, 1.0, 2.0))
    release = command(mavlink.MAV_CMD_DO_GRIPPER, 1.0, 0.0)
    takeoff, *corners = encode_steps(steps, HOME)
    back_to = 1.0 if released_in_loop else 2.0
    path = tmp_path / "loop.plan"
    write_foreign(path, (takeoff, release, *corners, command(mavlink.MAV_CMD_DO_JUMP, back_to, -1.0)), HOME)
    checked = CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs").stdout
    told = "item 1: releases the load in the first pass; the next ones are flown without it"
    assert (told in checked) == released_in_loop, checked


def test_the_way_back_of_a_loop_over_a_fence_is_refused_by_gcs_check(tmp_path: Path) -> None:
    corners = (Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), Waypoint(1.0, 1.0, 2.0), Waypoint(-1.0, 1.0, 2.0))
    zone = place(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, 0.2, 0.0, 0.5)
    path = tmp_path / "loop.plan"
    items = (*encode_steps(corners, HOME), command(mavlink.MAV_CMD_DO_JUMP, 1.0, -1.0))
    write_foreign(path, items, HOME, fence=(zone,))
    result = CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs")
    assert result.exit_code != EXIT_DONE
    assert "item 1 leads into an exclusion zone of the fence, when a jump without end repeats it" in (
        result.stdout + result.stderr
    )
