"""Links, addresses, datagrams, texts and small requests."""

from __future__ import annotations

import math

import pytest

from autopilot.services.endpoint import LINK_REPLACEMENT_US, LINK_SILENCE_US, MAX_LINKS, VehicleEndpoint
from autopilot.services.identity import (
    AUTO,
    AUTO_MISSION,
    DIALECT_COMPONENT,
    LOAD_COMPONENT,
    WINCH_COMPONENT,
    Identity,
)
from autopilot.services.links import DATAGRAM_BYTES
from autopilot.services.records import TimesyncAnswered, Verdict
from autopilot.services.snapshot import SensorReadings, Snapshot
from autopilot.services.streams import OFF
from autopilot.services.telemetry import STREAMS
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.parameter_table import Parameter, ParameterTable
from autopilot.wire.statustext import CHUNK

GCS_BEAT = m.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def types(received):
    return [r.message.get_type() for r in received]


ALL_THERE = {
    "x_quad_d": (0.0, 0.0, 1.0),
    "wind": (1.0, 0.0, 0.0),
    "readings": SensorReadings((0.0,) * 3, (0.0, 0.0, 9.81), (0.0,) * 3, 1e5, 0.0, 15.0, 0, 0),
    "built_in": ((0.0, 0.0, 1.0), (0.1, 0.0, 0.0), (0.0, 0.0, 1.7)),
}


# ---- streams over links


def test_a_configured_link_hears_from_the_first_tick(rig):
    assert "HEARTBEAT" in types(rig.poll()["gcs"])


def test_default_rates_over_ten_seconds(rig):
    rig.changes = ALL_THERE
    rig.run(1_000_000 - 4000)  # up to the tick before a whole second: each multiple is counted once
    rig.poll()
    counts: dict[int, int] = {}
    for received in rig.run(10_000_000):
        key = received.message.get_msgId()
        counts[key] = counts.get(key, 0) + 1
    per_poll = {m.MAVLINK_MSG_ID_DEBUG_VECT: 4, m.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: 5}
    for message_id, stream in STREAMS.items():
        expected = 0 if stream.interval_us == OFF else 10_000_000 // stream.interval_us
        assert counts.get(message_id, 0) == expected * per_poll.get(message_id, 1), message_id


@pytest.mark.parametrize("configured", [True, False])
def test_a_link_to_a_program_has_what_programs_expect_besides(rig, configured):
    rig.changes = ALL_THERE
    if configured:
        rig.endpoint.add_link("api", program=True)
    else:
        ping = FrameWriter(245, 190).frame(m.MAVLink_ping_message(1, 1, 0, 0))
        rig.endpoint.receive(ping, "api", rig.now_us, rig.decide, program=True)
    rig.run(1_000_000 - 4000)
    rig.poll()
    heard = {"api": [], "gcs": []}
    for _ in range(250):
        for link, received in rig.poll().items():
            heard[link] += [r.message.get_msgId() for r in received]
    besides = {key: heard["api"].count(key) for key in set(heard["api"]) - set(heard["gcs"])}
    assert besides == {
        m.MAVLINK_MSG_ID_HIGHRES_IMU: 50,
        m.MAVLINK_MSG_ID_ODOMETRY: 30,
        m.MAVLINK_MSG_ID_ESC_STATUS: 5,
        m.MAVLINK_MSG_ID_ESC_INFO: 1,
    }


def test_every_stream_comes_when_it_is_asked_for(rig):
    rig.changes = ALL_THERE
    for message_id in STREAMS:
        rig.run(12_000)
        for off in STREAMS.keys() - {m.MAVLINK_MSG_ID_HEARTBEAT}:
            rig.send(m.MAVLink_command_long_message(1, 1, 511, 0, off, -1, 0, 0, 0, 0, 0))
        rig.run(12_000)
        rig.send(m.MAVLink_command_long_message(1, 1, 512, 0, message_id, 0, 0, 0, 0, 0, 0))
        heard = [r.message for r in rig.poll()["gcs"]]
        assert [x.result for x in heard if x.get_type() == "COMMAND_ACK"] == [0]
        assert message_id in [x.get_msgId() for x in heard]


