"""Records of the estimator: its state, its assumptions about the sensors, and its readings.

Kernels replace a few fields by `with_field`. One that computes most of them names each, unless there are more
than 15, which cannot be passed to compiled code by name.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control.drag import UNKNOWN_FRAME_SHARE, Drag
from autopilot.geometry.linear import E1, ZERO, Vec3
from autopilot.geometry.so3 import IDENTITY_QUAT, Quat
from autopilot.geometry.wide import aligned_zeros

Array = NDArray[np.float64]

# The error state, all but the biases in world axes: position, velocity and attitude of the vehicle (R =
# exp(attitude error) R estimated), biases of gyro and accelerometer (body), then the cable in its own two
# axes: direction, rate, and its length; and the horizontal acceleration of the load by the air. Flights with
# only trackers need no more.
POSITION, VELOCITY, ATTITUDE, GYRO_BIAS, ACCEL_BIAS = 0, 3, 6, 9, 12
DIRECTION, RATE, LENGTH, AIR = 15, 17, 19, 20
TRACKED_SIZE = 22
# mounting of the camera (about the body's forward and left axes), magnetic heading, barometer, receiver
MOUNTING, HEADING, BAROMETER, GNSS = 22, 24, 25, 26
AIDED_SIZE = 29
# horizontal acceleration of the vehicle by the air: only where the load is known by its pull alone
PUSH = 29
SIZE = 31

PADDED_SIZE = 32  # a multiple of eight
SCALARS, ENTRIES = 9, 13  # of one reading; of a scalar's Jacobian, with their number in column 0
INNOVATION, VARIANCE = 0, 1  # columns of `History.scalars`

# columns of the ring of past states: column 0 is the time, then as named
RING_LENGTH = 512
X_QUAD, V_QUAD, QUAT, Q_CABLE, ACROSS, Q_RATE = 1, 4, 7, 11, 14, 17
RING_COLUMNS = 20

# sensors, as rows of `History.consistency`
POSE, LOAD, FIX, PRESSURE, MAGNETIC, LINE_OF_SIGHT, ZERO_VELOCITY, PULL = 0, 1, 2, 3, 4, 5, 6, 7
SENSORS = 8
TEST_RATIO = 2  # column: normalised innovation squared over the gate's limit; above 1 it is rejected

NO_SENSOR, TRACKER, RECEIVER = 0.0, 1.0, 2.0  # what measures the position of the vehicle
PLAIN, RTK_FLOAT, RTK_FIXED = 0.0, 1.0, 2.0  # GnssReading.rtk: what is known of the carrier's whole waves
# what measures the position of the load, beside NO_SENSOR and TRACKER: a camera, or the load's pull on the
# vehicle
CAMERA = 2.0

Covariance2 = tuple[float, float, float]  # (aa, ab, bb)


class History(NamedTuple):
    """The arrays of the filter, written in place: too large for tuples."""

    ring: Array  # past states, RING_LENGTH x RING_COLUMNS
    # of the error state, symmetric to the bit; PADDED_SIZE x PADDED_SIZE, of which SIZE x SIZE are used
    covariance: Array
    error: Array  # 1 x PADDED_SIZE: the correction being collected
    columns: NDArray[np.int64]  # SCALARS x ENTRIES: how many entries its Jacobian has, then their columns
    jacobian: Array  # SCALARS x ENTRIES: the entries, from column 1 on
    gain: Array  # SCALARS x PADDED_SIZE: Jacobian times covariance
    scalars: Array  # SCALARS x 2: innovation and variance
    consistency: Array  # SENSORS x 3: readings absorbed, the sum of their NIS, and the last TEST_RATIO


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


class GnssReading(NamedTuple):
    """A satellite navigation receiver's fix, ENU from home; `rtk` is PLAIN, RTK_FLOAT or RTK_FIXED: whether
    it knows the whole numbers of waves of the carrier."""

    age_s: float
    position: Vec3
    velocity: Vec3
    horizontal_std: float
    vertical_std: float
    rtk: float


class DirectionReading(NamedTuple):
    """Unit vector from vehicle to load, body FLU, as a camera or an encoder sees it."""

    age_s: float
    direction_body: Vec3
    direction_std: float


class EstimatorTuning(NamedTuple):
    """The estimator's assumptions. Deviations of IMU and models are of one sample, walks of one second."""

    cable_length: float
    quad_mass: float
    load_mass: float
    gravity: float
    gyro_std: float
    accel_std: float
    gyro_range: float  # rad/s, full scale
    accel_range: float  # m/s^2
    gyro_bias_std: float  # rad/s, at switch-on
    accel_bias_std: float  # m/s^2
    gyro_bias_walk: float  # rad/s per square root of a second
    accel_bias_walk: float  # m/s^2 per square root of a second
    cable_accel_std: float  # rad/s^2, error of the pendulum model while taut
    load_drag: float  # 1/m, drag on the load that the model leaves out: acceleration over square of speed
    air_std: float  # m/s^2, horizontal, of the load's acceleration by the air
    air_walk: float  # m/s^2 per square root of a second
    push_std: float  # m/s^2, horizontal, of the vehicle's acceleration by the air beyond its assumed drag
    push_walk: float  # m/s^2 per square root of a second
    drag: Drag  # of the vehicle
    inertia: Vec3  # kg m^2, body
    turn_std: float  # rad/s^2, error of the angular acceleration by which the rotors turn the vehicle
    length_std: float  # m, of the assumed length
    gate_sigma: float
    imu_age: float  # s, of an inertial sample when it arrives
    rtk_white: float  # share of a fix's stated deviation that is new in every fix
    gnss_white: float  # the same without carrier phase
    gnss_time: float  # s, time constant with which the rest changes
    rtk_speed_std: float  # m/s, horizontal; the climb has 1.7 times this deviation
    gnss_speed_std: float
    barometer_std: float  # m
    barometer_walk: float  # m per square root of a second
    barometer_age: float  # s
    magnetic_std: float  # rad of heading
    magnetic_bias: float  # rad
    magnetic_age: float  # s
    declination: float  # rad, east of north
    mounting_std: float  # rad, of the camera
    standing_height: float  # m, of the cable's attachment above the ground on which the vehicle stands
    load_height: float  # m, height of the centre of the load on the ground
    initial_load_forward: float  # m ahead of the vehicle on the ground: where the load is at first
    initial_load_std: float  # m
    imu_position: Vec3  # m, from the centre of mass, body
    antenna_position: Vec3  # m, of the receiver


