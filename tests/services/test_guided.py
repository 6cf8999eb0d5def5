"""Setpoint messages, sticks and guided commands: what they become, and what is refused with a text."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.services.guided import (
    STICK_KEPT_US,
    read_attitude,
    read_channels,
    read_global,
    read_local,
    read_stick,
    read_target,
)
from autopilot.services.records import Verdict
from autopilot.services.requests import (
    ChangeAltitude,
    FollowAttitude,
    FollowRates,
    FollowSetpoint,
    FollowStick,
    FollowTarget,
    Orbit,
    Pause,
    Reposition,
)
from autopilot.services.text_limiter import WARNING_INTERVAL_US
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as m

HOME = Home()
POSITION, VELOCITY, BOTH = 0x9F8, 0xDC7, 0xDC0  # MAVLink's bits, as MAVSDK sends them


def local(frame, mask, x=0.0, y=0.0, z=0.0, vx=0.0, vy=0.0, vz=0.0, a=(0.0, 0.0, 0.0), yaw=0.0, rate=0.0):
    return m.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, frame, mask, x, y, z, vx, vy, vz, *a, yaw, rate
    )


def attitude(q, thrust, mask=7, rates=(0.0, 0.0, 0.0)):
    return m.MAVLink_set_attitude_target_message(0, 1, 1, mask, q, *rates, thrust)


def same(a, b):
    return all(x == pytest.approx(y, abs=1e-6, nan_ok=True) for x, y in zip(a, b, strict=True))


NOTHING = (math.nan,) * 3


@pytest.mark.parametrize(
    ("message", "position", "velocity", "relative"),
    [
        (local(1, POSITION, 1.0, 2.0, -3.0), (2.0, 1.0, 3.0), NOTHING, False),
        (local(1, VELOCITY, vx=1.0, vy=2.0, vz=-3.0), NOTHING, (2.0, 1.0, 3.0), False),
        (local(1, BOTH, 1.0, 2.0, -3.0, 4.0, 5.0, 6.0), (2.0, 1.0, 3.0), (5.0, 4.0, -6.0), False),
        (local(7, POSITION, 1.0, 2.0, -3.0), (2.0, 1.0, 3.0), NOTHING, True),
        # axes of the nose: forward, left, up
        (local(8, VELOCITY, vx=1.0, vy=2.0, vz=-3.0), NOTHING, (1.0, -2.0, 3.0), True),
        (local(9, POSITION, 1.0, 2.0, -3.0), (1.0, -2.0, 3.0), NOTHING, True),
        # north and down ignored
        (local(1, 0xDFD, 9.0, 2.0, 9.0), (2.0, math.nan, math.nan), NOTHING, False),
    ],
)
def test_local_setpoints(message, position, velocity, relative):
    asked = read_local(message)
    assert isinstance(asked, FollowSetpoint)
    assert same(asked.position, position) and same(asked.velocity, velocity)
    assert asked.relative == relative
    assert asked.body == (message.coordinate_frame in (8, 9, 12))


def test_global_setpoints_are_above_home_or_above_the_sea():
    home = Home(altitude_m=100.0)
    lat, lon = home.latitude_deg * 1e7, home.longitude_deg * 1e7
    for frame, alt in ((6, 5.0), (3, 5.0), (0, 105.0), (5, 105.0)):
        message = m.MAVLink_set_position_target_global_int_message(
            0, 1, 1, frame, POSITION, round(lat) + 1000, round(lon), alt, 0, 0, 0, 0, 0, 0, 0, 0
        )
        asked = read_global(message, home)
        assert isinstance(asked, FollowSetpoint)
        assert asked.position[1] == pytest.approx(11.1, abs=0.1)  # 1e-4 deg of latitude
        assert asked.position[2] == pytest.approx(5.0)


@pytest.mark.parametrize(
    "message",
    [
        local(2, POSITION),
        local(1, 0xFFF),
        local(1, 0xBFF, yaw=math.nan),
        local(1, POSITION, math.nan),
        local(1, VELOCITY, vx=math.inf),
        local(1, 0x200, 1.0),  # a force
        local(1, 0x9F8, yaw=math.inf),
        local(1, 0x5F8, rate=-math.inf),
        local(1, 0xC3F, a=(math.nan, 0.0, 0.0)),
    ],
)
def test_setpoints_that_ask_for_nothing_are_refused(message):
    verdict = read_local(message)
    assert isinstance(verdict, Verdict)
    assert verdict.result == m.MAV_RESULT_DENIED and verdict.text


def test_a_velocity_as_mavproxy_asks_for_it_is_followed():
    """Its mask 4039 says that an acceleration would be a force, and that there is none."""
    asked = read_local(local(1, 4039, vx=1.0, vy=2.0, vz=-0.5))
    assert isinstance(asked, FollowSetpoint)
    assert same(asked.velocity, (2.0, 1.0, 0.5))
    assert all(map(math.isnan, (*asked.position, *asked.accel)))


def test_an_acceleration_alone_is_followed():
    asked = read_local(local(1, 0xC3F, a=(1.0, 2.0, -0.5)))
    assert isinstance(asked, FollowSetpoint)
    assert same(asked.accel, (2.0, 1.0, 0.5))
    assert all(map(math.isnan, (*asked.position, *asked.velocity)))


@pytest.mark.parametrize(
    ("mask", "yaw", "rate", "heading", "turning"),
    [
        (0x9F8, 0.0, 9.0, 0.5 * math.pi, math.nan),  # north
        (0x9F8, 0.5 * math.pi, 9.0, 0.0, math.nan),  # east
        (0x9F8, math.nan, 9.0, math.nan, math.nan),  # MAVSDK: the heading is kept
        (0x5F8, 9.0, 0.3, math.nan, -0.3),  # clockwise
        (0x1F8, math.pi, -0.3, -0.5 * math.pi, 0.3),
        (0xDF8, 9.0, 9.0, math.nan, math.nan),
    ],
)
def test_yaw_is_from_north_and_clockwise(mask, yaw, rate, heading, turning):
    place = HOME.latitude_deg * 1e7, HOME.longitude_deg * 1e7
    globally = m.MAVLink_set_position_target_global_int_message(
        0, 1, 1, 6, mask, round(place[0]), round(place[1]), 5.0, 0, 0, 0, 0, 0, 0, yaw, rate
    )
    for asked in (read_local(local(1, mask, yaw=yaw, rate=rate)), read_global(globally, HOME)):
        assert isinstance(asked, FollowSetpoint)
        assert same((asked.heading_rad, asked.yaw_rate_rad_s), (heading, turning))


def test_a_yaw_alone_is_turned_to_on_the_spot():
    for mask, heading, turning in ((0xBFF, 0.0, math.nan), (0x7FF, math.nan, -0.3)):
        place = {"lat_int": 0, "lon_int": 0, "alt": math.nan}
        globally = m.MAVLink_set_position_target_global_int_message(
            0, 1, 1, 6, mask, *place.values(), *[math.nan] * 6, 0.5 * math.pi, 0.3
        )
        locally = local(1, mask, math.nan, vx=math.nan, yaw=0.5 * math.pi, rate=0.3)
        for asked in (read_local(locally), read_global(globally, HOME)):
            assert isinstance(asked, FollowSetpoint)
            assert asked.velocity == (0.0, 0.0, 0.0)
            assert all(map(math.isnan, (*asked.position, *asked.accel)))
            assert same((asked.heading_rad, asked.yaw_rate_rad_s), (heading, turning))


def test_an_attitude_has_a_heading():
    half = 0.5 * math.radians(120.0)
    asked = read_attitude(attitude((math.cos(half), 0.0, 0.0, math.sin(half)), 0.5, 3, (9.0, 9.0, 0.2)))
    assert isinstance(asked, FollowAttitude)
    assert same((asked.heading_rad, asked.yaw_rate_rad_s), (math.radians(-30.0), -0.2))
    assert math.isnan(read_attitude(attitude((1.0, 0.0, 0.0, 0.0), 0.5)).yaw_rate_rad_s)


def test_body_rates_without_an_attitude():
    asked = read_attitude(attitude((math.nan,) * 4, 0.5, 128, (0.1, 0.2, 0.3)))
    assert isinstance(asked, FollowRates)
    assert same(asked.rates, (0.1, -0.2, -0.3))
    assert asked.thrust == pytest.approx(0.5)
    some = read_attitude(attitude((math.nan,) * 4, 9.0, 128 | 64 | 3, (math.nan, math.nan, 0.3)))
    assert isinstance(some, FollowRates)
    assert same(some.rates, (0.0, 0.0, -0.3)) and some.thrust is None


def test_an_attitude_is_its_thrust_axis():
    half = math.radians(5.0)
    # pitched down by 10 deg with the nose to the north: leans north
    pitched = read_attitude(attitude((math.cos(half), 0.0, -math.sin(half), 0.0), 0.6))
    assert isinstance(pitched, FollowAttitude)
    assert same(pitched.thrust_axis, (0.0, math.sin(2 * half), math.cos(2 * half)))
    assert pitched.thrust == pytest.approx(0.6)
    rolled = read_attitude(attitude((math.cos(half), math.sin(half), 0.0, 0.0), 0.6, mask=7 | 64))
    assert isinstance(rolled, FollowAttitude)
    assert same(rolled.thrust_axis, (math.sin(2 * half), 0.0, math.cos(2 * half)))
    assert rolled.thrust is None


@pytest.mark.parametrize(
    "message",
    [
        attitude((1.0, 0.0, 0.0, 0.0), 0.5, mask=128 | 7),
        attitude((1.0, 0.0, 0.0, 0.0), 0.5, mask=128, rates=(11.0, 0.0, 0.0)),
        attitude((1.0, 0.0, 0.0, 0.0), 0.5, mask=3, rates=(0.0, 0.0, math.nan)),
        attitude((0.0, 0.0, 0.0, 0.0), 0.5),
        attitude((math.nan, 0.0, 0.0, 0.0), 0.5),
        attitude((1.0, 0.0, 0.0, 0.0), 1.5),
        attitude((1.0, 0.0, 0.0, 0.0), math.nan),
    ],
)
def test_attitudes_that_cannot_be_followed_are_refused(message):
    verdict = read_attitude(message)
    assert isinstance(verdict, Verdict)
    assert verdict.result == m.MAV_RESULT_DENIED and verdict.text


def test_the_stick():
    asked = read_stick(m.MAVLink_manual_control_message(1, 500, -1000, 750, 0, 0))
    assert isinstance(asked, FollowStick)
    assert same((*asked.velocity_share, asked.yaw_rate), (0.5, 1.0, 0.5, 0.0))
    turning = read_stick(m.MAVLink_manual_control_message(1, 0, 0, 500, 250, 0))
    assert isinstance(turning, FollowStick)
    assert turning.yaw_rate == -0.25  # clockwise
    assert isinstance(read_stick(m.MAVLink_manual_control_message(1, 0, 0, 500, 2000, 0)), Verdict)
    centred = read_stick(m.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0))
    assert isinstance(centred, FollowStick)
    assert same(centred.velocity_share, (0.0, 0.0, 0.0))
    assert isinstance(read_stick(m.MAVLink_manual_control_message(1, 2000, 0, 500, 0, 0)), Verdict)


def channels(roll=0, pitch=0, throttle=0, yaw=0, other=0):
    return m.MAVLink_rc_channels_override_message(1, 1, roll, pitch, throttle, yaw, other, 0, 0, 0)


def test_overridden_channels_are_the_same_stick():
    flown = read_channels(channels(roll=1750, pitch=1300, throttle=1600, yaw=1450))
    assert isinstance(flown, FollowStick)
    assert same((*flown.velocity_share, flown.yaw_rate), (0.4, -0.5, 0.2, 0.1))
    for centred in (0, 65535, 1500):
        forward = read_channels(channels(roll=centred, pitch=900, throttle=centred, yaw=centred))
        assert isinstance(forward, FollowStick)
        assert same((*forward.velocity_share, forward.yaw_rate), (1.0, 0.0, 0.0, 0.0))


def test_channels_that_are_given_back_ask_for_nothing(rig):
    for other in (0, 1800):
        rig.send(channels(other=other))
    assert rig.asked == []
    rig.send(channels(throttle=1500))
    assert [type(asked) for asked in rig.asked] == [FollowStick]


def test_a_pulse_of_no_receiver_is_refused():
    assert isinstance(read_channels(channels(pitch=2201)), Verdict)
    assert isinstance(read_channels(channels(pitch=100)), Verdict)


def target(capabilities, lat, lon, alt=0.0, velocity=(0.0, 0.0, 0.0), accel=(0.0, 0.0, 0.0)):
    place = round(lat * 1e7), round(lon * 1e7), alt
    none, upright = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    return m.MAVLink_follow_target_message(0, capabilities, *place, velocity, accel, upright, none, none, 0)


def test_a_target_is_reported_with_what_its_sender_estimates():
    home = Home(47.0, 8.0, 500.0)
    asked = read_target(target(3, 47.0001, 8.0001, 502.0, (1.0, 2.0, -0.5)), home)
    assert isinstance(asked, FollowTarget)
    assert asked.position == pytest.approx((7.6, 11.12, 2.0), abs=0.02)
    assert (asked.velocity, asked.accel) == ((2.0, 1.0, 0.5), None)
    asked = read_target(target(7, 47.0, 8.0, velocity=(1.0, 2.0, 0.0), accel=(3.0, 4.0, -5.0)), home)
    assert (asked.velocity, asked.accel) == ((2.0, 1.0, 0.0), (4.0, 3.0, 5.0))
    # MAVSDK sends a velocity that it does not claim to know
    assert read_target(target(1, 47.0, 8.0, 502.0, (1.0, 2.0, 0.0)), home) == FollowTarget(
        (0.0, 0.0, 2.0), None
    )
    unknown = (math.nan, 0.0, 0.0)
    assert read_target(target(3, 47.0, 8.0, math.nan, unknown), home) == FollowTarget((0.0, 0.0, 0.0), None)


@pytest.mark.parametrize("message", [target(2, 47.0, 8.0), target(3, 91.0, 8.0), target(3, 47.0, 181.0)])
def test_a_target_without_a_position_is_refused(message):
    verdict = read_target(message, Home(47.0, 8.0, 500.0))
    assert verdict == Verdict(m.MAV_RESULT_DENIED, "Target refused: FOLLOW_TARGET without a position")


def test_a_target_of_any_sender_is_handed_on(rig):
    rig.send(target(3, 47.0, 8.0))
    assert [type(asked) for asked in rig.asked] == [FollowTarget]


def test_what_is_said_of_a_report_that_is_accepted_is_a_warning_or_information(rig):
    for warns, severity in ((False, m.MAV_SEVERITY_INFO), (True, m.MAV_SEVERITY_WARNING)):
        rig.verdict = lambda _, warns=warns: Verdict(m.MAV_RESULT_ACCEPTED, f"told, {warns}", warns)
        rig.send(target(3, 47.0, 8.0))
        said = [r.message for r in rig.poll()["gcs"] if r.message.get_type() == "STATUSTEXT"]
        assert [(one.severity, one.text) for one in said] == [(severity, f"told, {warns}")]


def test_setpoints_are_not_acknowledged_and_announce_nothing(rig):
    rig.poll()
    rig.send(local(1, POSITION, 1.0))
    assert [type(r) for r in rig.asked] == [FollowSetpoint]
    assert all(not link for link in rig.poll().values())


def test_a_refusal_is_said_once_in_a_while(rig):
    said = 0
    for _ in range(2 * WARNING_INTERVAL_US // 100_000):
        replies = rig.replies(local(1, 0xFFF))
        said += sum(r.get_type() == "STATUSTEXT" and r.chunk_seq == 0 for r in replies)
        rig.now_us += 100_000
    assert said == 3  # in 10.8 s


def test_a_stick_for_another_system_is_not_ours(rig):
    rig.send(m.MAVLink_manual_control_message(7, 0, 0, 500, 0, 0))
    assert rig.asked == []


CENTRED, FORWARD = (m.MAVLink_manual_control_message(1, x, 0, 500, 0, 0) for x in (0, 1000))


def test_of_two_sticks_the_first_is_followed_until_it_is_silent(rig):
    first, second = {"system": 255}, {"system": 254}
    rig.send(FORWARD, **first)
    assert rig.replies(CENTRED, **second) == []  # nobody moves it: nothing to report
    rig.run(STICK_KEPT_US - 100_000)
    rig.send(channels(pitch=1000), **first)
    replies = rig.replies(FORWARD, **second)
    text = "".join(r.text for r in replies if r.get_type() == "STATUSTEXT")
    assert text == "Stick of system 254, component 190 ignored: that of system 255, component 190 is followed"
    assert len(rig.asked) == 2
    rig.run(STICK_KEPT_US)
    rig.send(CENTRED, **second)
    rig.send(FORWARD, **first)
    assert rig.asked[2:] == [read_stick(CENTRED)]


def long(rig, command, *p):
    params = (*p, *([0.0] * (7 - len(p))))
    replies = rig.replies(m.MAVLink_command_long_message(1, 1, command, 0, *params))
    (ack,) = [r for r in replies if r.get_type() == "COMMAND_ACK"]
    return ack.result


NAN = math.nan


def test_guided_commands(rig):
    assert long(rig, m.MAV_CMD_DO_ORBIT, -2.0, 1.0, 0.0, 0.0, NAN, NAN, NAN) == 0
    assert rig.asked[-1] == Orbit(-2.0, 1.0, None, None, None, faces_centre=True)
    assert long(rig, m.MAV_CMD_DO_ORBIT, 0.0, 1.0, 0.0, 0.0, NAN, NAN, NAN) == m.MAV_RESULT_DENIED
    assert long(rig, m.MAV_CMD_DO_CHANGE_ALTITUDE, 4.0, 3.0) == 0
    assert rig.asked[-1] == ChangeAltitude(4.0)
    assert long(rig, m.MAV_CMD_DO_CHANGE_ALTITUDE, NAN, 3.0) == m.MAV_RESULT_DENIED
    assert long(rig, m.MAV_CMD_NAV_LOITER_UNLIM) == 0
    assert rig.asked[-1] == Pause()
    place = (HOME.latitude_deg, HOME.longitude_deg, 3.0)
    assert long(rig, m.MAV_CMD_DO_REPOSITION, 0.7, 1.0, 0.0, NAN, *place) == 0
    assert isinstance(rig.asked[-1], Reposition)
    assert rig.asked[-1].speed_m_s == pytest.approx(0.7)
    assert long(rig, m.MAV_CMD_PREFLIGHT_CALIBRATION, 1.0) == m.MAV_RESULT_UNSUPPORTED
    assert long(rig, m.MAV_CMD_PREFLIGHT_CALIBRATION) == 0


@pytest.mark.parametrize(
    ("frame", "height_m"),
    [
        (m.MAV_FRAME_GLOBAL, HOME.altitude_m + 3.0),
        (m.MAV_FRAME_GLOBAL_INT, HOME.altitude_m + 3.0),
        (m.MAV_FRAME_GLOBAL_RELATIVE_ALT, HOME.altitude_m + 3.0),  # MAVSDK's `absolute_altitude_m`
        (m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 3.0),
    ],
)
def test_the_height_of_an_orbit_is_that_of_its_frame_except_for_that_of_mavsdk(rig, frame, height_m):
    place = round(HOME.latitude_deg * 1e7), round(HOME.longitude_deg * 1e7)
    command = m.MAVLink_command_int_message
    rig.send(command(1, 1, frame, m.MAV_CMD_DO_ORBIT, 0, 0, 2.0, 1.0, 0.0, NAN, *place, height_m))
    assert rig.asked[-1].altitude_m == pytest.approx(3.0, abs=1e-3)
    rig.send(command(1, 1, frame, m.MAV_CMD_NAV_LOITER_TURNS, 0, 0, 1.0, 0.0, 2.0, NAN, *place, 3.0))
    above_home_m = 3.0 if frame in (3, 6) else 3.0 - HOME.altitude_m
    assert rig.asked[-1].altitude_m == pytest.approx(above_home_m, abs=1e-3), "no command of MAVSDK's"
    rig.send(command(1, 1, frame, m.MAV_CMD_DO_ORBIT, 0, 0, 2.0, 1.0, 0.0, NAN, *place, NAN))
    assert rig.asked[-1].altitude_m is None, "the present height"


any_float = st.floats(width=32)


@settings(max_examples=200, deadline=None)
@given(
    frame=st.integers(0, 21), mask=st.integers(0, 0xFFF), values=st.lists(any_float, min_size=11, max_size=11)
)
def test_what_is_read_is_finite_wherever_it_is_asked(frame, mask, values):
    asked = read_local(local(frame, mask, *values[:6], a=values[6:9], yaw=values[9], rate=values[10]))
    if isinstance(asked, FollowSetpoint):
        used = (*asked.position, *asked.velocity, *asked.accel)
        assert not any(map(math.isinf, (*used, asked.heading_rad, asked.yaw_rate_rad_s)))
        assert not all(map(math.isnan, used))
