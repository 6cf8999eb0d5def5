"""The parameter protocol: read the whole list and fill its gaps, read one by name, set one and verify it.

A value is sent as the float32 nearest to the typed number, also if the vehicle sends it as an INT32.
"""

from __future__ import annotations

import math
from typing import Any

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_encoding import decode_parameter_value
from autopilot.wire.parameter_table import NAME_LENGTH, decimal_from_float32, float32
from gcs.clients.operation import GROUND, Result, Retry, Status, Target, is_addressed_to

RETRY_US = 500_000
SENDS = 6
BURST = 20  # missing parameters of the list requested in one go
_ERRORS = {
    mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST: "no such parameter",
    mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE: "out of range",
    mavlink.MAV_PARAM_ERROR_PERMISSION_DENIED: "not permitted",
    mavlink.MAV_PARAM_ERROR_READ_ONLY: "cannot be changed while running",
}


class ParameterList:
    """Read every parameter; `values` by name in the vehicle's order when done."""

    def __init__(self, target: Target) -> None:
        self.result: Result | None = None
        self._target = target
        self._count: int | None = None
        self._found: dict[int, tuple[str, float]] = {}
        self._retry = Retry(RETRY_US, SENDS)

    @property
    def values(self) -> dict[str, float]:
        return dict(self._found[index] for index in sorted(self._found))

    @property
    def progress(self) -> tuple[int, int]:
        return len(self._found), self._count or 0

    def receive(self, message: Any, now_us: int) -> None:
        if self.result is not None or message.get_msgId() != mavlink.MAVLINK_MSG_ID_PARAM_VALUE:
            return
        if message.param_index >= message.param_count:  # 65535: the answer to a PARAM_SET
            return
        self._count = message.param_count
        if message.param_index not in self._found:
            self._found[message.param_index] = (
                message.param_id,
                decode_parameter_value(message.param_value, message.param_type),
            )
            self._retry.restart()
            self._retry.wait(now_us, RETRY_US)
        if len(self._found) >= self._count:
            self.result = Result(Status.DONE, f"{self._count} parameters")

    def poll(self, now_us: int) -> list[Any]:
        if self.result is not None or not self._retry.due(now_us):
            return []
        if self._retry.exhausted:
            text = f"parameters: {len(self._found)} of {self._count or '?'} came, then no answer"
            self.result = Result(Status.UNANSWERED, text)
            return []
        self._retry.record_sent(now_us)
        if self._count is None:
            return [mavlink.MAVLink_param_request_list_message(*self._target)]
        gaps = [index for index in range(self._count) if index not in self._found][:BURST]
        return [mavlink.MAVLink_param_request_read_message(*self._target, b"", index) for index in gaps]


class ParameterGet:
    """Read one parameter by name; `value` when done."""

    def __init__(self, target: Target, name: str) -> None:
        self.result: Result | None = None
        self.value = math.nan
        self.name = name
        self.unknown = False  # the vehicle says that it has none of this name
        self._target = target
        self._retry = Retry(RETRY_US, SENDS)

    @property
    def progress(self) -> tuple[int, int]:
        return 0, 0

    def receive(self, message: Any, now_us: int) -> None:
        if self.result is not None:
            return
        error = _error(message, self.name)
        if error is not None:
            self.unknown = message.error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
            self.result = Result(Status.REFUSED, error, self.name)
        elif _is_value(message, self.name):
            self.value = decode_parameter_value(message.param_value, message.param_type)
            self.result = Result(Status.DONE, f"{self.name} = {self.value:.9g}")

    def poll(self, now_us: int) -> list[Any]:
        if self.result is not None or not self._retry.due(now_us):
            return []
        if self._retry.exhausted:
            text = f"{self.name}: no answer after {self._retry.sends} tries"
            self.result = Result(Status.UNANSWERED, text, guess="has the vehicle this parameter?")
            return []
        self._retry.record_sent(now_us)
        return [mavlink.MAVLink_param_request_read_message(*self._target, _name_bytes(self.name), -1)]


class ParameterSet:
    """Set one parameter and verify that the vehicle stored it."""

    def __init__(self, target: Target, name: str, value: float) -> None:
        self.result: Result | None = None
        self.name = name
        self.unknown = False  # the vehicle says that it has none of this name
        self._target = target
        self._value = float32(value)
        self._reported: float | None = None
        self._retry = Retry(RETRY_US, SENDS)

    @property
    def progress(self) -> tuple[int, int]:
        return 0, 0

    def receive(self, message: Any, now_us: int) -> None:
        if self.result is not None or not self._retry.sent:
            return
        error = _error(message, self.name)
        if error is not None:
            self.unknown = message.error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
            self.result = Result(Status.REFUSED, error, self.name)
        elif _is_value(message, self.name):
            reported = decode_parameter_value(message.param_value, message.param_type)
            if float32(reported) == self._value:
                self.result = Result(Status.DONE, f"{self.name} = {decimal_from_float32(self._value):.9g}")
            else:  # refused, or an answer to an older question: the next tries decide which
                self._reported = reported

    def poll(self, now_us: int) -> list[Any]:
        if self.result is not None or not self._retry.due(now_us):
            return []
        if self._retry.exhausted or (self._reported is not None and self._retry.sent >= 3):
            requested = decimal_from_float32(self._value)
            if self._reported is None:
                text = f"{self.name} = {requested:.9g}: no answer after {self._retry.sent} tries"
                self.result = Result(Status.UNANSWERED, text)
            else:
                text = f"{self.name} = {requested:.9g}: the vehicle keeps {self._reported:.9g}"
                self.result = Result(Status.REFUSED, text, self.name)
            return []
        self._retry.record_sent(now_us)
        return [
            mavlink.MAVLink_param_set_message(
                *self._target, _name_bytes(self.name), self._value, mavlink.MAV_PARAM_TYPE_REAL32
            )
        ]


def _name_bytes(name: str) -> bytes:
    return name.encode("ascii", "replace")[:NAME_LENGTH]


def _is_value(message: Any, name: str) -> bool:
    return bool(message.get_msgId() == mavlink.MAVLINK_MSG_ID_PARAM_VALUE and message.param_id == name)


def _error(message: Any, name: str) -> str | None:
    """The text of a PARAM_ERROR about `name`; None if `message` is something else."""
    if message.get_msgId() != mavlink.MAVLINK_MSG_ID_PARAM_ERROR:
        return None
    if message.param_id != name or not is_addressed_to(message, GROUND):
        return None
    return f"{name}: {_ERRORS.get(message.error, f'refused (error {message.error})')}"
