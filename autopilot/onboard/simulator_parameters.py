"""The simulator's SIM_* parameters, shown to ground stations as if they belonged to the autopilot.

They are learned over the simulator link once it is up. A ground station's PARAM_SET is passed on to the
simulator; the value that it then reports is in force, and is the answer. If it refuses a value, PARAM_ERROR
comes before the value in force, and is handed on to the client that sent the refused one. These parameters
describe a world, not the autopilot, and are stored only if PREFLIGHT_STORAGE requests it; then they are set
again in every simulator that connects.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from autopilot.services.records import Peer
from autopilot.wire.convert.simulator import SIMULATOR_COMPONENT
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_table import Parameter, ParameterTable, decimal_from_float32

FAILING_ROTORS = "SIM_ENGINE_FAIL"  # bit i: rotor i+1 fails
RETRY_US = 500_000
MAX_LIST_REQUESTS = 6  # requests, after which a silent simulator is assumed to have no parameters
_MAX_VALUE, _MAX_WHOLE = 1e9, 2.0**24


class SimulatorParameters:
    """The copy of the simulator's parameters in our table."""

    def __init__(self, table: ParameterTable) -> None:
        self._table = table
        self._received: set[str] = set()
        self._complete = False  # the simulator has reported all its parameters
        self._list_requests = 0
        self._next_list_request_us = 0
        self._restored: Mapping[str, float] = {}
        self._pending: dict[str, tuple[float, int]] = {}  # value, and when it is next sent
        self._clients: dict[str, Peer] = {}  # who requested the pending values

    def request(self, name: str, value: float, client: Peer | None = None) -> None:
        """Set a parameter in the simulator, for a client or for the vehicle itself."""
        self._pending[name] = (value, 0)
        self._clients.pop(name, None)
        if client is not None:
            self._clients[name] = client

    def client_of(self, name: str) -> Peer | None:
        """The client whose value of this parameter is still to be answered."""
        return self._clients.get(name)

    @property
    def unanswered(self) -> dict[str, float]:
        """The values to be set in the simulator that it has not answered yet."""
        return {name: value for name, (value, _) in self._pending.items()}

    def drop_unanswered(self) -> None:
        """Drop requested values that are not answered, since the client will have given up. Values to be
        restored are kept."""
        pending = self._pending.items()
        self._pending = {name: due for name, due in pending if self._restored.get(name) == due[0]}
        self._clients.clear()

    def restore(self, values: Mapping[str, float]) -> None:
        """Set these values in the simulator as soon as it has reported that it has these parameters."""
        self._restored = values

    def receive(self, message: Any) -> str | None:
        """Handle a message of the simulator. Returns the name of a parameter whose value is to be sent to the
        ground stations: it answers a request, or differs from the value sent before."""
        if message.get_msgId() != mavlink.MAVLINK_MSG_ID_PARAM_VALUE:
            return None
        name: str = message.param_id
        value = decimal_from_float32(message.param_value)
        self._received.add(name)
        self._complete = len(self._received) >= message.param_count
        was_requested = self._pending.get(name, (0.0, 0))[1] > 0  # else it answers an earlier request
        if was_requested:
            del self._pending[name]
            self._clients.pop(name, None)
        if name in self._table.remote_names:
            new = self._table[name] != value
            if new:
                self._table.set(name, value)
            return name if new or was_requested else None
        whole = message.param_type == mavlink.MAV_PARAM_TYPE_INT32 and value.is_integer()
        limit = _MAX_WHOLE if whole else _MAX_VALUE
        if name in self._table or not name.startswith("SIM_") or not abs(value) <= limit:
            return None
        text = "Of the simulator, which knows its range"
        self._table.add_remote(Parameter(name, value, -limit, limit, "", text, integer=whole))
        saved = self._restored.get(name, value)
        if saved != value:
            self._pending[name] = (saved, 0)
        return None

    @property
    def has_messages(self) -> bool:
        """Whether there is, or may soon be, anything to send to the simulator."""
        return bool(self._pending) or not (self._complete or self._list_requests >= MAX_LIST_REQUESTS)

    def is_settled(self, now_us: int) -> bool:
        """Whether all parameters are known, or the simulator has had enough time to report them."""
        return self._complete or (
            self._list_requests == MAX_LIST_REQUESTS and now_us >= self._next_list_request_us
        )

    def messages(self, now_us: int) -> list[Any]:
        """Messages to the simulator besides the answer to this tick."""
        messages: list[Any] = []
        if (
            not self._complete
            and self._list_requests < MAX_LIST_REQUESTS
            and now_us >= self._next_list_request_us
        ):
            self._list_requests += 1
            self._next_list_request_us = now_us + RETRY_US
            messages.append(mavlink.MAVLink_param_request_list_message(1, SIMULATOR_COMPONENT))
        for name, (value, send_us) in self._pending.items():
            if now_us >= send_us:
                self._pending[name] = (value, now_us + RETRY_US)
                messages.append(
                    mavlink.MAVLink_param_set_message(
                        1, SIMULATOR_COMPONENT, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
                    )
                )
        return messages
