"""ESC_STATUS and ESC_INFO: what the speed controllers report, four of them in a message, as PX4 sends them.

Builders of `telemetry`. The speeds are those that the controllers measure. Voltage and current are the
battery's; the current is divided in proportion to the power of each rotor, the cube of its speed.
"""

from __future__ import annotations

from math import isnan
from typing import Any

from autopilot.services.identity import Identity
from autopilot.services.snapshot import Snapshot
from autopilot.wire.convert.scaling import saturated
from autopilot.wire.convert.simulator import SPEED_REPORT_US
from autopilot.wire.dialect import plumbline as mavlink

_GROUP = 4  # rotors in a message
_DSHOT = 5  # ESC_CONNECTION_TYPE
_STUCK = 32  # ESC_FAILURE_FLAGS: the motor is commanded to turn but stands
_UNKNOWN_TEMPERATURE = 0x7FFF
_INT32 = 2**31 - 1


def _group_values(values: list[Any], first: int, missing: Any) -> list[Any]:
    """The values of a group, filled up with `missing`."""
    found = values[first : first + _GROUP]
    return found + [missing] * (_GROUP - len(found))


def esc_status(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """ESC_STATUS of every group of rotors."""
    powers = [abs(rpm) ** 3 for rpm in s.rotor_rpm]
    total = sum(powers) or 1.0
    volts = 0.0 if isnan(s.battery_voltage) else s.battery_voltage
    amperes = 0.0 if isnan(s.battery_current) else s.battery_current
    speeds = [saturated(rpm, -_INT32, _INT32) for rpm in s.rotor_rpm]
    currents = [amperes * power / total for power in powers]
    voltages = [volts] * len(speeds)
    return tuple(
        mavlink.MAVLink_esc_status_message(
            index=first,
            time_usec=s.now_us,
            rpm=_group_values(speeds, first, 0),
            voltage=_group_values(voltages, first, 0.0),
            current=_group_values(currents, first, 0.0),
        )
        for first in range(0, s.rotors, _GROUP)
    )


def esc_info(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """ESC_INFO of every group of rotors; all controllers answer, including that of a lost rotor."""
    flags = [_STUCK if s.rotors_lost >> i & 1 else 0 for i in range(s.rotors)]
    return tuple(
        mavlink.MAVLink_esc_info_message(
            index=first,
            time_usec=s.now_us,
            counter=s.now_us // SPEED_REPORT_US & 0xFFFF,
            count=s.rotors,
            connection_type=_DSHOT,
            info=(1 << min(_GROUP, s.rotors - first)) - 1,
            failure_flags=_group_values(flags, first, 0),
            error_count=[0] * _GROUP,
            temperature=[_UNKNOWN_TEMPERATURE] * _GROUP,
        )
        for first in range(0, s.rotors, _GROUP)
    )
