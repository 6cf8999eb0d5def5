"""Accelerometer and gyroscope at the centre of mass, strapped to the body."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add3, apply_transposed
from autopilot.geometry.so3 import rotation_from_quat
from sitl.plant.records import PlantState
from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, white


class ImuConfig(NamedTuple):
    """Deviations per sample, drifts and full scales, in m/s^2 and rad/s; `gravity` of the world in m/s^2."""

    accel_noise: float
    accel_drift: Drift
    accel_range: float
    gyro_noise: float
    gyro_drift: Drift
    gyro_range: float
    gravity: float


class ImuState(NamedTuple):
    """Biases, body FLU, m/s^2 and rad/s."""

    accel_bias: Vec3
    gyro_bias: Vec3


class ImuReading(NamedTuple):
    """Specific force (m/s^2) and angular rate (rad/s), body FLU."""

    accel_body: Vec3
    gyro_body: Vec3


@kernel
def clip(v: Vec3, limit: float) -> Vec3:
    """Each component kept within the full scale."""
    return (
        min(max(v[0], -limit), limit),
        min(max(v[1], -limit), limit),
        min(max(v[2], -limit), limit),
    )


@kernel
def start(config: ImuConfig, noise: Noise) -> ImuState:
    """The biases at switch-on."""
    return ImuState(drift_start(config.accel_drift, noise, 4), drift_start(config.gyro_drift, noise, 5))


@kernel
def sample(
    truth_state: PlantState, sensor_state: ImuState, config: ImuConfig, noise: Noise
) -> tuple[ImuReading, ImuState]:
    """Specific force R^T (x'' + g e3) and body rate, each with bias and white noise."""
    R = rotation_from_quat(truth_state.quat_wxyz)
    a = truth_state.accel_quad
    force = apply_transposed(R, (a[0], a[1], a[2] + config.gravity))
    accel = add3(force, sensor_state.accel_bias, white(config.accel_noise, noise, 0))
    gyro = add3(truth_state.omega_body, sensor_state.gyro_bias, white(config.gyro_noise, noise, 1))
    return (
        ImuReading(accel, gyro),
        ImuState(
            drift_step(sensor_state.accel_bias, config.accel_drift, noise, 2),
            drift_step(sensor_state.gyro_bias, config.gyro_drift, noise, 3),
        ),
    )


@kernel
def clip_reading(reading: ImuReading, config: ImuConfig) -> ImuReading:
    """The reading cut at full scale."""
    return ImuReading(
        clip(reading.accel_body, config.accel_range), clip(reading.gyro_body, config.gyro_range)
    )
