"""Commands: a table of what clients send, the request to the supervisor, and the answer."""

from __future__ import annotations

import copy
import math
import re
from pathlib import Path

import pytest

from autopilot.services.commands import DUPLICATE_US, FORCE_ARM, PARSERS, REPEAT_US
from autopilot.services.identity import ARDUPILOT, AUTO, AUTO_LAND, AUTO_MISSION, OFFBOARD, PX4, Identity
from autopilot.services.records import (
    ParameterChanged,
    ParametersSaved,
    SimulatorParameterRequested,
    SimulatorParametersSaved,
    Verdict,
)
from autopilot.services.requests import (
    Arm,
    ChangeAltitude,
    ChangeSpeed,
    Continue,
    EnableFence,
    Grab,
    Land,
    LookAt,
    Orbit,
    Pause,
    Reboot,
    Release,
    Reposition,
    ResetParameters,
    ReturnHome,
    RunPrearmChecks,
    SetCurrent,
    SetHome,
    SetMode,
    StartMission,
    Takeoff,
    Terminate,
    TurnHeading,
    Winch,
)
from autopilot.wire.codec import FrameWriter
from autopilot.wire.convert.geodesy import geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_table import Parameter

NAN = math.nan
OK, DENIED, UNSUPPORTED = (
    mavlink.MAV_RESULT_ACCEPTED,
    mavlink.MAV_RESULT_DENIED,
    mavlink.MAV_RESULT_UNSUPPORTED,
)
PACKED_LAND = float(AUTO_LAND << 24 | AUTO << 16)

