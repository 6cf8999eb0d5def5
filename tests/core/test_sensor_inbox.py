"""A datagram of the simulator becomes a tick, and its readings rows of the inbox."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autopilot.core.sensor_inbox import Tick, fill, read_tick
from autopilot.estimation import inbox as box
from autopilot.estimation.records import DirectionReading, GnssReading, ImuReading, LoadReading, PoseReading
from autopilot.geometry.packed import unpack
from autopilot.wire.codec import FrameWriter
from autopilot.wire.convert import (
    MAG,
    PRESSURE,
    Home,
    hil_gps_message,
    hil_sensor_message,
    load_sensor_message,
    odometry_message,
)
from autopilot.wire.dialect import plumbline as mavlink

HOME = Home()
NOW_US = 1_000_000
WRITER = FrameWriter(1, 26)
SINGLE = 1e-6  # rounding of single precision, of numbers up to 10


def sensor(fields: int = 63, accel: tuple[float, float, float] = (0.0, 0.5, 9.81)) -> bytes:
    message = hil_sensor_message(
        NOW_US, accel, (0.1, 0.2, 0.3), (0.2, 0.0, -0.4), 101_325.0, HOME.altitude_m + 2.5, 20.0, fields
    )
    return WRITER.frame(message)


def gps(fix_type: int) -> bytes:
    message = hil_gps_message(
        NOW_US - 80_000, fix_type, (1.0, 2.0, 3.0), (0.5, 0.0, -0.25), 0.02, 0.04, 12, home=HOME
    )
    return WRITER.frame(message)


def tick_of(*datagrams: bytes) -> Tick:
    tick = read_tick(b"".join(datagrams), HOME)
    assert tick is not None
    return tick


def record(tick: Tick, kind: int) -> tuple[int, object]:
    """The only reading of this kind: the instant it shows, and its record."""
    ((_, shows_us, found),) = (reading for reading in tick.readings if reading[0] == kind)
    return shows_us, found


POSE = WRITER.frame(
    odometry_message(
        NOW_US - 4000, (1.0, 2.0, 3.0), (0.6, 0.0, 0.0, 0.8), (0.1, 0.2, 0.3), None, 1e-3, 2e-3, 3e-3
    )
)
STILL_POSE = WRITER.frame(
    odometry_message(NOW_US, (1.0, 2.0, 3.0), (0.6, 0.0, 0.0, 0.8), None, None, 1e-3, 2e-3, math.nan)
)
TRACKED_LOAD = WRITER.frame(
    load_sensor_message(NOW_US - 8000, (1.0, 2.0, 0.5), (0.1, 0.2, 0.3), None, 1e-3, 2e-3, math.nan)
)
SEEN_LOAD = WRITER.frame(
    load_sensor_message(NOW_US - 12_000, None, None, (0.0, 0.6, -0.8), math.nan, math.nan, 0.01, 1)
)
HEARTBEAT = WRITER.frame(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))


@pytest.mark.parametrize("datagram", [b"", b"\x00\xff" * 40, HEARTBEAT, POSE, sensor()[:-1]])
def test_without_a_whole_sensor_message_there_is_no_tick(datagram: bytes) -> None:
    assert read_tick(datagram, HOME) is None


def test_the_sensor_message_is_the_clock_and_the_inertial_sample() -> None:
    tick = tick_of(sensor(0))
    assert (tick.now_us, tick.fields_updated, tick.gps, tick.aside) == (NOW_US, 0, None, ())
    assert [kind for kind, _, _ in tick.readings] == [box.IMU]
    assert tick.imu is not None
    assert tick.imu.accel == pytest.approx((0.0, 0.5, 9.81), abs=SINGLE)
    assert tick.imu.gyro == pytest.approx((0.1, 0.2, 0.3), abs=SINGLE)
    assert record(tick, box.IMU) == (NOW_US, tick.imu)


@pytest.mark.parametrize("accel", [(math.nan, 0.0, 9.81), (0.0, math.inf, 9.81), (0.0, 0.0, 3000.0)])
def test_a_sample_beyond_any_sensors_range_is_not_told_to_the_log(accel: tuple[float, float, float]) -> None:
    assert tick_of(sensor(0, accel)).imu is None


@pytest.mark.parametrize(
    ("fields", "kinds"),
    [(PRESSURE, {box.HEIGHT}), (MAG, {box.FIELD}), (PRESSURE | MAG, {box.HEIGHT, box.FIELD}), (0, set())],
)
def test_pressure_and_field_count_where_they_are_new(fields: int, kinds: set[int]) -> None:
    tick = tick_of(sensor(fields))
    assert {kind for kind, _, _ in tick.readings} == {box.IMU} | kinds
    if fields & PRESSURE:
        assert record(tick, box.HEIGHT)[1] == pytest.approx((2.5,), abs=1e-4)  # of an altitude of 500 m
    if fields & MAG:
        assert record(tick, box.FIELD)[1] == pytest.approx((0.2, 0.0, -0.4), abs=SINGLE)


def test_a_pose_comes_with_the_deviations_that_its_tracker_states() -> None:
    shows_us, pose = record(tick_of(POSE, sensor()), box.POSE)
    assert isinstance(pose, PoseReading)
    assert shows_us == NOW_US - 4000
    assert pose.x_quad == pytest.approx((1.0, 2.0, 3.0), abs=SINGLE)
    assert pose.quat_wxyz == pytest.approx((0.6, 0.0, 0.0, 0.8), abs=SINGLE)
    assert pose.v_quad == pytest.approx((0.1, 0.2, 0.3), abs=SINGLE)
    stated = (pose.position_std, pose.attitude_std, pose.velocity_std)
    assert stated == pytest.approx((1e-3, 2e-3, 3e-3), rel=SINGLE)


def test_a_velocity_that_was_not_measured_is_marked() -> None:
    _, pose = record(tick_of(STILL_POSE, sensor()), box.POSE)
    assert isinstance(pose, PoseReading)
    assert (pose.v_quad, pose.velocity_std) == ((0.0, 0.0, 0.0), box.NOT_MEASURED)


def test_a_load_is_tracked_or_seen() -> None:
    tick = tick_of(TRACKED_LOAD, SEEN_LOAD, sensor(0))
    shows_us, load = record(tick, box.LOAD)
    assert isinstance(load, LoadReading)
    assert shows_us == NOW_US - 8000
    assert (*load.x_load, *load.v_load) == pytest.approx((1.0, 2.0, 0.5, 0.1, 0.2, 0.3), abs=SINGLE)
    assert (load.position_std, load.velocity_std) == pytest.approx((1e-3, 2e-3), rel=SINGLE)
    shows_us, sight = record(tick, box.DIRECTION)
    assert isinstance(sight, DirectionReading)
    assert shows_us == NOW_US - 12_000
    assert sight.direction_body == pytest.approx((0.0, 0.6, -0.8), abs=SINGLE)
    assert sight.direction_std == pytest.approx(0.01, rel=SINGLE)


@pytest.mark.parametrize(
    ("fix_type", "rtk"),
    [(0, None), (1, None), (2, None), (3, 0.0), (4, 0.0), (5, 1.0), (6, 1.0)],
)
def test_a_fix_is_read_from_three_dimensions_on_and_always_told_to_the_operator(
    fix_type: int, rtk: float | None
) -> None:
    tick = tick_of(gps(fix_type), sensor(0))
    assert tick.gps is not None
    assert tick.gps.fix_type == fix_type
    fixes = [reading for kind, _, reading in tick.readings if kind == box.FIX]
    if rtk is None:
        assert fixes == []
        return
    shows_us, fix = record(tick, box.FIX)
    assert isinstance(fix, GnssReading)
    assert shows_us == NOW_US - 80_000
    assert fix.position == pytest.approx((1.0, 2.0, 3.0), abs=0.012)  # 1e-7 degrees
    assert fix.velocity == pytest.approx((0.5, 0.0, -0.25), abs=0.01)
    assert (fix.horizontal_std, fix.vertical_std, fix.rtk) == pytest.approx((0.02, 0.04, rtk))


def test_other_messages_are_put_aside() -> None:
    tick = tick_of(HEARTBEAT, sensor(0))
    assert [message.get_type() for message in tick.aside] == ["HEARTBEAT"]


def test_the_inbox_holds_what_the_tick_says() -> None:
    tick = tick_of(POSE, TRACKED_LOAD, SEEN_LOAD, gps(6), sensor(PRESSURE | MAG))
    inbox = fill(box.new_inbox(), tick)
    assert len(inbox) == box.ROOM
    kinds = {box.IMU: ImuReading, box.POSE: PoseReading, box.LOAD: LoadReading}
    kinds |= {box.FIX: GnssReading, box.DIRECTION: DirectionReading}
    assert len(tick.readings) == 7
    for row, (kind, shows_us, reading) in zip(inbox, tick.readings, strict=False):
        assert row[box.KIND] == kind
        if kind in kinds:
            assert row[box.SHOWS] == shows_us
            assert unpack(kinds[kind], row, box.READING) == reading
        else:
            assert tuple(row[box.READING : box.READING + len(reading)]) == reading


def test_an_inbox_grows_to_what_a_tick_brings_and_is_kept_otherwise() -> None:
    inbox = box.new_inbox()
    assert fill(inbox, tick_of(POSE, sensor())) is inbox
    larger = fill(inbox, tick_of(*[POSE] * 40, sensor(0)))
    assert len(larger) >= 41
    assert np.count_nonzero(larger[:, box.KIND] == box.POSE) == 40
