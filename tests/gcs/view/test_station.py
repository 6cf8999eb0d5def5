"""The ground station behind the page: what it requests from vehicles, does for pages, and reports to them."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.wire.codec import FrameWriter
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from gcs.clients.datagrams import messages
from gcs.view.controls import SLIDERS
from gcs.view.station import FAST_MESSAGES, INTERVAL_US, MAX_REQUESTS, Outgoing, Station

MAP = (473977420, 85455940)
FENCE = mavlink.MAV_MISSION_TYPE_FENCE


class Watched:
    """A station with the scripted vehicle of the other tests."""

    def __init__(self, world: Any, **station: Any) -> None:
        self.world = world
        self.station = Station(**station)
        self.news: list[dict[str, Any]] = []

    def run(self, seconds: float) -> None:
        """Run station and vehicle for so long."""
        for _ in self.world.ticks(self.station.receive, self.poll, seconds):
            self.news += self.station.news()

    def poll(self, now_us: int) -> list[bytes]:
        return [out.datagram for out in self.station.poll(now_us)]

    def ask(self, action: Any, arguments: Any = None, **more: Any) -> dict[str, Any]:
        """Send a request as a page does, and wait for the result."""
        before = len(self.results)
        request = {"vehicle": 1, "request": 5, "action": action, "arguments": arguments or {}, **more}
        self.station.handle_request("page", request)
        self.news += self.station.news()
        while len(self.results) == before:
            self.run(0.1)
        return self.results[-1]

    @property
    def results(self) -> list[dict[str, Any]]:
        return [record for record in self.news if record["type"] == "result"]

    def commands(self, number: int) -> list[Any]:
        """The commands of that id that the vehicle has received."""
        return [one for one in self.world.vehicle.commands if one.command == number]


@pytest.fixture
def watched(world: Any) -> Watched:
    for slider in SLIDERS:
        world.vehicle.parameters[slider.name] = slider.default or 0.0
    found = Watched(world)
    found.run(8.0)
    return found


def test_a_vehicle_that_is_met_is_asked_for_fast_telemetry_and_for_the_parameters_that_are_shown(
    watched: Watched,
) -> None:
    asked = watched.commands(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
    assert {(one.param1, one.param2) for one in asked} == {(float(m), INTERVAL_US) for m in FAST_MESSAGES}
    told = [record for record in watched.news if record["type"] == "vehicle"][-1]
    assert told["id"] == 1
    assert told["parameters"] == {slider.name: slider.default or 0.0 for slider in SLIDERS}


@pytest.mark.parametrize(("system", "shown"), [(None, [1, 2]), (2, [2]), (3, [])])
def test_of_several_vehicles_all_are_shown_or_the_one_that_is_chosen(
    system: int | None, shown: list[int]
) -> None:
    station = Station(system=system)
    heartbeat = mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, 29, 0, 3, 3
    )
    heard = [station.receive(FrameWriter(one, 1).frame(heartbeat), 1000) for one in (1, 2)]
    assert list(station.vehicles) == shown
    assert [one for found in heard for one in found] == shown


def test_one_that_only_looks_on_says_no_word_until_a_person_asks(world: Any) -> None:
    watched = Watched(world, active=False)
    watched.run(5.0)
    assert list(watched.station.vehicles) == [1]
    assert world.vehicle.commands == []
    assert watched.ask("hold")["ok"]
    assert [one.command for one in world.vehicle.commands] == [mavlink.MAV_CMD_DO_PAUSE_CONTINUE]


def test_what_a_person_asks_goes_before_what_we_ask_by_ourselves(world: Any) -> None:
    watched = Watched(world)
    watched.run(0.04)
    watched.ask("hold")
    watched.run(2.0)
    sent = [one.command for one in world.vehicle.commands]
    assert sent.index(mavlink.MAV_CMD_DO_PAUSE_CONTINUE) < sent.count(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)


def test_a_refusal_is_answered_with_the_reason_that_the_vehicle_gives(watched: Watched) -> None:
    vehicle = watched.world.vehicle
    vehicle.command_results[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = [mavlink.MAV_RESULT_DENIED]
    vehicle.say("Arming denied: no load")
    answer = watched.ask("arm")
    assert not answer["ok"]
    vehicle.command_results[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = [mavlink.MAV_RESULT_DENIED]
    watched.station.handle_request("page", {"vehicle": 1, "request": 6, "action": "arm", "arguments": {}})
    watched.run(0.1)
    vehicle.say("Arming denied: in the air")
    watched.run(1.0)
    assert watched.results[-1]["text"] == "arm: denied; Arming denied: in the air"
    assert (watched.results[-1]["page"], watched.results[-1]["request"]) == ("page", 6)


def test_a_mission_on_the_ground_is_armed_for_and_not_begun_where_arming_is_refused(watched: Watched) -> None:
    vehicle = watched.world.vehicle
    vehicle.command_results[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = [mavlink.MAV_RESULT_DENIED]
    assert not watched.ask("start")["ok"]
    assert watched.commands(mavlink.MAV_CMD_MISSION_START) == []
    assert watched.ask("start")["ok"]
    assert vehicle.armed
    assert len(watched.commands(mavlink.MAV_CMD_MISSION_START)) == 1


def test_a_clicked_place_is_sent_to_the_centimetre(watched: Watched) -> None:
    assert watched.ask("goto", {"place": [123.45, -67.89, -3.5]})["ok"]
    (sent,) = watched.commands(mavlink.MAV_CMD_DO_REPOSITION)
    assert sent.get_type() == "COMMAND_INT"
    assert sent.frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    assert sent.z == 3.5
    east, north, _ = enu_from_geodetic(sent.x, sent.y, 0, Home())
    # the unit of latitude in the message is 11 mm
    assert (north, east) == pytest.approx((123.45, -67.89), abs=0.011)


def test_a_slider_sets_its_parameter_and_a_push_ends_with_its_trigger(watched: Watched) -> None:
    assert watched.ask("set", {"name": "SIM_WIND_E", "value": 3.5})["ok"]
    assert watched.world.vehicle.parameters["SIM_WIND_E"] == 3.5
    gust = ("SIM_GUST_N", "SIM_GUST_E", "SIM_GUST_U", "SIM_GUST_FOR_S", "SIM_GUST_NOW")
    watched.world.vehicle.parameters.update(dict.fromkeys(gust, 0.0))
    assert watched.ask("push", {"north": -4, "east": 3, "seconds": 0.5})["ok"]
    assert [watched.world.vehicle.parameters[name] for name in gust] == [-4.0, 3.0, 0.0, 0.5, 1.0]


@pytest.mark.parametrize(
    ("action", "arguments", "says"),
    [
        ("open", {}, "no such action"),
        (["arm"], {}, "no such action"),
        ("arm", [], "must be an object"),
        ("set", {"name": "MAV_SYS_ID", "value": 3}, "a slider"),
        ("set", {"name": ["SIM_WIND_E"], "value": 3}, "a slider"),
        ("set", {"name": "SIM_WIND_E", "value": "3"}, "must be a number"),
        ("set", {"name": "SIM_WIND_E", "value": True}, "must be a number"),
        ("push", {"north": 1000, "east": 0, "seconds": 1}, "must be -30 ... 30"),
        ("goto", {"place": [1, 2]}, "must be [north, east, down]"),
        ("goto", {"place": [1, None, 3]}, "must be a number"),
        ("fail", {"rotor": 15}, "must be 1 ... 14"),
    ],
)
def test_what_is_no_action_is_refused_with_a_reason_and_not_sent(
    watched: Watched, action: Any, arguments: Any, says: str
) -> None:
    before = len(watched.world.vehicle.commands)
    watched.station.handle_request(
        "page", {"vehicle": 1, "request": 1, "action": action, "arguments": arguments}
    )
    watched.run(0.5)
    assert not watched.results[-1]["ok"]
    assert says in watched.results[-1]["text"]
    assert len(watched.world.vehicle.commands) == before


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)


@given(JSON, st.sampled_from(["goto", "set", "push", "fail", "arm"]))
def test_no_request_at_all_raises(anything: Any, action: str) -> None:
    station = Station()
    station.receive(heartbeat(1), 0)
    station.handle_request("page", anything)
    station.handle_request(
        "page", {"vehicle": 1, "request": anything, "action": action, "arguments": anything}
    )
    station.handle_request("page", {"vehicle": anything, "action": anything})
    list(station.poll(0))
    json.dumps(station.news(), allow_nan=False)


def test_a_page_that_asks_too_much_is_told_so(watched: Watched) -> None:
    for number in range(MAX_REQUESTS + 1):
        watched.station.handle_request(
            "page", {"vehicle": 1, "request": number, "action": "hold", "arguments": {}}
        )
    watched.news += watched.station.news()
    assert [record["request"] for record in watched.results if not record["ok"]] == [MAX_REQUESTS]


def heartbeat(system: int) -> bytes:
    """The heartbeat of the vehicle with that system id."""
    message = mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, 29, 0x03040000, 3, 3
    )
    return FrameWriter(system, 1).frame(message)


def test_several_vehicles_are_told_apart_and_each_is_spoken_to_by_its_own_number() -> None:
    station = Station()
    assert station.receive(heartbeat(3), 0) == [3]
    assert station.receive(heartbeat(7), 0) == [7]
    station.handle_request("page", {"vehicle": 7, "request": 1, "action": "land", "arguments": {}})
    sent = [out for out in station.poll(0) if isinstance(out, Outgoing)]
    assert {out.system for out in sent} == {3, 7}
    assert [state["id"] for state in station.state(0)["vehicles"]] == [3, 7]


def test_ground_stations_and_loads_are_no_vehicles() -> None:
    station = Station()
    for kind, autopilot in ((mavlink.MAV_TYPE_GCS, 8), (mavlink.MAV_TYPE_AIRSHIP, 8)):
        message = mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 0, 3)
        station.receive(FrameWriter(9, 190).frame(message), 0)
    assert station.vehicles == {}


def test_mission_and_fence_are_fetched_when_they_have_changed(watched: Watched) -> None:
    vehicle = watched.world.vehicle
    corners = [(MAP[0] + a, MAP[1] + b) for a, b in ((900, 0), (0, 900), (-900, 0))]
    inside = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    outside = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
    polygon = [WireItem(3, inside, 0, 1, 3.0, 0, 0, 0, x, y, 0.0) for x, y in corners]
    vehicle.areas[FENCE] = [*polygon, WireItem(3, outside, 0, 1, 2.5, 0, 0, 0, *MAP, 0.0)]
    vehicle.mission = [
        WireItem(6, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 1, 0, 0, 0, 0, *MAP, 2.0),
        WireItem(6, mavlink.MAV_CMD_NAV_WAYPOINT, 0, 1, 0, 0, 0, 0, MAP[0] + 900, MAP[1], 3.0),
        WireItem(6, mavlink.MAV_CMD_NAV_LAND, 0, 1, 0, 0, 0, 0, 0, 0, math.nan),
        WireItem(6, mavlink.MAV_CMD_NAV_LAND, 0, 1, 0, 0, 0, 0, 0, 0, 0.0),
    ]
    current = mavlink.MAVLink_mission_current_message(0, 0, 0, 0, 5, 77, 0)
    watched.station.receive(FrameWriter(1, 1).frame(current), watched.world.now_us)
    watched.run(2.0)
    fence = watched.station.vehicles[1].fence
    assert fence is not None
    first, second = fence["zones"]
    assert first["kind"] == "inclusion"
    assert first["polygon"][0] == pytest.approx([10.0, 0.0], abs=0.05)
    places = watched.station.vehicles[1].waypoints
    assert places[1:] == [
        [0, 0, -2],
        [pytest.approx(10.0, abs=0.05), 0, -3],
        [pytest.approx(10, abs=0.05), 0, 0],
    ]
    assert second == {"kind": "exclusion", "centre": [0.0, 0.0], "radius": 2.5}


def test_a_mission_whose_download_was_not_answered_is_fetched_later(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For a minute the vehicle does not hear who asks for lists."""
    world.vehicle.mission = [
        WireItem(6, mavlink.MAV_CMD_NAV_WAYPOINT, 0, 1, 0, 0, 0, 0, MAP[0] + 900, MAP[1], 3.0)
    ]
    watched = Watched(world)

    def without_lists(now_us: int) -> list[bytes]:
        datagrams = [out.datagram for out in watched.station.poll(now_us)]
        asked = mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST
        return [one for one in datagrams if all(each.id != asked for each in messages(one)[0])]

    with monkeypatch.context() as lost:
        lost.setattr(watched, "poll", without_lists)
        watched.run(60.0)
    assert watched.station.vehicles[1].waypoints == []
    watched.run(30.0)
    assert watched.station.vehicles[1].waypoints[-1][0] == pytest.approx(10.0, abs=0.05)