# what is sent as COMMAND_LONG, the request to the supervisor (None: none), the result
LONG = [
    (400, (1,), Arm(True, False), OK),
    (400, (0,), Arm(False, False), OK),
    *[(400, (0, magic), Arm(False, True), OK) for magic in FORCE_ARM],
    (400, (1, 1), Arm(True, False), OK),
    (400, (NAN,), None, DENIED),
    (400, (2,), None, DENIED),
    (22, (NAN,) * 7, Takeoff(None), OK),  # MAVSDK
    (22, (-1, 0, 0, NAN, NAN, NAN, 5), Takeoff(5.0), OK),  # QGroundControl
    (22, (0, 0, 0, 0, 0, 0, -3), None, DENIED),
    (22, (0, 0, 0, 0, 0, 0, 0), None, DENIED),
    (21, (NAN,) * 7, Land(), OK),
    (20, (), ReturnHome(), OK),
    (176, (1, AUTO, AUTO_MISSION), SetMode(AUTO, AUTO_MISSION), OK),
    (176, (129, AUTO), SetMode(AUTO, AUTO_MISSION), OK),
    (176, (1, OFFBOARD, NAN), SetMode(OFFBOARD, 0), OK),
    (176, (1, PACKED_LAND), SetMode(AUTO, AUTO_LAND), OK),
    (176, (1, AUTO, 77), None, DENIED),
    (176, (1, 3e9), None, DENIED),
    (176, (1, -1), None, DENIED),
    (176, (0, AUTO, AUTO_MISSION), None, UNSUPPORTED),
    (176, (NAN, AUTO, 4), None, DENIED),
    (300, (0, 0), StartMission(0), OK),
    (300, (3,), StartMission(3), OK),
    (300, (NAN,), StartMission(None), OK),
    (300, (-1,), None, DENIED),
    (300, (0.5,), None, DENIED),
    (193, (0,), Pause(), OK),
    (193, (1,), Continue(), OK),
    (193, (NAN,), None, DENIED),
    (224, (7,), SetCurrent(7), OK),
    (224, (7, NAN), SetCurrent(7), OK),
    (224, (7, 1), SetCurrent(7, reset=True), OK),
    (224, (-1, 1), SetCurrent(None, reset=True), OK),
    (224, (-2,), None, DENIED),
    (224, (7, 2), None, DENIED),
    (224, (NAN,), None, DENIED),
    (192, (-1, 1, 0, NAN, NAN, NAN, NAN), Pause(), OK),  # QGroundControl's pause
    (192, (-1, 1, 0, 0, NAN, NAN, NAN), Reposition(None, None, None, True, heading_rad=0.5 * math.pi), OK),
    (192, (-1, 1, 0, NAN, 200, 0, 5), None, DENIED),
    (192, (-1, 1, 0, NAN, NAN, NAN, 5), Reposition(None, None, 5.0, True), OK),
    (192, (-1, 0, 0, NAN, NAN, NAN, math.inf), None, DENIED),
    (192, (0, 1, 0, NAN, NAN, NAN, 5), Reposition(None, None, 5.0, True), OK),
    (192, (NAN, 1, 0, NAN, NAN, NAN, 5), Reposition(None, None, 5.0, True), OK),
    (192, (2, 1, 0, NAN, NAN, NAN, 5), Reposition(None, None, 5.0, True, 2.0), OK),
    (192, (-2, 1, 0, NAN, NAN, NAN, 5), None, DENIED),
    (192, (-0.5, 1, 0, NAN, NAN, NAN, NAN), None, DENIED),
    (192, (math.inf, 1, 0, NAN, NAN, NAN, 5), None, DENIED),
    (192, (-1, 1, 0, math.inf, NAN, NAN, 5), None, DENIED),
    (22, (0, 0, 0, NAN, NAN, NAN, math.inf), None, DENIED),
    (22, (0, 0, 0, NAN, NAN, NAN, -math.inf), None, DENIED),
    (192, (0.01, 1, 0, NAN, NAN, NAN, 5), None, DENIED),
    (34, (2, 1, 0, 0, NAN, NAN, NAN), Orbit(2.0, 1.0, None, None, None, faces_centre=True), OK),
    (34, (2, 1, 1, 0, NAN, NAN, NAN), Orbit(2.0, 1.0, None, None, None, faces_centre=False), OK),
    *[
        (34, (2, 1, as_before, 0, NAN, NAN, NAN), Orbit(2.0, 1.0, None, None, None), OK)
        for as_before in (2, 5, NAN)
    ],
    (34, (2, 1, 3, 0, NAN, NAN, NAN), None, UNSUPPORTED),  # along the path
    (34, (2, 1, 4, 0, NAN, NAN, NAN), None, UNSUPPORTED),  # by a remote control
    (34, (2, 1, 6, 0, NAN, NAN, NAN), None, DENIED),
    (34, (2, 1, 0.5, 0, NAN, NAN, NAN), None, DENIED),
    (34, (NAN, NAN, NAN, 0, NAN, NAN, NAN), Orbit(None, None, None, None, None), OK),
    (34, (-2, -1, NAN, 0, NAN, NAN, NAN), Orbit(-2.0, -1.0, None, None, None), OK),  # the sign is a direction
    (34, (0, 1, 0, 0, NAN, NAN, NAN), None, DENIED),
    (34, (math.inf, 1, 0, 0, NAN, NAN, NAN), None, DENIED),
    (34, (2, math.inf, 0, 0, NAN, NAN, NAN), None, DENIED),
    (186, (4, 3), ChangeAltitude(4.0), OK),
    (186, (NAN, 3), None, DENIED),
    (186, (4, 1), None, DENIED),
    (17, (), Pause(), OK),
    (17, (0, 0, 0, 0, NAN, NAN, 4), Reposition(None, None, 4.0, True), OK),
    (19, (30, 0, 0, 0, NAN, NAN, 4), Reposition(None, None, 4.0, True), OK),
    (31, (0, 0, 0, 0, NAN, NAN, 4), Reposition(None, None, 4.0, True), OK),
    (18, (2, 0, -1.5, 0, NAN, NAN, NAN), Orbit(-1.5, None, None, None, None, 2.0), OK),
    (18, (2, 0, 1.5), Orbit(1.5, None, None, None, None, 2.0), OK),
    (18, (0, 0, 1.5), None, DENIED),
    (18, (2, 0, 0), None, DENIED),
    (241, (1,), None, UNSUPPORTED),
    (241, (), None, OK),
    (178, (1, 2.5, -1), ChangeSpeed(2.5), OK),
    (178, (0, 2.5, -1), ChangeSpeed(2.5), OK),
    (178, (1, -2, -1), ChangeSpeed(None), OK),
    (178, (1, -1, -1), None, OK),
    (178, (1, 0, -1), None, DENIED),
    (178, (2, 0.1, -1), None, OK),
    (178, (3, 0.1, -1), None, OK),
    (178, (4, 2.5, -1), None, DENIED),
    (178, (NAN, 2.5, -1), None, DENIED),
    (178, (1, NAN, -1), None, DENIED),
    (179, (1,), SetHome(None), OK),
    (179, (2, 0, 0, 0, 47.397742, 8.545594, 0), None, DENIED),
    (179, (0, 0, 0, 0, NAN, 0, 0), None, DENIED),
    (185, (1,), Terminate(), OK),
    (185, (0,), None, DENIED),
    (401, (), RunPrearmChecks(), OK),
    (207, (0,), EnableFence(False), OK),
    (207, (1,), EnableFence(True), OK),
    (207, (2,), None, DENIED),
    (420, (101, 1, 5), None, DENIED),
    (420, (101, 1, 1), None, DENIED),  # the simulator has reported no parameters
    (420, (101, 5, 1), None, UNSUPPORTED),
    (420, (0, 1, 0), None, DENIED),  # the same
    (420, (0, 2, 0), None, UNSUPPORTED),
    (420, (4, 1, 2), None, DENIED),
    (420, (5, 1, 0), None, UNSUPPORTED),
    (115, (90,), TurnHeading(0.0), OK),  # east
    (115, (90, NAN), TurnHeading(0.0), OK),
    (115, (90, 180, -1), TurnHeading(0.0, sense=1, rate_rad_s=math.pi), OK),
    (115, (180, 0, 1), TurnHeading(-0.5 * math.pi, sense=-1), OK),
    (115, (180, 0, 0, 1), TurnHeading(-math.pi, relative=True), OK),
    (115, (180, 0, -1, 1), TurnHeading(math.pi, relative=True), OK),
    (115, (-180, 0, 0, 1), TurnHeading(math.pi, relative=True), OK),
    (115, (NAN,), None, DENIED),
    (115, (361,), None, DENIED),
    (115, (90, 0, 2), None, DENIED),
    (115, (90, 0, 0, NAN), None, DENIED),
    (195, (0, 0, 0, 0, NAN, 0, 0), None, DENIED),
    (195, (0, 0, 0, 0, 91, 0, 0), None, DENIED),
    (197, (), LookAt(None, None), OK),
    *[
        (command, params, *answer)
        for command in (80, 201)
        for params, *answer in [
            ((), LookAt(None, None), OK),
            ((0, 0, 0, 0, NAN, NAN, NAN), LookAt(None, None), OK),
            ((3, 0, 0, 0, 91, 0, 0), None, DENIED),
            ((1,), None, UNSUPPORTED),
            ((NAN,), None, UNSUPPORTED),
        ]
    ],
    (196, (), None, UNSUPPORTED),
    (187, (), None, UNSUPPORTED),
    (183, (), None, UNSUPPORTED),
    (181, (), None, UNSUPPORTED),
    (410, (), None, OK),
    (246, (1,), Reboot(), OK),
    (246, (2,), None, UNSUPPORTED),
    (246, (NAN,), None, UNSUPPORTED),
    (245, (0,), None, OK),
    (245, (1,), None, OK),
    (245, (2,), ResetParameters(), OK),
    (245, (3,), None, UNSUPPORTED),
    (512, (148,), None, OK),
    (512, (397,), None, OK),
    (512, (395,), None, OK),
    (512, (396,), None, UNSUPPORTED),
    (512, (NAN,), None, UNSUPPORTED),
    (512, (244, NAN), None, UNSUPPORTED),
    (512, (244, math.inf), None, UNSUPPORTED),
    (520, (1,), None, OK),
    (519, (1,), None, OK),
    (262, (mavlink.MAV_STANDARD_MODE_MISSION,), SetMode(AUTO, AUTO_MISSION), OK),
    (262, (mavlink.MAV_STANDARD_MODE_CRUISE,), None, UNSUPPORTED),
    (262, (NAN,), None, UNSUPPORTED),
    (512, (435, 0), None, OK),
    (512, (435, 99), None, DENIED),
    (512, (435, NAN), None, DENIED),
    (511, (30, 100_000), None, OK),
    (511, (30, NAN), None, DENIED),
    (511, (30, -2), None, DENIED),
    (511, (30, 3e38), None, OK),
    (511, (77, 1000), None, UNSUPPORTED),
    (511, (0, -1), None, DENIED),
    (510, (30,), None, OK),
    (510, (1e9,), None, UNSUPPORTED),
    (211, (1, 0), Release(), OK),
    (211, (0, 0), Release(), OK),
    (211, (NAN, 0), Release(), OK),
    (211, (1, 1), Grab(), OK),
    (211, (1, 2), None, OK),
    (211, (2, 0), None, DENIED),
    (211, (1, 3), None, DENIED),
    (211, (1, NAN), None, DENIED),
    (42600, (1, 1, 0.5, 0.2), Winch(0.5, 0.2), OK),
    (42600, (0, 1, -0.5, -0.2), Winch(-0.5, 0.2), OK),
    (42600, (NAN, 1, 0.5), Winch(0.5), OK),
    (42600, (1, 2, 0, 0.1), Winch(math.inf, 0.1), OK),
    (42600, (1, 2, 0, -0.1), Winch(-math.inf, 0.1), OK),
    (42600, (1, 2, 0, 0), Winch(0.0), OK),
    (42600, (1, 5), Winch(0.0), OK),
    (42600, (1, 6), Winch(-math.inf), OK),
    (42600, (2, 1, 0.5), None, DENIED),
    (42600, (1, 1, NAN), None, DENIED),
    (42600, (1, 1, 0.5, math.inf), None, DENIED),
    (42600, (1, 1, 0.5, NAN), None, DENIED),
    (42600, (1, 2, 0, NAN), None, DENIED),
    (42600, (1, 0), None, UNSUPPORTED),
    (42600, (1, 4), None, UNSUPPORTED),
    (65535, (), None, UNSUPPORTED),
]


