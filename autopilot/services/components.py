"""The components of the vehicle beside the autopilot: each answers what it is asked, under its own id.

The winch does DO_WINCH. Each tells, when it is asked, what it sends anyway; it has no parameters, files and
missions, and says so.
"""

from __future__ import annotations

from typing import Any

from autopilot.services.commands import CommandService
from autopilot.services.identity import WINCH_COMPONENT
from autopilot.services.parameter_protocol import no_such_parameter
from autopilot.services.records import Decide, Output, Peer
from autopilot.services.refusals import refusals
from autopilot.wire.dialect import plumbline as mavlink

_LONG, _INT = mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_COMMAND_INT
_OF_ALL = frozenset(
    {
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
    }
)
_OF: dict[int | None, frozenset[int]] = {WINCH_COMPONENT: _OF_ALL | {mavlink.MAV_CMD_DO_WINCH}}


class ComponentService:
    """Messages to a component that is not the autopilot."""

    def __init__(self, commands: CommandService) -> None:
        self._commands = commands

    def receive(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """Do what the component does, refuse what it does not."""
        kind = message.get_msgId()
        component = None if peer.addressed is None else peer.addressed[1]
        if kind in (_LONG, _INT) and message.command in _OF.get(component, _OF_ALL):
            do = self._commands.receive_long if kind == _LONG else self._commands.receive_int
            return do(message, peer, now_us, decide)
        if kind == mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ:
            return [no_such_parameter(message.param_id, message.param_index, peer)]
        if kind == mavlink.MAVLINK_MSG_ID_PARAM_SET:
            return [no_such_parameter(message.param_id, -1, peer)]
        return refusals(message, peer, mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_MISSION_UNSUPPORTED)