class VehicleEstimate(NamedTuple):
    """Estimate of the vehicle."""

    x_quad: Vec3
    v_quad: Vec3
    quat_wxyz: Quat
    omega_body: Vec3
    gyro_bias: Vec3
    accel_bias: Vec3
    accel_quad: Vec3  # inertial acceleration, ENU
    age_s: float  # of the last accepted pose or fix; infinite before the first
    rejected: float  # poses or fixes in a row that failed the gate
    source: float  # NO_SENSOR, TRACKER or RECEIVER
    turning_accel: Vec3  # m/s^2, body: what an IMU beside the centre of mass measures of the rotation


NOT_LAID = -1e6  # m, a height below all others


class LoadEstimate(NamedTuple):
    """Load and cable. While the cable is slack, `covariance` is that of the load's position and velocity, the
    same on each axis."""

    x_load: Vec3
    v_load: Vec3
    q_cable: Vec3
    q_cable_dot: Vec3
    across: Vec3  # first axis of the cable's own frame, orthogonal to q_cable; the second is q_cable x across
    length: float
    covariance: Covariance2
    taut: float
    tension: float
    pull: float  # N along the cable: what the vehicle's acceleration shows beyond assumed thrust, smoothed
    pull_duration_s: (
        float  # s, how long the pull has contradicted `taut`; how long a tracked load has been carried
    )
    tautness_age_s: float  # since the cable came taut or slack
    age_s: float
    rejected: float
    source: float  # NO_SENSOR, TRACKER or CAMERA
    laid_height: float  # m, at which it lay when its cable came taut; NOT_LAID if it is in the air
    laid_height_var: float  # m^2, of the height at which it lies or lay
    length_share: float  # of the assumed length: what a tracked load's cable, by its pull, has of it at least


class SensorErrors(NamedTuple):
    """Errors of the aiding sensors, and the age of the last reading of each."""

    mounting: tuple[float, float]  # of the camera, rad about the body's forward and left axes
    heading: float  # of the magnetometer, rad
    barometer: float  # m
    gnss: Vec3  # m, the slow error of the receiver
    horizontal_slow_std: float  # m, its standard deviation as last stated
    vertical_slow_std: float
    reversion: float  # 1 with carrier phase, else less: see `correct_gnss`
    pending_correction: Vec3  # m, recent corrections of the position that are not yet passed on to the laws
    field: Vec3  # the magnetometer's last reading, body
    magnetic_age: float
    barometer_age: float
    rejected: float  # directions to the load in a row that failed the gate


class AirEstimate(NamedTuple):
    """Horizontal accelerations by the air that the models leave out, m/s^2: of the load beyond the pendulum,
    of the vehicle beyond its assumed drag."""

    load_accel: tuple[float, float]
    vehicle_accel: tuple[float, float]
    load_drag: float  # 1/s: how the load's acceleration by the air changes with the load's speed
    mean_velocity: tuple[float, float]  # m/s, horizontal, of the load: over some seconds
    mean_accel: tuple[float, float]  # m/s^2, the same of the load's acceleration by the air
    velocity_accel_covariance: float  # m^2/s^3, mean product of both, each less its mean
    velocity_variance: float  # m^2/s^2, mean square of the speed less its mean
    gust_variance: float  # (m/s^2)^2, mean square of the load's acceleration by the wind less its mean


class Vibration(NamedTuple):
    """The noise of the inertial unit as its samples show it."""

    accel_var: float  # (m/s^2)^2, of one sample and axis
    accel_band_var: float  # (m/s^2)^2, of white noise that is as strong in the band below the rotors' speeds
    gyro_var: float  # (rad/s)^2
    attitude_var_rate: float  # rad^2/s, growth of the attitude's variance by the gyroscope's noise
    last_difference: ImuReading  # change from the last sample but one to the last
    low_passed: tuple[Vec3, Vec3, Vec3, Vec3]  # m/s^2, the accelerometer through one to four low-passes