def long(command, params=(), confirmation=0, system=1, component=1):
    values = (*params, *(0.0,) * (7 - len(params)))
    return mavlink.MAVLink_command_long_message(system, component, command, confirmation, *values)


def as_int(command, frame, params=(0, 0, 0, 0), x=0, y=0, z=0.0, system=1, component=1):
    return mavlink.MAVLink_command_int_message(system, component, frame, command, 0, 0, *params, x, y, z)


def acks(replies):
    return [(m.command, m.result) for m in replies if m.get_type() == "COMMAND_ACK"]


@pytest.mark.parametrize(("command", "params", "request_", "result"), LONG, ids=lambda value: str(value)[:40])
def test_command_long(rig_with, items, command, params, request_, result):
    rig = rig_with(items(6))
    replies = rig.replies(long(command, params))
    assert acks(replies) == [(command, result)]
    assert rig.asked == ([] if request_ is None else [request_])


@pytest.mark.parametrize(
    ("command", "params"),
    [(c, p) for c, p, request_, result in LONG if request_ is None and result == DENIED and c != 512],
    ids=lambda value: str(value)[:40],
)
def test_the_text_of_a_refusal_names_the_parameter_that_is_wrong(rig, command, params):
    texts = [r for r in rig.replies(long(command, params)) if r.get_type() == "STATUSTEXT"]
    text = "".join(part.text for part in texts)
    assert text
    for number in re.finditer(r"param\d", text):
        # "speed (param1) = -2 m/s", or "latitude ... (param5 ... param7)"
        assert re.search(r"\w \((param\d \.\.\. )?$", text[: number.start()]), text


