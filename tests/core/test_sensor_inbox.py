"""A datagram of the simulator becomes a tick, and its readings rows of the inbox."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from fastcrc.crc16 import mcrf4xx
from hypothesis import given
from hypothesis import strategies as st

from autopilot.core.sensor_inbox import INERTIAL, SensorInbox
from autopilot.estimation import inbox as box
from autopilot.estimation.records import (
    PLAIN,
    RTK_FIXED,
    RTK_FLOAT,
    DirectionReading,
    GnssReading,
    ImuReading,
    LoadReading,
    PoseReading,
)
from autopilot.geometry.packed import unpack
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import MAG, PRESSURE, HilGps
from autopilot.wire.dialect import plumbline as mavlink
from tests.doubles.messages import hil_gps_message, hil_sensor_message, load_sensor_message, odometry_message

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


KINDS = {
    box.IMU: ImuReading,
    box.POSE: PoseReading,
    box.LOAD: LoadReading,
    box.FIX: GnssReading,
    box.DIRECTION: DirectionReading,
}


class Read(NamedTuple):
    """A tick with its readings as (kind, instant shown in us, record or numbers)."""

    now_us: int
    readings: list[tuple[int, int, Any]]
    imu: ImuReading | None
    gps: HilGps | None
    fields_updated: int
    other_messages: tuple[Any, ...]


def reading_in(row: np.ndarray) -> tuple[int, int, Any]:
    kind, shows_us = int(row[box.KIND]), int(row[box.SAMPLE_TIME_US])
    if kind in KINDS:
        return kind, shows_us, unpack(KINDS[kind], row, box.READING)
    return kind, shows_us, tuple(row[box.READING : box.READING + (1 if kind == box.HEIGHT else 3)])


def sample_of(inbox: SensorInbox) -> ImuReading | None:
    """The inertial sample of the last tick; None where it is not sane."""
    imu = unpack(ImuReading, inbox.imu, 0)
    return imu if box.is_valid_imu(imu) else None


def tick_of(*datagrams: bytes, rows: int = box.INBOX_ROWS) -> Read:
    inbox = SensorInbox(HOME, box.new_inbox(rows))
    tick = inbox.read(b"".join(datagrams), -1)
    assert tick is not None
    readings = [reading_in(row) for row in inbox.rows[: tick.readings]]
    gps = unpack(HilGps, inbox.fix, 0) if tick.has_fix else None
    return Read(tick.now_us, readings, sample_of(inbox), gps, tick.fields_updated, tick.other_messages)


def record(tick: Read, kind: int) -> tuple[int, object]:
    """The only reading of this kind: the instant it shows, and its record."""
    ((_, shows_us, found),) = (reading for reading in tick.readings if reading[0] == kind)
    return shows_us, found


NO_VECTOR = (math.nan, math.nan, math.nan)
POSE = WRITER.frame(
    odometry_message(
        NOW_US - 4000, (1.0, 2.0, 3.0), (0.6, 0.0, 0.0, 0.8), (0.1, 0.2, 0.3), NO_VECTOR, 1e-3, 2e-3, 3e-3
    )
)
STILL_POSE = WRITER.frame(
    odometry_message(
        NOW_US, (1.0, 2.0, 3.0), (0.6, 0.0, 0.0, 0.8), NO_VECTOR, NO_VECTOR, 1e-3, 2e-3, math.nan
    )
)
TRACKED_LOAD = WRITER.frame(
    load_sensor_message(NOW_US - 8000, (1.0, 2.0, 0.5), (0.1, 0.2, 0.3), NO_VECTOR, 1e-3, 2e-3, math.nan)
)
SEEN_LOAD = WRITER.frame(
    load_sensor_message(NOW_US - 12_000, NO_VECTOR, NO_VECTOR, (0.0, 0.6, -0.8), math.nan, math.nan, 0.01, 1)
)
HEARTBEAT = WRITER.frame(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))


@pytest.mark.parametrize("datagram", [b"", b"\x00\xff" * 40, HEARTBEAT, POSE, sensor()[:-1]])
def test_without_a_whole_sensor_message_there_is_no_tick(datagram: bytes) -> None:
    assert SensorInbox(HOME, box.new_inbox()).read(datagram, -1) is None


def test_the_sensor_message_is_the_clock_and_the_inertial_sample() -> None:
    tick = tick_of(sensor(0))
    assert (tick.now_us, tick.fields_updated, tick.gps, tick.other_messages) == (NOW_US, 0, None, ())
    assert [kind for kind, _, _ in tick.readings] == [box.IMU]
    assert tick.imu is not None
    assert tick.imu.accel == pytest.approx((0.0, 0.5, 9.81), abs=SINGLE)
    assert tick.imu.gyro == pytest.approx((0.1, 0.2, 0.3), abs=SINGLE)
    assert record(tick, box.IMU) == (box.REPEATED_SAMPLE, tick.imu), "nothing of it was updated"
    tick = tick_of(sensor(INERTIAL))
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
    [(0, None), (1, None), (2, None), (3, PLAIN), (4, PLAIN), (5, RTK_FLOAT), (6, RTK_FIXED)],
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
    assert [message.get_type() for message in tick.other_messages] == ["HEARTBEAT"]


def test_readings_are_absorbed_in_this_order() -> None:
    tick = tick_of(gps(6), POSE, TRACKED_LOAD, sensor(PRESSURE | MAG), SEEN_LOAD)
    kinds = [kind for kind, _, _ in tick.readings]
    assert kinds == [box.POSE, box.LOAD, box.DIRECTION, box.IMU, box.FIX, box.HEIGHT, box.FIELD]


def test_an_inbox_grows_to_what_a_tick_brings_and_is_kept_otherwise() -> None:
    rows = box.new_inbox()
    inbox = SensorInbox(HOME, rows)
    assert inbox.read(POSE + sensor(), -1) is not None
    assert inbox.rows is rows
    tick = inbox.read(b"".join([*[POSE] * 40, sensor(0)]), -1)
    assert tick is not None
    assert tick.readings == 41
    assert len(inbox.rows) >= 41
    assert np.count_nonzero(inbox.rows[:, box.KIND] == box.POSE) == 40


def test_only_a_later_tick_changes_the_sample_and_the_fix_that_are_kept() -> None:
    inbox = SensorInbox(HOME, box.new_inbox())
    assert sample_of(inbox) is None
    inbox.read(gps(3) + sensor(0), -1)
    kept, fix = sample_of(inbox), inbox.fix.copy()
    assert kept is not None
    again = inbox.read(gps(6) + sensor(0, (5.0, 5.0, 5.0)), NOW_US)
    assert again is not None
    assert again.now_us == NOW_US
    assert sample_of(inbox) == kept
    assert np.array_equal(inbox.fix, fix)


# ---- frames that are not plain are read by the general decoder, and give the same readings


def version_1(frame: bytes) -> bytes:
    """The frame of a message with an id below 256 in the format of MAVLink 1."""
    received = decode(frame)[0][0].message
    payload = frame[10:-2].ljust(type(received).unpacker.size, b"\0")
    head = bytes((0xFE, len(payload), *frame[4:8]))
    checked = head[1:] + payload + bytes((received.crc_extra,))
    return head + payload + mcrf4xx(checked).to_bytes(2, "little")


WHOLE = (POSE, TRACKED_LOAD, SEEN_LOAD, gps(6), sensor(PRESSURE | MAG))


@pytest.mark.parametrize(
    "datagram",
    [
        b"\x00" + b"".join(WHOLE),
        b"".join(WHOLE) + b"\xfd",
        b"".join((*WHOLE[:2], b"\xfd\x03rubbish", *WHOLE[2:])),
        b"".join((*WHOLE[:2], POSE[:-1] + b"\x00", *WHOLE[2:])),
        b"".join((*WHOLE[:4], version_1(WHOLE[4]))),
        b"".join((*WHOLE, HEARTBEAT)),
    ],
    ids=["rubbish before", "rubbish behind", "rubbish between", "wrong checksum", "version 1", "a heartbeat"],
)
def test_what_surrounds_the_frames_of_the_sensors_changes_no_reading(datagram: bytes) -> None:
    expected, found = tick_of(*WHOLE), tick_of(datagram)
    assert len(expected.readings) == 7
    assert found._replace(other_messages=()) == expected._replace(other_messages=())


@given(at=st.integers(0, len(b"".join(WHOLE)) - 1), to=st.integers(0, 255), cut=st.integers(0, 400))
def test_damaged_datagrams_give_what_the_general_decoder_finds(at: int, to: int, cut: int) -> None:
    damaged = bytearray(b"".join(WHOLE))
    damaged[at] = to
    datagram = bytes(damaged[: max(len(damaged) - cut, 0)])
    sound = b"".join(one.frame for one in decode(datagram)[0])
    inbox, other = (SensorInbox(HOME, box.new_inbox()) for _ in range(2))
    found, expected = inbox.read(datagram, -1), other.read(sound, -1)
    assert (found and found.readings) == (expected and expected.readings)
    assert np.array_equal(inbox.rows, other.rows, equal_nan=True)
