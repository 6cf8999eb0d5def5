"""Every stream is built from any numbers, and states in NED and FRD what the snapshot has in ENU and FLU."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from autopilot.services.identity import Identity
from autopilot.services.snapshot import ACCEL, GEOFENCE, GYRO, MAG, PREARM, GpsFix, SensorReadings
from autopilot.services.streams import OFF
from autopilot.services.telemetry import LOAD_STREAMS, LOAD_SYSTEM_BIT, PROGRAM_INTERVALS_US, STREAMS
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import padded_forces
from autopilot.wire.dialect import plumbline as mavlink

ALL = STREAMS | LOAD_STREAMS
NAN3 = (math.nan,) * 3
HUGE3 = (1e300, -1e300, 1e300)

# single-precision fields
FLOAT32_REL = 1e-6


def sent(key, snapshot):
    """The messages of a stream as a ground station gets them."""
    writer = FrameWriter(1, ALL[key].component)
    frames = b"".join(writer.frame(message) for message in ALL[key].build(snapshot, Identity()))
    received, junk = decode(frames)
    assert junk == 0
    return [r.message for r in received]


FLYING = {
    "armed": True,
    "x_quad": (1.0, 2.0, 3.0),
    "v_quad": (0.1, 0.2, 0.3),
    "omega_body": (0.4, 0.5, 0.6),
    "x_load": (1.0, 2.0, 2.2),
    "v_load": (-0.1, 0.7, 0.3),
    "q_cable": (0.6, 0.0, -0.8),
    "q_cable_dot": (0.4, 0.1, 0.3),
    "x_quad_d": (5.0, 6.0, 7.0),
    "e_x": (0.3, 0.4, 0.0),
    "tension": 0.9,
    "forces": padded_forces((0.98, 1.96, 0.0, -0.1)),
    "rotor_max": 1.96,
    "gps": GpsFix(3_000, 3, (1.0, 2.0, 3.0), (0.0, 2.0, 0.0), 1.5, 2.5, 12),
    "battery_voltage": 11.1,
    "battery_remaining": 0.75,
    "sensors_present": GYRO | ACCEL | MAG,
    "sensors_healthy": GYRO | ACCEL | PREARM,
}


@pytest.mark.parametrize("key", ALL, ids=lambda key: f"{key:#x}")
@pytest.mark.parametrize(
    "vector",
    [(0.0, 0.0, 0.0), NAN3, HUGE3, (math.inf, -math.inf, math.nan)],
    ids=["zero", "nan", "huge", "inf"],
)
def test_every_stream_stands_any_numbers(key, vector, snap):
    scalar = vector[2]
    changes = dict.fromkeys(
        [
            "x_quad",
            "v_quad",
            "omega_body",
            "x_load",
            "v_load",
            "q_cable",
            "q_cable_dot",
            "x_load_d",
            "v_load_d",
            "a_load_d",
            "x_quad_d",
            "e_x",
            "e_v",
            "e_q",
            "e_q_dot",
            "e_R",
            "e_Omega",
            "moment",
        ],
        vector,
    )
    changes |= dict.fromkeys(
        [
            "tension",
            "distance",
            "psi_R",
            "psi_q",
            "thrust",
            "battery_voltage",
            "battery_remaining",
        ],
        scalar,
    )
    fix = GpsFix(0, 3, vector, vector, scalar, scalar, 300)
    changes["readings"] = SensorReadings(vector, vector, vector, scalar, scalar, scalar, 0, 0)
    snapshot = snap(
        2**40, forces=(scalar,) * 14, quat_wxyz=(vector[0],) * 4, gps=fix, slack_events=2**20, **changes
    )
    for message in sent(key, snapshot):
        assert message.get_type() != "BAD_DATA"


def test_pose_changes_axes(snap):
    half = math.sqrt(0.5)
    # nose to the north: a quarter turn to the left from east
    north = snap(1_000_000, **FLYING, quat_wxyz=(half, 0.0, 0.0, half))
    (local,) = sent(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, north)
    assert (local.x, local.y, local.z) == (2.0, 1.0, -3.0)
    assert (local.vx, local.vy, local.vz) == pytest.approx((0.2, 0.1, -0.3), rel=FLOAT32_REL)
    (attitude,) = sent(mavlink.MAVLINK_MSG_ID_ATTITUDE, north)
    assert (attitude.roll, attitude.pitch, attitude.yaw) == pytest.approx((0, 0, 0), abs=FLOAT32_REL)
    rates = (attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed)
    assert rates == pytest.approx((0.4, -0.5, -0.6), rel=FLOAT32_REL)
    (globally,) = sent(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, north)
    assert globally.hdg in (0, 35999)
    assert globally.relative_alt == 3000
    assert (globally.vx, globally.vy, globally.vz) == (20, 10, -30)
    (hud,) = sent(mavlink.MAVLINK_MSG_ID_VFR_HUD, north)
    assert hud.climb == pytest.approx(0.3, rel=FLOAT32_REL)
    assert hud.throttle == 36  # of 2.84 N / (4 * 1.96 N)


def test_altitudes_are_above_the_sea_and_above_home(snap):
    high = snap(home=Home(47.0, 8.0, 500.0), x_quad=(0.0, 0.0, 12.0))
    (globally,) = sent(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, high)
    assert (globally.alt, globally.relative_alt) == (512_000, 12_000)
    (home,) = sent(mavlink.MAVLINK_MSG_ID_HOME_POSITION, high)
    assert (home.latitude, home.longitude, home.altitude) == (470_000_000, 80_000_000, 500_000)


def test_health_as_the_sensors_say_and_no_fence_breach(snap):
    (status,) = sent(mavlink.MAVLINK_MSG_ID_SYS_STATUS, snap(**FLYING))
    assert status.onboard_control_sensors_present & MAG
    assert not status.onboard_control_sensors_health & MAG
    assert status.onboard_control_sensors_health & PREARM
    assert status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_GEOFENCE
    assert (status.voltage_battery, status.battery_remaining) == (11_100, 75)


@pytest.mark.parametrize("fence_enabled", [True, False])
def test_a_fence_is_present_and_enabled_unless_it_is_switched_off(snap, fence_enabled):
    (status,) = sent(
        mavlink.MAVLINK_MSG_ID_SYS_STATUS, snap(sensors_present=GYRO | GEOFENCE, fence_enabled=fence_enabled)
    )
    assert status.onboard_control_sensors_present & GEOFENCE
    assert bool(status.onboard_control_sensors_enabled & GEOFENCE) == fence_enabled
    assert status.onboard_control_sensors_enabled & GYRO
    (status,) = sent(mavlink.MAVLINK_MSG_ID_SYS_STATUS, snap(sensors_present=GYRO))
    assert not (status.onboard_control_sensors_present | status.onboard_control_sensors_enabled) & GEOFENCE


def test_what_is_unknown_is_said_to_be(snap):
    (battery,) = sent(mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, snap())
    assert (battery.voltages[0], battery.battery_remaining) == (65535, -1)
    (gps,) = sent(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, snap())
    assert (gps.fix_type, gps.eph, gps.satellites_visible) == (mavlink.GPS_FIX_TYPE_NO_GPS, 65535, 255)
    assert sent(mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, snap()) == []


def test_gps_is_the_receiver_not_the_estimate(snap):
    (gps,) = sent(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, snap(**FLYING))
    assert (gps.time_usec, gps.fix_type, gps.satellites_visible) == (3000, 3, 12)
    assert (gps.eph, gps.epv, gps.vel, gps.cog) == (70, 110, 200, 0)
    assert (gps.h_acc, gps.v_acc, gps.alt_ellipsoid) == (1500, 2500, gps.alt)


@pytest.mark.parametrize(("std", "accuracy_mm"), [(0.00023, 1), (0.0, 1), (0.0026, 3), (math.nan, 0)])
def test_an_accuracy_below_a_millimetre_is_not_unknown(snap, std, accuracy_mm):
    fix = GpsFix(3000, 3, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), std, std, 255)
    (gps,) = sent(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, snap(gps=fix))
    assert (gps.h_acc, gps.v_acc) == (accuracy_mm, accuracy_mm)


def test_a_lost_fix_has_no_dilution(snap):
    lost = GpsFix(3000, mavlink.GPS_FIX_TYPE_NO_FIX, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), math.inf, math.nan, 2)
    (gps,) = sent(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, snap(gps=lost))
    assert (gps.fix_type, gps.eph, gps.epv, gps.h_acc, gps.v_acc) == (1, 65535, 65535, 2**32 - 1, 0)


@pytest.mark.parametrize(
    ("breach", "kind"),
    [
        ("", mavlink.FENCE_BREACH_NONE),
        ("beyond the fence, GF_MAX_VER_DIST 5 m above home (vehicle at 5.02 m)", mavlink.FENCE_BREACH_MAXALT),
        ("beyond the fence, GF_MAX_HOR_DIST 5 m from home", mavlink.FENCE_BREACH_BOUNDARY),
    ],
)
def test_the_kind_of_a_breach_is_stated(snap, breach, kind):
    for now in (breach, ""):  # the last one is stated also when it is over
        (status,) = sent(mavlink.MAVLINK_MSG_ID_FENCE_STATUS, snap(breach=now, last_breach=breach))
        assert (status.breach_status, status.breach_type) == (int(bool(now)), kind)


def test_the_winch_reports_the_length_of_the_cable_and_its_tension_as_a_weight(snap):
    held = {"distance": 0.71, "cable_length": 0.7, "tension": 0.980665}
    (winch,) = sent(mavlink.MAVLINK_MSG_ID_WINCH_STATUS, snap(**held, taut=True))
    assert (winch.line_length, winch.tension) == (pytest.approx(0.71), pytest.approx(0.1))
    (winch,) = sent(mavlink.MAVLINK_MSG_ID_WINCH_STATUS, snap(**{**held, "distance": 4.2}, taut=False))
    assert winch.line_length == pytest.approx(0.7)


@pytest.mark.parametrize("released", [False, True])
def test_the_winch_says_whether_cable_and_load_are_let_go_of(snap, released):
    (winch,) = sent(mavlink.MAVLINK_MSG_ID_WINCH_STATUS, snap(released=released))
    assert bool(winch.status & mavlink.MAV_WINCH_STATUS_ABANDON_LINE) == released
    assert winch.status & mavlink.MAV_WINCH_STATUS_HEALTHY


def test_servo_outputs_stay_within_what_a_servo_means(snap):
    (servo,) = sent(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, snap(**FLYING))
    assert (servo.servo1_raw, servo.servo2_raw, servo.servo3_raw, servo.servo4_raw) == (
        1500,
        2000,
        1000,
        1000,
    )


def test_load_state_is_an_estimate_in_ned(snap):
    (load,) = sent(mavlink.MAVLINK_MSG_ID_LOAD_STATE, snap(77, **FLYING))
    assert load.source == mavlink.PLUMBLINE_SOURCE_ESTIMATED
    assert load.time_usec == 77
    assert (load.x, load.y, load.z) == pytest.approx((2.0, 1.0, -2.2), rel=FLOAT32_REL)
    assert (load.qx, load.qy, load.qz) == pytest.approx((0.0, 0.6, 0.8), rel=FLOAT32_REL)


def test_named_values_carry_tension_and_the_length_of_the_load_error(snap):
    values = {m.name: m.value for m in sent(mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT, snap(**FLYING))}
    assert values["TENSION"] == pytest.approx(0.9, rel=FLOAT32_REL)
    assert values["LOAD_ERR"] == pytest.approx(0.5, rel=FLOAT32_REL)


def test_attitude_of_the_load_is_that_of_the_cable(snap):
    (attitude,) = sent(LOAD_SYSTEM_BIT | mavlink.MAVLINK_MSG_ID_ATTITUDE, snap(**FLYING))
    sin, cos = math.sin, math.cos
    roll, pitch = attitude.roll, attitude.pitch
    # third column of Ry(pitch) Rx(roll): body down in NED
    down = (sin(pitch) * cos(roll), -sin(roll), cos(pitch) * cos(roll))
    assert down == pytest.approx((0.0, 0.6, 0.8), abs=FLOAT32_REL)
    # d/dt of that column = rotation * (rates x e3)
    p, q = attitude.rollspeed, attitude.pitchspeed
    forward = (cos(pitch), 0.0, -sin(pitch))
    right = (sin(pitch) * sin(roll), cos(roll), cos(pitch) * sin(roll))
    down_dot = [q * f - p * r for f, r in zip(forward, right, strict=True)]
    assert down_dot == pytest.approx((0.1, 0.4, -0.3), abs=FLOAT32_REL)


@pytest.mark.parametrize("key", ALL, ids=lambda key: f"{key:#x}")
def test_every_stream_and_its_rate_stand_in_the_manual(key):
    stream = ALL[key]
    message = mavlink.mavlink_map[key & ~LOAD_SYSTEM_BIT]
    rate = "on request" if stream.interval_us == OFF else f"{1_000_000 // stream.interval_us} Hz"
    if key in PROGRAM_INTERVALS_US:
        rate += f"; {1_000_000 // PROGRAM_INTERVALS_US[key]} Hz to programs"
    manual = Path(__file__).parents[2] / "docs" / "mavlink.md"
    rows = [line for line in manual.read_text().splitlines() if line.startswith(f"| {message.msgname} ")]
    assert any(f"| {rate} |" in row and f"| {stream.component} |" in row for row in rows), (
        message.msgname,
        rate,
    )


def test_the_built_in_filter_is_told_beside_an_estimator_of_ones_own(snap):
    message_id = mavlink.MAVLINK_MSG_ID_FILTER_STATE
    assert not sent(message_id, snap(77))
    (state,) = sent(message_id, snap(77, built_in=((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0))))
    assert (state.time_usec, state.x, state.y, state.z) == (77, 2.0, 1.0, -3.0)
    assert (state.vx, state.vy, state.vz) == (5.0, 4.0, -6.0)
    assert (state.vehicle_x, state.vehicle_y, state.vehicle_z) == (8.0, 7.0, -9.0)