@pytest.mark.parametrize(
    ("command", "params", "result"),
    [(c, p, r) for c, p, _, r in LONG if len(p) <= 4],
    ids=lambda v: str(v)[:40],
)
def test_command_int_is_acknowledged_as_command_long(rig, command, params, result):
    p = (*params, *(0.0,) * (4 - len(params)))
    expected = result if command not in (22, 179) else None
    (answer,) = acks(rig.replies(as_int(command, mavlink.MAV_FRAME_GLOBAL_INT, p)))
    assert answer[0] == command
    assert expected in (None, answer[1])


def test_no_command_is_left_without_an_answer(rig):
    for command in range(0, 65536, 97):
        assert len(acks(rig.replies(long(command)))) == 1


@pytest.mark.parametrize("command", [181, 183, 187])
def test_who_wants_an_actuator_is_told_what_moves_them(rig, command):
    said = "".join(r.text for r in rig.replies(long(command)) if r.get_type() == "STATUSTEXT")
    assert said == "Actuators: there are rotors, gripper and winch; DO_GRIPPER and DO_WINCH move these"


@pytest.mark.parametrize(
    ("warns", "severity"), [(False, mavlink.MAV_SEVERITY_INFO), (True, mavlink.MAV_SEVERITY_WARNING)]
)
def test_what_is_said_with_an_acceptance_is_news_or_a_warning(rig, warns, severity):
    rig.verdict = lambda request: Verdict(OK, "load position not settled", warns)
    (text,) = [r for r in rig.replies(long(401)) if r.get_type() == "STATUSTEXT"]
    assert (text.severity, text.text) == (severity, "load position not settled")


def test_the_ack_names_the_asker(rig):
    (ack,) = rig.replies(long(20), system=245, component=77)
    assert (ack.target_system, ack.target_component) == (245, 77)


@pytest.mark.parametrize("component", [0, 1])
@pytest.mark.parametrize("system", [0, 1])
def test_broadcast_and_own_address_execute(rig, system, component):
    assert acks(rig.replies(long(20, system=system, component=component))) == [(20, OK)]


@pytest.mark.parametrize(("system", "component"), [(2, 1), (2, 0), (1, 99), (255, 190)])
def test_for_somebody_else_there_is_silence(rig, system, component):
    assert rig.replies(long(400, (1,), system=system, component=component)) == []
    assert rig.replies(as_int(400, 0, (1, 0, 0, 0), system=system, component=component)) == []
    assert rig.asked == []


def test_only_the_asker_hears_the_ack_but_all_hear_the_reason(rig):
    rig.endpoint.add_link("api")
    rig.verdict = lambda request: Verdict(DENIED, "Arm: the load is not measured")
    rig.poll()
    rig.send(long(400, (1,)))
    out = rig.poll()
    kinds = {link: [r.message.get_type() for r in got] for link, got in out.items()}
    assert kinds["gcs"][:2] == ["STATUSTEXT", "COMMAND_ACK"]
    assert "STATUSTEXT" in kinds["api"]
    assert "COMMAND_ACK" not in kinds["api"]


@pytest.mark.parametrize("frame", [3, 6])
def test_takeoff_above_home_by_frame(rig_with, frame):
    rig = rig_with()
    rig.replies(as_int(22, frame, z=4.0))
    assert rig.asked == [Takeoff(4.0)]


@pytest.mark.parametrize("frame", [1, 2, 8, 10, 77])
def test_takeoff_in_a_frame_without_a_height_above_home_or_the_sea_is_refused(rig_with, frame):
    rig = rig_with()
    replies = rig.replies(as_int(22, frame, z=1.5))
    assert replies[0].text == f"Take-off: frame {frame}; must be 0, 3, 5 or 6"
    assert (acks(replies), rig.asked) == ([(22, DENIED)], [])


def test_takeoff_below_home_says_the_height_it_understood(rig):
    replies = rig.replies(long(22, (0, 0, 0, 0, 0, 0, -4)))
    assert "-4" in replies[0].text
    assert acks(replies) == [(22, DENIED)]


@pytest.mark.parametrize(("frame", "up"), [(0, 7.0), (5, 7.0), (3, 7.0), (6, 7.0)])
def test_reposition_by_int_is_metres_from_home(rig, snap, frame, up):
    home = snap().home
    latitude, longitude, _ = geodetic_from_enu((30.0, -20.0, 0.0), home)
    rig.replies(as_int(192, frame, (-1, 1, 0, NAN), latitude, longitude, up))
    (request,) = rig.asked
    assert (request.east_m, request.north_m) == pytest.approx((30.0, -20.0), abs=0.01)  # 1e-7 degrees
    assert (request.altitude_m, request.change_mode) == (up, True)


@pytest.mark.parametrize(
    ("command", "first"), [(195, 0.0), (201, 3.0), (201, 0.0), (80, 3.0)], ids=lambda value: f"{value:g}"
)
def test_a_place_to_look_at_is_metres_from_home(rig, snap, command, first):
    latitude, longitude, _ = geodetic_from_enu((30.0, -20.0, 0.0), snap().home)
    rig.replies(as_int(command, 6, (first, 0, 0, 0), latitude, longitude, NAN))
    (request,) = rig.asked
    assert (request.east_m, request.north_m) == pytest.approx((30.0, -20.0), abs=0.01)  # 1e-7 degrees


