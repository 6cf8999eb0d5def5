"""The topics of the flight log, with PX4's names and fields where PX4 has them, and their sources.

A fast topic is a table of columns, from which `log_records` writes it in machine code: a column is a field of
an `Instant` or of `Derived`, converted to NED or FRD if it has axes, or numbers that never change. Slow
topics are made in Python.
"""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any, NamedTuple

from autopilot.estimation.records import EstimatorState
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.packed import Row
from autopilot.geometry.so3 import Quat
from autopilot.services import identity
from autopilot.services.snapshot import Snapshot
from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.wire.convert.axes import frd_from_flu, ned_from_enu
from autopilot.wire.convert.simulator import Forces
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.ulog import Topic

OUTPUTS = 16  # actuator_outputs.output
# PX4's vehicle_status
_DISARMED, _ARMED = 1, 2
_NAV_STATES = {
    identity.AUTO_MISSION: 3,
    identity.AUTO_LOITER: 4,
    identity.AUTO_RTL: 5,
    identity.AUTO_TAKEOFF: 17,
    identity.AUTO_LAND: 18,
}
_ROTARY_WING = 1

Numbers = tuple[float, ...]
Axes = Callable[[Any], Any]


class Sample(NamedTuple):
    """One instant of the flight."""

    snapshot: Snapshot
    instant: Row  # the packed `Instant`
    imu: Row  # the packed `ImuReading`
    imu_is_sane: bool
    estimator: Callable[[], EstimatorState]  # for the slow topics


