"""`gcs check` of a file of another ground station: what the vehicle would refuse because of its fence."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, encode_steps
from gcs.cli import gcs
from gcs.errors import EXIT_DONE, EXIT_ERROR, EXIT_USAGE
from gcs.formats.missions import write_foreign
from missions.model import Land, Step, Takeoff, Waypoint

HOME = Home(-33.9, 18.4, 60.0)  # not where the vehicle is by default
INSIDE, OUTSIDE = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
)
CORNER = (Waypoint(6.0, 0.0, 2.0), Waypoint(6.0, 6.0, 2.0))


def place(command: int, param1: float, east: float, north: float) -> WireItem:
    latitude, longitude, _ = geodetic_from_enu((east, north, 0.0), HOME)
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    return WireItem(frame, command, 0, 1, param1, 0.0, 0.0, 0.0, latitude, longitude, 0.0)


def polygon(*corners: tuple[float, float]) -> tuple[WireItem, ...]:
    return tuple(place(INSIDE, len(corners), *corner) for corner in corners)


def box(east: float, north: float, half: float) -> tuple[WireItem, ...]:
    sides = ((-half, -half), (half, -half), (half, half), (-half, half))
    return polygon(*((east + x, north + y) for x, y in sides))


def checked(
    folder: Path,
    fence: tuple[WireItem, ...],
    steps: tuple[Step, ...],
    rally: tuple[WireItem, ...] = (),
    options: tuple[str, ...] = (),
) -> Result:
    path = folder / "x.plan"
    items = encode_steps((Takeoff(2.0), *steps, Land()), HOME)
    write_foreign(path, items, HOME, fence, rally)
    return CliRunner().invoke(gcs, ["check", str(path), *options], prog_name="gcs")


def test_a_mission_within_its_fence_passes(tmp_path: Path) -> None:
    found = checked(tmp_path, box(3.0, 3.0, 6.0), CORNER)
    assert found.exit_code == EXIT_DONE
    first, *paths, duration, wind, note = found.stdout.splitlines()
    assert first == "x: vehicle bebop can fly it"
    assert [line.partition(" (")[0] for line in paths] == ["items[0]", "items[1]", "items[2]"]
    assert duration.startswith("in all: about ")
    assert wind.startswith("withstands ")
    assert note == "note: flown with home at -33.9000000, 18.4000000, 60 m"


@pytest.mark.parametrize(
    ("fence", "steps", "refusals"),
    [
        (box(0.0, 0.0, 5.0), CORNER, ["Mission denied: item 1 leads outside the fence"]),
        # the waypoints are inside, the curve between them leaves the square
        (box(0.0, 0.0, 6.05), CORNER, ["Mission denied: the curve to item 2 leads outside the fence"]),
        (
            (place(OUTSIDE, 1.0, 0.0, 3.0),),
            (Waypoint(-3.0, 3.0, 2.0), Waypoint(3.0, 3.0, 2.0)),
            ["Mission denied: item 2 leads into an exclusion zone of the fence"],
        ),
        (
            box(6.0, 0.0, 3.0),
            (Waypoint(6.0, 0.0, 2.0),),
            ["Arming denied: outside the fence", "Mission denied: item 0 leads outside the fence"],
        ),
        (
            polygon((-5.0, -5.0), (5.0, 5.0), (5.0, -5.0), (-5.0, 5.0)),
            (),
            ["fence item 2: the polygon crosses or touches itself: sides 0-1 and 2-3"],
        ),
    ],
)
def test_what_the_fence_forbids_is_refused_in_the_words_of_the_vehicle(
    tmp_path: Path, fence: tuple[WireItem, ...], steps: tuple[Step, ...], refusals: list[str]
) -> None:
    found = checked(tmp_path, fence, steps)
    assert (found.exit_code, found.stdout.splitlines()) == (EXIT_ERROR, refusals)
    record = json.loads(checked(tmp_path, fence, steps, options=("--json",)).stdout)
    assert (record["violations"], record["refusals"]) == ([], refusals)


def test_limits_among_the_parameters_of_the_vehicle_count_for_every_mission(tmp_path: Path) -> None:
    vehicle = tmp_path / "near.toml"

    def check_square(parameters: str) -> Result:
        vehicle.write_text(f'believed = "bebop"\n[parameters]\n{parameters}\n', encoding="utf-8")
        return CliRunner().invoke(gcs, ["check", "square", "--vehicle", str(vehicle)], prog_name="gcs")

    found = check_square("GF_MAX_HOR_DIST = 3.0")
    assert found.exit_code == EXIT_ERROR
    assert found.stdout.startswith(
        "Mission denied: item 2 leads beyond the fence, GF_MAX_HOR_DIST 3 m from home"
    )
    assert check_square("GF_MAX_HOR_DIST = 3.0\nGF_ACTION = 0").exit_code == EXIT_DONE


@pytest.mark.parametrize(
    ("fence", "steps", "near"),
    [
        (box(0.0, 0.0, 6.1), (Waypoint(6.0, 0.0, 2.0),), "item 1"),
        (box(0.0, 0.0, 7.0), (Waypoint(6.0, 0.0, 2.0),), ""),
        # through the gap between the box and a zone
        ((*box(0.0, 0.0, 6.0), place(OUTSIDE, 1.0, 2.0, 1.1)), (Waypoint(4.0, 0.0, 2.0),), "item 1"),
        ((*box(0.0, 0.0, 6.0), place(OUTSIDE, 1.0, 2.0, 2.0)), (Waypoint(4.0, 0.0, 2.0),), ""),
        # the curve between the waypoints comes near
        (box(0.0, 0.0, 6.15), CORNER, "the curve to item 2"),
    ],
)
def test_a_path_near_the_fence_is_warned_of(
    tmp_path: Path, fence: tuple[WireItem, ...], steps: tuple[Step, ...], near: str
) -> None:
    found = checked(tmp_path, fence, steps)
    assert found.exit_code == EXIT_DONE
    warnings = [line for line in found.stdout.splitlines() if line.startswith("warning: ")]
    expected = f"warning: {near} leads within 0.2 m of the fence: wind, or the vehicle that swings the load, "
    assert [line.startswith(expected) for line in warnings] == ([True] if near else [])


def test_rally_points_beyond_the_fence_are_warned_of(tmp_path: Path) -> None:
    rally = tuple(place(mavlink.MAV_CMD_NAV_RALLY_POINT, 0.0, east, 0.0) for east in (1.0, 20.0))
    found = checked(tmp_path, box(3.0, 3.0, 6.0), CORNER, rally)
    assert found.exit_code == EXIT_DONE
    assert "warning: Rally point 1 is outside the fence: no return leads there\n" in found.stdout


def camera_plan(folder: Path, name: str, last: Waypoint, fence: tuple[WireItem, ...] = ()) -> Path:
    """A file with an item that is kept before its waypoints; the last one is item 3 of the mission."""
    first, *rest = encode_steps((Takeoff(2.0), Waypoint(3.0, 0.0, 2.0), last, Land()), HOME)
    path = folder / name
    write_foreign(
        path, (first, place(mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 25.0, 0.0, 0.0), *rest), HOME, fence
    )
    return path


@pytest.mark.parametrize(("name", "home_rows"), [("x.plan", 0), ("x.waypoints", 1)])
def test_the_items_of_a_file_have_one_number_each(tmp_path: Path, name: str, home_rows: int) -> None:
    """That of the file, in which the home is a row of its own or not, and items are no steps."""
    takeoff, camera, first, last = (number + home_rows for number in range(4))
    path = camera_plan(tmp_path, name, Waypoint(6.0, 0.0, 2.0))
    found = CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs")
    labels = [line.partition(" (")[0] for line in found.stdout.splitlines() if line.startswith("items[")]
    assert labels == [f"items[{number}]" for number in (takeoff, first, last)]
    assert f"note: item {camera}, DO_SET_CAM_TRIGG_DIST (206): kept" in found.stdout
    record = json.loads(CliRunner().invoke(gcs, ["check", str(path), "--json"], prog_name="gcs").stdout)
    assert [report["item"] for report in record["paths"]] == [takeoff, first, last]
    low = camera_plan(tmp_path, name, Waypoint(6.0, 0.0, 0.1))
    record = json.loads(CliRunner().invoke(gcs, ["check", str(low), "--json"], prog_name="gcs").stdout)
    assert [(one["item"], one["text"].partition(":")[0]) for one in record["violations"]] == [
        (last, f"items[{last}] (waypoint)")
    ]
    vehicle = tmp_path / "near.toml"
    vehicle.write_text('believed = "bebop"\n[parameters]\nGF_MAX_HOR_DIST = 5.0\n', encoding="utf-8")
    path = camera_plan(tmp_path, name, Waypoint(6.0, 0.0, 2.0))
    found = CliRunner().invoke(gcs, ["check", str(path), "--vehicle", str(vehicle)], prog_name="gcs")
    assert found.stdout.startswith(f"Mission denied: item {last} leads beyond the fence")


def test_what_cannot_be_sent_is_a_refusal(tmp_path: Path) -> None:
    path = tmp_path / "x.waypoints"
    path.write_text("QGC WPL 110\n0 1 3 84 0 0 0 0 47.397742 8.545594 2 1\n", encoding="utf-8")
    found = CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs")
    assert found.exit_code == EXIT_ERROR
    first, last = found.stdout.splitlines()
    assert "NAV_VTOL_TAKEOFF (84): cannot be flown; use NAV_TAKEOFF" in first
    assert last == "nothing that can be flown"


def test_an_unreadable_file_is_a_wrong_input(tmp_path: Path) -> None:
    path = tmp_path / "x.plan"
    path.write_text("{}", encoding="utf-8")
    found = CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs")
    assert (found.exit_code, found.stdout) == (EXIT_USAGE, "")
    assert found.stderr == f'gcs: {path}: "fileType" must be "Plan"\n'


def test_what_a_jump_repeats_is_one_line_with_the_worst_of_all_times(tmp_path: Path) -> None:
    path = tmp_path / "x.plan"
    takeoff, *corners, land = encode_steps((Takeoff(2.0), *CORNER, Land()), HOME)
    jump = land._replace(command=mavlink.MAV_CMD_DO_JUMP, param1=1.0, param2=4.0, x=0, y=0, z=0.0)
    write_foreign(path, (takeoff, *corners, jump, land), HOME)
    found = CliRunner().invoke(gcs, ["check", str(path)], prog_name="gcs")
    lines = [line for line in found.stdout.splitlines() if line.startswith("items[")]
    assert [line.partition(" s")[0].rpartition(" ")[0] for line in lines] == [
        "items[0] (takeoff):",
        "items[1] (waypoint): 5 times, up to",
        "items[2] (waypoint): 5 times, up to",
    ]
    record = json.loads(CliRunner().invoke(gcs, ["check", str(path), "--json"], prog_name="gcs").stdout)
    second = [report for report in record["paths"] if report["item"] == 1]
    assert len(second) == 5
    assert f"up to {max(report['duration_s'] for report in second):.1f} s" in lines[1]
