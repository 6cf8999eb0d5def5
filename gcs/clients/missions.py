"""The mission protocol: upload, download, clear, on a link that loses, duplicates and reorders datagrams."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from gcs.clients.operation import GROUND, Result, Retry, Status, Target, is_addressed_to

RETRY_US = 300_000
SENDS = 12  # of one message; with 20 % lost each way, all twelve fail once in two hundred thousand
RESTARTS = 3  # of a whole upload
_MISSION = mavlink.MAV_MISSION_TYPE_MISSION
AREA_NAMES = {mavlink.MAV_MISSION_TYPE_FENCE: "fence", mavlink.MAV_MISSION_TYPE_RALLY: "rally points"}


def _result_text(result: int) -> str:
    entry = mavlink.enums["MAV_MISSION_RESULT"].get(result)
    if entry is None:
        return f"result {result}"
    return str(entry.name).removeprefix("MAV_MISSION_").replace("_", " ").lower()


def _is_ours(message: Any, kind: int = _MISSION) -> bool:
    return is_addressed_to(message, GROUND) and getattr(message, "mission_type", _MISSION) == kind


class MissionUpload:
    """Upload `items` to the vehicle: COUNT, one ITEM for each REQUEST, ACK.

    The vehicle leads: it requests the items that it lacks. The ground station sends unrequested messages only
    while the vehicle is silent: the count until an item is requested, later the last requested item, and if
    that does not help, the upload starts again.
    """

    def __init__(self, target: Target, items: Sequence[WireItem], kind: int = _MISSION) -> None:
        self.result: Result | None = None
        self._target = target
        self._items = tuple(items)
        self._kind = kind  # MAV_MISSION_TYPE
        self._name = AREA_NAMES.get(kind, "upload")
        self._requested: list[int] = []  # items requested and not yet sent
        self._last_requested: int | None = None
        self._next = 0  # items 0 ... next-1 were requested
        self._restarts = 0
        self._retry = Retry(RETRY_US, SENDS)

    @property
    def progress(self) -> tuple[int, int]:
        return self._next, len(self._items)

    def receive(self, message: Any, now_us: int) -> None:
        if self.result is not None or not self._retry.sent or not _is_ours(message, self._kind):
            return
        kind = message.get_msgId()
        if kind in (mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT, mavlink.MAVLINK_MSG_ID_MISSION_REQUEST):
            if message.seq < len(self._items):
                if message.seq not in self._requested:
                    self._requested.append(message.seq)
                self._last_requested = message.seq
                self._next = max(self._next, message.seq + 1)
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_ACK:
            self._acknowledged(message.type)

    def _acknowledged(self, result: int) -> None:
        if result == mavlink.MAV_MISSION_ACCEPTED:
            if self._next == len(self._items):  # else it belongs to an older transfer
                count = len(self._items)
                text = f"{self._name}: {count} item{'s' * (count != 1)} accepted"
                self.result = Result(Status.DONE, text)
        elif result == mavlink.MAV_MISSION_INVALID_SEQUENCE:
            return  # an item that came twice or too late; the vehicle requests again what it lacks
        elif result == mavlink.MAV_MISSION_OPERATION_CANCELLED:
            self._restart()
        elif result == mavlink.MAV_MISSION_ERROR and self._next and self._restarts < RESTARTS:
            self._restart()  # it has given the upload up, and the message that said so was lost
        else:
            where = f"item {self._next - 1}" if self._next else "the mission"
            text = f"{self._name}: {where} refused: {_result_text(result)}"
            self.result = Result(Status.REFUSED, text, self._name)

    def _restart(self) -> None:
        self._restarts += 1
        self._next = 0
        self._last_requested = None
        self._requested.clear()
        self._retry.restart()

    def poll(self, now_us: int) -> list[Any]:
        if self.result is not None:
            return []
        if self._requested:
            answers = [self._item(seq) for seq in self._requested]
            self._requested.clear()
            self._retry.restart()
            self._retry.record_sent(now_us)
            return answers
        if not self._retry.due(now_us):
            return []
        if self._retry.exhausted:
            if self._last_requested is None or self._restarts >= RESTARTS:
                text = f"{self._name}: no answer at item {self._next} of {len(self._items)}"
                self.result = Result(Status.UNANSWERED, text)
                return []
            self._restart()
        self._retry.record_sent(now_us)
        if self._last_requested is None:
            return [mavlink.MAVLink_mission_count_message(*self._target, len(self._items), self._kind)]
        return [self._item(self._last_requested)]

    def _item(self, seq: int) -> Any:
        """Item `seq` with its place in whole numbers, whichever request came: a float32 resolves it only to a
        metre."""
        item = self._items[seq]
        return mavlink.MAVLink_mission_item_int_message(
            *self._target,
            seq,
            item.frame,
            item.command,
            item.current,
            item.autocontinue,
            *(item.param1, item.param2, item.param3, item.param4),
            item.x,
            item.y,
            item.z,
            self._kind,
        )


class MissionDownload:
    """Download the mission: REQUEST_LIST, COUNT, a REQUEST_INT for each item, our ACK. `items` when done."""

    def __init__(self, target: Target, kind: int = _MISSION) -> None:
        self.result: Result | None = None
        self.items: list[WireItem] = []
        self.kind = kind  # MAV_MISSION_TYPE
        self._target = target
        self._count: int | None = None
        self._retry = Retry(RETRY_US, SENDS)
        self._ack_is_due = False

    @property
    def progress(self) -> tuple[int, int]:
        return len(self.items), self._count or 0

    def receive(self, message: Any, now_us: int) -> None:
        if self.result is not None or not self._retry.sent or not _is_ours(message, self.kind):
            return
        kind = message.get_msgId()
        if kind == mavlink.MAVLINK_MSG_ID_MISSION_COUNT and self._count is None:
            self._count = message.count
            self._retry.restart()
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT and message.seq == len(self.items):
            if self._count is None:
                return
            self.items.append(
                WireItem(
                    message.frame,
                    message.command,
                    message.current,
                    message.autocontinue,
                    message.param1,
                    message.param2,
                    message.param3,
                    message.param4,
                    message.x,
                    message.y,
                    message.z,
                )
            )
            self._retry.restart()
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_ACK and message.type not in (
            mavlink.MAV_MISSION_ACCEPTED,
            mavlink.MAV_MISSION_INVALID_SEQUENCE,
        ):
            self.result = Result(Status.REFUSED, f"download: refused: {_result_text(message.type)}")
        if self.result is None and self._count is not None and len(self.items) == self._count:
            self.result = Result(Status.DONE, f"download: {self._count} items")
            self._ack_is_due = True

    def poll(self, now_us: int) -> list[Any]:
        if self._ack_is_due:
            self._ack_is_due = False
            return [
                mavlink.MAVLink_mission_ack_message(*self._target, mavlink.MAV_MISSION_ACCEPTED, self.kind)
            ]
        if self.result is not None or not self._retry.due(now_us):
            return []
        if self._retry.exhausted:
            total = "?" if self._count is None else self._count
            self.result = Result(
                Status.UNANSWERED, f"download: no answer at item {len(self.items)} of {total}"
            )
            return []
        self._retry.record_sent(now_us)
        if self._count is None:
            return [mavlink.MAVLink_mission_request_list_message(*self._target, self.kind)]
        return [mavlink.MAVLink_mission_request_int_message(*self._target, len(self.items), self.kind)]


class MissionClear:
    """Delete the mission on the vehicle."""

    def __init__(self, target: Target) -> None:
        self.result: Result | None = None
        self._target = target
        self._retry = Retry(RETRY_US, SENDS)

    @property
    def progress(self) -> tuple[int, int]:
        return 0, 0

    def receive(self, message: Any, now_us: int) -> None:
        if self.result is not None or not self._retry.sent or not _is_ours(message):
            return
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_MISSION_ACK:
            accepted = message.type == mavlink.MAV_MISSION_ACCEPTED
            text = "clear: accepted" if accepted else f"clear: refused: {_result_text(message.type)}"
            self.result = Result(Status.DONE if accepted else Status.REFUSED, text, "clear")

    def poll(self, now_us: int) -> list[Any]:
        if self.result is not None or not self._retry.due(now_us):
            return []
        if self._retry.exhausted:
            self.result = Result(Status.UNANSWERED, f"clear: no answer after {self._retry.sends} tries")
            return []
        self._retry.record_sent(now_us)
        return [mavlink.MAVLink_mission_clear_all_message(*self._target, _MISSION)]