class Derived(NamedTuple):
    """Values that the fast topics need besides `Instant`."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    gyro: Vec3
    accel: Vec3
    valid: bool  # the whole estimate of the vehicle
    height_valid: bool
    quat_ned: Quat
    quat_c_ned: Quat
    shares: Forces  # rotor forces as shares of the maximum, if there is one
    pulses: Forces  # the same as pulse widths, which most tools expect


class Column(NamedTuple):
    """A field of `Instant` or `Derived`, converted to other axes (`axes`)."""

    name: str
    axes: Axes | None = None


def _columns(*names: str) -> tuple[Column, ...]:
    return tuple(Column(name) for name in names)


def _ned(*names: str) -> tuple[Column, ...]:
    return tuple(Column(name, ned_from_enu) for name in names)


def _frd(*names: str) -> tuple[Column, ...]:
    return tuple(Column(name, frd_from_flu) for name in names)


def _vector(name: str) -> str:
    return f"float[3] {name}"


_AXES = ("float x", "float y", "float z", "float vx", "float vy", "float vz")
# in turn of the horizontal and of the vertical part
_VALID = ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid", "xy_global", "z_global")

FAST: tuple[tuple[Topic, tuple[Column | Numbers, ...]], ...] = (
    (
        Topic(
            "vehicle_local_position",
            (
                *("double ref_lat", "double ref_lon", *_AXES, "float ax", "float ay", "float az"),
                *("float ref_alt", "float eph", "float epv", *(f"bool {name}" for name in _VALID)),
            ),
        ),
        (
            *_columns("latitude_deg", "longitude_deg"),
            *_ned("x_quad", "v_quad", "accel_quad"),
            *_columns("altitude_m", "horizontal_std", "vertical_std"),
            *(_columns("valid", "height_valid") * (len(_VALID) // 2)),
        ),
    ),
    (Topic("vehicle_attitude", ("float[4] q",)), _columns("quat_ned")),
    (Topic("vehicle_angular_velocity", (_vector("xyz"),)), _frd("omega_body")),
    (Topic("sensor_combined", (_vector("gyro_rad"), _vector("accelerometer_m_s2"))), _frd("gyro", "accel")),
    (
        Topic("actuator_outputs", ("uint32_t noutputs", f"float[{OUTPUTS}] output")),
        (*_columns("rotors", "pulses"), (0.0,) * (OUTPUTS - MAX_ROTORS)),
    ),
    (Topic("actuator_motors", (f"float[{MAX_ROTORS}] control",)), _columns("shares")),
    (
        Topic("vehicle_local_position_setpoint", (*_AXES, _vector("acceleration"))),
        (*_ned("x_quad_d"), ned_from_enu(ZERO), ned_from_enu(ZERO)),
    ),
    (Topic("vehicle_attitude_setpoint", ("float[4] q_d",)), _columns("quat_c_ned")),
    (
        Topic(
            "load_state",
            (
                *(_vector(name) for name in ("position", "velocity", "cable", "cable_rate")),
                *("float distance", "float tension", "uint32_t slack_events", "bool taut"),
            ),
        ),
        (
            *_ned("x_load", "v_load", "q_cable", "q_cable_dot"),
            *_columns("distance", "tension", "slack_events", "taut"),
        ),
    ),
    (
        Topic(
            "load_setpoint",
            (
                *(_vector(name) for name in ("position", "velocity", "acceleration")),
                *(_vector(name) for name in ("position_asked", "velocity_asked", "cable")),
                *("float elapsed", "float duration"),
                *("uint16_t item", "uint8_t phase", "uint8_t control_mode"),
            ),
        ),
        (
            *_ned("x_load_d", "v_load_d", "a_load_d", "x_load_requested", "v_load_requested", "q_cable_c"),
            *_columns("elapsed_s", "duration_s", "seq", "phase", "control_mode"),
        ),
    ),
    (
        Topic(
            "cascade_errors",
            (
                *(_vector(name) for name in ("e_x", "e_v", "e_q", "e_q_dot", "e_r", "e_omega")),
                *("float psi_r", "float psi_q", "float thrust", _vector("moment")),
            ),
        ),
        (
            *_ned("e_x", "e_v", "e_q", "e_q_dot"),
            *_frd("e_R", "e_Omega"),
            *_columns("psi_R", "psi_q", "thrust"),
            *_frd("moment"),
        ),
    ),
    (
        Topic(
            "rotor_forces",
            (
                f"float[{MAX_ROTORS}] force",
                "float force_min",
                "float force_max",
                "uint16_t saturated",
                "uint8_t rotors",
            ),
        ),
        _columns("forces", "rotor_min", "rotor_max", "saturated", "rotors"),
    ),
)


def _estimator(s: Sample) -> Numbers:
    estimator = s.estimator()
    vehicle, load = estimator.vehicle, estimator.load
    return (
        *frd_from_flu(vehicle.gyro_bias),
        *frd_from_flu(vehicle.accel_bias),
        *(vehicle.age_s, vehicle.rejected, load.age_s, load.rejected),
    )


def _status(s: Sample) -> Numbers:
    v = s.snapshot
    failsafe = v.system_status in (mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_FLIGHT_TERMINATION)
    return (
        *(_ARMED if v.armed else _DISARMED, _NAV_STATES.get(v.sub_mode, _NAV_STATES[identity.AUTO_LOITER])),
        *(_ROTARY_WING, failsafe),
    )


def _land_detected(s: Sample) -> Numbers:
    return (s.snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND,)


def _battery(s: Sample) -> Numbers:
    v = s.snapshot
    return (v.battery_voltage, nan, v.battery_remaining, True)


SLOW: tuple[tuple[Topic, Callable[[Sample], Numbers]], ...] = (
    (
        Topic(
            "vehicle_status",
            ("uint8_t arming_state", "uint8_t nav_state", "uint8_t vehicle_type", "bool failsafe"),
        ),
        _status,
    ),
    (Topic("vehicle_land_detected", ("bool landed",)), _land_detected),
    (
        Topic("battery_status", ("float voltage_v", "float current_a", "float remaining", "bool connected")),
        _battery,
    ),
    (
        Topic(
            "estimator_plumbline",
            (
                *(_vector("gyro_bias"), _vector("accel_bias")),
                *("float vehicle_age", "float vehicle_rejected", "float load_age", "float load_rejected"),
            ),
        ),
        _estimator,
    ),
)