def test_a_circle_whose_centre_is_left_open_is_one_around_here(rig):
    """MAVSDK converts NaN to the least integer."""
    for nowhere in (2**31 - 1, -(2**31)):
        assert acks(rig.replies(as_int(34, 3, (NAN, NAN, 0, NAN), nowhere, nowhere, NAN))) == [(34, OK)]
    assert rig.asked == [Orbit(None, None, None, None, None, faces_centre=True)] * 2


def test_the_yaw_of_a_place_is_heeded_as_the_identity_does(rig_with):
    """PX4 turns to it; ArduPilot does not, and its clients leave it 0."""
    for identity, heading in ((Identity(), 0.0), (Identity(flavour=ARDUPILOT), None)):
        rig = rig_with(identity=identity)
        rig.replies(as_int(192, 6, (-1, 1, 0, 0.5 * math.pi), 2**31 - 1, 2**31 - 1, 5.0))
        (request,) = rig.asked
        assert request.heading_rad == (heading if heading is None else pytest.approx(heading, abs=1e-6))


def test_set_mode_message_is_acknowledged_as_the_command(rig):
    message = mavlink.MAVLink_set_mode_message(1, 1, AUTO_LAND << 24 | AUTO << 16)
    assert acks(rig.replies(message)) == [(176, OK)]
    assert rig.asked == [SetMode(AUTO, AUTO_LAND)]


@pytest.mark.parametrize(
    ("base_mode", "custom", "result"), [(1, 99 << 16, DENIED), (0, 4 << 16, UNSUPPORTED)]
)
def test_set_mode_message_refused(rig, base_mode, custom, result):
    assert acks(rig.replies(mavlink.MAVLink_set_mode_message(1, base_mode, custom))) == [(176, result)]
    assert rig.asked == []


@pytest.mark.parametrize(
    ("flavour", "custom", "text"),
    [
        (PX4, 7 << 16, "STABILIZED not flown; use LOITER MISSION RTL LAND"),
        (PX4, 5 << 16, "ACRO not flown; use LOITER MISSION RTL LAND POSCTL"),
        (PX4, 99 << 16, "Mode 6488064 unknown; use LOITER MISSION RTL LAND"),
        (ARDUPILOT, 0, "STABILIZE not flown; use GUIDED AUTO RTL LAND"),
        (ARDUPILOT, 1, "ACRO not flown; use GUIDED AUTO RTL LAND POSHOLD"),
        (ARDUPILOT, 77, "Mode 77 unknown; use GUIDED AUTO RTL LAND POSHOLD"),
        (ARDUPILOT, 2**32 - 1, "Mode 4294967295 unknown; use GUIDED AUTO RTL LAND"),
    ],
)
def test_a_mode_that_is_not_flown_is_refused_by_its_name_with_those_that_are(rig_with, flavour, custom, text):
    rig = rig_with(identity=Identity(flavour=flavour))
    replies = rig.replies(mavlink.MAVLink_set_mode_message(1, 1, custom))
    assert acks(replies) == [(176, DENIED)]
    assert [m.text for m in replies if m.get_type() == "STATUSTEXT"] == [text]
    assert len(text) <= 50 and rig.asked == []


@pytest.mark.parametrize(
    ("flavour", "ask", "name"),
    [
        (ARDUPILOT, mavlink.MAVLink_set_mode_message(1, 1, 16), "POSHOLD"),
        (ARDUPILOT, long(176, (1, 16, 0, 0, 0, 0, 0)), "POSHOLD"),
        (PX4, long(176, (1, 3, 0, 0, 0, 0, 0)), "POSCTL"),
        (ARDUPILOT, long(262, (mavlink.MAV_STANDARD_MODE_POSITION_HOLD, 0, 0, 0, 0, 0, 0)), "POSHOLD"),
    ],
)
def test_the_supervisor_knows_the_name_of_the_requested_mode(rig_with, flavour, ask, name):
    rig = rig_with(identity=Identity(flavour=flavour))
    rig.replies(ask)
    assert [request.name for request in rig.asked] == [name]


@pytest.mark.parametrize(("flavour", "total"), [(PX4, 9), (ARDUPILOT, 8)])  # item 0 of these is home
def test_set_current_message_is_answered_by_mission_current(rig_with, flavour, total):
    rig = rig_with(identity=Identity(flavour=flavour))
    rig.changes = {"mission_current": 5, "mission_total": 9, "mission_state": 3}
    rig.poll()
    rig.send(mavlink.MAVLink_mission_set_current_message(1, 1, 5))
    answers = [r.message for r in rig.poll()["gcs"]]
    (current,) = [m for m in answers if m.get_type() == "MISSION_CURRENT"]
    assert (current.seq, current.total, current.mission_state) == (5, total, 3)
    assert rig.asked == [SetCurrent(5)]


