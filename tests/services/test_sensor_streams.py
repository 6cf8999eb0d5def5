"""Readings of sensors, odometry and flight information on the wire, in its axes and units."""

from __future__ import annotations

import math

import pytest

from autopilot.services.snapshot import SensorReadings, Sortie
from autopilot.services.telemetry import DATA_STREAM_GROUPS
from autopilot.wire.convert.simulator import padded_forces
from autopilot.wire.dialect import plumbline as m
from tests.doubles.streams import sent

FLOAT32_REL = 1e-6  # single-precision fields
NOW_US = 5_000_000
# turning left, pushed to the left and upwards
READ = SensorReadings(
    (0.1, 0.2, 0.3), (1.0, 2.0, 9.80665), (0.2, -0.1, -0.4), 101_325.0, 12.5, 21.25, NOW_US, NOW_US
)


def test_readings_are_told_in_the_axes_of_the_body_and_in_the_units_of_each_message(snap):
    snapshot = snap(NOW_US, readings=READ)
    (fine,) = sent(snapshot, m.MAVLINK_MSG_ID_HIGHRES_IMU)
    assert (fine.xacc, fine.yacc, fine.zacc) == pytest.approx((1.0, -2.0, -9.80665), rel=FLOAT32_REL)
    assert (fine.xgyro, fine.ygyro, fine.zgyro) == pytest.approx((0.1, -0.2, -0.3), rel=FLOAT32_REL)
    assert (fine.xmag, fine.ymag, fine.zmag) == pytest.approx((0.2, 0.1, 0.4), rel=FLOAT32_REL)
    assert (fine.abs_pressure, fine.pressure_alt, fine.temperature) == pytest.approx(
        (1013.25, 12.5, 21.25), rel=FLOAT32_REL
    )
    assert fine.fields_updated == 0x1BFF  # all but the differential pressure
    (coarse,) = sent(snapshot, m.MAVLINK_MSG_ID_SCALED_IMU)
    assert (coarse.xacc, coarse.yacc, coarse.zacc) == (102, -204, -1000)  # milli-g
    assert (coarse.xgyro, coarse.ygyro, coarse.zgyro) == (100, -200, -300)
    assert (coarse.xmag, coarse.ymag, coarse.zmag, coarse.temperature) == (200, 100, 400, 0)
    (air,) = sent(snapshot, m.MAVLINK_MSG_ID_SCALED_PRESSURE)
    assert (air.press_abs, air.temperature) == (pytest.approx(1013.25, rel=FLOAT32_REL), 2125)


def test_only_what_has_read_of_late_counts_as_updated(snap):
    stale = READ._replace(field_us=NOW_US - 100_000, pressure_us=-1)
    (fine,) = sent(snap(NOW_US, readings=stale), m.MAVLINK_MSG_ID_HIGHRES_IMU)
    assert fine.fields_updated == 0x3F
    assert sent(snap(NOW_US, readings=stale), m.MAVLINK_MSG_ID_SCALED_PRESSURE) == []


def test_a_pressure_that_was_read_long_ago_has_the_time_of_its_reading(snap):
    old = READ._replace(pressure_us=NOW_US - 900_000)
    (air,) = sent(snap(NOW_US, readings=old), m.MAVLINK_MSG_ID_SCALED_PRESSURE)
    assert air.time_boot_ms == (NOW_US - 900_000) // 1000


def test_a_vehicle_that_has_not_sensed_yet_says_nothing_of_it(snap):
    for message_id in (
        m.MAVLINK_MSG_ID_HIGHRES_IMU,
        m.MAVLINK_MSG_ID_SCALED_IMU,
        m.MAVLINK_MSG_ID_SCALED_PRESSURE,
    ):
        assert sent(snap(NOW_US), message_id) == []


