"""The readings of the vehicle's sensors, its estimate as odometry, and other messages sent on request.

Builders of `telemetry`; NED and FRD on the wire, scaled integers saturate. Nothing is reported for a sensor
that the vehicle does not carry.
"""

from __future__ import annotations

from math import nan
from typing import Any

from autopilot.geometry.linear import Vec3
from autopilot.services.identity import Identity
from autopilot.services.instant import attitude_quaternion_of, pulses_of
from autopilot.services.snapshot import SensorReadings, Snapshot
from autopilot.wire.codec import layout_of
from autopilot.wire.convert.axes import frd_from_flu, ned_from_enu
from autopilot.wire.convert.scaling import STANDARD_GRAVITY, saturated
from autopilot.wire.convert.telemetry import boot_ms
from autopilot.wire.dialect import plumbline as mavlink

_HIGHRES_IMU = layout_of(mavlink.MAVLink_highres_imu_message)
_ODOMETRY = layout_of(mavlink.MAVLink_odometry_message)
_RC_CHANNELS = layout_of(mavlink.MAVLink_rc_channels_message)
_ACTUATOR_OUTPUT_STATUS = layout_of(mavlink.MAVLink_actuator_output_status_message)

_UINT16, _INT16 = 0xFFFF, 0x7FFF
_CHANNELS = 18  # of RC_CHANNELS
_OUTPUTS = 32  # of ACTUATOR_OUTPUT_STATUS
# HIGHRES_IMU.fields_updated
_INERTIAL, _FIELD, _PRESSURE = 0x003F, 0x01C0, 0x1A00
_UPDATED_US = 20_000  # a slower sensor is "updated" if it read within the default interval of HIGHRES_IMU
_LOST = -1  # ODOMETRY.quality; 0 is "not stated"


def _within(value: float, factor: float) -> int:
    return saturated(value * factor, -_INT16 - 1, _INT16)


def _updated(s: Snapshot, readings: SensorReadings) -> int:
    """Bits of the fields of HIGHRES_IMU that are new."""
    fields = _INERTIAL
    for bits, read_us in ((_FIELD, readings.field_us), (_PRESSURE, readings.pressure_us)):
        if read_us >= 0 and s.now_us - read_us < _UPDATED_US:
            fields |= bits
    return fields


def highres_imu(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """HIGHRES_IMU; fields of a sensor that has never read anything are 0, and their bits are not set."""
    readings = s.readings
    if readings is None:
        return ()
    return (
        (
            _HIGHRES_IMU,
            (
                s.now_us,
                *frd_from_flu(readings.accel),
                *frd_from_flu(readings.gyro),
                *frd_from_flu(readings.field_gauss),
                readings.pressure_pa * 0.01,
                0.0,
                readings.pressure_altitude_m,
                readings.temperature_degC,
                _updated(s, readings),
                0,
            ),
        ),
    )


def scaled_imu(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """SCALED_IMU of the one inertial unit: milli-g, mrad/s, mgauss; its temperature is not known."""
    readings = s.readings
    if readings is None:
        return ()
    fields = (
        *(_within(a, 1e3 / STANDARD_GRAVITY) for a in frd_from_flu(readings.accel)),
        *(_within(w, 1e3) for w in frd_from_flu(readings.gyro)),
        *(_within(b, 1e3) for b in frd_from_flu(readings.field_gauss)),
    )
    return (mavlink.MAVLink_scaled_imu_message(boot_ms(s.now_us), *fields),)


def scaled_pressure(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """SCALED_PRESSURE of the barometer, if one is carried, with the time of its last reading."""
    readings = s.readings
    if readings is None or readings.pressure_us < 0:
        return ()
    temperature = _within(readings.temperature_degC, 100.0)
    pressure = readings.pressure_pa * 0.01
    read_ms = boot_ms(readings.pressure_us)
    return (mavlink.MAVLink_scaled_pressure_message(read_ms, pressure, 0.0, temperature),)


def _diagonal(first: Vec3) -> tuple[float, ...]:
    """Upper triangle of a 6x6 covariance of which three variances are known; NaN: not known."""
    x, y, z = first
    return (x, *(nan,) * 5, y, *(nan,) * 4, z, *(nan,) * 9)


def odometry(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """ODOMETRY: the estimate of the vehicle, position and velocity in LOCAL_NED."""
    attitude = attitude_quaternion_of(s)
    rates = frd_from_flu(s.omega_body)
    horizontal, vertical = s.horizontal_std * s.horizontal_std, s.vertical_std * s.vertical_std
    return (
        (
            _ODOMETRY,
            (
                s.now_us,
                *ned_from_enu(s.x_quad),
                *attitude[1:5],
                *ned_from_enu(s.v_quad),
                *rates,
                *_diagonal((horizontal, horizontal, vertical)),
                *(nan,) * 21,
                mavlink.MAV_FRAME_LOCAL_NED,
                mavlink.MAV_FRAME_LOCAL_NED,
                0,
                mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
                0 if s.estimator_flags & mavlink.ESTIMATOR_POS_HORIZ_ABS else _LOST,
            ),
        ),
    )


def actuator_output_status(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """ACTUATOR_OUTPUT_STATUS: the pulses of SERVO_OUTPUT_RAW, us."""
    pulses = pulses_of(s)
    return ((_ACTUATOR_OUTPUT_STATUS, (s.now_us, s.rotors, *pulses, *(0.0,) * (_OUTPUTS - len(pulses)))),)


def rc_channels(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """RC_CHANNELS: there is no receiver."""
    return ((_RC_CHANNELS, (boot_ms(s.now_us), *(_UINT16,) * _CHANNELS, 0, 255)),)


def flight_information(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """FLIGHT_INFORMATION of the present or the last flight: us since boot, although the field names say UTC.

    The number of a flight is the time of its arming, us since 1970.
    """
    armed_us, takeoff_us, landed_us = s.sortie
    number = s.boot_unix_us + armed_us if armed_us else 0
    return (
        mavlink.MAVLink_flight_information_message(
            boot_ms(s.now_us), armed_us, takeoff_us, number, boot_ms(landed_us)
        ),
    )
