"""Names of commands for texts."""

from __future__ import annotations

from autopilot.wire.dialect import plumbline as mavlink


def command_name(command: int) -> str:
    """The name of a command without its prefix, or its number."""
    for enum in ("PLUMBLINE_COMMAND", "MAV_CMD"):
        entry = mavlink.enums[enum].get(command)
        if entry is not None:
            return str(entry.name).removeprefix("MAV_CMD_").removeprefix("PLUMBLINE_")
    return str(command)


def numbered_name(command: int) -> str:
    """The name of a command and its number, as a text names it: `NAV_LAND (21)`, or `command 99`."""
    name = command_name(command)
    return f"command {command}" if name == str(command) else f"{name} ({command})"
