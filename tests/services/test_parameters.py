"""The parameter protocol, with a ground station that misses any messages."""

from __future__ import annotations

import math
import struct

import pytest

from autopilot.services.identity import ARDUPILOT, GENERIC, Identity, ParameterEncoding
from autopilot.services.parameter_protocol import (
    DOES_NOT_EXIST,
    HASH_NAME,
    LIST_INTERVAL_US,
    OUT_OF_RANGE,
    READ_ONLY,
    TYPE_MISMATCH,
    ParameterService,
)
from autopilot.services.records import ParameterChanged, Peer, SimulatorParameterRequested, Verdict
from autopilot.services.requests import ChangeVehicle
from autopilot.services.streams import NEVER_US
from autopilot.wire.codec import payload_of
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.parameter_table import Parameter, ParameterTable

REAL32, INT32 = m.MAV_PARAM_TYPE_REAL32, m.MAV_PARAM_TYPE_INT32


def set_(name: bytes, value: float, kind: int = REAL32):
    return m.MAVLink_param_set_message(1, 1, name, value, kind)


def read(name: bytes = b"", index: int = -1):
    return m.MAVLink_param_request_read_message(1, 1, name, index)


def values(messages):
    return [(x.param_id, x.param_value, x.param_index) for x in messages if x.get_type() == "PARAM_VALUE"]


def errors(messages):
    return [(x.param_id, x.error) for x in messages if x.get_type() == "PARAM_ERROR"]


def told(rig, link="gcs", duration_us=200_000):
    return [r.message for r in rig.run(duration_us, link) if r.message.get_type() == "PARAM_VALUE"]


def listed(rig, link="gcs", duration_us=200_000):
    """The values, without the hash before them."""
    return [x for x in told(rig, link, duration_us) if x.param_id != HASH_NAME]


def px4_hash(rig) -> int:
    """PX4's `param_hash_check`, bit by bit: CRC-32 from 0, not inverted, over each name and its 4 bytes."""
    crc = 0
    for name in sorted(rig.table.names):
        for byte in name.encode() + struct.pack("<f", rig.table[name]):
            crc ^= byte
            for _ in range(8):
                crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    return crc


def hash_in(received) -> int:
    """The hash in the frame of a PARAM_VALUE, by its bits."""
    assert received.message.param_type == m.MAV_PARAM_TYPE_UINT32
    assert (received.message.param_id, received.message.param_index) == (HASH_NAME, 65535)
    return struct.unpack("<I", payload_of(received.frame)[:4])[0]


def test_the_list_is_whole_in_order_and_real32(rig):
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    got = listed(rig)
    assert [x.param_id for x in got] == list(rig.table.names)
    assert [x.param_index for x in got] == list(range(len(rig.table)))
    assert {x.param_count for x in got} == {len(rig.table)}
    assert {x.param_type for x in got} == {REAL32}


def hashes(received):
    return [hash_in(r) for r in received if getattr(r.message, "param_id", "") == HASH_NAME]


def test_a_list_begins_with_the_hash_that_px4_would_send(rig):
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    first, *rest = [r for r in rig.run(200_000) if r.message.get_type() == "PARAM_VALUE"]
    assert hash_in(first) == px4_hash(rig)
    assert first.message.param_count == len(rest) == len(rig.table)


def test_the_hash_is_that_of_the_values_in_force_to_the_bit(rig):
    # hundreds of values, so that some hashes are signalling NaN, which conversion to a float would change
    seen = set()
    for step in range(600):
        rig.table.set("LOAD_MASS", 0.1 + step * 1e-4)
        rig.poll()
        rig.send(read(HASH_NAME.encode()))
        (number,) = hashes(rig.poll()["gcs"])
        assert number == px4_hash(rig)
        seen.add(number)
    assert len(seen) == 600
    assert any(number >> 22 & 0x1FF == 0x1FE and number & 0x3FFFFF for number in seen)  # a signalling NaN


def test_a_ground_station_that_has_these_parameters_ends_the_list(rig):
    rig.poll()
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    rig.poll()
    rig.send(set_(HASH_NAME.encode(), 1.0, m.MAV_PARAM_TYPE_UINT32))
    out = rig.run(200_000)
    assert not [r for r in out if r.message.get_type() in ("PARAM_VALUE", "PARAM_ERROR", "STATUSTEXT")]
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    assert len(listed(rig)) == len(rig.table)


@pytest.mark.parametrize("flavour", [ARDUPILOT, GENERIC], ids=["ardupilot", "generic"])
def test_only_px4_has_a_hash(rig_with, flavour):
    rig = rig_with(identity=Identity(flavour=flavour))
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    assert HASH_NAME not in {x.param_id for x in told(rig)}
    for ask in (read(HASH_NAME.encode()), set_(HASH_NAME.encode(), 1.0)):
        assert errors(rig.replies(ask)) == [(HASH_NAME, DOES_NOT_EXIST)]