# executed twice, they lead elsewhere
RELATIVE = [
    pytest.param(long(42600, (1, 1, 0.1, 0.3)), id="winch"),
    pytest.param(long(115, (20, 0, 1, 1)), id="yaw"),
    pytest.param(long(300, (0,)), id="mission start"),
]
# executed twice, they lead to the same state
ABSOLUTE = [
    pytest.param(long(400, (1,)), id="arm"),
    pytest.param(long(21), id="land"),
    pytest.param(long(193, (0,)), id="pause"),
    pytest.param(long(176, (1, 4, 3)), id="hold"),
    pytest.param(long(42600, (1, 5)), id="winch stop"),
    pytest.param(long(42600, (1, 6)), id="winch retract"),
    pytest.param(long(115, (20, 0, 1, 0)), id="yaw from north"),
    pytest.param(long(300, (NAN,)), id="mission start at the current item"),
]


def repeated(command, confirmation):
    again = copy.copy(command)
    again.confirmation = confirmation
    return again


@pytest.mark.parametrize("command", RELATIVE)
def test_a_relative_command_that_is_repeated_as_its_ack_was_lost_is_done_once(rig, command):
    """QGroundControl repeats after 3 s."""
    for confirmation in range(3):
        assert acks(rig.replies(repeated(command, confirmation))) == [(command.command, OK)]
        rig.now_us += 3_500_000
    assert len(rig.asked) == 1


@pytest.mark.parametrize("command", RELATIVE)
def test_a_relative_command_whose_first_frame_was_lost_is_done_after_an_equal_one(rig, command):
    rig.replies(command)
    rig.now_us += REPEAT_US + 1
    rig.replies(repeated(command, 1))
    assert len(rig.asked) == 2, "too late for a repetition"
    rig.replies(repeated(command, 1))
    assert len(rig.asked) == 3, "a repetition would have counted on"


@pytest.mark.parametrize("command", RELATIVE)
def test_a_relative_command_that_is_given_twice_is_done_twice(rig, command):
    for _ in range(2):
        assert acks(rig.replies(command)) == [(command.command, OK)]
    assert len(rig.asked) == 2


@pytest.mark.parametrize("as_message", ["long", "int"])
def test_a_frame_that_the_network_has_duplicated_is_done_once_and_told_once(rig, as_message):
    rig.verdict = lambda request: Verdict(OK, "Winch: 1.20 m to 1.30 m")
    parameters = (1.0, 1.0, 0.1, 0.3)
    command = long(42600, parameters) if as_message == "long" else as_int(42600, 0, parameters)
    frame = FrameWriter(255, 190).frame(command)
    heard = []
    for _ in range(3):
        rig.send_bytes(frame)
        heard += [r.message for r in rig.poll()["gcs"]]
    assert len(rig.asked) == 1
    assert acks(heard) == [(42600, OK)] * 3
    assert [m.text for m in heard if m.get_type() == "STATUSTEXT"] == ["Winch: 1.20 m to 1.30 m"]
    rig.now_us += DUPLICATE_US + 1
    rig.send_bytes(frame)
    assert len(rig.asked) == 2, "its number has come round"


@pytest.mark.parametrize("command", ABSOLUTE)
def test_a_command_that_leads_to_a_state_is_done_as_often_as_it_comes(rig, command):
    """The vehicle may have left that state: it disarms by itself, for example, or lands in a failsafe."""
    rig.replies(command)
    assert acks(rig.replies(repeated(command, 1))) == [(command.command, OK)]
    assert len(rig.asked) == 2
    rig.verdict = lambda request: Verdict(DENIED, "Hold denied while in failsafe")
    assert acks(rig.replies(repeated(command, 2))) == [(command.command, DENIED)]


@pytest.mark.parametrize("take_off", [long(22, (NAN,) * 7), long(176, (1, 4, 2))], ids=["command", "mode"])
def test_a_repeated_take_off_that_has_begun_is_not_refused(rig, take_off):
    rig.replies(take_off)
    rig.verdict = lambda request: Verdict(DENIED, "Take-off denied: it has begun already")
    assert acks(rig.replies(repeated(take_off, 1))) == [(take_off.command, OK)]
    rig.now_us += REPEAT_US
    assert acks(rig.replies(repeated(take_off, 2))) == [(take_off.command, DENIED)]


def test_a_command_that_comes_again_because_its_ack_was_lost_is_not_refused(rig):
    """MAVSDK repeats a command without marking it as a repetition."""
    take_off = (NAN,) * 7
    rig.replies(long(22, take_off))
    rig.verdict = lambda request: Verdict(DENIED, "already flying")
    assert acks(rig.replies(long(22, take_off))) == [(22, OK)]
    assert acks(rig.replies(long(22, (*take_off[:6], 3.0)))) == [(22, DENIED)]
    assert acks(rig.replies(long(22, take_off), system=245)) == [(22, DENIED)]
    rig.now_us += REPEAT_US + 1
    assert acks(rig.replies(long(22, take_off))) == [(22, DENIED)]


def test_a_command_after_another_one_is_no_repetition(rig):
    rig.replies(long(22, (NAN,) * 7))
    rig.replies(long(193, (0,)))
    rig.verdict = lambda request: Verdict(DENIED, "already flying")
    assert acks(rig.replies(long(22, (NAN,) * 7))) == [(22, DENIED)]


