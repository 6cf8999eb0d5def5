"""What was requested of the vehicle, read from a log: the uploaded mission, and parameters."""

from __future__ import annotations

import math

from autopilot.wire.codec import Received
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.records import WireItem
from autopilot.wire.parameter_encoding import decode_parameter_value

SETUP_MESSAGES = (
    mavlink.MAVLINK_MSG_ID_MISSION_COUNT,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION,
)


class VehicleSetup:
    """Collects messages of the kinds `SETUP_MESSAGES` from all senders, in the order of the log; `system`:
    the system id of the vehicle."""

    def __init__(self, system: int) -> None:
        self._system = system
        self.parameters: dict[str, float] = {}
        self.home = Home()  # the reference of the items' positions
        self._items: dict[int, WireItem] = {}
        self._count = 0

    def receive(self, received: Received) -> None:
        """Process one message. A parameter or home of another system, and a value that is not finite, are
        ignored."""
        message = received.message
        if received.id == mavlink.MAVLINK_MSG_ID_PARAM_VALUE:
            value = decode_parameter_value(message.param_value, message.param_type)
            if received.system == self._system and math.isfinite(value):
                self.parameters[message.param_id] = value
        elif received.id == mavlink.MAVLINK_MSG_ID_HOME_POSITION:
            if received.system == self._system:
                self.home = Home(1e-7 * message.latitude, 1e-7 * message.longitude, 1e-3 * message.altitude)
        elif message.mission_type == mavlink.MAV_MISSION_TYPE_MISSION:
            self._receive_mission(received)

    def _receive_mission(self, received: Received) -> None:
        message = received.message
        if received.id == mavlink.MAVLINK_MSG_ID_MISSION_COUNT:
            self._items, self._count = {}, message.count
        elif message.seq < self._count:
            self._items[message.seq] = WireItem(*(getattr(message, name) for name in WireItem._fields))

    @property
    def mission(self) -> tuple[WireItem, ...]:
        """The items of the last transfer, upload or download; empty unless all were received."""
        if len(self._items) != self._count:
            return ()
        return tuple(self._items[seq] for seq in range(self._count))