FLOATS = st.floats(width=32)
MESSAGES = {
    mavlink.MAVLink_load_state_message: {"taut": st.integers(0, 1), "source": st.sampled_from([0, 2])},
    mavlink.MAVLink_load_setpoint_message: {"phase": st.integers(0, 12)},
    mavlink.MAVLink_cascade_errors_message: {"control_mode": st.integers(0, 5)},
    mavlink.MAVLink_rotor_state_message: {"source": st.sampled_from([0, 2])},
    mavlink.MAVLink_wind_state_message: {},
    mavlink.MAVLink_wind_cov_message: {},
    mavlink.MAVLink_local_position_ned_message: {},
    mavlink.MAVLink_attitude_quaternion_message: {},
    mavlink.MAVLink_home_position_message: {},
    mavlink.MAVLink_hil_state_quaternion_message: {},
    mavlink.MAVLink_param_value_message: {"param_id": st.just(b"SIM_WIND_E")},
}
_RANGES = {
    "uint8_t": (0, 255),
    "int8_t": (-128, 127),
    "uint16_t": (0, 2**16 - 1),
    "int16_t": (-(2**15), 2**15 - 1),
}
_RANGES |= {"uint32_t": (0, 2**32 - 1), "int32_t": (-(2**31), 2**31 - 1), "uint64_t": (0, 2**63)}


