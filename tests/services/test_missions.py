"""Mission transfer step by step on fake time: what MAVSDK tests in its client, seen from the vehicle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.services.endpoint import REACHED_INTERVAL_US, REACHED_REPETITIONS, REASON_INTERVAL_US
from autopilot.services.identity import ARDUPILOT, PX4, Identity
from autopilot.services.missions import (
    ACK_INTERVAL_US,
    ACK_REPETITIONS,
    INT_REQUESTS,
    LATE_ITEM_US,
    MAX_REQUESTS,
    MAX_RETRY_US,
    QUICK_REQUESTS,
    RETRY_US,
    TAKEOVER_US,
)
from autopilot.services.records import MissionChanged, Verdict
from autopilot.services.requests import ChangeAltitude, ReplaceMission, Reposition
from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.items import WireItem, home_item, located_steps
from autopilot.wire.items.limits import MAX_ITEMS

LAT, LON = round(Home().latitude_deg * 1e7), round(Home().longitude_deg * 1e7)
PATIENCE_US = 45_000_000  # more than the vehicle has for an item
ACK, INT, REQUEST = "MISSION_ACK", "MISSION_REQUEST_INT", "MISSION_REQUEST"


def said(messages: list[Any]) -> list[tuple[str, int]]:
    """(type, seq or result) of the mission messages among those that the vehicle sent."""
    pick = {ACK: "type", INT: "seq", REQUEST: "seq", "MISSION_COUNT": "count", "MISSION_ITEM_INT": "seq"}
    return [(x.get_type(), getattr(x, pick[x.get_type()])) for x in messages if x.get_type() in pick]


def count(n: int, kind: int = 0) -> Any:
    return m.MAVLink_mission_count_message(1, 1, n, kind)


def silence(rig, duration_us: int, link: str = "gcs") -> list[tuple[str, int]]:
    return said([r.message for r in rig.run(duration_us, link)])


def upload(rig, items, as_message, **origin) -> list[tuple[str, int]]:
    """Make a whole upload without any trouble; return the last answers."""
    answers = said(rig.replies(count(len(items)), **origin))
    for seq, item in enumerate(items):
        assert answers == [(INT, seq)]
        answers = said(rig.replies(as_message(seq, item), **origin))
    return answers


@pytest.mark.parametrize("n", [1, 2, 10])
def test_upload_and_download_give_the_same_items(rig, items, as_message, as_item, n):
    sent = items(n)
    assert upload(rig, sent, as_message) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    assert rig.endpoint.mission.items == sent
    assert [e.mission.items for e in rig.events if isinstance(e, MissionChanged)] == [sent]
    assert said(rig.replies(m.MAVLink_mission_request_list_message(1, 1))) == [("MISSION_COUNT", n)]
    got = rig.replies(*(m.MAVLink_mission_request_int_message(1, 1, seq) for seq in range(n)))
    assert tuple(as_item(x) for x in got) == sent


def test_nan_and_integer_coordinates_survive_bit_by_bit(rig, as_message):
    nan = math.nan
    camera = WireItem(m.MAV_FRAME_MISSION, 2000, 0, 1, nan, 0.1, nan, -0.0, 2**31 - 1, -(2**31), nan)
    upload(rig, (camera,), as_message)
    (got,) = rig.replies(m.MAVLink_mission_request_int_message(1, 1, 0))
    assert math.isnan(got.param1)
    assert math.isnan(got.z)
    assert math.copysign(1.0, got.param4) == -1.0
    assert (got.x, got.y, got.autocontinue) == (2**31 - 1, -(2**31), 1)


# ---- time


def test_asks_again_and_gives_up(rig_with, items):
    rig = rig_with(items(3))
    rig.send(count(5))
    heard = silence(rig, PATIENCE_US)
    asked = [INT] * INT_REQUESTS + [REQUEST] * (MAX_REQUESTS - INT_REQUESTS)
    assert heard == [(kind, 0) for kind in asked] + [(ACK, m.MAV_MISSION_OPERATION_CANCELLED)]
    assert rig.endpoint.mission.items == items(3)
    assert silence(rig, 10 * RETRY_US) == []


def test_gives_up_in_the_middle_as_int_only(rig, items, as_message):
    rig.replies(count(3))
    rig.send(as_message(0, items(3)[0]))
    heard = silence(rig, PATIENCE_US)
    assert heard == [(INT, 1)] * MAX_REQUESTS + [(ACK, m.MAV_MISSION_OPERATION_CANCELLED)]
    assert rig.endpoint.mission.items == ()
    assert not rig.events


def test_it_asks_quickly_at_first_and_then_waits_longer(rig):
    """At forty times real time, a client that is busy for a second has not answered for forty."""
    rig.send(count(1))
    asked_us, before = [], rig.now_us
    while rig.now_us - before < PATIENCE_US:
        if any(kind in (INT, REQUEST) for kind, _ in silence(rig, 50_000)):
            asked_us.append(rig.now_us)
    intervals_us = np.diff(asked_us)
    expected_us = [RETRY_US] * QUICK_REQUESTS + [500_000, 1_000_000, 2_000_000, MAX_RETRY_US]
    assert intervals_us[: len(expected_us)] == pytest.approx(expected_us, abs=50_000)
    assert intervals_us[len(expected_us) :] == pytest.approx(MAX_RETRY_US, abs=50_000)
    assert intervals_us.sum() > 25_000_000


def test_a_slow_upload_is_not_given_up(rig, items, as_message):
    slow = RETRY_US * 9 // 10
    sent = items(20)
    rig.send(count(20))
    for seq, item in enumerate(sent):
        assert silence(rig, slow) == [(INT, seq)]
        rig.send(as_message(seq, item))
    assert silence(rig, slow) == [(ACK, m.MAV_MISSION_ACCEPTED)]


def test_an_answer_after_most_of_the_tries_is_still_good(rig, items, as_message):
    sent = items(2)
    rig.send(count(2))
    for seq, item in enumerate(sent):
        silence(rig, RETRY_US * 2)
        rig.send(as_message(seq, item))
    assert silence(rig, RETRY_US) == [(ACK, m.MAV_MISSION_ACCEPTED)]


def test_the_last_ack_is_repeated_where_messages_are_lost(rig, items, as_message):
    sent = items(2)
    rig.send(count(2))
    rig.send(as_message(0, sent[0]))
    silence(rig, 3 * RETRY_US // 2)  # item 1 is requested twice
    accepted = (ACK, m.MAV_MISSION_ACCEPTED)
    assert said(rig.replies(as_message(1, sent[1])))[-1] == accepted
    assert silence(rig, 10 * ACK_INTERVAL_US) == [accepted] * ACK_REPETITIONS
    # the peer's next request shows that it received the acknowledgement
    rig.send(count(2))
    rig.send(as_message(0, sent[0]))
    silence(rig, 3 * RETRY_US // 2)
    assert said(rig.replies(as_message(1, sent[1])))[-1] == accepted
    assert silence(rig, 3 * ACK_INTERVAL_US // 2) == [accepted]
    assert said(rig.replies(m.MAVLink_mission_request_list_message(1, 1, 0))) == [("MISSION_COUNT", 2)]
    assert silence(rig, 10 * ACK_INTERVAL_US) == []


# ---- order


def test_duplicates_are_ignored(rig, items, as_message):
    sent = items(3)
    rig.replies(count(3))
    twice = as_message(0, sent[0])
    assert said(rig.replies(twice, twice, twice)) == [(INT, 1)]
    assert said(rig.replies(as_message(1, sent[1]), twice)) == [(INT, 2)]
    assert said(rig.replies(as_message(2, sent[2]))) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    assert rig.endpoint.mission.items == sent


def test_an_item_too_early_brings_the_missing_one_to_mind(rig, items, as_message):
    sent = items(3)
    rig.replies(count(3))
    for seq in (1, 2, 65535):
        assert said(rig.replies(as_message(seq, sent[1]))) == [(INT, 0)]
    assert said(rig.replies(as_message(0, sent[0]))) == [(INT, 1)]


def test_a_lost_ack_is_said_again_for_the_last_item(rig, items, as_message):
    sent = items(3)
    upload(rig, sent, as_message)
    assert said(rig.replies(as_message(2, sent[2]))) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    assert said(rig.replies(as_message(1, sent[1]))) == []
    assert rig.replies(as_message(2, sent[2]), system=77)[-1].type == m.MAV_MISSION_ERROR
    rig.now_us += LATE_ITEM_US + 1
    assert rig.replies(as_message(2, sent[2]))[-1].type == m.MAV_MISSION_ERROR
    assert len(rig.events) == 1


@pytest.mark.parametrize("current", [0, 1, 4])
def test_items_without_an_upload_are_errors(rig, items, as_message, current):
    *texts, ack = rig.replies(as_message(0, items(1)[0]._replace(current=current)))
    assert said([ack]) == [(ACK, m.MAV_MISSION_ERROR)]
    told = "".join(text.text for text in texts)
    assert told == "Mission item 0 refused: no upload is under way; MISSION_COUNT begins one"
    assert rig.endpoint.mission.items == ()
    rig.send(count(2), link="other", system=77)
    assert rig.replies(as_message(0, items(1)[0])) == [], "another client uploads"


def test_a_new_count_begins_again(rig, items, as_message):
    rig.replies(count(5))
    rig.replies(as_message(0, items(1)[0]))
    assert upload(rig, items(2), as_message) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    assert rig.endpoint.mission.items == items(2)


def test_the_client_gives_up(rig_with, items, as_message):
    rig = rig_with(items(2))
    rig.replies(count(5))
    rig.replies(m.MAVLink_mission_ack_message(1, 1, m.MAV_MISSION_OPERATION_CANCELLED))
    assert silence(rig, 10 * RETRY_US) == []
    assert rig.endpoint.mission.items == items(2)


def test_random_messages_in_between_change_nothing(rig, items, as_message):
    sent = items(4)
    rig.replies(count(4))
    stray = [
        m.MAVLink_mission_request_int_message(1, 1, 9),
        m.MAVLink_mission_request_list_message(1, 1),
        m.MAVLink_param_request_read_message(1, 1, b"NONE", -1),
        m.MAVLink_mission_ack_message(1, 1, m.MAV_MISSION_ACCEPTED, m.MAV_MISSION_TYPE_FENCE),
        m.MAVLink_mission_clear_all_message(1, 1, m.MAV_MISSION_TYPE_RALLY),
        m.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
    ]
    for seq, item in enumerate(sent):
        rig.replies(*stray)
        rig.replies(as_message(seq, item, m.MAV_MISSION_TYPE_FENCE))
        rig.replies(as_message(seq, item))
    assert rig.endpoint.mission.items == sent


# ---- who


@pytest.mark.parametrize("other", [{"system": 245}, {"component": 7}, {"link": "api"}])
def test_one_upload_at_a_time(rig, items, as_message, other):
    rig.endpoint.add_link("api")
    sent = items(2)
    rig.replies(count(2))
    for ask in (count(3), m.MAVLink_mission_clear_all_message(1, 1)):
        *texts, ack = rig.replies(ask, **other)
        assert said([ack]) == [(ACK, m.MAV_MISSION_DENIED)]
        told = "".join(text.text for text in texts)
        assert told == "Upload denied: system 255, component 190 uploads; try again"
        rig.now_us += REASON_INTERVAL_US
    assert said(rig.replies(as_message(0, items(1)[0]), **other)) == []
    rig.replies(m.MAVLink_mission_ack_message(1, 1, 0), **other)
    assert said(rig.replies(as_message(0, sent[0]))) == [(INT, 1)]
    assert said(rig.replies(as_message(1, sent[1]))) == [(ACK, m.MAV_MISSION_ACCEPTED)]


@pytest.mark.parametrize("kind", [m.MAV_MISSION_TYPE_MISSION, m.MAV_MISSION_TYPE_RALLY])
def test_an_abandoned_upload_gives_way_to_another_client_after_five_seconds(rig, items, as_message, kind):
    other = {"system": 245, "link": "other"}
    rig.replies(count(3))
    rig.run(TAKEOVER_US // 2)
    rig.replies(as_message(0, items(3)[0]))
    rig.run(TAKEOVER_US - 200_000)
    assert said(rig.replies(count(2, kind), **other)) == [(ACK, m.MAV_MISSION_DENIED)]
    rig.run(200_000)
    rig.send(count(2, kind), **other)
    out = rig.poll()
    assert said([r.message for r in out["other"]]) == [(INT, 0)]
    assert said([r.message for r in out["gcs"]]) == [(ACK, m.MAV_MISSION_OPERATION_CANCELLED)]
    texts = "".join(r.message.text for r in out["gcs"] if r.message.get_type() == "STATUSTEXT")
    assert texts == "Mission upload given up: item 1 of 3 did not come"
    assert said(rig.replies(count(3))) == [(ACK, m.MAV_MISSION_DENIED)], "now the other one uploads"


def test_an_abandoned_upload_gives_way_to_a_clearing(rig, items):
    rig.replies(count(3))
    rig.run(TAKEOVER_US)
    cleared = rig.replies(m.MAVLink_mission_clear_all_message(1, 1), system=245, link="other")
    assert said(cleared) == [(ACK, m.MAV_MISSION_ACCEPTED)]


def test_the_vehicle_speaks_to_the_uploader_alone(rig, items):
    rig.endpoint.add_link("api")
    rig.send(count(2), system=245, component=3)
    out = rig.poll()
    (request,) = [r.message for r in out["gcs"] if r.message.get_type() == INT]
    assert (request.target_system, request.target_component) == (245, 3)
    assert not [r for r in out["api"] if r.message.get_type() == INT]


# ---- refused


@pytest.mark.parametrize(
    ("item", "result"),
    [
        (WireItem(6, 84, 0, 1, 0, 0, 0, 0, 0, 0, 5.0), m.MAV_MISSION_UNSUPPORTED),
        (WireItem(10, 16, 0, 1, 0, 0, 0, 0, 473977420, 85455940, 5.0), m.MAV_MISSION_UNSUPPORTED_FRAME),
        (WireItem(6, 16, 0, 1, -1.0, 0, 0, 0, 473977420, 85455940, 5.0), m.MAV_MISSION_INVALID_PARAM1),
        (WireItem(6, 16, 0, 1, 0, 0, 0, 0, 2**31 - 1, 0, 5.0), m.MAV_MISSION_INVALID_PARAM5_X),
        (WireItem(6, 16, 0, 1, 0, 0, 0, 0, 473977420, 85455940, math.nan), m.MAV_MISSION_INVALID_PARAM7),
    ],
)
def test_a_mission_with_a_bad_item_leaves_the_old_one(rig_with, items, as_message, item, result):
    rig = rig_with(items(2))
    assert upload(rig, (*items(2), item), as_message) == [(ACK, result)]
    assert rig.endpoint.mission.items == items(2)
    assert not rig.events


def test_why_a_mission_was_refused_is_said_in_words(rig, items, as_message):
    bad = items(2)[1]._replace(z=-1.0)
    rig.replies(count(1))
    texts = [x.text for x in rig.replies(as_message(0, bad)) if x.get_type() == "STATUSTEXT"]
    assert "item 0" in "".join(texts)
    assert "height" in "".join(texts)


def test_too_many_items(rig):
    assert said(rig.replies(count(MAX_ITEMS + 1))) == [(ACK, m.MAV_MISSION_NO_SPACE)]
    assert said(rig.replies(count(MAX_ITEMS))) == [(INT, 0)]


@pytest.mark.parametrize("at", ["begin", "end", "clear"])
def test_the_supervisor_can_refuse_a_replacement(rig_with, items, as_message, at):
    rig = rig_with(items(2))
    no = Verdict(m.MAV_RESULT_DENIED, "Mission: it is being flown")
    if at == "begin":
        rig.verdict = lambda request: no
        assert said(rig.replies(count(3))) == [(ACK, m.MAV_MISSION_DENIED)]
        assert rig.asked == [ReplaceMission(3)]
    elif at == "end":
        rig.replies(count(1))
        rig.verdict = lambda request: no
        assert said(rig.replies(as_message(0, items(1)[0]))) == [(ACK, m.MAV_MISSION_DENIED)]
    else:
        rig.verdict = lambda request: no
        replies = rig.replies(m.MAVLink_mission_clear_all_message(1, 1))
        assert said(replies) == [(ACK, m.MAV_MISSION_DENIED)]
        assert rig.asked == [ReplaceMission(0)]
    assert rig.endpoint.mission.items == items(2)


# ---- empty, clear, other kinds


@pytest.mark.parametrize("kind", [m.MAV_MISSION_TYPE_MISSION, m.MAV_MISSION_TYPE_ALL])
def test_clear(rig_with, items, kind):
    rig = rig_with(items(2))
    (ack,) = rig.replies(m.MAVLink_mission_clear_all_message(1, 1, kind))
    assert (ack.type, ack.mission_type) == (m.MAV_MISSION_ACCEPTED, kind)
    assert said(rig.replies(m.MAVLink_mission_request_list_message(1, 1))) == [("MISSION_COUNT", 0)]
    assert [e.mission.items for e in rig.events] == [()]


def test_an_upload_of_nothing_clears(rig_with, items):
    rig = rig_with(items(2))
    assert said(rig.replies(count(0))) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    assert rig.endpoint.mission.items == ()


@pytest.mark.parametrize("kind", [m.MAV_MISSION_TYPE_FENCE, m.MAV_MISSION_TYPE_RALLY])
def test_fence_and_rally_are_empty_at_first_and_cleared(rig_with, items, kind):
    rig = rig_with(items(2))
    (answer,) = rig.replies(m.MAVLink_mission_request_list_message(1, 1, kind))
    assert (answer.count, answer.mission_type) == (0, kind)
    for message, result in [
        (count(0, kind), m.MAV_MISSION_ACCEPTED),
        (m.MAVLink_mission_clear_all_message(1, 1, kind), m.MAV_MISSION_ACCEPTED),
        (m.MAVLink_mission_request_int_message(1, 1, 0, kind), m.MAV_MISSION_INVALID_SEQUENCE),
    ]:
        (ack,) = rig.replies(message)
        assert (ack.type, ack.mission_type) == (result, kind)
    assert rig.endpoint.mission.items == items(2)


@pytest.mark.parametrize(
    "message",
    [
        count(1, 77),
        count(1, m.MAV_MISSION_TYPE_ALL),
        m.MAVLink_mission_request_list_message(1, 1, 77),
        m.MAVLink_mission_clear_all_message(1, 1, 77),
        m.MAVLink_mission_write_partial_list_message(1, 1, 0, 1),
        m.MAVLink_mission_request_partial_list_message(1, 1, 0, 1),
    ],
    ids=lambda message: f"{message.get_type()} {message.mission_type}",
)
def test_what_is_not_served_is_said(rig, message):
    assert said(rig.replies(message)) == [(ACK, m.MAV_MISSION_UNSUPPORTED)]


# ---- download


def test_downloads_need_no_order(rig_with, items, as_item):
    sent = items(5)
    rig = rig_with(sent)
    asks = [4, 0, 2, 2, 1, 3]
    got = rig.replies(*(m.MAVLink_mission_request_int_message(1, 1, seq) for seq in asks))
    assert [as_item(x) for x in got] == [sent[seq] for seq in asks]


def test_for_clients_of_ardupilot_there_is_always_home(rig_with, as_message, as_item, items):
    rig = rig_with(identity=Identity(flavour=ARDUPILOT))
    assert said(rig.replies(m.MAVLink_mission_request_list_message(1, 1))) == [("MISSION_COUNT", 1)]
    answers = rig.replies(m.MAVLink_mission_request_int_message(1, 1, 0))
    (home,) = [as_item(x) for x in answers if x.get_type() == "MISSION_ITEM_INT"]
    # what is uploaded after it is the mission, and home is not flown to
    sent = (home, *items(2))
    assert upload(rig, sent, as_message) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    assert rig.endpoint.mission.items == sent
    assert [step.first for step in located_steps(rig.endpoint.mission.items, Home())] == [1, 2]
    assert said(rig.replies(m.MAVLink_mission_request_list_message(1, 1))) == [("MISSION_COUNT", 3)]


@pytest.mark.parametrize("current", [0, 1])
def test_the_home_of_a_file_is_the_vehicles_own_for_clients_of_ardupilot(
    rig_with, items, as_message, current
):
    """Another home would be a waypoint: the vehicle would fly to its place and its height above the sea."""
    rig = rig_with(identity=Identity(flavour=ARDUPILOT))
    canberra = WireItem(0, 16, current, 1, 0.0, 0.0, 0.0, 0.0, -353632620, 1491652370, 584.0)
    assert upload(rig, (canberra, *items(2)), as_message) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    home, *rest = rig.endpoint.mission.items
    assert (home.x, home.y, home.z) == (
        round(Home().latitude_deg * 1e7),
        round(Home().longitude_deg * 1e7),
        0.0,
    )
    assert tuple(rest) == items(2)
    assert [step.first for step in located_steps(rig.endpoint.mission.items, Home())] == [1, 2]


MOVED = (0.0, 5.0, 0.0)  # m, ENU from the origin


def item_of_home(place: Vec3) -> WireItem:
    x, y, _ = geodetic_from_enu(place, Home())
    return home_item(Home())._replace(x=x, y=y)


@pytest.mark.parametrize("flavour", [PX4, ARDUPILOT])
def test_home_as_item_0_is_where_home_is(rig_with, items, as_message, as_item, flavour):
    """A file written with the home that DO_SET_HOME gave was refused, or its home was that of the start."""
    rig = rig_with(identity=Identity(flavour=flavour))
    rig.endpoint.move_home(MOVED)
    sent = (item_of_home(MOVED), *items(2))
    assert upload(rig, sent, as_message) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    assert [step.first for step in located_steps(rig.endpoint.mission.items, Home())] == [1, 2]
    answers = rig.replies(*(m.MAVLink_mission_request_int_message(1, 1, seq) for seq in range(3)))
    assert tuple(as_item(x) for x in answers) == sent
    # home is moved once more: the mission stays, and its item 0 is home
    rig.endpoint.move_home(ZERO)
    (served,) = rig.replies(m.MAVLink_mission_request_int_message(1, 1, 0))
    assert as_item(served) == item_of_home(ZERO)


@pytest.mark.parametrize("ask", [m.MAVLink_mission_request_int_message, m.MAVLink_mission_request_message])
def test_an_item_that_is_not_there(rig_with, items, ask):
    rig = rig_with(items(2))
    assert said(rig.replies(ask(1, 1, 2))) == [(ACK, m.MAV_MISSION_INVALID_SEQUENCE)]


# ---- single items outside an upload, as ArduPilot has them


def single_item(float_form: bool, **changes: Any) -> Any:
    """MISSION_ITEM or MISSION_ITEM_INT of a waypoint 10 m north of home and 5 m above it."""
    item = WireItem(3, 16, 2, 1, 0.0, 0.0, 0.0, 0.0, LAT + 900, LON, 5.0)._replace(**changes)
    if float_form:
        return float_message(0, item)
    return m.MAVLink_mission_item_int_message(target_system=1, target_component=1, seq=0, **item._asdict())


@pytest.mark.parametrize("float_form", [False, True])
def test_a_single_item_is_a_place_or_a_height_to_fly_to(rig, float_form):
    assert said(rig.replies(single_item(float_form))) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    (go,) = rig.asked
    assert isinstance(go, Reposition)
    assert (go.east_m, go.north_m, go.altitude_m) == pytest.approx((0.0, 10.0, 5.0), abs=0.5)
    # MAVProxy's change of height has no place
    assert said(rig.replies(single_item(float_form, current=3, x=0, y=0))) == [(ACK, m.MAV_MISSION_ACCEPTED)]
    assert said(rig.replies(single_item(float_form, current=3, frame=0, z=6.5))) == [
        (ACK, m.MAV_MISSION_ACCEPTED)
    ]
    assert rig.asked[1:] == [ChangeAltitude(5.0), ChangeAltitude(6.5)]
    assert rig.endpoint.mission.items == ()


@pytest.mark.parametrize("current", [2, 3])
@pytest.mark.parametrize("wrong", [{"command": m.MAV_CMD_NAV_LAND}, {"frame": m.MAV_FRAME_LOCAL_NED}])
def test_a_single_item_that_is_no_waypoint_is_refused_with_a_text(rig, current, wrong):
    *text, ack = rig.replies(single_item(False, current=current, **wrong))
    assert (ack.get_type(), ack.type) == (ACK, m.MAV_MISSION_UNSUPPORTED)
    assert "refused outside an upload" in "".join(part.text for part in text)
    assert rig.asked == []


@pytest.mark.parametrize("current", [2, 3])
def test_a_single_item_that_cannot_be_flown_now_is_refused_with_the_reason(rig, current):
    rig.verdict = lambda request: Verdict(m.MAV_RESULT_TEMPORARILY_REJECTED, "Reposition denied: not now")
    text, ack = rig.replies(single_item(False, current=current))
    assert (text.text, ack.type) == ("Reposition denied: not now", m.MAV_MISSION_DENIED)


def test_a_single_item_of_floats_without_a_place_is_answered(rig):
    nowhere = single_item(True)
    nowhere.x = math.inf
    *text, ack = rig.replies(nowhere)
    assert text and ack.type == m.MAV_MISSION_INVALID_PARAM5_X


# ---- clients that use floats only


def float_message(seq: int, item: WireItem) -> Any:
    scale = 1.0 if item.frame == m.MAV_FRAME_MISSION else 1e7
    fields = item._asdict() | {"x": item.x / scale, "y": item.y / scale}
    return m.MAVLink_mission_item_message(target_system=1, target_component=1, seq=seq, **fields)


def test_a_client_of_floats_uploads(rig, items):
    sent = items(4)
    rig.send(count(4))
    heard = silence(rig, RETRY_US * INT_REQUESTS + RETRY_US // 2)
    assert heard[-1] == (REQUEST, 0)
    for seq, item in enumerate(sent):
        answers = said(rig.replies(float_message(seq, item)))
        assert answers == [(REQUEST, seq + 1) if seq < 3 else (ACK, m.MAV_MISSION_ACCEPTED)]
    for got, item in zip(rig.endpoint.mission.items, sent, strict=True):
        # float32 degrees: 3.8e-6 deg at 47 deg
        assert abs(got.x - item.x) <= 20
        assert got._replace(x=0, y=0) == item._replace(x=0, y=0)


def test_a_client_of_floats_downloads(rig_with, items):
    sent = items(2)
    rig = rig_with(sent)
    (got,) = rig.replies(m.MAVLink_mission_request_message(1, 1, 1))
    assert got.get_type() == "MISSION_ITEM"
    assert got.x == pytest.approx(sent[1].x / 1e7, abs=4e-6)  # float32 at 47 degrees


@pytest.mark.parametrize("x", [math.inf, 1e30, -1e30])
def test_a_float_that_is_no_coordinate(rig_with, items, x):
    rig = rig_with(items(2))
    rig.replies(count(1))
    fields = items(1)[0]._asdict() | {"x": x, "y": 0.0}
    bad = m.MAVLink_mission_item_message(target_system=1, target_component=1, seq=0, **fields)
    assert said(rig.replies(bad)) == [(ACK, m.MAV_MISSION_INVALID_PARAM5_X)]
    assert rig.endpoint.mission.items == items(2)


# ---- progress


def test_mission_current_goes_out_when_it_changes(rig):
    rig.run(100_000)
    for seq in (1, 2):
        rig.changes = {"mission_current": seq, "mission_total": 3, "mission_state": 3}
        rig.endpoint.state_changed()
        got = [r.message.seq for r in rig.poll()["gcs"] if r.message.get_type() == "MISSION_CURRENT"]
        assert got == [seq]


def _told_as_reached(rig, duration_us):
    return [r.message.seq for r in rig.run(duration_us) if r.message.get_type() == "MISSION_ITEM_REACHED"]


def test_the_end_of_a_mission_is_said_again(rig):
    rig.endpoint.item_reached(3)
    rig.endpoint.item_reached(4, last=True)
    rig.changes = {"mission_state": m.MISSION_STATE_COMPLETE}
    assert _told_as_reached(rig, 20 * REACHED_INTERVAL_US) == [3, 4] + [4] * REACHED_REPETITIONS


def test_the_end_of_a_mission_is_not_said_of_the_next_one(rig):
    rig.endpoint.item_reached(4, last=True)
    rig.changes = {"mission_state": m.MISSION_STATE_COMPLETE}
    assert _told_as_reached(rig, 2 * REACHED_INTERVAL_US) == [4, 4]
    rig.changes = {"mission_state": m.MISSION_STATE_ACTIVE}
    assert _told_as_reached(rig, 2 * REACHED_INTERVAL_US) == []
    rig.changes = {"mission_state": m.MISSION_STATE_COMPLETE}
    assert _told_as_reached(rig, 2 * REACHED_INTERVAL_US) == []


def test_reached_items_are_told_to_all(rig):
    rig.endpoint.add_link("api")
    rig.poll()
    rig.endpoint.item_reached(4)
    for received in rig.poll().values():
        assert [r.message.seq for r in received if r.message.get_type() == "MISSION_ITEM_REACHED"] == [4]


# ---- numbers of plans


def test_a_plan_has_a_number_that_tells_its_versions_apart(rig, items, as_message):
    def numbers() -> tuple[int, int]:
        (listed,) = rig.replies(m.MAVLink_mission_request_list_message(1, 1))
        rig.send(m.MAVLink_command_long_message(1, 1, m.MAV_CMD_REQUEST_MESSAGE, 0, 42, 0, 0, 0, 0, 0, 0))
        current = [r.message for r in rig.poll()["gcs"] if r.message.get_type() == "MISSION_CURRENT"]
        return listed.opaque_id, current[-1].mission_id

    assert numbers() == (0, 0)
    seen = set()
    for sent in (items(3), items(4), items(3)):
        answers = rig.replies(count(len(sent)))
        for seq, item in enumerate(sent):
            answers = rig.replies(as_message(seq, item))
        assert answers[-1].opaque_id != 0
        assert numbers() == (answers[-1].opaque_id,) * 2
        seen.add(answers[-1].opaque_id)
    assert len(seen) == 2  # equal plans have equal numbers, also after a restart
    (cleared,) = rig.replies(m.MAVLink_mission_clear_all_message(1, 1))
    assert cleared.opaque_id == 0
    assert numbers() == (0, 0)
