"""What the estimator keeps, believes of its sensors, and is given."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.so3 import IDENTITY_QUAT, Quat

HISTORY_LENGTH = 512
# columns of the history: time, x_quad (3), quat (4), x_load (3), q_cable (3), one to spare
X_QUAD, QUAT, X_LOAD, Q_CABLE = 1, 4, 8, 11
HISTORY_COLUMNS = 15

History = NDArray[np.float64]
ACCEL_BIAS_STD = 0.2  # m/s^2, before anything is known
GYRO_BIAS_STD = 0.05  # rad/s

Covariance2 = tuple[float, float, float]  # (aa, ab, bb)
Covariance3 = tuple[float, float, float, float, float, float]  # (pp, pv, pb, vv, vb, bb)


class ImuReading(NamedTuple):
    """One sample: body rate in rad/s and specific force in m/s^2, both body FLU."""

    gyro: Vec3
    accel: Vec3


class PoseReading(NamedTuple):
    """A pose tracker's reading of the vehicle, ENU; standard deviations are those the tracker states.

    `velocity_std` is negative when the velocity was not measured.
    """

    age_s: float
    x_quad: Vec3
    quat_wxyz: Quat
    v_quad: Vec3
    position_std: float
    attitude_std: float
    velocity_std: float


class LoadReading(NamedTuple):
    """A tracker's reading of the load, ENU. `velocity_std` is negative when the velocity was not measured."""

    age_s: float
    x_load: Vec3
    v_load: Vec3
    position_std: float
    velocity_std: float


class EstimatorTuning(NamedTuple):
    """What the estimator believes: vehicle, process noise as standard deviations of one sample, gate."""

    cable_length: float
    load_mass: float
    gravity: float
    gyro_std: float
    accel_std: float
    gyro_bias_walk: float  # rad/s per square root of a second
    accel_bias_walk: float  # m/s^2 per square root of a second
    cable_accel_std: float  # rad/s^2, error of the pendulum model while taut
    load_accel_std: float  # m/s^2, error of the load's acceleration while taut
    gate_sigma: float


class VehicleEstimate(NamedTuple):
    """The vehicle; covariances of (position, velocity, accelerometer bias) and of (attitude, gyro bias)."""

    x_quad: Vec3
    v_quad: Vec3
    quat_wxyz: Quat
    omega_body: Vec3
    gyro_bias: Vec3
    accel_bias: Vec3
    accel_quad: Vec3  # inertial acceleration, ENU
    covariance: Covariance3
    attitude_covariance: Covariance2
    age_s: float  # of the last accepted pose; infinite before the first
    rejected: float  # poses in a row that failed the gate


class LoadEstimate(NamedTuple):
    """Load and cable, with the covariances of (position, velocity) and (direction, rate)."""

    x_load: Vec3
    v_load: Vec3
    q_cable: Vec3
    q_cable_dot: Vec3
    covariance: Covariance2
    cable_covariance: Covariance2
    taut: float
    tension: float
    age_s: float
    rejected: float


class EstimatorState(NamedTuple):
    """All the estimator knows. One covariance serves the three axes of a quantity."""

    time_s: float
    vehicle: VehicleEstimate
    load: LoadEstimate
    last_imu: ImuReading
    resets: float
    head: int  # row of the history that holds this state


def new_history() -> History:
    """An empty ring of past states; `predict` writes it in place."""
    history = np.zeros((HISTORY_LENGTH, HISTORY_COLUMNS))
    history[:, 0] = -np.inf  # the time: long ago
    return history


def blank_state() -> EstimatorState:
    """The state before the first reading: nothing is known."""
    return EstimatorState(
        time_s=0.0,
        vehicle=VehicleEstimate(
            x_quad=ZERO,
            v_quad=ZERO,
            quat_wxyz=IDENTITY_QUAT,
            omega_body=ZERO,
            gyro_bias=ZERO,
            accel_bias=ZERO,
            accel_quad=ZERO,
            covariance=(1.0, 0.0, 0.0, 1.0, 0.0, ACCEL_BIAS_STD**2),
            attitude_covariance=(1.0, 0.0, GYRO_BIAS_STD**2),
            age_s=inf,
            rejected=0.0,
        ),
        load=LoadEstimate(
            x_load=ZERO,
            v_load=ZERO,
            q_cable=(0.0, 0.0, -1.0),
            q_cable_dot=ZERO,
            covariance=(1.0, 0.0, 1.0),
            cable_covariance=(1.0, 0.0, 1.0),
            taut=0.0,
            tension=0.0,
            age_s=inf,
            rejected=0.0,
        ),
        last_imu=ImuReading(ZERO, (0.0, 0.0, 9.81)),
        resets=0.0,
        head=0,
    )
