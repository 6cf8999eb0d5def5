"""The SIM_* parameters on the simulator link: listed and set by the autopilot, which shows them as its own.

The parameter protocol in its simplest form: PARAM_REQUEST_LIST and PARAM_SET arrive with the answer to a
tick, PARAM_VALUE is sent with the sensors, a few with each tick. Before the value that stays in force where
another one was refused come a STATUSTEXT and PARAM_ERROR.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_encoding import encode_parameter_value
from autopilot.wire.parameter_table import ParameterError, ParameterTable, decimal_from_float32
from autopilot.wire.statustext import TextWriter
from sitl.messages import VEHICLE_SYSTEM

VALUES_PER_TICK = 4


class ParameterServer:
    """Serves one table to one client."""

    def __init__(self, table: ParameterTable) -> None:
        self.table = table
        self._outgoing: deque[Any] = deque()
        self._texts = TextWriter()

    def receive(self, message: Any) -> bool:
        """Process a message; True if it changed a value."""
        match message.get_msgId():
            case mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST:
                self._outgoing.clear()
                self._outgoing.extend(self._value(name) for name in self.table.names)
            case mavlink.MAVLINK_MSG_ID_PARAM_SET if message.param_id in self.table:
                return self._set(message.param_id, decimal_from_float32(message.param_value))
        return False

    @property
    def has_messages(self) -> bool:
        """Whether a message waits to be sent."""
        return bool(self._outgoing)

    def pop_messages(self) -> list[Any]:
        """The messages that are sent with this tick."""
        outgoing = self._outgoing
        return [outgoing.popleft() for _ in range(min(VALUES_PER_TICK, len(outgoing)))] if outgoing else []

    def set_and_report(self, name: str, value: float) -> None:
        """Change a value on the simulator's side, and report it."""
        self.table.set(name, value)
        self._outgoing.append(self._value(name))

    def send_text(self, text: str, severity: int = mavlink.MAV_SEVERITY_WARNING) -> None:
        """Send a text to the operators of the vehicle."""
        self._outgoing.extend(self._texts.messages(severity, text))

    def _set(self, name: str, value: float) -> bool:
        previous = self.table[name]
        try:
            self.table.set(name, value)
        except ParameterError as error:
            self.send_text(str(error))
            self._outgoing.append(self._error(name, value))
        self._outgoing.append(self._value(name))
        return self.table[name] != previous

    def _error(self, name: str, value: float) -> Any:
        """PARAM_ERROR for a value that was refused: out of range, or fixed while the simulator runs."""
        error = mavlink.MAV_PARAM_ERROR_READ_ONLY
        try:
            self.table.describe(name).checked(value)
        except ParameterError:
            error = mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
        return mavlink.MAVLink_param_error_message(
            VEHICLE_SYSTEM, mavlink.MAV_COMP_ID_AUTOPILOT1, name.encode(), self.table.index(name), error
        )

    def _value(self, name: str) -> Any:
        return mavlink.MAVLink_param_value_message(
            name.encode(),
            *encode_parameter_value(self.table[name], self.table.describe(name).integer, bytewise=False),
            len(self.table.names),
            self.table.index(name),
        )
