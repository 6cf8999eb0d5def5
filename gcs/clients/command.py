"""The command protocol: COMMAND_LONG is repeated until a COMMAND_ACK gives the result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.operation import GROUND, Result, Retry, Status, Target, is_addressed_to

RETRY_US = 500_000
SENDS = 10
IN_PROGRESS_TIMEOUT_US = 5_000_000  # after IN_PROGRESS
FORCE = 21196.0  # the MAVLink number that makes arming and disarming unconditional
UNUSED = math.nan

_RESULTS = {
    value: str(entry.name).removeprefix("MAV_RESULT_").replace("_", " ").lower()
    for value, entry in mavlink.enums["MAV_RESULT"].items()
}


class CommandOperation:
    """One command. `name` is its name in texts; `percent` is the progress that the vehicle reports."""

    def __init__(
        self, target: Target, name: str, command: int, parameters: Sequence[float] = (), sends: int = SENDS
    ) -> None:
        self.result: Result | None = None
        self.name = name
        self.percent = 0
        self._target = target
        self._command = command
        self._parameters = [float(p) for p in parameters] + [0.0] * (7 - len(parameters))
        self._retry = Retry(RETRY_US, sends)

    @property
    def progress(self) -> tuple[int, int]:
        return (self.percent, 100) if self.percent else (0, 0)

    def receive(self, message: Any, now_us: int) -> None:
        if (
            self.result is not None
            or message.get_msgId() != mavlink.MAVLINK_MSG_ID_COMMAND_ACK
            or message.command != self._command
            or not is_addressed_to(message, GROUND)
            or not self._retry.sent
        ):
            return
        if message.result == mavlink.MAV_RESULT_IN_PROGRESS:
            self.percent = min(message.progress, 100) if message.progress != 255 else 0
            self._retry.wait(now_us, IN_PROGRESS_TIMEOUT_US)
            return
        text = f"{self.name}: {_RESULTS.get(message.result, f'result {message.result}')}"
        accepted = message.result == mavlink.MAV_RESULT_ACCEPTED
        self.result = Result(Status.DONE if accepted else Status.REFUSED, text, self.name)

    def poll(self, now_us: int) -> list[Any]:
        if self.result is not None or not self._retry.due(now_us):
            return []
        if self._retry.exhausted:
            text = f"{self.name}: no answer after {self._retry.sends} tries"
            self.result = Result(Status.UNANSWERED, text)
            return []
        confirmation = self._retry.sent
        self._retry.record_sent(now_us)
        return [self._message(confirmation)]

    def _message(self, confirmation: int) -> Any:
        return mavlink.MAVLink_command_long_message(
            *self._target, self._command, confirmation, *self._parameters
        )


class RepositionOperation(CommandOperation):
    """Fly the load to a place by COMMAND_INT, because a float32 resolves degrees only to a metre."""

    def __init__(
        self,
        target: Target,
        latitude_degE7: int,
        longitude_degE7: int,
        height_m: float,
        speed_m_s: float | None = None,
    ) -> None:
        super().__init__(target, "goto", mavlink.MAV_CMD_DO_REPOSITION)
        self._latitude_degE7 = latitude_degE7
        self._longitude_degE7 = longitude_degE7
        self._height_m = height_m
        self._speed_m_s = -1.0 if speed_m_s is None else speed_m_s  # -1: the vehicle's default

    def _message(self, confirmation: int) -> Any:
        change_mode, radius = 1.0, 0.0
        return mavlink.MAVLink_command_int_message(
            *self._target,
            mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
            self._command,
            0,
            0,
            *(self._speed_m_s, change_mode, radius, UNUSED),
            self._latitude_degE7,
            self._longitude_degE7,
            self._height_m,
        )


def arm(target: Target, force: bool = False) -> CommandOperation:
    """Start the rotors."""
    parameters = (1.0, FORCE if force else 0.0)
    return CommandOperation(target, "arm", mavlink.MAV_CMD_COMPONENT_ARM_DISARM, parameters)


def disarm(target: Target, force: bool = False) -> CommandOperation:
    """Stop the rotors; in the air only with `force`."""
    parameters = (0.0, FORCE if force else 0.0)
    return CommandOperation(target, "disarm", mavlink.MAV_CMD_COMPONENT_ARM_DISARM, parameters)


def run_prearm_checks(target: Target) -> CommandOperation:
    """Have the vehicle report in status texts what prevents arming."""
    return CommandOperation(target, "pre-arm checks", mavlink.MAV_CMD_RUN_PREARM_CHECKS)


def start_mission(target: Target) -> CommandOperation:
    """Fly the mission from its first item."""
    return CommandOperation(target, "start", mavlink.MAV_CMD_MISSION_START)


def fly_mission(target: Target) -> CommandOperation:
    """Fly the mission from its current item, which is the first after an upload; a mission that is flown
    already does not begin again."""
    return CommandOperation(target, "start", mavlink.MAV_CMD_MISSION_START, (UNUSED,))


def pause(target: Target) -> CommandOperation:
    """Hold the load where it is."""
    return CommandOperation(target, "pause", mavlink.MAV_CMD_DO_PAUSE_CONTINUE, (0.0,))


def resume(target: Target) -> CommandOperation:
    """Continue a paused mission."""
    return CommandOperation(target, "resume", mavlink.MAV_CMD_DO_PAUSE_CONTINUE, (1.0,))


def takeoff(target: Target, altitude_amsl_m: float = UNUSED) -> CommandOperation:
    """Lift the load; NaN: to the height of the vehicle's parameter."""
    parameters = (UNUSED, UNUSED, UNUSED, UNUSED, UNUSED, UNUSED, altitude_amsl_m)
    return CommandOperation(target, "takeoff", mavlink.MAV_CMD_NAV_TAKEOFF, parameters)


