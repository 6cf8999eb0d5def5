"""A service that fails, for whatever reason, stops nothing: the sender is answered, a text is sent to all."""

from __future__ import annotations

from typing import Any

import pytest

from autopilot.services.faults import REPORT_INTERVAL_US
from autopilot.services.ftp import Op, Packet, packet_of, payload_of
from autopilot.services.records import ServiceFailed
from autopilot.wire.dialect import plumbline as mavlink

COMMAND = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, *[0.0] * 7)
COUNT = mavlink.MAVLink_mission_count_message(1, 1, 3)
FTP = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, list(payload_of(Packet(5, 0, Op.LIST, 1))))


def broken(*_: Any) -> Any:
    raise RecursionError("too deep")


@pytest.mark.parametrize("message", [COMMAND, COUNT, FTP], ids=lambda message: message.get_type())
def test_the_asker_is_answered_and_the_operators_are_told(rig: Any, message: Any) -> None:
    rig.endpoint.handlers[message.get_msgId()] = broken
    replies = rig.replies(message)
    answers = [reply for reply in replies if reply.get_type() != "STATUSTEXT"]
    texts = "".join(reply.text for reply in replies if reply.get_type() == "STATUSTEXT")
    assert texts == f"Internal error in {message.get_type()}: RecursionError; the flight continues"
    (answer,) = answers
    match answer.get_type():
        case "COMMAND_ACK":
            assert (answer.command, answer.result) == (COMMAND.command, mavlink.MAV_RESULT_FAILED)
        case "MISSION_ACK":
            assert answer.type == mavlink.MAV_MISSION_ERROR
        case _:
            packet = packet_of(bytes(answer.payload))
            assert (packet.seq, packet.opcode) == (6, Op.NAK)
    (event,) = rig.events
    assert isinstance(event, ServiceFailed)
    assert "too deep" in event.trace


def test_one_that_fails_at_every_tick_is_told_of_now_and_then(rig: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr("autopilot.services.missions.MissionService.poll", broken)
    monkeypatch.setattr("autopilot.services.missions.MissionService.next_timer", lambda _: 0)
    rig.endpoint.add_link("gcs")
    out = rig.run(2 * REPORT_INTERVAL_US)
    texts = [r.message.text for r in out if r.message.get_type() == "STATUSTEXT" and r.message.chunk_seq == 0]
    assert len(texts) == 2
    assert [r for r in out if r.message.get_type() == "HEARTBEAT"], "telemetry goes on"


def test_messages_without_an_answer_are_only_told_of(rig: Any) -> None:
    rig.endpoint.handlers[mavlink.MAVLINK_MSG_ID_TIMESYNC] = broken
    replies = rig.replies(mavlink.MAVLink_timesync_message(0, 1))
    assert {reply.get_type() for reply in replies} == {"STATUSTEXT"}
