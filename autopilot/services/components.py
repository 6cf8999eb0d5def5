"""The components of the vehicle other than the autopilot: each answers requests under its own id.

The winch executes DO_WINCH. Each component serves requests for the messages that it sends; it refuses
requests for parameters, files and missions, since it has none.
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
_COMMON_COMMANDS = frozenset(
    {
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
    }
)
_COMMANDS_BY_COMPONENT: dict[int | None, frozenset[int]] = {
    WINCH_COMPONENT: _COMMON_COMMANDS | {mavlink.MAV_CMD_DO_WINCH}
}


class ComponentService:
    """Handles messages to a component other than the autopilot."""

    def __init__(self, commands: CommandService) -> None:
        self._commands = commands

    def receive(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """Execute what the component offers, and refuse everything else."""
        kind = message.get_msgId()
        component = None if peer.addressed is None else peer.addressed[1]
        if kind in (_LONG, _INT) and message.command in _COMMANDS_BY_COMPONENT.get(
            component, _COMMON_COMMANDS
        ):
            receive_command = self._commands.receive_long if kind == _LONG else self._commands.receive_int
            return receive_command(message, peer, now_us, decide)
        if kind == mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ:
            return [no_such_parameter(message.param_id, message.param_index, peer)]
        if kind == mavlink.MAVLINK_MSG_ID_PARAM_SET:
            return [no_such_parameter(message.param_id, -1, peer)]
        return refusals(message, peer, mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_MISSION_UNSUPPORTED)
