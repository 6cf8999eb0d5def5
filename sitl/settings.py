"""The settings of the world that follow from the SIM_* parameters."""

from __future__ import annotations

from math import inf, radians
from typing import NamedTuple

from autopilot.geometry.linear import Vec3
from autopilot.wire.parameter_table import ParameterError, ParameterTable
from sitl.sensors.imu import AxisErrors
from sitl.sensors.overrides import Overrides, overrides_in

SECOND_US = 1_000_000


class Settings(NamedTuple):
    """Rates, delays, losses, wind, and the values that replace those of the sensor profile."""

    tick_us: int
    actuator_delay_us: int
    noise_scale: float
    sensor_latency_us: int  # added to that of each sensor
    sensor_loss: float  # 0 ... 1, added to that of each sensor but the IMU
    failed_sensors: tuple[bool, ...]  # in the order of the rows in `sitl.world`
    wind: Vec3  # mean, ENU, m/s
    gust_std: float  # m/s, each axis
    gust_tau_s: float
    pulse: Vec3  # ENU, m/s, added to the wind for `pulse_for_us`
    pulse_at_us: int  # when it begins; negative: never
    pulse_for_us: int
    failing_rotors: int = 0  # bit i: rotor i+1
    failing_share: float = 0.0  # share of its command that a failing rotor gives
    rotors_fail_at_us: int = 0
    sensors_fail_at_us: int = 0  # those of `failed_sensors`
    sensors_work_at_us: float = inf  # from when on these work again
    stamp_offset_us: int = 0  # added to the time stamps of the readings of trackers, camera and receiver
    overrides: Overrides = ()
    imu_axes: AxisErrors = AxisErrors()

    def rotor_shares(self, count: int) -> tuple[float, ...]:
        """The share of its command that each of `count` rotors gives once they fail."""
        return tuple(self.failing_share if self.failing_rotors >> i & 1 else 1.0 for i in range(count))


def settings_of(table: ParameterTable) -> Settings:
    """The settings of a table of SIM_* parameters, or ParameterError."""
    rate = table["SIM_RATE_HZ"]
    tick_us = round(SECOND_US / rate)
    if tick_us * rate != SECOND_US:
        divisors = (hz for hz in range(100, 1001) if SECOND_US % hz == 0)
        allowed = ", ".join(str(hz) for hz in divisors)
        raise ParameterError(
            f"SIM_RATE_HZ = {rate:g} Hz; a tick must be a whole number of microseconds, and "
            f"{SECOND_US} us / {rate:g} is not: take one of {allowed}"
        )
    fail_at_us, fail_for_us = (round(table[f"SIM_SENS_{name}_S"] * SECOND_US) for name in ("AT", "FOR"))
    return Settings(
        tick_us=tick_us,
        actuator_delay_us=round(table["SIM_ACT_DELAY_MS"] * 1000.0),
        noise_scale=table["SIM_NOISE_SCALE"],
        sensor_latency_us=round(table["SIM_SENS_LAT_MS"] * 1000.0),
        sensor_loss=table["SIM_DROP_PCT"] / 100.0,
        failed_sensors=tuple(bool(int(table["SIM_SENS_FAIL"]) >> bit & 1) for bit in range(7)),
        sensors_fail_at_us=fail_at_us,
        sensors_work_at_us=fail_at_us + fail_for_us if fail_for_us else inf,
        wind=(table["SIM_WIND_E"], table["SIM_WIND_N"], table["SIM_WIND_U"]),
        gust_std=table["SIM_GUST_STD"],
        gust_tau_s=table["SIM_GUST_TAU_S"],
        pulse=(table["SIM_GUST_E"], table["SIM_GUST_N"], table["SIM_GUST_U"]),
        pulse_at_us=round(table["SIM_GUST_AT_S"] * SECOND_US),
        pulse_for_us=round(table["SIM_GUST_FOR_S"] * SECOND_US),
        failing_rotors=int(table["SIM_ENGINE_FAIL"]),
        failing_share=table["SIM_ENGINE_MUL"],
        rotors_fail_at_us=round(table["SIM_ENGINE_AT_S"] * SECOND_US),
        stamp_offset_us=round(table["SIM_SENS_OFS_MS"] * 1000.0),
        overrides=overrides_in(table.__getitem__),
        imu_axes=_imu_axes(table),
    )


def _imu_axes(table: ParameterTable) -> AxisErrors:
    def share(name: str) -> Vec3:
        x, y, z = table.vector(name)
        return (x / 100.0, y / 100.0, z / 100.0)

    def angles(name: str) -> Vec3:
        x, y, z = table.vector(name)
        return (radians(x), radians(y), radians(z))

    return AxisErrors(
        share("SIM_ACC_SCALE_"), angles("SIM_ACC_ALIGN_"), share("SIM_GYR_SCALE_"), angles("SIM_GYR_ALIGN_")
    )
