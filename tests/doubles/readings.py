"""Readings of one tick by name, for tests of the estimator: they fill the inbox that the estimator reads."""

from __future__ import annotations

from typing import Any, NamedTuple

from autopilot.control.records import Cable
from autopilot.estimation import inbox as box
from autopilot.estimation.filter import estimate as estimate_from_inbox
from autopilot.estimation.records import (
    Array,
    DirectionReading,
    EstimatorState,
    EstimatorTuning,
    GnssReading,
    History,
    ImuReading,
    LoadReading,
    PoseReading,
)
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.packed import pack


class Readings(NamedTuple):
    """The readings of the sensors since the last tick; each kind in the order of arrival."""

    imu: ImuReading | None
    poses: tuple[PoseReading, ...] = ()
    loads: tuple[LoadReading, ...] = ()
    fixes: tuple[GnssReading, ...] = ()
    directions: tuple[DirectionReading, ...] = ()
    height_m: float | None = None  # by the barometer, over home
    field_body: Vec3 | None = None  # of the magnetometer


def put_reading(inbox: Array, row: int, kind: int, sample_time_us: int, reading: Any) -> None:
    """Write a record of a reading into a row; its age is not used."""
    inbox[row, box.KIND] = kind
    inbox[row, box.SAMPLE_TIME_US] = sample_time_us
    pack(reading, inbox[row], box.READING)


def put_vector(inbox: Array, row: int, kind: int, vector: tuple[float, ...]) -> None:
    """Write a reading that is a number or a vector, and of this instant."""
    inbox[row, box.KIND] = kind
    inbox[row, box.READING : box.READING + len(vector)] = vector


def estimate(
    state: EstimatorState,
    history: History,
    readings: Readings,
    tuning: EstimatorTuning,
    dt: float,
    thrust: float = 0.0,
) -> EstimatorState:
    """The state after `dt` seconds and the readings, with the cable length of the tuning."""
    inbox = box.new_inbox(64)
    count = 0
    if readings.imu is not None:
        put_reading(inbox, count, box.IMU, 0, readings.imu)
        count += 1
    aged = (
        (box.POSE, readings.poses),
        (box.LOAD, readings.loads),
        (box.FIX, readings.fixes),
        (box.DIRECTION, readings.directions),
    )
    for kind, found in aged:
        for reading in found:
            put_reading(inbox, count, kind, 0, reading)
            inbox[count, box.SAMPLE_TIME_US] = -1e6 * (reading.age_s + tuning.imu_age)
            count += 1
    if readings.height_m is not None:
        put_vector(inbox, count, box.HEIGHT, (readings.height_m,))
        count += 1
    if readings.field_body is not None:
        put_vector(inbox, count, box.FIELD, readings.field_body)
        count += 1
    cable = Cable(tuning.cable_length)
    return estimate_from_inbox(state, history, inbox, count, 0, tuning, cable, 0.0, dt, thrust, ZERO)