def test_messages_of_the_dialect_come_from_their_own_component(rig):
    components = {r.message.get_msgId(): r.component for r in rig.run(1_000_000)}
    assert {c for i, c in components.items() if i >= 60000} == {DIALECT_COMPONENT}
    assert {c for i, c in components.items() if i < 60000} == {1, WINCH_COMPONENT}


def test_sequence_counters_run_by_link_and_component(rig):
    rig.endpoint.add_link("api")
    seen: dict[tuple[str, int], list[int]] = {}
    for _ in range(500):
        for link, received in rig.poll().items():
            for one in received:
                seen.setdefault((link, one.component), []).append(one.sequence)
    assert {component for _, component in seen} == {1, DIALECT_COMPONENT, WINCH_COMPONENT}
    assert len(seen) == 6
    for numbers in seen.values():
        assert numbers == [n % 256 for n in range(len(numbers))]


def test_datagrams_stay_below_the_mtu_and_hold_whole_frames(rig, snap):
    rig.send(m.MAVLink_param_request_list_message(1, 1))
    rig.endpoint.send_text(4, "x" * 3000)
    datagrams = rig.endpoint.poll(snap, 0)
    assert len(datagrams) > 1
    for _, datagram in datagrams:
        assert len(datagram) <= DATAGRAM_BYTES
        assert decode(datagram)[1] == 0


def test_nothing_is_asked_of_the_core_when_nothing_is_due(rig):
    rig.poll()

    def never():
        raise AssertionError("a snapshot was made for nothing")

    assert not rig.endpoint.is_due(rig.now_us)
    assert rig.endpoint.poll(never, rig.now_us) == []
    rig.endpoint.send_text(6, "only a text")
    assert len(rig.endpoint.poll(never, rig.now_us)) == 1


def test_the_load_as_a_system_of_its_own(rig_with):
    rig = rig_with(identity=Identity(load_system=2))
    own = [r for r in rig.run(1_000_000) if r.system == 2]
    assert {r.component for r in own} == {LOAD_COMPONENT}
    counts = {kind: types(own).count(kind) for kind in types(own)}
    assert counts == {"HEARTBEAT": 1, "GLOBAL_POSITION_INT": 5, "ATTITUDE": 5}


def test_without_it_there_is_one_system(rig):
    assert {r.system for r in rig.run(1_000_000)} == {1}


# ---- changes


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"armed": True}, "HEARTBEAT"),
        ({"main_mode": AUTO, "sub_mode": AUTO_MISSION}, "HEARTBEAT"),
        ({"system_status": m.MAV_STATE_EMERGENCY}, "HEARTBEAT"),
        ({"landed_state": m.MAV_LANDED_STATE_IN_AIR}, "EXTENDED_SYS_STATE"),
        ({"mission_state": m.MISSION_STATE_ACTIVE}, "MISSION_CURRENT"),
        ({"main_mode": AUTO, "sub_mode": AUTO_MISSION}, "MISSION_CURRENT"),
    ],
)
def test_a_change_is_told_within_two_ticks_of_the_fastest_stream(rig, change, message):
    rig.run(100_000)
    rig.changes = change
    assert message in types(rig.run(40_000))


def test_a_change_that_is_announced_is_told_at_once(rig):
    rig.poll()
    rig.changes = {"armed": True}
    rig.endpoint.state_changed()
    assert types(rig.poll()["gcs"]) == ["HEARTBEAT"]


# ---- links


def test_a_new_sender_gets_a_link_and_loses_it_in_silence(rig):
    rig.poll()
    rig.send(GCS_BEAT, link="late")
    assert types(rig.poll()["late"])[0] == "HEARTBEAT"
    rig.now_us += LINK_SILENCE_US
    rig.run(1_000_000)
    assert rig.endpoint.links == ("gcs",)


def test_a_link_stays_while_somebody_speaks(rig):
    for _ in range(4):
        rig.send(GCS_BEAT, link="late")
        rig.now_us += LINK_SILENCE_US // 2
        rig.poll()
    assert "late" in rig.endpoint.links


