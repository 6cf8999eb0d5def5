"""Accelerometer and gyroscope, strapped to the body.

| symbol | code | frame, unit | |
|---|---|---|---|
| s | scale_error | | relative error of the scale of each axis |
| phi | misalignment | body, rad | rotation vector that turns the body's axes into those of the sensor |
| M | accel_axes, gyro_axes | | diag(1 + s) exp(phi^)^T: a reading is M times the true vector |

Bias and noise are added to the reading, and vibration to both.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    IDENTITY,
    ZERO,
    Mat3,
    Vec3,
    add,
    add3,
    apply,
    apply_transposed,
    column,
    is_zero,
    scale,
)
from autopilot.geometry.rigid_body import arm_accel
from autopilot.geometry.so3 import quat_exp, rotation_from_quat
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
    position: Vec3 = ZERO  # m, from the centre of mass, body
    accel_axes: Mat3 = IDENTITY
    gyro_axes: Mat3 = IDENTITY
    calibrated: float = 1.0  # 0.0: `accel_axes` or `gyro_axes` is not the identity


class ImuState(NamedTuple):
    """Biases, body FLU, m/s^2 and rad/s."""

    accel_bias: Vec3
    gyro_bias: Vec3


class ImuReading(NamedTuple):
    """Specific force (m/s^2) and angular rate (rad/s), body FLU."""

    accel_body: Vec3
    gyro_body: Vec3


class AxisErrors(NamedTuple):
    """Errors of the axes of accelerometer and gyroscope: s and phi of each."""

    accel_scale: Vec3 = ZERO
    accel_misalignment: Vec3 = ZERO
    gyro_scale: Vec3 = ZERO
    gyro_misalignment: Vec3 = ZERO


def sensor_axes(scale_error: Vec3, misalignment: Vec3) -> Mat3:
    """M."""
    R = rotation_from_quat(quat_exp(misalignment))
    return (
        scale(1.0 + scale_error[0], column(R, 0)),
        scale(1.0 + scale_error[1], column(R, 1)),
        scale(1.0 + scale_error[2], column(R, 2)),
    )


def with_errors(config: ImuConfig, position: Vec3, errors: AxisErrors) -> ImuConfig:
    """The inertial unit at a position (m, from the centre of mass, body), with errors of its axes."""
    if errors == AxisErrors():
        return config._replace(position=position)
    return config._replace(
        position=position,
        accel_axes=sensor_axes(errors.accel_scale, errors.accel_misalignment),
        gyro_axes=sensor_axes(errors.gyro_scale, errors.gyro_misalignment),
        calibrated=0.0,
    )


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
    """Specific force R^T (x'' + g e3) at the unit's position, and body rate, each with errors of axes, bias
    and white noise."""
    R = rotation_from_quat(truth_state.quat_wxyz)
    a = truth_state.accel_quad
    force = apply_transposed(R, (a[0], a[1], a[2] + config.gravity))
    omega = truth_state.omega_body
    if not is_zero(config.position):
        force = add(force, arm_accel(omega, truth_state.omega_dot_body, config.position))
    if config.calibrated == 0.0:
        force, omega = apply(config.accel_axes, force), apply(config.gyro_axes, omega)
    accel = add3(force, sensor_state.accel_bias, white(config.accel_noise, noise, 0))
    gyro = add3(omega, sensor_state.gyro_bias, white(config.gyro_noise, noise, 1))
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