@pytest.mark.parametrize("other", ["parameters", "asker", "late", "first refused"])
def test_a_repetition_is_the_same_command_from_the_same_asker_soon_after(rig, other):
    if other == "first refused":
        rig.verdict = lambda request: Verdict(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    rig.replies(long(300, (0,)))
    if other == "late":
        rig.now_us += REPEAT_US + 1
    params = (1,) if other == "parameters" else (0,)
    rig.replies(long(300, params, confirmation=1), system=245 if other == "asker" else 255)
    assert len(rig.asked) == 2


def test_a_refusal_that_recurs_is_answered_each_time_and_told_now_and_then(rig):
    """The client that asks gets the reason again sooner than the others."""
    rig.endpoint.add_link("other")
    logged = []
    rig.endpoint.on_text = lambda severity, text: logged.append(text)
    heard = {"gcs": [], "other": []}
    asked = 0
    while rig.now_us < 10_000_000:
        rig.send(long(176, (1, 77)))
        asked += 1
        for link, received in rig.poll().items():
            heard[link] += [
                r.message for r in received if r.message.get_type() in ("STATUSTEXT", "COMMAND_ACK")
            ]
    refusal = "Mode 77/0 unknown; use LOITER MISSION RTL LAND"
    assert acks(heard["gcs"]) == [(176, DENIED)] * asked
    assert [m.text for m in heard["gcs"] if m.get_type() == "STATUSTEXT"] == [refusal] * 10
    assert [m.text for m in heard["other"]] == [refusal] * 2
    assert logged == [refusal] * 2


def test_another_refusal_and_a_new_link_are_told_at_once(rig):
    rig.send(long(176, (1, 77)))
    rig.poll()
    rig.endpoint.add_link("new")
    rig.send(long(176, (1, 77)), long(176, (1, 78)))
    texts = {
        link: [r.message.text for r in received if r.message.get_type() == "STATUSTEXT"]
        for link, received in rig.poll().items()
    }
    first, second = (f"Mode {mode}/0 unknown; use LOITER MISSION RTL LAND" for mode in (77, 78))
    assert texts == {"gcs": [second], "new": [first, second]}


def test_refusals_with_other_numbers_each_time_are_told_no_more_often_than_equal_ones(rig):
    """Nor do they push out the texts that are kept."""
    rig.endpoint.add_link("other")
    rig.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, "kept")
    told = {"gcs": [], "other": []}
    mode = 0
    while rig.now_us < 10_000_000:
        mode += 1
        set_mode = mavlink.MAVLink_set_mode_message(1, 1, mode << 16)
        rig.send(set_mode if mode % 2 else long(176, (1, 77 + mode % 100)))
        for link, received in rig.poll().items():
            told[link] += [r.message.text for r in received if r.message.get_type() == "STATUSTEXT"]
    refused = [text for text in told["gcs"] if "unknown" in text]
    assert refused == [text for text in told["other"] if "unknown" in text]
    assert len(set(refused)) == len(refused) == 10, "five in five seconds"
    assert "kept" in [text.text for text in rig.endpoint.kept_texts.texts]


def test_the_reasons_of_prearm_checks_are_told_as_often_as_asked(rig):
    rig.verdict = lambda request: Verdict(OK, "battery nearly empty", warns=True)
    for _ in range(3):
        assert [m.get_type() for m in rig.replies(long(401))] == ["STATUSTEXT", "COMMAND_ACK"]


def test_heartbeat_at_once_when_the_supervisor_did_something(rig):
    rig.poll()
    rig.poll()
    rig.send(long(400, (1,)))
    rig.changes = {"armed": True}
    beats = [r.message for r in rig.poll()["gcs"] if r.message.get_type() == "HEARTBEAT"]
    assert [beat.base_mode & 128 for beat in beats] == [128]


@pytest.mark.parametrize("ask", [long(512, (148,)), long(520, (1,))], ids=["512", "520"])
def test_version_comes_with_its_ack(rig, ask):
    assert [m.get_type() for m in rig.replies(ask)] == ["COMMAND_ACK", "AUTOPILOT_VERSION"]


def test_intervals_are_told_and_kept_by_link(rig):
    rig.endpoint.add_link("api")
    replies = rig.replies(long(511, (mavlink.MAVLINK_MSG_ID_LOAD_STATE, 4000)), long(510, (60101,)))
    intervals = [m.interval_us for m in replies if m.get_type() == "MESSAGE_INTERVAL"]
    assert intervals == [4000]
    counts = {"gcs": 0, "api": 0}
    for _ in range(250):
        for link, received in rig.poll().items():
            counts[link] += sum(r.message.get_type() == "LOAD_STATE" for r in received)
    assert counts == {"gcs": 250, "api": 20}


@pytest.mark.parametrize(("message_id", "interval_us"), [(30, 40_000), (148, -1), (9999, 0)])
def test_interval_of_a_stream_of_a_message_on_request_and_of_neither(rig, message_id, interval_us):
    for ask in (long(510, (message_id,)), long(512, (244, message_id))):
        (told,) = [m for m in rig.replies(ask) if m.get_type() == "MESSAGE_INTERVAL"]
        assert (told.message_id, told.interval_us) == (message_id, interval_us)


def test_an_interval_longer_than_can_be_stated_is_the_longest_that_can(rig):
    assert acks(rig.replies(long(511, (30, 1e19)))) == [(511, OK)]
    (told,) = [m for m in rig.replies(long(510, (30,))) if m.get_type() == "MESSAGE_INTERVAL"]
    assert told.interval_us == 2**31 - 1


