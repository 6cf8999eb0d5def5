"""A flight by an autopilot that knows of no load: find it, upload, arm, fly and land, judged by its messages.

Unlike Plumbline's autopilot, it reports no phases: EXTENDED_SYS_STATE says whether it flies, MISSION_CURRENT
says at which item it is, and only the simulator knows about the load.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from gcs.clients import command
from gcs.clients.connection import LINK_TIMEOUT_US
from gcs.clients.flight import FlightClient, Stage, StageRow
from gcs.clients.missions import MissionUpload
from gcs.clients.operation import Operation, Target
from gcs.clients.repeated_operation import RepeatedOperation

READY_LIMIT_US = 120_000_000  # its estimator settles for half a minute of its own time
RETRY_PAUSE_US = 500_000  # after a refusal: it answers, and may report that it is ready, before it is
_STREAMS_US = {
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 50_000,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 100_000,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 200_000,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 500_000,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 20_000,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 40_000,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 200_000,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 50_000,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 1_000_000,
}
_FLYING = (
    mavlink.MAV_LANDED_STATE_IN_AIR,
    mavlink.MAV_LANDED_STATE_TAKEOFF,
    mavlink.MAV_LANDED_STATE_LANDING,
)
_WATCHED = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED,
    }
)


@dataclass(frozen=True)
class Firmware:
    """What distinguishes one third-party autopilot from others."""

    title: str
    item_0_is_home: bool  # item 0 of a mission is home
    accepts_low_takeoff: bool  # accepts a take-off to less than the length of the cable
    reports_ready: bool  # reports readiness by the pre-arm bit of SYS_STATUS
    before_arming: Callable[[Target], Operation]  # the mode in which it is armed


def _guided(target: Target) -> Operation:
    return command.set_mode(target, "guided", 4, 0, armed=False)


def _hold(target: Target) -> Operation:
    return command.set_mode(target, "hold", 4, 3, armed=False)


ARDUPILOT = Firmware("ArduPilot", True, True, True, _guided)
PX4 = Firmware("PX4", False, False, False, _hold)
FIRMWARES = {"ardupilot": ARDUPILOT, "px4": PX4}


class FirmwareFlight(FlightClient):
    """Flies `items`, which begin with a take-off and end with a landing, with a third-party firmware."""

    def __init__(
        self,
        firmware: Firmware,
        items: Sequence[WireItem],
        expected_s: float,
        limit_s: float | None = None,
        link_timeout_us: int = LINK_TIMEOUT_US,
    ) -> None:
        super().__init__(items, expected_s, limit_s, link_timeout_us)
        self._firmware = firmware

    @property
    def watched_messages(self) -> frozenset[int]:
        return _WATCHED

    def stage_row(self, stage: Stage) -> StageRow:
        row = super().stage_row(stage)
        match stage:
            case Stage.STREAMS:
                return replace(row, operations=_streams)
            case Stage.UPLOAD:
                return replace(row, operations=_upload)
            case Stage.READY:
                return replace(
                    row,
                    operations=self._set_arming_mode,
                    limit_us=READY_LIMIT_US if self._firmware.reports_ready else 0,
                )
            case Stage.ARM:
                return replace(row, operations=_arm)
            case Stage.START:
                return replace(row, operations=_start)
        return row

    def _set_arming_mode(self, client: FlightClient) -> list[Operation]:
        assert client.connection.target is not None
        return [self._firmware.before_arming(client.connection.target)]

    def _update_facts(self) -> None:
        view = self.view
        self._was_armed = self._was_armed or bool(view.armed)
        state = view.latest.get("EXTENDED_SYS_STATE")
        if state is not None and state.landed_state in _FLYING:
            self._was_airborne = True
        current, reached = view.latest.get("MISSION_CURRENT"), view.latest.get("MISSION_ITEM_REACHED")
        if not self._was_airborne:
            return
        self._item_flown = self._item()
        reported_items = [message.seq for message in (current, reached) if message is not None]
        if len(self.items) - 1 in reported_items:
            self._mission_over = True

    def _item(self) -> int:
        current = self.view.latest.get("MISSION_CURRENT")
        return int(current.seq) if current is not None else 0


def _upload(client: FlightClient) -> list[Operation]:
    assert client.connection.target is not None
    target = client.connection.target
    return [RepeatedOperation(lambda: MissionUpload(target, client.items), RETRY_PAUSE_US, READY_LIMIT_US)]


def _start(client: FlightClient) -> list[Operation]:
    """ArduPilot refuses a first item that is not 0."""
    assert client.connection.target is not None
    return [command.start_mission(client.connection.target)]


def _arm(client: FlightClient) -> list[Operation]:
    assert client.connection.target is not None
    target = client.connection.target
    return [RepeatedOperation(lambda: command.arm(target), RETRY_PAUSE_US, READY_LIMIT_US)]


def _streams(client: FlightClient) -> list[Operation]:
    assert client.connection.target is not None
    target = client.connection.target
    return [command.message_interval(target, kind, period) for kind, period in _STREAMS_US.items()]
