"""The addressed component answers: the vehicle is an autopilot, a winch and the component of the dialect."""

from __future__ import annotations

from collections import Counter

import pytest

from autopilot.services.identity import FOLLOW_MODE, Identity
from autopilot.services.requests import Winch
from autopilot.wire.dialect import plumbline as m

AUTOPILOT, DIALECT, WINCH, LOAD = 1, 25, 169, 35
LOAD_SYSTEM = 2
BESIDE = [(1, DIALECT), (1, WINCH), (LOAD_SYSTEM, LOAD)]
OK, UNSUPPORTED = m.MAV_RESULT_ACCEPTED, m.MAV_RESULT_UNSUPPORTED
SECOND_US = 1_000_000


def long(to, command, *params):
    return m.MAVLink_command_long_message(*to, command, 0, *params, *(0.0,) * (7 - len(params)))


def heard(rig, message, kind, **origin):
    """The messages of a kind that follow a message, each with its source."""
    rig.poll()
    rig.send(message, **origin)
    got = rig.poll().get("gcs", [])
    return [((r.system, r.component), r.message) for r in got if r.message.get_type() == kind]


@pytest.fixture
def rig(rig_with):
    return rig_with(identity=Identity(load_system=LOAD_SYSTEM))


@pytest.mark.parametrize("to", [(1, WINCH), (0, WINCH)])
def test_the_winch_does_what_a_winch_is_told_and_answers_itself(rig, to):
    ((source, ack),) = heard(rig, long(to, m.MAV_CMD_DO_WINCH, 1, 1, 0.5, 0.2), "COMMAND_ACK")
    assert source == (1, WINCH)
    assert (ack.command, ack.result, ack.target_system, ack.target_component) == (42600, OK, 255, 190)
    assert rig.asked == [Winch(0.5, 0.2)]


def test_the_autopilot_still_works_the_winch(rig):
    for component in (0, AUTOPILOT):
        ((source, ack),) = heard(rig, long((1, component), m.MAV_CMD_DO_WINCH, 1, 5), "COMMAND_ACK")
        assert (source, ack.result) == ((1, AUTOPILOT), OK)


@pytest.mark.parametrize("to", BESIDE)
def test_what_a_component_does_not_do_it_refuses(rig, to):
    for command in (m.MAV_CMD_COMPONENT_ARM_DISARM, m.MAV_CMD_NAV_LAND, m.MAV_CMD_DO_GRIPPER, 31000):
        ((source, ack),) = heard(rig, long(to, command, 1.0), "COMMAND_ACK")
        assert (source, ack.command, ack.result) == (to, command, UNSUPPORTED)
        as_int = m.MAVLink_command_int_message(*to, 6, command, 0, 0, 1.0, 0, 0, 0, 0, 0, 0)
        ((source, ack),) = heard(rig, as_int, "COMMAND_ACK")
        assert (source, ack.command, ack.result) == (to, command, UNSUPPORTED)
    assert rig.asked == []


def test_the_load_as_a_system_answers_where_nobody_of_it_is_named(rig):
    ((source, ack),) = heard(rig, long((LOAD_SYSTEM, 0), m.MAV_CMD_NAV_LAND), "COMMAND_ACK")
    assert (source, ack.result) == ((LOAD_SYSTEM, LOAD), UNSUPPORTED)


@pytest.mark.parametrize(
    ("to", "message_id", "kind"),
    [
        ((1, WINCH), m.MAVLINK_MSG_ID_WINCH_STATUS, "WINCH_STATUS"),
        ((1, WINCH), m.MAVLINK_MSG_ID_HEARTBEAT, "HEARTBEAT"),
        ((1, DIALECT), m.MAVLINK_MSG_ID_LOAD_STATE, "LOAD_STATE"),
        ((LOAD_SYSTEM, LOAD), m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, "GLOBAL_POSITION_INT"),
    ],
)
def test_a_component_says_what_it_has_to_say_when_asked(rig, to, message_id, kind):
    ask = long(to, m.MAV_CMD_REQUEST_MESSAGE, message_id)
    rig.poll()
    rig.send(ask)
    got = [((r.system, r.component), r.message) for r in rig.poll()["gcs"]]
    assert [(who, said.result) for who, said in got if said.get_type() == "COMMAND_ACK"] == [(to, OK)]
    assert to in [who for who, said in got if said.get_type() == kind]


@pytest.mark.parametrize("to", BESIDE)
def test_what_a_component_never_says_it_refuses_to_say(rig, to):
    for message_id in (m.MAVLINK_MSG_ID_AUTOPILOT_VERSION, m.MAVLINK_MSG_ID_AVAILABLE_MODES, 397):
        ((source, ack),) = heard(rig, long(to, m.MAV_CMD_REQUEST_MESSAGE, message_id), "COMMAND_ACK")
        assert (source, ack.result) == (to, UNSUPPORTED)
        ((source, ack),) = heard(
            rig, long(to, m.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, 1e5), "COMMAND_ACK"
        )
        assert (source, ack.result) == (to, UNSUPPORTED)