@st.composite
def hostile_messages(draw: Any) -> Any:
    """Any message that the page shows, with any numbers."""
    kind = draw(st.sampled_from(list(MESSAGES)))
    values = []
    types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    for name in kind.fieldnames:
        special = MESSAGES[kind].get(name)
        number = (
            FLOATS if types[name] in ("float", "double") else st.integers(*_RANGES.get(types[name], (0, 9)))
        )
        if special is not None:
            values.append(draw(special))
        elif lengths[name]:
            values.append(draw(st.lists(number, min_size=lengths[name], max_size=lengths[name])))
        else:
            values.append(draw(number))
    return kind(*values)


@given(st.lists(hostile_messages(), min_size=1, max_size=8))
def test_whatever_numbers_a_vehicle_says_the_page_gets_json(sent: list[Any]) -> None:
    station = Station()
    station.receive(heartbeat(1), 0)
    for step, message in enumerate(sent):
        frame = FrameWriter(1, 25).frame(message)
        station.receive(frame, step * 20_000)
        station.receive_truth(frame)
        json.dumps(station.state(step * 20_000), allow_nan=False)
    json.dumps([station.news(), station.initial_records()], allow_nan=False)


TRUTH, ESTIMATE = mavlink.PLUMBLINE_SOURCE_TRUTH, mavlink.PLUMBLINE_SOURCE_ESTIMATED