def test_odometry_is_the_estimate_and_says_what_it_does_not_know(snap):
    half = math.sqrt(0.5)
    snapshot = snap(
        NOW_US,
        x_quad=(1.0, 2.0, 3.0),
        v_quad=(0.1, 0.2, 0.3),
        omega_body=(0.4, 0.5, 0.6),
        quat_wxyz=(half, 0.0, 0.0, half),  # nose to the north
        horizontal_std=0.1,
        vertical_std=0.2,
        estimator_flags=m.ESTIMATOR_POS_HORIZ_ABS,
    )
    (said,) = sent(snapshot, m.MAVLINK_MSG_ID_ODOMETRY)
    assert (said.frame_id, said.child_frame_id) == (m.MAV_FRAME_LOCAL_NED, m.MAV_FRAME_LOCAL_NED)
    assert (said.x, said.y, said.z) == (2.0, 1.0, -3.0)
    assert (said.vx, said.vy, said.vz) == pytest.approx((0.2, 0.1, -0.3), rel=FLOAT32_REL)
    assert [abs(number) for number in said.q] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=FLOAT32_REL)
    assert (said.rollspeed, said.pitchspeed, said.yawspeed) == pytest.approx(
        (0.4, -0.5, -0.6), rel=FLOAT32_REL
    )
    known = {i: number for i, number in enumerate(said.pose_covariance) if not math.isnan(number)}
    assert known == pytest.approx({0: 0.01, 6: 0.01, 11: 0.04}, rel=FLOAT32_REL)
    assert all(map(math.isnan, said.velocity_covariance))
    assert (said.estimator_type, said.quality) == (m.MAV_ESTIMATOR_TYPE_AUTOPILOT, 0)
    for flags in (0, m.ESTIMATOR_ATTITUDE | m.ESTIMATOR_POS_VERT_ABS):
        (lost,) = sent(snap(NOW_US, estimator_flags=flags), m.MAVLINK_MSG_ID_ODOMETRY)
        assert lost.quality == -1


def test_outputs_are_those_of_servo_output_raw(snap):
    snapshot = snap(NOW_US, forces=padded_forces((0.0, 0.49, 0.98, 1.96)), rotor_max=1.96)
    (said,) = sent(snapshot, m.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS)
    assert said.active == 4
    assert said.actuator == [1000.0, 1250.0, 1500.0, 2000.0, *[0.0] * 28]


def test_there_is_no_remote_control(snap):
    (said,) = sent(snap(NOW_US), m.MAVLINK_MSG_ID_RC_CHANNELS)
    assert (said.chancount, said.chan1_raw, said.chan18_raw, said.rssi) == (0, 65535, 65535, 255)


def test_a_flight_is_known_by_when_it_was_armed(snap):
    (none,) = sent(snap(NOW_US), m.MAVLINK_MSG_ID_FLIGHT_INFORMATION)
    assert (none.arming_time_utc, none.takeoff_time_utc, none.flight_uuid, none.landing_time) == (0, 0, 0, 0)
    snapshot = snap(NOW_US, sortie=Sortie(1_000_000, 2_000_000, 4_000_000))
    (said,) = sent(snapshot, m.MAVLINK_MSG_ID_FLIGHT_INFORMATION)
    assert (said.time_boot_ms, said.arming_time_utc, said.takeoff_time_utc) == (5000, 1_000_000, 2_000_000)
    assert (said.flight_uuid, said.landing_time) == (snapshot.boot_unix_us + 1_000_000, 4000)


def test_the_groups_of_a_ground_station_have_them():
    assert DATA_STREAM_GROUPS[m.MAV_DATA_STREAM_RAW_SENSORS] == (
        m.MAVLINK_MSG_ID_SCALED_IMU,
        m.MAVLINK_MSG_ID_SCALED_PRESSURE,
    )
    assert m.MAVLINK_MSG_ID_RC_CHANNELS in DATA_STREAM_GROUPS[m.MAV_DATA_STREAM_RC_CHANNELS]