def test_the_rate_of_what_the_winch_says(rig):
    status = m.MAVLINK_MSG_ID_WINCH_STATUS
    heard(rig, long((1, WINCH), m.MAV_CMD_SET_MESSAGE_INTERVAL, status, 100_000.0), "COMMAND_ACK")
    ((source, told),) = heard(
        rig, long((1, WINCH), m.MAV_CMD_GET_MESSAGE_INTERVAL, status), "MESSAGE_INTERVAL"
    )
    assert (source, told.message_id, told.interval_us) == ((1, WINCH), status, 100_000)
    said = [r for r in rig.run(SECOND_US) if r.message.get_type() == "WINCH_STATUS"]
    assert len(said) == 10


@pytest.mark.parametrize("to", BESIDE)
def test_components_have_no_parameters_files_or_missions_and_say_so(rig, to):
    read = m.MAVLink_param_request_read_message(*to, b"LOAD_MASS", -1)
    write = m.MAVLink_param_set_message(*to, b"LOAD_MASS", 0.2, m.MAV_PARAM_TYPE_REAL32)
    for message in (read, write):
        ((source, error),) = heard(rig, message, "PARAM_ERROR")
        assert (source, error.error) == (to, m.MAV_PARAM_ERROR_DOES_NOT_EXIST)
    payload = [0] * 251
    payload[3] = 3  # list a directory
    ftp = m.MAVLink_file_transfer_protocol_message(0, *to, payload)
    ((source, reply),) = heard(rig, ftp, "FILE_TRANSFER_PROTOCOL")
    assert (source, reply.payload[3]) == (to, 129)  # NAK
    for message in (
        m.MAVLink_mission_count_message(*to, 3, 0),
        m.MAVLink_mission_request_list_message(*to, 0),
        m.MAVLink_mission_clear_all_message(*to, 0),
    ):
        ((source, ack),) = heard(rig, message, "MISSION_ACK")
        assert (source, ack.type) == (to, m.MAV_MISSION_UNSUPPORTED)
    assert rig.table["LOAD_MASS"] != pytest.approx(0.2)
    assert rig.events == []


def test_the_winch_shows_itself_where_it_is_addressed(rig):
    """And nowhere else: DroneKit and pymavlink would mistake its HEARTBEAT for that of the vehicle."""
    rig.endpoint.add_link("api")

    def hearts(link):
        got = rig.run(5 * SECOND_US, link)
        return Counter(
            (r.component, r.message.type, r.message.autopilot)
            for r in got
            if r.message.get_type() == "HEARTBEAT" and r.system == 1
        )

    winch = (WINCH, m.MAV_TYPE_WINCH, m.MAV_AUTOPILOT_INVALID)
    rig.send(m.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
    rig.send(long((1, AUTOPILOT), m.MAV_CMD_DO_WINCH, 1, 5))
    assert winch not in hearts("gcs")
    rig.send(long((1, WINCH), m.MAV_CMD_DO_WINCH, 1, 5))
    assert hearts("gcs")[winch] == 5
    assert winch not in hearts("api")


def test_each_component_counts_its_own_messages(rig):
    last: dict[tuple[int, int], int] = {}
    for tick in range(400):
        if tick % 50 == 0:
            rig.send(long((1, WINCH), m.MAV_CMD_DO_WINCH, 1, 5), long((1, DIALECT), 31000))
        for r in rig.poll().get("gcs", []):
            source = r.system, r.component
            sequence = r.frame[4]
            assert sequence == (last.get(source, sequence - 1) + 1) % 256
            last[source] = sequence
    assert set(last) == {(1, AUTOPILOT), *BESIDE}


def test_what_the_winch_says_of_itself_comes_from_it(rig):
    said = {r.component for r in rig.run(SECOND_US) if r.message.get_type() == "WINCH_STATUS"}
    assert said == {WINCH}


def test_the_winch_is_silent_while_a_target_is_followed(rig):
    """FollowMe of MAVSDK takes every HEARTBEAT of the system for the autopilot's, and ends its own mode."""
    rig.send(long((1, WINCH), m.MAV_CMD_DO_WINCH, 1, 5))

    def winch_beats():
        got = rig.run(5 * SECOND_US)
        return sum(r.message.get_type() == "HEARTBEAT" and r.component == WINCH for r in got)

    assert winch_beats() == 5
    main, sub = FOLLOW_MODE
    rig.changes = {"main_mode": main, "sub_mode": sub}
    assert winch_beats() == 0
    rig.changes = {}
    assert winch_beats() == 5