def load(time_us: int, east: float, source: int, distance: float = 0.7, taut: int = 1) -> bytes:
    zero = (0.0,) * 3
    message = mavlink.MAVLink_load_state_message(
        time_us, 0.0, east, -1.0, *zero, 0.0, 0.0, 1.0, *zero, distance, 1.0, 0, taut, source
    )
    return FrameWriter(1, 25).frame(message)


@pytest.mark.parametrize("source", [TRUTH, ESTIMATE])
def test_a_load_that_has_left_its_cable_is_not_on_it_again_because_the_vehicle_lands_beside_it(
    source: int,
) -> None:
    station = Station()
    station.receive(heartbeat(1), 0)

    def attached(time_us: int, distance: float, taut: int) -> bool:
        frame = load(time_us, 0.0, source, distance, taut)
        if source == TRUTH:
            station.receive_truth(frame)
        else:
            station.receive(frame, time_us)
        found: bool = station.state(time_us)["vehicles"][0]["load"]["attached"]
        return found

    assert attached(1000, 0.7, taut=1)
    assert attached(2000, 0.5, taut=0), "slack"
    assert not attached(3000, 0.95, taut=0), "released"
    assert not attached(4000, 0.3, taut=0), "the vehicle has landed beside it"
    assert attached(5000, 0.7, taut=1), "and carries it again"


def test_the_error_of_the_estimator_is_that_of_one_time() -> None:
    station = Station()
    station.receive(heartbeat(1), 0)
    for time_us in (0, 8000, 16_000):  # 2 m/s east
        station.receive_truth(load(time_us, 2e-6 * time_us, TRUTH))
    station.receive(load(12_000, 0.024 + 0.003, ESTIMATE), 0)
    (state,) = station.state(0)["vehicles"]
    assert state["estimator_error"] == pytest.approx(0.003, abs=1e-4)  # because it is rounded
    station.receive(load(24_000, 9.0, ESTIMATE), 0)  # its truth has not come yet
    (state,) = station.state(0)["vehicles"]
    assert state["estimator_error"] == pytest.approx(0.003, abs=1e-4)
    assert not math.isnan(state["tension"])


def test_the_truth_is_shown_of_the_run_of_the_world_in_which_a_vehicle_says_it_flies(world: Any) -> None:
    watched = Watched(world)
    station = watched.station
    status = FrameWriter(1, 27).frame(mavlink.MAVLink_sim_status_message(5, 0.0, 250.0, 0, 0, 0, 0, 1, 1))
    watched.run(1.0)

    def shown() -> bool:
        return station.vehicles[1].truth.message(mavlink.MAVLINK_MSG_ID_SIM_STATUS) is not None

    station.receive_truth(status, run=3, alone=False)
    assert not shown(), "which of several worlds it is, the vehicle has not said"
    boot = mavlink.MAVLink_sim_boot_message(0, 7, [0.0] * 4, 0.0, 0, 0)
    station.receive(FrameWriter(1, 25).frame(boot), 0)
    station.receive_truth(status, run=3)
    assert not shown()
    asked = len(watched.commands(mavlink.MAV_CMD_REQUEST_MESSAGE))
    watched.run(8.0)
    assert len(watched.commands(mavlink.MAV_CMD_REQUEST_MESSAGE)) > asked, "it may have begun anew"
    station.receive_truth(status, run=7, alone=False)
    assert shown()
