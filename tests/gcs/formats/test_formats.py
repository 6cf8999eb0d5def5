"""Mission and parameter files of other ground stations: read, checked, written, and read again."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink import mavwp

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.fence import read_fence, read_rally
from autopilot.wire.items import WireItem, decode_items, encode_mission
from autopilot.wire.parameter_table import parse_text
from gcs.clients.operation import Target
from gcs.formats.items import NO_COORDINATE, FormatError
from gcs.formats.missions import mission_of, planned_home, read_foreign, write_foreign
from gcs.formats.params import parameter_lines, qgc_parameters
from gcs.formats.plan import Plan, read_plan, write_plan
from gcs.formats.waypoints import read_waypoints, write_waypoints
from missions.fileformat import load_mission, shipped
from missions.model import Land, PlaceLoad, Takeoff, Waypoint

HOME = Home()


def simple(command: int, frame: int = 3, params: Any = None, **more: Any) -> dict[str, Any]:
    params = params or [0, 0, 0, None, 47.3977, 8.5456, 3]
    return {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": command,
        "doJumpId": 1,
        "frame": frame,
        "params": params,
        **more,
    }


def survey(*items: Any, kind: str = "survey") -> dict[str, Any]:
    """As QGroundControl writes it: the polygon, and the items that were made from it."""
    return {
        "type": "ComplexItem",
        "complexItemType": kind,
        "version": 5,
        "angle": 90,
        "polygon": [[47.3979, 8.5457], [47.3979, 8.5462], [47.3974, 8.5462]],
        "TransectStyleComplexItem": {"version": 1, "CameraShots": 6, "Items": list(items)},
    }


def plan_text(*items: Any, **more: Any) -> str:
    return json.dumps(
        {
            "fileType": "Plan",
            "version": 1,
            "groundStation": "QGroundControl",
            "mission": {"version": 2, "items": list(items), "plannedHomePosition": [47.397742, 8.545594, 0]},
            "geoFence": {"version": 2, "circles": [], "polygons": []},
            "rallyPoints": {"version": 2, "points": []},
            **more,
        }
    )


def plan_at(home: object) -> str:
    return json.dumps({"fileType": "Plan", "mission": {"items": [], "plannedHomePosition": home}})


TAKEOFF = simple(22, params=[0, 0, 0, None, 47.397742, 8.545594, 2])
TRIGGER = simple(206, 2, [25, 0, 1, 0, 0, 0, 0])
WAYPOINTS = [simple(16, params=[0, 0, 0, None, 47.3977 + i * 1e-5, 8.5456, 3.5]) for i in range(3)]


def test_a_survey_is_taken_apart_in_its_order() -> None:
    plan = read_plan(plan_text(TAKEOFF, survey(WAYPOINTS[0], TRIGGER, WAYPOINTS[1]), simple(20, 2)))
    assert [one.item.command for one in plan.items] == [22, 16, 206, 16, 20]
    assert plan.items[2].where == "mission.items[1].TransectStyleComplexItem.Items[1]"
    assert plan.not_converted == []
    first = plan.items[1].item
    assert (first.x, first.y, first.z, first.frame) == (473977000, 85456000, 3.5, 3)
    assert math.isnan(first.param4)


def test_what_is_no_item_is_told() -> None:
    structure = {"type": "ComplexItem", "complexItemType": "StructureScan", "Layers": 2}
    lost = read_plan(plan_text(structure)).not_converted
    assert len(lost) == 1
    assert "mission.items[0]: StructureScan" in lost[0]


TRIANGLE = [[47.3979, 8.5457], [47.3979, 8.5462], [47.3974, 8.5462]]
FENCE = {
    "version": 2,
    "polygons": [
        {"version": 1, "inclusion": True, "polygon": TRIANGLE},
        {"version": 1, "inclusion": False, "polygon": TRIANGLE},
    ],
    "circles": [{"version": 1, "inclusion": True, "circle": {"center": [47.3, 8.5], "radius": 12.5}}],
    "breachReturn": [47.3977, 8.5456, 3.0],
}
RALLY = {"version": 2, "points": [[47.3, 8.5, 3.0], [47.3001, 8.5, 4.0]]}


def test_fence_and_rally_points_become_items_and_come_back() -> None:
    plan = read_plan(plan_text(TAKEOFF, geoFence=FENCE, rallyPoints=RALLY))
    assert plan.fence is not None and plan.rally is not None
    assert [item.command for item in plan.fence] == [5001] * 3 + [5002] * 3 + [5003, 5000]
    assert [item.param1 for item in plan.fence] == [3.0] * 6 + [12.5, 0.0]
    assert [item.command for item in plan.rally] == [5100, 5100]
    assert len(read_fence(plan.fence, HOME).zones) == 3
    assert len(read_rally(plan.rally, HOME)) == 2
    back = json.loads(write_plan([], HOME, plan.fence, plan.rally))
    assert back["geoFence"] == FENCE
    assert back["rallyPoints"] == RALLY
    bare = json.dumps({"fileType": "Plan", "mission": {"items": []}})
    assert (read_plan(bare).fence, read_plan(bare).rally) == (None, None)


@pytest.mark.parametrize(
    ("place", "home"),
    [
        ([47.5, 8.5, 488.0], Home(47.5, 8.5, 488.0)),
        ([47.5, 8.5, None], Home(47.5, 8.5, 0.0)),
        ([None, None, None], Home()),
        (None, Home()),
    ],
)
def test_a_plan_is_judged_at_its_planned_home(place: list[float | None] | None, home: Home) -> None:
    assert planned_home(read_plan(plan_at(place))) == home


def test_what_cannot_be_flown_is_named_with_what_to_do() -> None:
    text = plan_text(
        TAKEOFF, simple(84), TRIGGER, WAYPOINTS[0], simple(16, 10), simple(31009), simple(201, 2)
    )
    judged = mission_of(read_plan(text), HOME, "")
    lines = judged.left_out
    assert [line.partition(" (")[0] for line in lines] == ["item 1", "item 4"]
    assert "NAV_VTOL_TAKEOFF (84)" in lines[0]
    assert "use NAV_TAKEOFF" in lines[0]
    assert "frame 10" in lines[1]
    assert list(judged.notes) == [
        "item 2, DO_SET_CAM_TRIGG_DIST (206): kept on the vehicle but not done",
        "item 5, SPATIAL_USER_5 (31009): kept on the vehicle but not done",
    ]
    assert [item.command for item in judged.items] == [22, 206, 16, 31009, 201]


def test_what_is_refused_is_left_out_and_not_kept() -> None:
    judged = mission_of(read_plan(plan_text(TAKEOFF, simple(208, 2), simple(203, 2), simple(21))), HOME, "")
    (line,) = judged.left_out
    assert line.startswith("item 1 (") and "DO_PARACHUTE (208)" in line
    assert list(judged.notes) == ["item 2, DO_DIGICAM_CONTROL (203): kept on the vehicle but not done"]
    assert [item.command for item in judged.items] == [22, 203, 21]


def test_fence_items_within_the_mission_are_left_out_with_where_they_belong() -> None:
    (line,) = mission_of(read_plan(plan_text(TAKEOFF, simple(5003, 20), simple(21))), HOME, "").left_out
    assert line.endswith(
        "NAV_FENCE_CIRCLE_INCLUSION (5003): cannot be flown; "
        "it belongs in the list of the fence (mission type 1)"
    )


def test_a_load_is_placed_where_the_plan_says_and_the_vehicle_flies_on() -> None:
    judged = mission_of(read_plan(plan_text(TAKEOFF, simple(94), WAYPOINTS[0], simple(21))), HOME, "")
    assert not judged.left_out
    kinds = [type(step) for step in decode_items(judged.items, HOME)]
    assert kinds == [Takeoff, Waypoint, PlaceLoad, Waypoint, Land]


def test_items_behind_the_first_landing_are_named() -> None:
    again = read_plan(plan_text(TAKEOFF, simple(208, 2), WAYPOINTS[0], simple(21), TAKEOFF, simple(21)))
    assert list(mission_of(again, HOME, "").notes) == [
        "items 4 to 5: not flown; the mission ends with the landing of item 3"
    ]


def test_a_plan_that_is_flown_whole_is_not_complained_about() -> None:
    judged = mission_of(read_plan(plan_text(TAKEOFF, *WAYPOINTS, simple(21))), HOME, "")
    assert judged.left_out == judged.notes == ()
    assert [item.command for item in judged.items] == [22, 16, 16, 16, 21]


@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("ending", [".plan", ".waypoints"])
def test_shipped_missions_pass_through_files_unchanged(name: str, ending: str, tmp_path: Path) -> None:
    items = encode_mission(load_mission(name), HOME)
    path = tmp_path / f"mission{ending}"
    write_foreign(path, items, HOME)
    judged = mission_of(read_foreign(path), HOME, "")
    assert judged.left_out == judged.notes == ()
    assert judged.items == as_in_files(items)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


FLOAT32 = st.floats(width=32, allow_infinity=False)
WHOLE = st.integers(-(2**31) + 2, 2**31 - 1)
FRAMES = st.sampled_from([0, 1, 2, 3, 5, 6, 10])
ITEM = st.builds(
    WireItem, FRAMES, st.integers(0, 65535).filter(177 .__ne__), st.just(0), st.integers(0, 1),
    FLOAT32, FLOAT32, FLOAT32, FLOAT32, WHOLE, WHOLE, FLOAT32,
)  # fmt: skip


def as_in_files(items: Any) -> tuple[WireItem, ...]:
    """Items with the frames that files have: those without _INT."""
    return tuple(item._replace(frame={5: 0, 6: 3}.get(item.frame, item.frame)) for item in items)


def bits(items: Any) -> list[bytes]:
    """The items as bytes on the wire, every NaN with the same bits."""
    plain = [[math.nan if math.isnan(value) else value for value in item] for item in items]
    return [struct.pack("<BHBBffffiif", *item) for item in plain]


@given(items=st.lists(ITEM, max_size=5))
def test_any_items_come_back_bit_for_bit(items: list[WireItem]) -> None:
    in_files = as_in_files(items)
    assert bits(one.item for one in read_plan(write_plan(items, HOME)).items) == bits(in_files)
    current = [item._replace(current=1) for item in items]
    home, *others = read_waypoints(write_waypoints(current, HOME))
    assert (home.item.command, home.item.x) == (16, 473977420)
    assert bits(one.item for one in others) == bits(item._replace(current=1) for item in in_files)


def test_what_is_not_given_is_null() -> None:
    item = WireItem(6, 16, 0, 1, 0.1, 0.0, 0.0, math.nan, NO_COORDINATE, 85455940, 2.0)
    (entry,) = json.loads(write_plan([item], HOME))["mission"]["items"]
    assert entry["params"] == [0.1, 0.0, 0.0, None, None, 8.545594, 2.0]


def test_an_infinite_number_is_not_lost_silently() -> None:
    with pytest.raises(FormatError, match="item 0"):
        write_plan([WireItem(6, 16, 0, 1, math.inf, 0.0, 0.0, 0.0, 0, 0, 2.0)], HOME)


def test_pymavlink_reads_our_waypoints_and_we_read_its(tmp_path: Path) -> None:
    ours, theirs = tmp_path / "ours.waypoints", tmp_path / "theirs.waypoints"
    items = encode_mission(load_mission("square"), HOME)
    write_foreign(ours, items, HOME)
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(ours)) == 1 + len(items), "the home, too"
    for seq, item in enumerate(as_in_files(items), start=1):
        point = loader.wp(seq)
        assert (point.command, point.frame, point.autocontinue) == (
            item.command,
            item.frame,
            item.autocontinue,
        )
        assert (round(point.x * 1e7), round(point.y * 1e7)) == (item.x, item.y) or item.frame == 2
    loader.save(str(theirs))
    _, *read = [one.item for one in read_foreign(theirs).items]
    for got, item in zip(read, as_in_files(items), strict=True):
        assert (got.x, got.y) == pytest.approx((item.x, item.y), abs=6)  # it writes six decimals of a degree
        assert got._replace(current=0, x=item.x, y=item.y) == item


def test_a_home_row_of_another_place_is_not_flown() -> None:
    def rows(latitude: float, current: int = 1) -> Plan:
        text = f"QGC WPL 110\n0\t{current}\t0\t16\t0\t0\t0\t0\t{latitude}\t8.545594\t0\t1\n"
        return Plan(read_waypoints(text + "1\t0\t3\t22\t0\t0\t0\t0\t47.397742\t8.545594\t2\t1\n"), [])

    at_home = mission_of(rows(47.397742), HOME, "")
    assert at_home.left_out == ()
    assert [item.command for item in at_home.items] == [22], "it is no step to fly"
    for current in (0, 1):
        elsewhere = mission_of(rows(47.39, current), HOME, "")
        assert planned_home(rows(47.39, current)) == Home(47.39, 8.545594, 0.0)
        assert len(elsewhere.left_out) == 1
        assert "home row" in elsewhere.left_out[0]
        assert [item.command for item in elsewhere.items] == [22]


BAD_PLANS = [
    ("", "not JSON"),
    ("[" * 100_000, "not JSON"),
    ("[]", "fileType"),
    ('{"fileType": "Parameters"}', "fileType"),
    ('{"fileType": "Plan"}', "mission: must be an object"),
    ('{"fileType": "Plan", "mission": {"items": {}}}', "mission.items: must be a list"),
    (plan_text(7), "mission.items[0]: must be an object"),
    (plan_text({"type": "Other"}), "mission.items[0].type"),
    (plan_text(simple(16, params=[1])), "mission.items[0].params: 1 numbers; must be 7"),
    (plan_text(simple(16, params=[0, "x", 0, 0, 0, 0, 0])), "mission.items[0].params[1]"),
    (plan_text(simple(16, params=[0, 0, 0, 0, 400, 0, 0])), "parameter 5"),
    (plan_text(simple(16, params=[1e300, 0, 0, 0, 0, 0, 0])), "parameter 1"),
    (plan_text(simple(70_000)), "command 70000"),
    (plan_text(simple(16, -1)), "frame -1"),
    (plan_text(simple(16) | {"command": "x"}), "mission.items[0].command"),
    (plan_text(survey(3)), "Items[0]: must be an object"),
    (plan_at(3), "mission.plannedHomePosition: must be a list of 3"),
    (plan_at([47.0, 8.5]), "mission.plannedHomePosition: must be a list of 3"),
    (plan_at([470.0, 8.5, 0]), "mission.plannedHomePosition: home '470.0,8.5,0.0': latitude 470; must be"),
    (plan_at([47.0, "x", 0]), "mission.plannedHomePosition: 'x'; must be a number or null"),
    (plan_text(geoFence=3), "geoFence: must be an object"),
    (plan_text(geoFence={"circles": 3}), "geoFence.circles: must be a list"),
    (plan_text(geoFence={"polygons": [3]}), "geoFence.polygons[0]: must be an object"),
    (
        plan_text(geoFence={"polygons": [{"polygon": [[1]]}]}),
        "geoFence.polygons[0].polygon[0]: must be a list",
    ),
    (plan_text(geoFence={"circles": [{"circle": {"radius": "x"}}]}), "geoFence.circles[0].circle.radius"),
    (plan_text(geoFence={"breachReturn": [1, 2]}), "geoFence.breachReturn: must be a list of 3"),
    (plan_text(rallyPoints={"points": [[1, 2, None]]}), "rallyPoints.points[0]: must be a list of 3"),
]


@pytest.mark.parametrize(("text", "part"), BAD_PLANS)
def test_a_bad_plan_is_refused_with_the_place(text: str, part: str) -> None:
    with pytest.raises(FormatError) as error:
        read_plan(text)
    assert part in str(error.value)
    assert "\n" not in str(error.value)


BAD_WAYPOINTS = [
    ("", "line 1"),
    ("QGC WPL 120\n", "must be 'QGC WPL 110'"),
    ("QGC WPL 110\n1\t2\n", "line 2: 2 columns; must be 12"),
    ("QGC WPL 110\n0 0 3 16.5 0 0 0 0 47 8.5 2 1\n", "line 2: column 4 is '16.5'; must be a whole number"),
    ("QGC WPL 110\n0 0 3 16 0 0 0 0 a 8.5 2 1\n", "line 2: column 9 is 'a'; must be a number"),
    ("QGC WPL 110\n0 0 3 16 0 0 0 0 x 8.5 2 1\n", "line 2"),
    ("QGC WPL 110\n1 0 3 16 0 0 0 0 47 8.5 2 1\n", "item number 1; must be 0"),
    ("QGC WPL 110\n0 0 3 16 0 0 0 0 470 8.5 2 1\n", "parameter 5"),
    ("QGC WPL 110\n0 0 3 16 inf 0 0 0 47 8.5 1e99 1\n", "parameter 7"),
]


@pytest.mark.parametrize(("text", "part"), BAD_WAYPOINTS)
def test_bad_waypoints_are_refused_with_the_line(text: str, part: str) -> None:
    with pytest.raises(FormatError) as error:
        read_waypoints(text)
    assert part in str(error.value)


@given(text=st.text(max_size=200))
def test_any_text_is_a_mission_or_a_format_error(text: str) -> None:
    for reader in (read_plan, read_waypoints):
        try:
            reader("QGC WPL 110\n" + text if reader is read_waypoints else text)
        except FormatError:
            continue


def test_parameter_files_of_both_kinds_are_read_back() -> None:
    values = {"NGC_KX": 6.0, "SIXTEEN_LETTERS1": 0.1, "TINY": 1e-7}
    assert parse_text(parameter_lines(values)) == values
    text = qgc_parameters(values, Target(1, 1))
    assert parse_text(text) == values
    assert "1\t1\tNGC_KX\t6\t9\n" in text


PLACES = [simple(16, params=[0, 0, 0, None, 47.3977 + 1e-4 * k, 8.5456, 3], doJumpId=k) for k in (2, 3)]


def jump_in_plan(target: int) -> dict[str, Any]:
    return simple(177, 2, [target, -1, 0, 0, 0, 0, 0], doJumpId=4)


def flown(plan: Plan) -> list[tuple[int, float]]:
    return [(item.command, item.param1) for item in mission_of(plan, HOME, "").items]


def test_a_jump_in_a_plan_goes_to_the_item_with_that_id() -> None:
    """QGroundControl counts items from 1, and those inside of a survey have numbers of their own."""
    plan = read_plan(plan_text(TAKEOFF, *PLACES, jump_in_plan(2)))
    assert flown(plan) == [(22, 0.0), (16, 0.0), (16, 0.0), (177, 1.0)]
    inside = survey(*({**place, "doJumpId": 10 + place["doJumpId"]} for place in PLACES))
    assert flown(read_plan(plan_text(TAKEOFF, inside, jump_in_plan(12))))[-1] == (177, 1.0)
    with pytest.raises(
        FormatError, match=r"items\[3\]: jumps to the item with doJumpId 7, which there is not"
    ):
        read_plan(plan_text(TAKEOFF, *PLACES, jump_in_plan(7)))


def test_items_that_are_left_out_move_the_targets_of_jumps() -> None:
    unknown = simple(84, doJumpId=9)
    plan = read_plan(plan_text(TAKEOFF, unknown, *PLACES, jump_in_plan(2)))
    assert flown(plan) == [(22, 0.0), (16, 0.0), (16, 0.0), (177, 1.0)]
    to_what_is_left_out = read_plan(plan_text(TAKEOFF, unknown, *PLACES, jump_in_plan(9)))
    assert flown(to_what_is_left_out)[-1] == (177, 1.0), "to the next item"


@pytest.mark.parametrize("ending", [".plan", ".waypoints"])
@pytest.mark.parametrize("counts_home", [False, True])
def test_jumps_and_home_are_written_as_ground_stations_count_them(
    ending: str, counts_home: bool, tmp_path: Path
) -> None:
    """`counts_home`: the vehicle's item 0 is the home, as ArduPilot has it."""
    path = tmp_path / f"mission{ending}"
    plan = read_plan(plan_text(TAKEOFF, *PLACES, jump_in_plan(2)))
    items = mission_of(plan, HOME, "").items
    home = WireItem(0, 16, 1, 1, 0.0, 0.0, 0.0, 0.0, 473977420, 85455940, 0.0)
    on_vehicle = (home, *items[:-1], items[-1]._replace(param1=2.0)) if counts_home else items
    write_foreign(path, on_vehicle, HOME)
    if ending == ".plan":
        entries = json.loads(path.read_text())["mission"]["items"]
        assert [entry["command"] for entry in entries] == [22, 16, 16, 177]
        assert entries[-1]["params"][0] == entries[1]["doJumpId"] == 2
    else:
        rows = [line.split("\t") for line in path.read_text().splitlines()[1:]]
        assert [row[3] for row in rows] == ["16", "22", "16", "16", "177"]
        assert (rows[0][2], rows[0][8:11]) == ("0", ["47.397742", "8.545594", "0.0"])
        assert rows[-1][4] == "2.0", "the item behind the take-off"
    assert bits(mission_of(read_foreign(path), HOME, "").items) == bits(items)


