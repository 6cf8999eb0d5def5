"""Names of flight modes, and their numbers, which depend on the autopilot that HEARTBEAT names: pairs of main
mode and sub-mode as in PX4, which all but ArduPilot use here, or the numbers of ArduPilot's Copter."""

from __future__ import annotations

from typing import Any

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients import command
from gcs.clients.command import CommandOperation
from gcs.clients.operation import Target
from gcs.errors import InputError

_AUTO = 4
_MAIN_MODES = {
    1: "manual",
    2: "altitude",
    3: "position",
    _AUTO: "auto",
    5: "acro",
    6: "offboard",
    7: "stabilized",
    8: "rattitude",
}
_AUTO_MODES = {
    1: "ready",
    2: "takeoff",
    3: "hold",
    4: "mission",
    5: "return",
    6: "land",
    7: "return-ground",
    8: "follow",
    9: "precision-land",
}
_SUPPORTED = ("position", "offboard", "takeoff", "hold", "mission", "return", "land")
# the modes of `_SUPPORTED`: main mode and sub-mode
_PX4: dict[str, tuple[int, int]] = {
    **{name: (main, 0) for main, name in _MAIN_MODES.items() if name in _SUPPORTED},
    **{name: (_AUTO, sub) for sub, name in _AUTO_MODES.items() if name in _SUPPORTED},
}
MODES = tuple(sorted(_PX4))
# other names of some modes: those of ArduPilot's clients, and PX4's names in MAVLink
ALIASES = {"auto": "mission", "guided": "hold", "loiter": "hold", "poshold": "position", "rtl": "return"}
_COPTER_MODES = {
    0: "stabilize",
    1: "acro",
    2: "alt-hold",
    3: "auto",
    4: "guided",
    5: "loiter",
    6: "rtl",
    9: "land",
    16: "poshold",
    17: "brake",
}
# in GUIDED the vehicle holds until it gets a target, as after take-off, which is a command and no mode there
_COPTER: dict[str, int] = {"hold": 4, "mission": 3, "return": 6, "land": 9, "position": 16}


def mode_name(heartbeat: Any) -> str:
    """The name of the mode in a HEARTBEAT."""
    number = heartbeat.custom_mode
    if heartbeat.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return _COPTER_MODES.get(number, f"mode {number}")
    main, sub = number >> 16 & 0xFF, number >> 24 & 0xFF
    names, key = (_AUTO_MODES, sub) if main == _AUTO else (_MAIN_MODES, main)
    return names.get(key, f"mode {main}.{sub}")


def change_mode(target: Target, name: str, heartbeat: Any) -> CommandOperation:
    """Change the mode of the vehicle that sent this HEARTBEAT to one of `MODES` or `ALIASES`.

    InputError if it has no such mode.
    """
    name = ALIASES.get(name, name)
    armed = bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    if heartbeat.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return command.set_mode(target, name, *_PX4[name], armed)
    if name not in _COPTER:
        instead = "; use gcs takeoff" if name == "takeoff" else ""
        raise InputError(
            f"mode {name}: ArduPilot has no such mode; must be one of {', '.join(sorted(_COPTER))}{instead}"
        )
    return command.set_mode(target, name, _COPTER[name], 0, armed)