def test_a_stream_turned_off_and_on_again(rig):
    rig.replies(long(511, (30, -1)))
    assert not [r for r in rig.run(1_000_000) if r.message.get_type() == "ATTITUDE"]
    rig.replies(long(511, (30, 0)))
    assert len([r for r in rig.run(1_000_000) if r.message.get_type() == "ATTITUDE"]) == 25


def test_a_data_stream_request_turns_nothing_off(rig):
    rig.replies(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 0, 0))
    assert len([r for r in rig.run(1_000_000) if r.message.get_type() == "ATTITUDE"]) == 25


def test_every_command_stands_in_the_manual():
    manual = (Path(__file__).parents[2] / "docs" / "mavlink.md").read_text()
    for command in PARSERS:
        name = mavlink.enums["MAV_CMD"][command].name.removeprefix("MAV_CMD_")
        assert f"| {name} | {command} |" in manual


def test_every_parser_is_in_the_case_table():
    assert {command for command, *_ in LONG} >= set(PARSERS)


def test_takeoff_in_the_px4_flavour_is_above_the_sea():
    assert not Identity().flavour.takeoff_above_home


# ---- storage


def test_parameters_go_back_to_their_defaults(rig):
    rig.table.set("LOAD_MASS", 0.5)
    rig.table.set("CTRL_RATE_HZ", 500.0)
    rig.table.freeze()
    told = [x for x in rig.replies(long(245, (2,))) if x.get_type() == "PARAM_VALUE"]
    assert [x.param_id for x in told] == ["LOAD_MASS"]
    assert rig.table["LOAD_MASS"] == rig.table.describe("LOAD_MASS").default
    assert rig.table["CTRL_RATE_HZ"] == 500.0
    assert ParameterChanged("LOAD_MASS", rig.table["LOAD_MASS"]) in rig.events


def test_the_home_position_and_the_origin_are_told(rig):
    (home,) = [x for x in rig.replies(long(410)) if x.get_type() == "COMMAND_ACK"]
    assert home.result == OK
    rig.send(long(410))
    assert "HOME_POSITION" in [r.message.get_type() for r in rig.poll()["gcs"]]
    origin = mavlink.MAVLink_set_gps_global_origin_message(1, 0, 0, 0)
    told = {x.get_type() for x in rig.replies(origin)}
    assert told == {"STATUSTEXT", "GPS_GLOBAL_ORIGIN"}
    assert "GPS_GLOBAL_ORIGIN" not in {
        x.get_type() for x in rig.replies(mavlink.MAVLink_set_gps_global_origin_message(9, 0, 0, 0))
    }


def test_rotors_fail_and_work_again_by_the_simulators_parameter(rig):
    rig.table.add_remote(Parameter("SIM_ENGINE_FAIL", 0.0, 0.0, 15.0, "", ""))
    for p, failed in (((101, 1, 2), 0b0010), ((101, 1, 4), 0b1010), ((101, 0, 2), 0b1000), ((101, 1, 0), 15)):
        rig.send(long(420, p))
        assert rig.table["SIM_ENGINE_FAIL"] == failed
        assert rig.events[-1] == SimulatorParameterRequested("SIM_ENGINE_FAIL", failed)
    rig.send(long(420, (101, 0, 0)))
    assert rig.table["SIM_ENGINE_FAIL"] == 0


def test_sensors_fail_and_work_again_by_the_simulators_parameter(rig):
    rig.table.add_remote(Parameter("SIM_SENS_FAIL", 0.0, 0.0, 127.0, "", ""))
    for p, failed in (
        ((0, 1, 0), 1),
        ((4, 1, 1), 17),
        ((1, 0, 0), 16),
        ((2, 1), 80),
        ((3, 1), 112),
        ((6, 1), 114),
    ):
        rig.send(long(420, p))
        assert rig.table["SIM_SENS_FAIL"] == failed
        assert rig.events[-1] == SimulatorParameterRequested("SIM_SENS_FAIL", failed)


def test_nothing_fails_in_a_simulator_that_is_silent(rig):
    rig.table.add_remote(Parameter("SIM_ENGINE_FAIL", 0.0, 0.0, 15.0, "", ""))
    rig.endpoint.set_simulator_silent(True)
    told = {x.get_type(): x for x in rig.replies(long(420, (101, 1, 2)))}
    assert told["COMMAND_ACK"].result == mavlink.MAV_RESULT_DENIED
    assert told["STATUSTEXT"].text == "Failure: the simulator is silent"
    assert rig.table["SIM_ENGINE_FAIL"] == 0.0 and rig.events == []


def test_the_simulators_parameters_are_saved_on_request_alone(rig):
    rig.table.add_remote(Parameter("SIM_WIND_E", 0.0, -100.0, 100.0, "", ""))
    rig.send(mavlink.MAVLink_param_set_message(1, 1, b"SIM_WIND_E", 3.0, mavlink.MAV_PARAM_TYPE_REAL32))
    assert not any(isinstance(event, SimulatorParametersSaved) for event in rig.events)
    rig.table.set("SIM_WIND_E", 3.0)  # as the simulator then reports
    rig.send(long(245, (1,)))
    assert rig.events[-2:] == [ParametersSaved(), SimulatorParametersSaved({"SIM_WIND_E": 3.0})]
    rig.send(long(245, (2,)))
    assert rig.events[-1] == SimulatorParametersSaved({})
    assert SimulatorParameterRequested("SIM_WIND_E", 0.0) in rig.events