def test_the_list_is_paced_and_only_for_the_asker(rig):
    rig.endpoint.add_link("api")
    rig.run(8000)
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    names = []
    for _ in range(4):
        out = rig.poll()
        assert not values(r.message for r in out.get("api", []))
        names.append(len(values(r.message for r in out.get("gcs", []))))
    per_tick = 4000 // LIST_INTERVAL_US
    assert names[0] <= per_tick
    assert names[:3] == [1, per_tick, per_tick]  # the hash and 4


def test_a_second_request_begins_again(rig):
    rig.poll()
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    rig.poll()
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    assert [x.param_index for x in listed(rig)] == [0, 1, 2, 3]


@pytest.mark.parametrize("index", range(4))
def test_a_gap_is_filled_by_index(rig, index):
    name = rig.table.names[index]
    ((got, _, place),) = values(rig.replies(read(index=index)))
    assert (got, place) == (name, index)


@pytest.mark.parametrize("name", [b"LOAD_MASS", b"SIXTEEN_LETTERS1"])
def test_read_by_name(rig, name):
    ((got, value, _),) = values(rig.replies(read(name)))
    assert got == name.decode()
    assert value == pytest.approx(rig.table[got], rel=1e-7)  # float32


@pytest.mark.parametrize(
    "ask",
    [read(b"NONE"), read(index=4), read(index=-2), read(b""), read(b"\xff\x80"), set_(b"NONE", 1.0)],
    ids=["name", "index", "negative", "empty", "not ascii", "set"],
)
def test_what_is_not_there_is_said_and_no_other_name_is_sent(rig, ask):
    replies = rig.replies(ask)
    assert values(replies) == []
    assert [error for _, error in errors(replies)] == [DOES_NOT_EXIST]


def test_set_is_echoed_to_all_and_kept_as_the_number_that_was_typed(rig):
    rig.endpoint.add_link("api")
    rig.poll()
    rig.send(set_(b"LOAD_MASS", 0.1))
    out = rig.poll()
    for link in ("gcs", "api"):
        ((name, _, index),) = values(r.message for r in out[link])
        assert (name, index) == ("LOAD_MASS", rig.table.index("LOAD_MASS"))
    assert rig.table["LOAD_MASS"] == 0.1
    assert rig.events == [ParameterChanged("LOAD_MASS", 0.1)]


def test_setting_what_is_already_so_is_echoed_but_is_no_change(rig):
    assert values(rig.replies(set_(b"MIS_TAKEOFF_ALT", 2.0))) == [
        ("MIS_TAKEOFF_ALT", 2.0, rig.table.index("MIS_TAKEOFF_ALT"))
    ]
    assert rig.events == []


@pytest.mark.parametrize(
    ("name", "value", "kind", "error"),
    [
        (b"LOAD_MASS", math.nan, REAL32, OUT_OF_RANGE),
        (b"LOAD_MASS", math.inf, REAL32, OUT_OF_RANGE),
        (b"LOAD_MASS", 2.0, REAL32, OUT_OF_RANGE),
        (b"CTRL_RATE_HZ", 250.5, REAL32, OUT_OF_RANGE),
        (b"CTRL_RATE_HZ", 500.0, REAL32, READ_ONLY),
        (b"LOAD_MASS", 0.2, m.MAV_PARAM_TYPE_INT32, TYPE_MISMATCH),
    ],
)
def test_a_refused_value_is_answered_with_reason_and_value_in_force(rig, name, value, kind, error):
    rig.table.freeze()
    before = rig.table.values()
    replies = rig.replies(set_(name, value, kind))
    assert errors(replies) == [(name.decode(), error)]
    ((echoed, stored, _),) = values(replies)
    assert echoed == name.decode()
    assert stored == pytest.approx(before[echoed], rel=1e-7)  # float32
    assert name.decode() in "".join(x.text for x in replies if x.get_type() == "STATUSTEXT")
    assert rig.table.values() == before
    assert rig.events == []


def test_a_change_by_the_vehicle_itself_is_shown(rig):
    rig.table.set("LOAD_MASS", 0.2)
    rig.poll()
    rig.endpoint.parameter_changed("LOAD_MASS")
    assert [name for name, *_ in values(r.message for r in rig.poll()["gcs"])] == ["LOAD_MASS"]


def test_a_list_under_way_ends_with_its_link(rig):
    service = ParameterService(rig.table)
    service.receive_request_list(None, Peer("late", 255, 190), 0, rig.decide)
    assert service.next_timer() == 0
    service.forget("late")
    assert service.next_timer() == NEVER_US
    assert service.poll(10**9) == []


def integer_service(bytewise: bool):
    table = ParameterTable(
        [
            Parameter("WHOLE", 3.0, -1000.0, 100_000.0, "", "A count", integer=True),
            Parameter("LOAD_MASS", 0.1, 0.01, 1.0, "kg", "Believed mass of the load"),
        ]
    )
    return ParameterService(table, ParameterEncoding(True, bytewise))


def bits(number: int) -> float:
    """The float whose bits are those of the INT32."""
    return struct.unpack("<f", struct.pack("<i", number))[0]