def land(target: Target) -> CommandOperation:
    """Set the load down where it hangs, and the vehicle beside it."""
    return CommandOperation(target, "land", mavlink.MAV_CMD_NAV_LAND, (UNUSED,) * 7)


def winch(target: Target, length_m: float, speed_m_s: float | None = None) -> CommandOperation:
    """Make the cable longer by a length (negative: shorter); speed None: that of the vehicle's parameter."""
    by_length = float(mavlink.WINCH_RELATIVE_LENGTH_CONTROL)
    parameters = (1.0, by_length, length_m, 0.0 if speed_m_s is None else speed_m_s)
    return CommandOperation(target, "winch", mavlink.MAV_CMD_DO_WINCH, parameters)


def release(target: Target) -> CommandOperation:
    """Open the gripper that holds the cable: the load falls."""
    parameters = (1.0, float(mavlink.GRIPPER_ACTION_RELEASE))
    return CommandOperation(target, "release", mavlink.MAV_CMD_DO_GRIPPER, parameters)


def grab(target: Target) -> CommandOperation:
    """Take the load that lies within reach of a vehicle on the ground."""
    parameters = (1.0, float(mavlink.GRIPPER_ACTION_GRAB))
    return CommandOperation(target, "grab", mavlink.MAV_CMD_DO_GRIPPER, parameters)


def reposition(
    target: Target,
    latitude_degE7: int,
    longitude_degE7: int,
    height_m: float,
    speed_m_s: float | None = None,
) -> RepositionOperation:
    """Fly the load to this place and hold it, `height_m` above the origin (NaN: at its present height), at
    this speed (None: the vehicle's default)."""
    return RepositionOperation(target, latitude_degE7, longitude_degE7, height_m, speed_m_s)


def set_mode(target: Target, name: str, main: int, sub: int, armed: bool) -> CommandOperation:
    """Change the mode: PX4's main mode and sub-mode, or another autopilot's number and 0."""
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    return CommandOperation(
        target, f"mode {name}", mavlink.MAV_CMD_DO_SET_MODE, (float(base), float(main), float(sub))
    )


def message_interval(target: Target, message_id: int, interval_us: int) -> CommandOperation:
    """Request a message every `interval_us` of the vehicle's time."""
    name = mavlink.mavlink_map[message_id].msgname
    return CommandOperation(
        target,
        f"interval of {name}",
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        (float(message_id), float(interval_us)),
    )


def request_message(target: Target, message_id: int) -> CommandOperation:
    """Request a message once."""
    name = mavlink.mavlink_map[message_id].msgname
    return CommandOperation(
        target, f"request of {name}", mavlink.MAV_CMD_REQUEST_MESSAGE, (float(message_id),)
    )
