"""The readings of one tick as rows of an array, and which of them are accepted.

A row is (kind, instant that it shows in us, the reading's numbers as in its record). The age of a reading is
computed here, by the clock of the estimate. A reading that is not a number, beyond any sensor's range, from
the future or too old is dropped. Stated deviations are raised to the least deviations below, for a sensor
that claims to be perfect.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

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
from autopilot.geometry.packed import pack, unpack
from autopilot.geometry.so3 import Quat

KIND, SHOWS, READING = 0, 1, 2  # columns
COLUMNS = 16
IMU, POSE, FIELD, FIX, HEIGHT, LOAD, DIRECTION, SPEEDS = range(8)  # the last: of rotors, not for the estimate
ROOM = 16  # rows of a new inbox

# so that the filter stays well conditioned
LEAST_POSITION_STD_M = 2e-5
LEAST_ANGLE_STD_RAD = 2e-5
LEAST_VELOCITY_STD_M_S = 2e-4
LEAST_FIX_STD_M = 2e-3
LEAST_DIRECTION_STD_RAD = 1e-4
OLDEST_READING_S = 0.3  # older ones are dropped: corrections go back no further in the ring of past states
# beyond any sensor's range
GREATEST_ACCEL_M_S2, GREATEST_RATE_RAD_S = 2000.0, 500.0
FARTHEST_M, FASTEST_M_S = 1e6, 1e4
GREATEST_STD = 1e4  # m, m/s, rad: a sensor that states more has measured nothing
UNIT_TOLERANCE = 0.02  # of the square of a quaternion's length
NOT_MEASURED = -1.0  # deviation of a velocity that was not measured
LONG_AGO = -1  # instant of an inertial sample that only repeats the last one


def new_inbox(rows: int = ROOM) -> Array:
    """An inbox with room for this many readings."""
    return np.zeros((rows, COLUMNS))


def put_reading(inbox: Array, at: int, kind: int, shows_us: int, reading: Any) -> None:
    """Write a record of a reading into a row; its age is not used."""
    inbox[at, KIND] = kind
    inbox[at, SHOWS] = shows_us
    pack(reading, inbox[at], READING)


def put_vector(inbox: Array, at: int, kind: int, vector: tuple[float, ...]) -> None:
    """Write a reading that is a number or a vector, and of this instant."""
    inbox[at, KIND] = kind
    inbox[at, READING : READING + len(vector)] = vector


@kernel
def within(v: Vec3, most: float) -> bool:
    """Whether a vector is shorter than `most`; False for NaN."""
    return norm(v) < most


@kernel
def is_unit(q: Quat) -> bool:
    """Whether a quaternion is a rotation, apart from rounding."""
    return abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < UNIT_TOLERANCE


@kernel
def at_least(value: float, least: float) -> float:
    """`value`, but no less than `least`; also for NaN."""
    return value if value > least else least


@kernel
def is_sane(imu: ImuReading) -> bool:
    """Whether an inertial sample is a number and within any sensor's range."""
    return norm(imu.accel) < GREATEST_ACCEL_M_S2 and norm(imu.gyro) < GREATEST_RATE_RAD_S


@kernel
def age_of(row: Array, now_us: int, imu_age: float) -> float:
    """Age of a reading, s; NaN if it is from the future or too old."""
    age = reading_age(now_us - row[SHOWS], imu_age)
    if row[SHOWS] <= now_us and age <= OLDEST_READING_S:
        return age
    return np.nan


@kernel
def pose_in(row: Array, age_s: float) -> tuple[bool, PoseReading]:
    """Whether the row's pose is accepted, and the pose."""
    raw = unpack(PoseReading, row, READING)
    measured = not raw.velocity_std < 0.0
    q = raw.quat_wxyz
    pose = PoseReading(
        age_s,
        raw.x_quad,
        q,
        raw.v_quad if measured else ZERO,
        at_least(raw.position_std, LEAST_POSITION_STD_M),
        at_least(raw.attitude_std, LEAST_ANGLE_STD_RAD),
        at_least(raw.velocity_std, LEAST_VELOCITY_STD_M_S) if measured else NOT_MEASURED,
    )
    stated = max(pose.position_std, pose.attitude_std, pose.velocity_std) < GREATEST_STD
    placed = within(pose.x_quad, FARTHEST_M) and within(pose.v_quad, FASTEST_M_S)
    return isfinite(age_s) and placed and is_unit(q) and stated, pose


@kernel
def load_in(row: Array, age_s: float) -> tuple[bool, LoadReading]:
    """Whether the row's position of the load is accepted, and the reading."""
    raw = unpack(LoadReading, row, READING)
    measured = not raw.velocity_std < 0.0
    load = LoadReading(
        age_s,
        raw.x_load,
        raw.v_load if measured else ZERO,
        at_least(raw.position_std, LEAST_POSITION_STD_M),
        at_least(raw.velocity_std, LEAST_VELOCITY_STD_M_S) if measured else NOT_MEASURED,
    )
    stated = max(load.position_std, load.velocity_std) < GREATEST_STD
    placed = within(load.x_load, FARTHEST_M) and within(load.v_load, FASTEST_M_S)
    return isfinite(age_s) and placed and stated, load


@kernel
def fix_in(row: Array, age_s: float) -> tuple[bool, GnssReading]:
    """Whether the row's fix is accepted, and the fix."""
    raw = unpack(GnssReading, row, READING)
    fix = GnssReading(
        age_s,
        raw.position,
        raw.velocity,
        at_least(raw.horizontal_std, LEAST_FIX_STD_M),
        at_least(raw.vertical_std, LEAST_FIX_STD_M),
        raw.rtk,
    )
    stated = abs(raw.horizontal_std) < GREATEST_STD and abs(raw.vertical_std) < GREATEST_STD
    placed = within(fix.position, FARTHEST_M) and within(fix.velocity, FASTEST_M_S)
    return isfinite(age_s) and placed and stated, fix


@kernel
def direction_in(row: Array, age_s: float) -> tuple[bool, DirectionReading]:
    """Whether the row's direction to the load is accepted, and the reading."""
    raw = unpack(DirectionReading, row, READING)
    length = norm(raw.direction_body)
    sight = DirectionReading(
        age_s,
        scale(1.0 / length, raw.direction_body),
        at_least(raw.direction_std, LEAST_DIRECTION_STD_RAD),
    )
    return isfinite(age_s) and 0.5 < length < 2.0 and sight.direction_std < GREATEST_STD, sight


@kernel
def vector_in(row: Array) -> Vec3:
    """Three numbers of a row."""
    return (row[READING], row[READING + 1], row[READING + 2])