def test_a_survey_without_items_is_named() -> None:
    plan = read_plan(plan_text(TAKEOFF, survey(), simple(20, 2)))
    assert plan.not_converted == [
        "mission.items[1]: survey holds no items; make it of waypoints in the ground station"
    ]


CORNERS = [[47.0, 8.0], [47.1, 8.0], [47.0, 8.1]]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            plan_text(geoFence={"version": 1, "circles": [], "polygon": CORNERS}),
            "geoFence.polygon: a fence of an older format; open and save it in QGroundControl",
        ),
        (
            plan_text(geoFence={"version": 2, "polygons": [{"polygon": [], "inclusion": True}]}),
            "geoFence.polygons[0].polygon: has no corners",
        ),
        ("[" * 100_000, "not JSON: lists or objects within each other are too many"),
        ("9" * 5000, "not JSON: a number has too many digits"),
    ],
    ids=["older", "empty", "deep", "long"],
)
def test_what_would_be_left_out_without_a_word_is_an_error(text: str, problem: str) -> None:
    with pytest.raises(FormatError) as refusal:
        read_plan(text)
    assert str(refusal.value) == problem


def test_turns_that_take_longer_than_a_day_are_refused() -> None:
    turns = simple(18, params=[1000, 0, 1000, 1, 47.3977, 8.5456, 3])
    (line,) = mission_of(read_plan(plan_text(TAKEOFF, turns, simple(20, 2))), HOME, "").left_out
    assert "NAV_LOITER_TURNS (18): its turns would take" in line
