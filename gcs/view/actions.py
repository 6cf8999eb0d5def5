"""Actions that the page can request: each is a few MAVLink exchanges, as of any other ground station.

Requests of a page are not trusted: an unknown action, a number out of range or a value of another type is an
ActionError.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.wire.convert.axes import ned_from_enu
from autopilot.wire.convert.geodesy import geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients import command
from gcs.clients.modes import change_mode
from gcs.clients.operation import Operation
from gcs.clients.parameter_transfer import ParameterSet
from gcs.view.controls import SLIDER_NAMES
from gcs.view.vehicle import WatchedVehicle

Arguments = Mapping[str, Any]
Action = Callable[[WatchedVehicle, Arguments], list[Operation]]

_MAX_DISTANCE_M = 1000.0
_MAX_GUST_M_S = 30.0
_MAX_GUST_S = 10.0
_GRIPPER_RELEASE, _GRIPPER_GRAB = 0.0, 1.0
_MOTOR, _OK, _OFF = 101.0, 0.0, 1.0  # of INJECT_FAILURE


class ActionError(ValueError):
    """The requested action does not exist, or not with these arguments; the text says why."""


def operations_of(vehicle: WatchedVehicle, name: Any, arguments: Any) -> list[Operation]:
    """The exchanges that carry out an action, one after the other."""
    action = ACTIONS.get(name) if isinstance(name, str) else None
    if action is None:
        raise ActionError("there is no such action")
    if not isinstance(arguments, dict):
        raise ActionError(f"{name}: arguments must be an object")
    return action(vehicle, arguments)


def _number(arguments: Arguments, name: str, low: float, high: float) -> float:
    value = arguments.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ActionError(f"{name}: must be a number")
    if not low <= value <= high:
        raise ActionError(f"{name} = {value:g}; must be {low:g} ... {high:g}")
    return float(value)


def _command_action(make: Callable[..., Operation]) -> Action:
    return lambda vehicle, arguments: [make(vehicle.target)]


def _start_mission(vehicle: WatchedVehicle, arguments: Arguments) -> list[Operation]:
    """Fly the mission; a vehicle on the ground is armed first."""
    start = command.start_mission(vehicle.target)
    return [start] if vehicle.view.armed else [command.arm(vehicle.target), start]


def _take_off(vehicle: WatchedVehicle, arguments: Arguments) -> list[Operation]:
    """Lift the load and hold it; a vehicle on the ground is armed first."""
    lift = command.takeoff(vehicle.target)
    return [lift] if vehicle.view.armed else [command.arm(vehicle.target), lift]


def _return(vehicle: WatchedVehicle, arguments: Arguments) -> list[Operation]:
    return [change_mode(vehicle.target, "return", vehicle.view.latest["HEARTBEAT"])]


def _go_to(vehicle: WatchedVehicle, arguments: Arguments) -> list[Operation]:
    """Carry the load to `place`, [north, east, down] in m."""
    place = arguments.get("place")
    if not isinstance(place, list) or len(place) != 3:
        raise ActionError("place: must be [north, east, down]")
    named = dict(zip(("north", "east", "down"), place, strict=True))
    north, east, down = (_number(named, name, -_MAX_DISTANCE_M, _MAX_DISTANCE_M) for name in named)
    places = zip(
        (north, east, down), vehicle.offset, strict=True
    )  # the place in the picture, and that of the vehicle's home
    north, east, down = (place - home for place, home in places)
    # the change of axes is its own inverse
    latitude, longitude, _ = geodetic_from_enu(ned_from_enu((north, east, down)), vehicle.home)
    return [command.reposition(vehicle.target, latitude, longitude, -down)]


def _set_parameter(vehicle: WatchedVehicle, arguments: Arguments) -> list[Operation]:
    """Set the parameter of one of the sliders."""
    name = arguments.get("name")
    if not isinstance(name, str) or name not in SLIDER_NAMES:
        raise ActionError("name: must be that of a slider")
    return [ParameterSet(vehicle.target, name, _number(arguments, "value", -1e4, 1e4))]


def _gust(vehicle: WatchedVehicle, arguments: Arguments) -> list[Operation]:
    """A gust of `seconds` with the speed `north`, `east` in m/s."""
    speed = {
        "SIM_GUST_N": _number(arguments, "north", -_MAX_GUST_M_S, _MAX_GUST_M_S),
        "SIM_GUST_E": _number(arguments, "east", -_MAX_GUST_M_S, _MAX_GUST_M_S),
        "SIM_GUST_U": 0.0,
        "SIM_GUST_FOR_S": _number(arguments, "seconds", 0.1, _MAX_GUST_S),
    }
    settings: list[Operation] = [ParameterSet(vehicle.target, name, value) for name, value in speed.items()]
    return [*settings, ParameterSet(vehicle.target, "SIM_GUST_NOW", 1.0)]


def _set_rotor_failure(vehicle: WatchedVehicle, arguments: Arguments) -> list[Operation]:
    """Stop `rotor` (counted from 1), or let it run again."""
    rotor = _number(arguments, "rotor", 1, MAX_ROTORS)
    failure = _OFF if arguments.get("failed") is True else _OK
    parameters = (_MOTOR, failure, float(round(rotor)))
    name = f"rotor {round(rotor)} {'off' if failure == _OFF else 'on'}"
    return [command.CommandOperation(vehicle.target, name, mavlink.MAV_CMD_INJECT_FAILURE, parameters)]


def _gripper(name: str, action: float) -> Action:
    def make(vehicle: WatchedVehicle, arguments: Arguments) -> list[Operation]:
        code = mavlink.MAV_CMD_DO_GRIPPER
        return [command.CommandOperation(vehicle.target, name, code, (1.0, action))]

    return make


ACTIONS: dict[str, Action] = {
    "arm": _command_action(command.arm),
    "disarm": _command_action(command.disarm),
    "start": _start_mission,
    "takeoff": _take_off,
    "hold": _command_action(command.pause),
    "resume": _command_action(command.resume),
    "return": _return,
    "land": _command_action(command.land),
    "goto": _go_to,
    "set": _set_parameter,
    "push": _gust,
    "fail": _set_rotor_failure,
    "release": _gripper("release", _GRIPPER_RELEASE),
    "grab": _gripper("grab", _GRIPPER_GRAB),
}
