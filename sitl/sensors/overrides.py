"""Parameters of the simulator that replace values of the sensor profile.

A negative value, the default, leaves the profile unchanged; any other value replaces that of the profile, and
0 switches the effect off. Sensors that are not fitted stay so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from sitl.sensors.profile import Profile

_TIMED = ("mocap", "load_tracker", "cable_sensor", "gnss")  # sensors whose readings carry their time
_TRACKERS = ("mocap", "load_tracker")


class _Key(NamedTuple):
    """A key in some tables of the profile: its value is the parameter's times `factor`."""

    tables: tuple[str, ...]
    key: str
    factor: float = 1.0


OVERRIDDEN_KEYS: Mapping[str, tuple[_Key, ...]] = {
    "SIM_ACC_NOISE": (_Key(("imu",), "accel_noise_m_s2"),),
    "SIM_GYR_NOISE": (_Key(("imu",), "gyro_noise_rad_s"),),
    "SIM_VIB_ACC": (_Key(("imu",), "vibration_m_s2"),),
    "SIM_VIB_GYR": (_Key(("imu",), "vibration_rad_s"),),
    "SIM_VIB_BROAD": (_Key(("imu",), "vibration_broadband"),),
    "SIM_IMU_LPF_HZ": (_Key(("imu",), "lowpass_hz"),),
    "SIM_SENS_JIT_MS": (_Key(_TIMED, "jitter_ms"),),
    "SIM_SENS_JITMAX": (_Key(_TIMED, "jitter_max_ms"),),
    "SIM_TRK_ERR_M": (_Key(_TRACKERS, "position_correlated_m"),),
    "SIM_TRK_ERR_S": (_Key(_TRACKERS, "correlation_s"),),
    "SIM_TRK_CAL_M": (_Key(_TRACKERS, "calibration_error_m"),),
    "SIM_TRK_CAL_LEN": (_Key(_TRACKERS, "calibration_length_m"),),
    "SIM_OCC_VEH": (_Key(("mocap",), "outages_per_min"),),
    "SIM_OCC_LOAD": (_Key(("load_tracker", "cable_sensor"), "outages_per_min"),),
    "SIM_OCC_S": (_Key((*_TRACKERS, "cable_sensor"), "outage_s"),),
    "SIM_GPS_MP_M": (_Key(("gnss",), "horizontal_multipath_m"), _Key(("gnss",), "vertical_multipath_m", 1.5)),
    "SIM_GPS_MP_S": (_Key(("gnss",), "multipath_s"),),
    "SIM_GPS_FLT": (_Key(("gnss",), "float_per_min"),),
    "SIM_GPS_FLT_S": (_Key(("gnss",), "float_s"),),
    "SIM_GPS_FLT_M": (_Key(("gnss",), "float_error_m"),),
    "SIM_GPS_LOST": (_Key(("gnss",), "lost_per_min"),),
    "SIM_GPS_LOST_S": (_Key(("gnss",), "lost_s"),),
    "SIM_GPS_OUT": (_Key(("gnss",), "outages_per_min"),),
    "SIM_GPS_OUT_S": (_Key(("gnss",), "outage_s"),),
    "SIM_MAG_MOT": (_Key(("magnetometer",), "motor_field_gauss"),),
}

Overrides = tuple[tuple[str, float], ...]


def overrides_in(value_of: Callable[[str], float]) -> Overrides:
    """The parameters that replace a value of the profile, with their values."""
    values = ((name, value_of(name)) for name in OVERRIDDEN_KEYS)
    return tuple((name, value) for name, value in values if value >= 0.0)


def with_overrides(profile: Profile, overrides: Overrides) -> Profile:
    """The profile with these values."""
    found: dict[str, dict[str, Any]] = {}
    for name, value in overrides:
        for one in OVERRIDDEN_KEYS[name]:
            for table in one.tables:
                found.setdefault(table, {})[one.key] = value * one.factor
    fitted = {name: getattr(profile, name) for name in found}
    tables = {name: table.model_copy(update=found[name]) for name, table in fitted.items() if table}
    return profile.model_copy(update=tables) if tables else profile