def test_garbage_makes_no_link(rig):
    rig.send_bytes(b"hello", link="scan")
    rig.send_bytes(b"", link="scan")
    assert rig.endpoint.links == ("gcs",)


def test_links_are_bounded_and_the_most_silent_makes_room(rig):
    for number in range(MAX_LINKS + 3):
        rig.send(GCS_BEAT, link=f"n{number}")
        rig.now_us += LINK_REPLACEMENT_US
    assert len(rig.endpoint.links) == MAX_LINKS + 1
    assert "gcs" in rig.endpoint.links
    assert "n0" not in rig.endpoint.links
    assert f"n{MAX_LINKS + 2}" in rig.endpoint.links


def test_a_crowd_of_newcomers_makes_room_one_by_one(rig):
    """A link is expensive to set up: a flood from many ports must not set up all of them at each tick."""
    for number in range(MAX_LINKS + 100):
        rig.send(GCS_BEAT, link=f"n{number}")
    first, last = f"n{MAX_LINKS}", f"n{MAX_LINKS + 99}"
    assert first in rig.endpoint.links
    assert last not in rig.endpoint.links
    arm = m.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    rig.send(arm, link=last)
    assert rig.asked == [], "nobody could be answered"
    rig.now_us += LINK_REPLACEMENT_US
    rig.send(arm, link=last)
    assert last in rig.endpoint.links
    assert rig.asked


def test_a_list_under_way_ends_with_its_link():
    many = ParameterTable([Parameter(f"P{n}", 0.0, 0.0, 1.0, "", "") for n in range(100)])
    endpoint = VehicleEndpoint(Identity(), Home(), many)
    ask = FrameWriter(255, 190).frame(m.MAVLink_param_request_list_message(1, 1))
    endpoint.receive(ask, "late", 0, lambda request: Verdict(m.MAV_RESULT_ACCEPTED))
    assert endpoint.is_due(0)
    assert endpoint.poll(Snapshot, LINK_SILENCE_US + 1) == []
    assert endpoint.links == ()
    assert not endpoint.is_due(2 * LINK_SILENCE_US)


@pytest.mark.parametrize("origin", [{"component": 1}, {"component": DIALECT_COMPONENT}])
def test_our_own_words_are_not_obeyed(rig, origin):
    arm = m.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    rig.send(arm, link="loop", system=1, **origin)
    assert rig.asked == []
    assert rig.endpoint.links == ("gcs",)


def test_a_companion_of_the_same_system_is_obeyed(rig):
    arm = m.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    assert types_of(rig.replies(arm, system=1, component=191)) == ["COMMAND_ACK"]


def types_of(messages):
    return [message.get_type() for message in messages]


def test_commands_survive_garbage_in_the_same_datagram(rig):
    writer = FrameWriter(255, 190)
    land = writer.frame(m.MAVLink_command_long_message(1, 1, 21, 0, 0, 0, 0, 0, 0, 0, 0))
    rig.send_bytes(b"\xfd\xff" + land + b"\xfd\xff\x00" + land[:-1])
    assert len(rig.asked) == 1


# ---- texts


@pytest.mark.parametrize("length", [0, 1, CHUNK, CHUNK + 1, 2 * CHUNK, 2 * CHUNK + 20, 700])
def test_texts_come_together_again(rig, length):
    text = "".join(chr(ord("a") + n % 26) for n in range(length))
    rig.poll()
    rig.endpoint.send_text(m.MAV_SEVERITY_WARNING, text)
    got = [r.message for r in rig.poll()["gcs"]]
    assert {x.severity for x in got} == {m.MAV_SEVERITY_WARNING}
    assert "".join(x.text for x in got) == text
    assert [x.chunk_seq for x in got] == list(range(len(got)))
    assert all(bool(x.id) == (length > CHUNK) for x in got)
    # a receiver takes a chunk that is not full for the end of the text
    assert len(got[-1].text) < CHUNK or length <= CHUNK


def test_two_long_texts_have_two_numbers(rig):
    rig.endpoint.send_text(6, "a" * 60)
    rig.endpoint.send_text(6, "b" * 60)
    got = [r.message for r in rig.poll()["gcs"] if r.message.get_type() == "STATUSTEXT"]
    assert len({(text.id, text.text[0]) for text in got}) == 2
    assert len({text.id for text in got}) == 2


