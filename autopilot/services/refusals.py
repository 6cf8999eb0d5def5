"""Refusals of messages, each in the form of its protocol, so that no client waits for an answer."""

from __future__ import annotations

from typing import Any

from autopilot.services.ftp import refusal_of
from autopilot.services.records import Output, Peer, Send
from autopilot.wire.dialect import plumbline as mavlink


def refusals(message: Any, peer: Peer, result: int, mission_result: int) -> list[Output]:
    """The answer with a MAV_RESULT or a MAV_MISSION_RESULT; empty if the protocol has no such answer."""
    system, component = peer.system, peer.component
    match message.get_msgId():
        case mavlink.MAVLINK_MSG_ID_COMMAND_LONG | mavlink.MAVLINK_MSG_ID_COMMAND_INT:
            answer: Any = mavlink.MAVLink_command_ack_message(
                message.command, result, 0, 0, system, component
            )
        case (
            mavlink.MAVLINK_MSG_ID_MISSION_COUNT
            | mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT
            | mavlink.MAVLINK_MSG_ID_MISSION_ITEM
            | mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST
            | mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL
        ):
            kind = message.mission_type
            answer = mavlink.MAVLink_mission_ack_message(system, component, mission_result, kind)
        case mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
            answer = refusal_of(message, peer)
        case _:
            return []
    return [Send(peer.link, answer, peer.addressed)]
