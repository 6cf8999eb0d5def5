"""Messages of the simulator link as pymavlink's objects, made of the numbers that the kernels write."""

from __future__ import annotations

from itertools import islice
from typing import Any

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import (
    hil_actuator_controls_values,
    hil_gps_values,
    hil_sensor_values,
    hil_state_quaternion_values,
    load_sensor_values,
    odometry_values,
)
from autopilot.wire.dialect import plumbline as mavlink


def message_of(message_type: Any, values: tuple[float, ...]) -> Any:
    """pymavlink's object of these numbers, given in the order of the wire."""
    numbers = iter(values)
    lengths: list[int] = message_type.array_lengths
    fields = [list(islice(numbers, length)) if length else next(numbers) for length in lengths]
    return message_type(*(fields[place] for place in message_type.orders))


def hil_sensor_message(*record: Any) -> Any:
    """HIL_SENSOR, of the arguments of `hil_sensor_values`."""
    return message_of(mavlink.MAVLink_hil_sensor_message, hil_sensor_values(*record))


def odometry_message(*record: Any) -> Any:
    """ODOMETRY, of the arguments of `odometry_values`."""
    return message_of(mavlink.MAVLink_odometry_message, odometry_values(*record))


def load_sensor_message(*record: Any) -> Any:
    """LOAD_SENSOR, of the arguments of `load_sensor_values`."""
    return message_of(mavlink.MAVLink_load_sensor_message, load_sensor_values(*record))


def hil_gps_message(*record: Any, home: Home) -> Any:
    """HIL_GPS, of the arguments of `hil_gps_values`."""
    return message_of(mavlink.MAVLink_hil_gps_message, hil_gps_values(*(*record, home)))


def hil_state_quaternion_message(*record: Any, home: Home) -> Any:
    """HIL_STATE_QUATERNION, of the arguments of `hil_state_quaternion_values`."""
    values = hil_state_quaternion_values(*(*record, home))
    return message_of(mavlink.MAVLink_hil_state_quaternion_message, values)


def hil_actuator_controls_message(*record: Any) -> Any:
    """HIL_ACTUATOR_CONTROLS, of the arguments of `hil_actuator_controls_values`."""
    return message_of(mavlink.MAVLink_hil_actuator_controls_message, hil_actuator_controls_values(*record))