@pytest.mark.parametrize("bytewise", [True, False])
@pytest.mark.parametrize("number", [-1000, -1, 0, 1, 7, 100_000])
def test_whole_numbers_travel_as_int32(number: int, bytewise: bool) -> None:
    service = integer_service(bytewise)
    carried = bits(number) if bytewise else float(number)
    service.receive_set(set_(b"WHOLE", carried, INT32), Peer("gcs", 255, 190), 0, lambda request: None)
    assert service.table["WHOLE"] == number
    value = service.value_message("WHOLE")
    assert value.param_type == INT32
    assert struct.pack("<f", value.param_value) == struct.pack("<f", carried)
    assert service.value_message("LOAD_MASS").param_type == REAL32


def test_a_real_number_for_a_whole_one_is_taken_if_it_is_whole(rig):
    service, peer = integer_service(bytewise=True), Peer("gcs", 255, 190)
    service.receive_set(set_(b"WHOLE", 5.0), peer, 0, rig.decide)
    assert service.table["WHOLE"] == 5.0
    service.receive_set(set_(b"WHOLE", 5.5), peer, 0, rig.decide)
    service.receive_set(set_(b"LOAD_MASS", bits(1), INT32), peer, 0, rig.decide)
    assert (service.table["WHOLE"], service.table["LOAD_MASS"]) == (5.0, 0.1)


def test_what_the_simulator_is_asked_for_is_answered_when_it_has_said_what_holds(rig):
    rig.table.add_remote(Parameter("SIM_WIND_E", 0.5, -1e9, 1e9, "", ""))
    assert rig.replies(set_(b"SIM_WIND_E", 500.0)) == []
    assert rig.events == [SimulatorParameterRequested("SIM_WIND_E", 500.0)]
    assert rig.table["SIM_WIND_E"] == 0.5
    for value, shown in ((2e9, "2e+09"), (math.nan, "nan")):
        refusal = rig.replies(set_(b"SIM_WIND_E", value))
        assert {x.get_type() for x in refusal} == {"STATUSTEXT", "PARAM_ERROR", "PARAM_VALUE"}
        told = "".join(x.text for x in refusal if x.get_type() == "STATUSTEXT")
        assert told == f"SIM_WIND_E = {shown}; must be a number in its range, which the simulator knows"
    rig.table.set("SIM_WIND_E", 3.0)
    rig.send(m.MAVLink_command_long_message(1, 1, m.MAV_CMD_PREFLIGHT_STORAGE, 0, 2, *(0.0,) * 6))
    assert SimulatorParameterRequested("SIM_WIND_E", 0.5) in rig.events
    assert rig.table["SIM_WIND_E"] == 3.0


def test_nothing_is_set_in_a_simulator_that_is_silent(rig):
    rig.table.add_remote(Parameter("SIM_WIND_E", 0.5, -1e9, 1e9, "", ""))
    rig.endpoint.set_simulator_silent(True)
    told = {x.get_type(): x for x in rig.replies(set_(b"SIM_WIND_E", 3.0))}
    assert told["PARAM_ERROR"].error == m.MAV_PARAM_ERROR_COMPONENT_NOT_FOUND
    assert told["PARAM_VALUE"].param_value == 0.5
    assert told["STATUSTEXT"].text == "SIM_WIND_E not set: the simulator is silent"
    assert rig.events == []
    rig.endpoint.set_simulator_silent(False)
    rig.send(set_(b"SIM_WIND_E", 3.0))
    assert rig.events == [SimulatorParameterRequested("SIM_WIND_E", 3.0)]


def test_a_list_waits_until_the_table_is_complete(rig):
    """A client that fetches it while parameters are being added would keep only those of the first count."""
    rig.endpoint.expect_parameters()
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    assert not [r for r in rig.run(500_000) if r.message.get_type() == "PARAM_VALUE"]
    rig.table.add_remote(Parameter("SIM_WIND_E", 0.0, -100.0, 100.0, "", ""))
    rig.endpoint.parameters_complete(rig.now_us)
    got = listed(rig)
    assert [x.param_id for x in got] == list(rig.table.names)
    assert {x.param_count for x in got} == {len(rig.table.names)}


def test_what_describes_the_vehicle_is_changed_only_if_the_supervisor_agrees() -> None:
    peer = Peer("gcs", 255, 190)
    table = ParameterTable([Parameter("VEH_LEN", 1.0, 0.1, 9.0, "m", "Length", disarmed=True)])
    service, asked = ParameterService(table), []

    def refuse(request):
        asked.append(request)
        return Verdict(m.MAV_RESULT_DENIED, "VEH_LEN not set: armed")

    text, error, value = service.receive_set(set_(b"VEH_LEN", 2.0), peer, 0, refuse)
    assert (text.text, error.message.error, value.message.param_value) == (
        "VEH_LEN not set: armed",
        READ_ONLY,
        1.0,
    )
    assert asked == [ChangeVehicle("VEH_LEN")] and table["VEH_LEN"] == 1.0
    (same,) = service.receive_set(set_(b"VEH_LEN", 1.0), peer, 0, refuse)  # the value that it has
    assert same.message.param_value == 1.0
    changed = service.receive_set(set_(b"VEH_LEN", 2.0), peer, 0, lambda request: Verdict(0))
    assert changed[-1] == ParameterChanged("VEH_LEN", 2.0)
