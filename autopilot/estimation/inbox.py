"""The readings of one tick as rows of an array, and which of them are accepted.

A row is (kind, instant that it shows in us, the reading's numbers as in its record). The age of a reading is
computed here, by the clock of the estimate. A reading that is not a number, beyond any sensor's range, from
the future or too old is dropped. Stated deviations are raised to the least deviations below, for a sensor
that claims to be perfect.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from autopilot.estimation.history import reading_age
from autopilot.estimation.records import (
    Array,
    DirectionReading,
    GnssReading,
    ImuReading,
    LoadReading,
    PoseReading,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, norm, scale
from autopilot.geometry.packed import unpack
from autopilot.geometry.so3 import Quat

KIND, SAMPLE_TIME_US, READING = 0, 1, 2  # columns
COLUMNS = 16
IMU, POSE, FIELD, FIX, HEIGHT, LOAD, DIRECTION, ROTOR_SPEEDS = range(
    8
)  # the last: of rotors, not for the estimate
INBOX_ROWS = 16  # rows of a new inbox

# so that the filter stays well conditioned
MIN_POSITION_STD_M = 2e-5
MIN_ANGLE_STD_RAD = 2e-5
MIN_VELOCITY_STD_M_S = 2e-4
MIN_FIX_STD_M = 2e-3
MIN_DIRECTION_STD_RAD = 1e-4
MAX_READING_AGE_S = 0.3  # older ones are dropped: corrections go back no further in the ring of past states
# beyond any sensor's range
MAX_ACCEL_M_S2, MAX_RATE_RAD_S = 2000.0, 500.0
MAX_POSITION_M, MAX_SPEED_M_S = 1e6, 1e4
MAX_STD = 1e4  # m, m/s, rad: a sensor that states more has measured nothing
UNIT_TOLERANCE = 0.02  # of the square of a quaternion's length
NOT_MEASURED = -1.0  # deviation of a velocity that was not measured
REPEATED_SAMPLE = -1  # instant of an inertial sample that only repeats the last one


def new_inbox(rows: int = INBOX_ROWS) -> Array:
    """An inbox with room for this many readings."""
    return np.zeros((rows, COLUMNS))


@kernel
def within(v: Vec3, limit: float) -> bool:
    """Whether a vector is shorter than `limit`; False for NaN."""
    return norm(v) < limit


@kernel
def is_unit(q: Quat) -> bool:
    """Whether a quaternion is a rotation, apart from rounding."""
    return abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < UNIT_TOLERANCE


@kernel
def at_least(value: float, minimum: float) -> float:
    """`value`, but no less than `minimum`; also for NaN."""
    return value if value > minimum else minimum


@kernel
def is_valid_imu(imu: ImuReading) -> bool:
    """Whether an inertial sample is a number and within any sensor's range."""
    return norm(imu.accel) < MAX_ACCEL_M_S2 and norm(imu.gyro) < MAX_RATE_RAD_S


@kernel
def age_of(row: Array, now_us: int, imu_age: float) -> float:
    """Age of a reading, s; NaN if it is from the future or too old."""
    age = reading_age(now_us - row[SAMPLE_TIME_US], imu_age)
    if row[SAMPLE_TIME_US] <= now_us and age <= MAX_READING_AGE_S:
        return age
    return np.nan


@kernel
def read_pose(row: Array, age_s: float) -> tuple[bool, PoseReading]:
    """Whether the row's pose is accepted, and the pose."""
    raw = unpack(PoseReading, row, READING)
    velocity_measured = not raw.velocity_std < 0.0
    q = raw.quat_wxyz
    pose = PoseReading(
        age_s,
        raw.x_quad,
        q,
        raw.v_quad if velocity_measured else ZERO,
        at_least(raw.position_std, MIN_POSITION_STD_M),
        at_least(raw.attitude_std, MIN_ANGLE_STD_RAD),
        at_least(raw.velocity_std, MIN_VELOCITY_STD_M_S) if velocity_measured else NOT_MEASURED,
    )
    std_valid = max(pose.position_std, pose.attitude_std, pose.velocity_std) < MAX_STD
    in_range = within(pose.x_quad, MAX_POSITION_M) and within(pose.v_quad, MAX_SPEED_M_S)
    return isfinite(age_s) and in_range and is_unit(q) and std_valid, pose


@kernel
def read_load(row: Array, age_s: float) -> tuple[bool, LoadReading]:
    """Whether the row's position of the load is accepted, and the reading."""
    raw = unpack(LoadReading, row, READING)
    velocity_measured = not raw.velocity_std < 0.0
    load = LoadReading(
        age_s,
        raw.x_load,
        raw.v_load if velocity_measured else ZERO,
        at_least(raw.position_std, MIN_POSITION_STD_M),
        at_least(raw.velocity_std, MIN_VELOCITY_STD_M_S) if velocity_measured else NOT_MEASURED,
    )
    std_valid = max(load.position_std, load.velocity_std) < MAX_STD
    in_range = within(load.x_load, MAX_POSITION_M) and within(load.v_load, MAX_SPEED_M_S)
    return isfinite(age_s) and in_range and std_valid, load


@kernel
def read_fix(row: Array, age_s: float) -> tuple[bool, GnssReading]:
    """Whether the row's fix is accepted, and the fix."""
    raw = unpack(GnssReading, row, READING)
    fix = GnssReading(
        age_s,
        raw.position,
        raw.velocity,
        at_least(raw.horizontal_std, MIN_FIX_STD_M),
        at_least(raw.vertical_std, MIN_FIX_STD_M),
        raw.rtk,
    )
    std_valid = abs(raw.horizontal_std) < MAX_STD and abs(raw.vertical_std) < MAX_STD
    in_range = within(fix.position, MAX_POSITION_M) and within(fix.velocity, MAX_SPEED_M_S)
    return isfinite(age_s) and in_range and std_valid, fix


@kernel
def read_direction(row: Array, age_s: float) -> tuple[bool, DirectionReading]:
    """Whether the row's direction to the load is accepted, and the reading."""
    raw = unpack(DirectionReading, row, READING)
    length = norm(raw.direction_body)
    direction = DirectionReading(
        age_s,
        scale(1.0 / length, raw.direction_body),
        at_least(raw.direction_std, MIN_DIRECTION_STD_RAD),
    )
    return isfinite(age_s) and 0.5 < length < 2.0 and direction.direction_std < MAX_STD, direction


@kernel
def read_vector(row: Array) -> Vec3:
    """Three numbers of a row."""
    return (row[READING], row[READING + 1], row[READING + 2])
