"""sensor_msgs/msg/BatteryState of ROS 2 in CDR, its binary encoding: what viewers know as a battery."""

from __future__ import annotations

import struct
from math import nan

TYPE_NAME = "sensor_msgs/msg/BatteryState"
_SEPARATOR = f"{80 * '='}\n"
DEFINITION = f"""\
std_msgs/Header header
float32 voltage
float32 temperature
float32 current
float32 charge
float32 capacity
float32 design_capacity
float32 percentage
uint8 power_supply_status
uint8 power_supply_health
uint8 power_supply_technology
bool present
float32[] cell_voltage
float32[] cell_temperature
string location
string serial_number
{_SEPARATOR}MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_SEPARATOR}MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_LITTLE_ENDIAN = b"\x00\x01\x00\x00"  # the encoding's own header
_DISCHARGING, _HEALTH_UNKNOWN, _LITHIUM_POLYMER = 2, 0, 3
# with an empty text for the frame and padding to four bytes; at the end two arrays without entries and two
# empty texts, which have a length with their final zero
_MESSAGE = struct.Struct("<iI I 4x 7f 4B 2I I 4x Ix")


def encoded_battery_state(time_ns: int, voltage_v: float, current_a: float, share_left: float) -> bytes:
    """The message; NaN for what is unknown. A current that discharges the battery is positive here, and
    negative in the message."""
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    return _LITTLE_ENDIAN + _MESSAGE.pack(
        *(seconds, nanoseconds, 1),
        *(voltage_v, nan, -current_a, nan, nan, nan, share_left),
        *(_DISCHARGING, _HEALTH_UNKNOWN, _LITHIUM_POLYMER, True),
        *(0, 0, 1, 1),
    )
