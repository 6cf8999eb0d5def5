"""Fence and rally points over the mission protocol: uploaded, downloaded, cleared, refused."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.services.mission_store import deserialise_items, serialise
from autopilot.services.records import AreasChanged, MissionChanged
from autopilot.wire import fence as fence_module
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.fence import Disc, Polygon, read_fence, read_rally
from autopilot.wire.items import MissionItemError, WireItem
from autopilot.wire.statustext import TextReader
from tests.doubles.craft import Craft

HOME = Home()
LAT, LON = round(HOME.latitude_deg * 1e7), round(HOME.longitude_deg * 1e7)
FENCE, RALLY = m.MAV_MISSION_TYPE_FENCE, m.MAV_MISSION_TYPE_RALLY
IN_POLYGON, OUT_POLYGON, IN_CIRCLE, OUT_CIRCLE, RETURN = 5001, 5002, 5003, 5004, 5000
STEP = 900  # 1e-7 deg: 10 m of latitude


def item(command, p1=0.0, north=0, east=0, frame=3):
    return WireItem(frame, command, 0, 1, p1, 0.0, 0.0, 0.0, LAT + north * STEP, LON + east * STEP, 0.0)


SQUARE = tuple(item(IN_POLYGON, 4.0, n, e) for n, e in ((-1, -1), (-1, 1), (1, 1), (1, -1)))
GOOD = (*SQUARE, item(OUT_CIRCLE, 2.0), item(RETURN))


def polygon(*corners):
    return tuple(item(IN_POLYGON, float(len(corners)), north, east) for north, east in corners)


POINTS = (item(5100, north=1), item(5100, north=-2))


def upload(rig, kind, items, as_message, texts=None):
    replies = rig.replies(m.MAVLink_mission_count_message(1, 1, len(items), kind))
    for _ in range(2 * len(items)):
        requests = [r for r in replies if r.get_type() == "MISSION_REQUEST_INT"]
        if not requests:
            break
        assert requests[-1].mission_type == kind
        replies = rig.replies(as_message(requests[-1].seq, items[requests[-1].seq], kind))
    (ack,) = [r for r in replies if r.get_type() == "MISSION_ACK"]
    assert ack.mission_type == kind
    if texts is not None:
        reader = TextReader()
        texts += [reader.read(r) for r in replies if r.get_type() == "STATUSTEXT"]
    return ack.type


def download(rig, kind, as_item):
    (count,) = rig.replies(m.MAVLink_mission_request_list_message(1, 1, kind))
    assert count.mission_type == kind
    found = []
    for seq in range(count.count):
        (answer,) = rig.replies(m.MAVLink_mission_request_int_message(1, 1, seq, kind))
        assert answer.mission_type == kind
        found.append(as_item(answer))
    return tuple(found)


def test_all_three_kinds_live_side_by_side(rig_with, items, as_message, as_item):
    rig = rig_with(items(3))
    assert upload(rig, FENCE, GOOD, as_message) == m.MAV_MISSION_ACCEPTED
    assert upload(rig, RALLY, POINTS, as_message) == m.MAV_MISSION_ACCEPTED
    assert download(rig, FENCE, as_item) == GOOD
    assert download(rig, RALLY, as_item) == POINTS
    assert download(rig, 0, as_item) == items(3)
    assert [(e.kind, e.items) for e in rig.events if isinstance(e, AreasChanged)] == [
        (FENCE, GOOD),
        (RALLY, POINTS),
    ]
    assert not any(isinstance(e, MissionChanged) for e in rig.events)
    rig.replies(m.MAVLink_mission_clear_all_message(1, 1, FENCE))
    assert (download(rig, FENCE, as_item), download(rig, RALLY, as_item)) == ((), POINTS)
    rig.replies(m.MAVLink_mission_clear_all_message(1, 1, m.MAV_MISSION_TYPE_ALL))
    assert download(rig, RALLY, as_item) == download(rig, 0, as_item) == ()


BAD = {
    "too few corners": (SQUARE[:3], m.MAV_MISSION_INVALID),
    "two corners": ((item(IN_POLYGON, 2.0),) * 2, m.MAV_MISSION_INVALID_PARAM1),
    "another count": ((*SQUARE[:3], item(IN_POLYGON, 5.0)), m.MAV_MISSION_INVALID_PARAM1),
    "mixed": ((*SQUARE[:3], item(OUT_POLYGON, 4.0)), m.MAV_MISSION_INVALID),
    "no radius": ((item(IN_CIRCLE, 0.0),), m.MAV_MISSION_INVALID_PARAM1),
    "a waypoint": ((item(16),), m.MAV_MISSION_UNSUPPORTED),
    "frame": ((item(IN_CIRCLE, 5.0, frame=1),), m.MAV_MISSION_UNSUPPORTED_FRAME),
    "nowhere": (
        (item(IN_CIRCLE, 5.0), item(IN_CIRCLE, 5.0)._replace(x=0, y=0)),
        m.MAV_MISSION_INVALID_PARAM5_X,
    ),
    "a corner nowhere": ((*SQUARE[:3], SQUARE[3]._replace(x=0, y=0)), m.MAV_MISSION_INVALID_PARAM5_X),
    "no number": ((*SQUARE[:3], SQUARE[3]._replace(x=2**31 - 1)), m.MAV_MISSION_INVALID_PARAM5_X),
    "on a line": (polygon((0, 0), (1, 1), (3, 3), (2, 2)), m.MAV_MISSION_INVALID),
    "one place": (polygon((1, 0), (1, 0), (1, 0)), m.MAV_MISSION_INVALID),
    "a bow tie": ((*SQUARE, *polygon((0, 0), (2, 2), (2, 0), (0, 2))), m.MAV_MISSION_INVALID),
    "a corner twice": (polygon((0, 0), (2, 1), (3, 0), (3, 3), (2, 1), (0, 3)), m.MAV_MISSION_INVALID),
}
# what the operator is told of them
WHY = {
    "nowhere": "fence item 1: no place is given: latitude and longitude are 0",
    "a corner nowhere": "fence item 3: no place is given: latitude and longitude are 0",
    "no number": "fence item 3: no latitude",
    "on a line": "fence item 0: the polygon has no area: its corners lie on a line",
    "one place": "fence item 0: the corners of the polygon are fewer than three places",
    "a bow tie": "fence item 6: the polygon crosses or touches itself: sides 4-5 and 6-7",
    "a corner twice": "fence item 3: the polygon crosses or touches itself: sides 0-1 and 3-4",
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_fence_is_refused_and_the_old_one_stays(rig, as_message, as_item, name):
    assert upload(rig, FENCE, GOOD, as_message) == m.MAV_MISSION_ACCEPTED
    wrong, result = BAD[name]
    texts = []
    assert upload(rig, FENCE, wrong, as_message, texts) == result
    assert texts[-1] == WHY.get(name, texts[-1])
    assert download(rig, FENCE, as_item) == GOOD


@pytest.mark.parametrize(
    "corners",
    [
        ((0, 0), (0, 3), (3, 3), (3, 0), (0, 0)),  # the first corner again as the last
        ((0, 0), (0, 1), (0, 2), (2, 0)),  # a corner on a side
        ((0, 0), (5, 0), (5, 3), (4, 3), (4, 1), (1, 1), (1, 3), (0, 3)),  # two sides on one line
        ((-2, -2), (-2, 2), (0, 0), (2, 1)),  # an indentation
    ],
)
def test_a_polygon_may_have_any_shape_that_does_not_meet_itself(corners):
    for turned in (corners, corners[::-1], corners[2:] + corners[:2]):
        (zone,) = read_fence(polygon(*turned), HOME).zones
        assert zone.corners


@pytest.mark.parametrize(
    ("wrong", "result", "why"),
    [
        ({"x": 0, "y": 0}, m.MAV_MISSION_INVALID_PARAM5_X, "no place is given: latitude and longitude are 0"),
        ({"x": LAT + 10_000_000}, m.MAV_MISSION_INVALID_PARAM5_X, "111 km from home; must be at most 100 km"),
        ({"y": LON - 20_000_000}, m.MAV_MISSION_INVALID_PARAM6_Y, "151 km from home; must be at most 100 km"),
        ({"command": 16}, m.MAV_MISSION_UNSUPPORTED, "NAV_WAYPOINT (16) is no rally point"),
    ],
)
def test_a_rally_point_out_of_reach_is_refused_and_named(rig, as_message, as_item, wrong, result, why):
    assert upload(rig, RALLY, POINTS, as_message) == m.MAV_MISSION_ACCEPTED
    texts = []
    assert upload(rig, RALLY, (POINTS[0], POINTS[1]._replace(**wrong)), as_message, texts) == result
    assert texts[-1] == f"rally point 1: {why}"
    assert download(rig, RALLY, as_item) == POINTS


def test_a_large_polygon_is_checked_without_a_stop():
    ring = [(round(1000 * math.cos(a)), round(1000 * math.sin(a))) for a in np.linspace(0.0, 6.28, 1000)]
    began = time.process_time()
    assert len(read_fence(polygon(*ring), HOME).zones) == 1
    assert time.process_time() - began < 1.0


def test_a_fence_that_is_accepted_is_taken_over_without_another_check(monkeypatch):
    checked = []
    monkeypatch.setattr(fence_module, "shape_problem", lambda corners, first: checked.append(first))
    craft, corners = Craft(), polygon((-3, -3), (-3, 4), (4, 4), (4, -3))
    craft.send(m.MAVLink_mission_count_message(1, 1, len(corners), FENCE))
    for seq, corner in enumerate(corners):
        craft.send(m.MAVLink_mission_item_int_message(1, 1, seq, **corner._asdict(), mission_type=FENCE))
    assert len(craft.flight.area.fence.zones) == 1
    assert checked == [0]


def test_items_of_another_kind_do_not_slip_in(rig, as_message):
    rig.replies(m.MAVLink_mission_count_message(1, 1, 1, FENCE))
    assert rig.replies(as_message(0, POINTS[0], RALLY)) == []
    (ack,) = rig.replies(as_message(0, item(IN_CIRCLE, 5.0), FENCE))
    assert ack.type == m.MAV_MISSION_ACCEPTED


def test_zones():
    fence = read_fence(GOOD, HOME)
    square, disc = fence.zones
    assert isinstance(square, Polygon) and isinstance(disc, Disc)
    assert square.inclusion and not disc.inclusion
    assert fence.violation(5.0, 5.0) == ""
    assert fence.violation(0.5, 0.5) == "in an exclusion zone of the fence"
    assert fence.violation(30.0, 0.0) == "outside the fence"
    # a second inclusion zone allows what the first does not
    wider = read_fence((*GOOD, item(IN_CIRCLE, 100.0)), HOME)
    assert wider.violation(30.0, 0.0) == ""
    assert read_rally(POINTS, HOME)[0][1] == pytest.approx(10.0, abs=0.1)


def test_areas_are_stored_bit_by_bit():
    assert deserialise_items(serialise(GOOD)) == GOOD


wild = st.builds(
    WireItem,
    st.integers(0, 25),
    st.sampled_from([IN_POLYGON, OUT_POLYGON, IN_CIRCLE, OUT_CIRCLE, RETURN, 5100, 16]),
    st.just(0),
    st.just(1),
    st.sampled_from([3.0, 4.0]) | st.floats(width=32),
    st.just(0.0),
    st.just(0.0),
    st.just(0.0),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
    st.floats(width=32),
)


@settings(max_examples=200, deadline=None)
@given(st.lists(wild, max_size=8), st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
def test_no_items_raise_anything_else(items, x, y):
    try:
        read_fence(items, HOME).violation(x, y)
    except MissionItemError as error:
        assert error.text