def test_texts_are_one_line_of_ascii(rig):
    rig.poll()
    rig.endpoint.send_text(6, "Wind\n is 5 m/s \u2192 east")
    (got,) = rig.poll()["gcs"]
    assert got.message.text == "Wind is 5 m/s ? east"


# ---- small requests


def test_timesync_questions_are_answered_and_answers_are_events(rig):
    (answer,) = rig.replies(m.MAVLink_timesync_message(0, 12345))
    assert answer.ts1 == 12345
    assert answer.tc1 == (rig.now_us - 4000) * 1000
    assert rig.replies(m.MAVLink_timesync_message(99, 12345)) == []
    assert rig.events == [TimesyncAnswered("gcs", 99, 12345)]


def test_only_what_is_to_be_answered_is_work(rig):
    rig.poll()
    rig.send(m.MAVLink_timesync_message(99, 12345))
    before_all_streams_us = -1
    assert not rig.endpoint.is_due(before_all_streams_us)
    rig.send(m.MAVLink_timesync_message(0, 12345))
    assert rig.endpoint.is_due(before_all_streams_us)


def test_a_timesync_answer_at_boot_is_no_question(rig):
    rig.send(m.MAVLink_timesync_message(0, 5))
    (answer,) = [r.message for r in rig.poll()["gcs"] if r.message.get_type() == "TIMESYNC"]
    assert answer.tc1 != 0


def test_ping_comes_back_once(rig):
    (echo,) = rig.replies(m.MAVLink_ping_message(7, 3, 0, 0), system=245, component=9)
    assert (echo.time_usec, echo.seq, echo.target_system, echo.target_component) == (7, 3, 245, 9)
    assert rig.replies(m.MAVLink_ping_message(7, 3, 1, 1)) == []


@pytest.mark.parametrize(
    ("opcode", "answer", "code"),
    [(4, 129, 10), (3, 128, ord("D")), (15, 129, 4), (6, 129, 9), (1, 129, 4), (2, 128, 0), (77, 129, 7)],
)
def test_ftp_is_answered_at_once(rig, opcode, answer, code):
    payload = bytearray(251)
    payload[0:2] = b"\xff\xff"
    payload[2], payload[3] = 5, opcode
    ask = m.MAVLink_file_transfer_protocol_message(0, 1, 1, list(payload))
    (got,) = rig.replies(ask)
    assert (got.payload[0], got.payload[1]) == (0, 0)
    assert (got.payload[2], got.payload[3], got.payload[5], got.payload[12]) == (5, answer, opcode, code)
    assert (got.target_system, got.target_component) == (255, 190)


@pytest.mark.parametrize("opcode", [128, 129])
def test_ftp_answers_are_not_answered(rig, opcode):
    payload = [0] * 251
    payload[3] = opcode
    assert rig.replies(m.MAVLink_file_transfer_protocol_message(0, 1, 1, payload)) == []


def test_there_are_no_logs(rig):
    (entry,) = rig.replies(m.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    assert entry.num_logs == 0
    (data,) = rig.replies(m.MAVLink_log_request_data_message(1, 1, 3, 90, 9999))
    assert (data.id, data.ofs, data.count) == (3, 90, 0)


def test_a_message_out_of_turn_keeps_the_sequence(rig):
    before = rig.poll()["gcs"]
    last = max(r.sequence for r in before if r.component == 1)
    ((sync,), _) = decode(rig.endpoint.datagram("gcs", m.MAVLink_timesync_message(0, 1)))
    assert sync.sequence == last + 1
    assert next(r.sequence for r in rig.run(40_000) if r.component == 1) == last + 2


def test_a_diverged_flight_is_still_told(rig):
    rig.changes = {"e_x": (1e300, 0.0, 0.0), "x_quad": (math.nan,) * 3, "v_quad": (-1e300,) * 3}
    assert {"HEARTBEAT", "CASCADE_ERRORS", "GLOBAL_POSITION_INT"} <= set(types(rig.run(1_000_000)))