class Clipping(NamedTuple):
    """Samples of the inertial unit at its full scale."""

    accel: Vec3  # 1 for each body axis of the accelerometer that an impact cut in the last step, else 0
    gyro: float  # 1 if an impact cut the gyroscope in the last step, else 0
    impact_age_s: float  # since the last such step; infinite before the first
    samples: float  # of the accelerometer that were cut so far


class ImuHeight(NamedTuple):
    """The height of the inertial unit above its assumed place, and sums of the fit of f to e: see
    `autopilot.estimation.imu_height`."""

    height: float  # m; 0 until it is known
    correlation: float  # of f . e, m/s^4
    square: float  # of e . e, 1/s^4
    spread: float  # of the square of what f . e differs by from the fit, m^2/s^8
    mean_lateral: tuple[float, float]  # m/s^2, of f
    rest_lateral: tuple[float, float]  # m/s^2, mean of what f differs from its mean by
    mean_turning: tuple[float, float]  # 1/s^2, of e
    rest_turning: tuple[float, float]  # 1/s^2


class Uncertainty(NamedTuple):
    """Standard deviations of the estimate, as of the last prediction."""

    horizontal: float  # m, each axis
    vertical: float
    tilt: float  # rad, each axis
    heading: float
    load: float  # m, each axis; relative to the vehicle while nothing tracks the load
    relative: float  # m, each axis: of the vehicle without the receiver's slow error
    speed: float  # m/s, of the vehicle along the world axis on which it is known least


class EstimatorState(NamedTuple):
    """The whole state of the estimator, except for what `History` holds."""

    time_s: float
    vehicle: VehicleEstimate
    load: LoadEstimate
    sensor_errors: SensorErrors
    air: AirEstimate
    uncertainty: Uncertainty
    last_imu: ImuReading
    vibration: Vibration
    clipping: Clipping
    missing_pull: float  # N, averaged over time: the cable's pull by the pendulum less the measured pull
    slack_pull: float  # N, the pull that would be measured with the assumed mass while the cable is slack
    imu_height: ImuHeight
    frame_share: float  # of the air's force on the vehicle across the rotors' axis: see `cable_pull`
    last_thrust: float  # N, assumed at the last prediction
    resets: float
    memory_s: float  # s, age of the oldest reading so far: corrections go back this far in the ring
    head: int  # row of the ring that holds this state
    size: int  # how much of the error state is in use


def new_history() -> History:
    """Arrays of a filter without readings; `predict` and the corrections write them in place."""
    ring = np.zeros((RING_LENGTH, RING_COLUMNS))
    ring[:, 0] = -np.inf  # the time: long ago
    return History(
        ring,
        aligned_zeros(PADDED_SIZE, PADDED_SIZE),
        aligned_zeros(1, PADDED_SIZE),
        np.zeros((SCALARS, ENTRIES), np.int64),
        np.zeros((SCALARS, ENTRIES)),
        aligned_zeros(SCALARS, PADDED_SIZE),
        np.zeros((SCALARS, 2)),
        np.zeros((SENSORS, 3)),
    )


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
            age_s=inf,
            rejected=0.0,
            source=NO_SENSOR,
            turning_accel=ZERO,
        ),
        load=LoadEstimate(
            x_load=ZERO,
            v_load=ZERO,
            q_cable=(0.0, 0.0, -1.0),
            q_cable_dot=ZERO,
            across=E1,
            length=1.0,
            covariance=(1.0, 0.0, 1.0),
            taut=0.0,
            tension=0.0,
            pull=0.0,
            pull_duration_s=0.0,
            tautness_age_s=0.0,
            age_s=inf,
            rejected=0.0,
            source=NO_SENSOR,
            laid_height=NOT_LAID,
            laid_height_var=0.0,
            length_share=1.0,
        ),
        sensor_errors=SensorErrors((0.0, 0.0), 0.0, 0.0, ZERO, 1.0, 1.0, 1.0, ZERO, ZERO, inf, inf, 0.0),
        air=AirEstimate((0.0, 0.0), (0.0, 0.0), 0.0, (0.0, 0.0), (0.0, 0.0), 0.0, 0.0, 0.0),
        uncertainty=Uncertainty(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
        last_imu=ImuReading(ZERO, (0.0, 0.0, 9.81)),
        vibration=Vibration(0.0, 0.0, 0.0, 0.0, ImuReading(ZERO, ZERO), (ZERO, ZERO, ZERO, ZERO)),
        clipping=Clipping(ZERO, 0.0, inf, 0.0),
        missing_pull=0.0,
        slack_pull=0.0,
        imu_height=ImuHeight(0.0, 0.0, 0.0, 0.0, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
        frame_share=UNKNOWN_FRAME_SHARE,
        last_thrust=0.0,
        resets=0.0,
        memory_s=0.0,
        head=0,
        size=TRACKED_SIZE,
    )
