"""The identity that the vehicle reports, read back by pymavlink's own tables."""

from __future__ import annotations

import pytest
from pymavlink import mavutil

from autopilot.services.heartbeat import heartbeat_message, load_heartbeat_message
from autopilot.services.identity import (
    ARDUPILOT,
    AUTO,
    AUTO_TAKEOFF,
    FLAVOURS,
    OFFBOARD,
    PX4,
    SUPPORTED_MODES,
    Identity,
    autopilot_version_message,
    available_modes_messages,
    identity_of,
)
from autopilot.supervisor.requests.modes import MODES
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.dialect import plumbline as mavlink


@pytest.mark.parametrize("mode", PX4.modes, ids=lambda mode: mode.name)
def test_pymavlink_names_every_px4_mode_as_the_table_does(mode, snap):
    beat = heartbeat_message(snap(main_mode=mode.main, sub_mode=mode.sub), Identity())
    named = mavutil.interpret_px4_mode(beat.base_mode, beat.custom_mode)
    assert named == mode.name


@pytest.mark.parametrize("flavour", FLAVOURS.values(), ids=lambda flavour: flavour.name)
def test_modes_of_a_flavour_can_be_told_apart(flavour):
    assert len({(mode.custom_mode, mode.pair) for mode in flavour.modes}) == len(flavour.modes)
    for mode in flavour.modes:
        assert flavour.mode(*mode.pair, mode.custom_mode) is mode
        shown = flavour.mode(*mode.pair)
        assert shown is not None
        assert shown.pair == mode.pair
        meant = flavour.mode_of_number(mode.custom_mode)
        assert meant is not None
        assert meant.name == mode.name


@pytest.mark.parametrize("mode", ARDUPILOT.modes, ids=lambda mode: f"{mode.name}-{mode.pair}")
def test_pymavlink_names_every_ardupilot_mode_as_the_table_does(mode):
    assert mavutil.mode_mapping_acm[mode.custom_mode] == mode.name


@pytest.mark.parametrize("flavour", FLAVOURS.values(), ids=lambda flavour: flavour.name)
def test_the_modes_told_are_those_that_are_flown(flavour):
    told = available_modes_messages(Identity(flavour=flavour))
    assert [one.mode_index for one in told] == list(range(1, len(told) + 1))
    assert {one.number_modes for one in told} == {len(told)}
    pairs = set()
    for one in told:
        mode = flavour.mode_of_number(one.custom_mode)
        assert mode is not None
        pairs.add(mode.pair)
    # with ArduPilot, take-off has no separate number, and OFFBOARD is GUIDED
    hidden = {(AUTO, AUTO_TAKEOFF), (OFFBOARD, 0)} if flavour is ARDUPILOT else set()
    assert pairs == set(SUPPORTED_MODES) - hidden


@pytest.mark.parametrize(
    ("flavour", "names"),
    [
        (PX4, "Position,Takeoff,Hold,Mission,Return,Land,Follow Target,Offboard"),
        (ARDUPILOT, "GUIDED,LOITER,BRAKE,AUTO,RTL,LAND,POSHOLD,FOLLOW"),
    ],
)
def test_the_modes_have_the_names_that_the_users_of_that_autopilot_know(flavour, names):
    told = available_modes_messages(Identity(flavour=flavour))
    assert ",".join(one.mode_name for one in told) == names


def test_what_is_called_flown_is_what_the_supervisor_flies():
    assert set(SUPPORTED_MODES) == set(MODES)


def test_the_parameters_choose_the_identity():
    table = autopilot_parameters(load_vehicle("bebop"))
    for number, name in enumerate(("px4", "ardupilot", "generic")):
        table.set("MAV_IDENTITY", number)
        assert identity_of(table).flavour is FLAVOURS[name]
    table.set("MAV_SYS_ID", 7)
    table.set("MAV_LOAD_SYS_ID", 8)
    assert (identity_of(table).system, identity_of(table).load_system) == (7, 8)
    table.set("MAV_LOAD_SYS_ID", 7)
    assert identity_of(table).load_system == 0


def test_auto_without_a_sub_mode_is_the_mission_mode():
    mode = PX4.mode(AUTO, 0)
    assert mode is not None
    assert mode.name == "MISSION"


@pytest.mark.parametrize("armed", [False, True])
def test_heartbeat_says_armed_and_never_manual_input_in_auto(armed, snap):
    beat = heartbeat_message(snap(armed=armed), Identity())
    assert (beat.type, beat.autopilot) == (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4)
    assert beat.base_mode == (29 | 128 if armed else 29)


def test_heartbeat_in_a_mode_without_a_name_is_still_sent(snap):
    beat = heartbeat_message(snap(main_mode=99), Identity())
    assert beat.custom_mode == 0
    assert beat.base_mode == mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


def test_the_load_has_no_autopilot(snap):
    beat = load_heartbeat_message(snap())
    assert (beat.type, beat.autopilot) == (mavlink.MAV_TYPE_AIRSHIP, mavlink.MAV_AUTOPILOT_INVALID)


def test_capabilities_promise_what_is_served_and_nothing_else():
    capabilities = autopilot_version_message(Identity()).capabilities
    for name in ("MISSION_INT", "COMMAND_INT", "MAVLINK2", "PARAM_ENCODE_BYTEWISE", "FTP"):
        assert capabilities & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{name}")
    unserved = [
        "PARAM_ENCODE_C_CAST",
        "TERRAIN",
    ]
    for name in unserved:
        assert not capabilities & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{name}")


def test_release_is_one_that_ground_stations_accept():
    word = autopilot_version_message(Identity()).flight_sw_version
    assert word >> 24 >= 1
    assert (word >> 24, word >> 16 & 0xFF, word >> 8 & 0xFF) >= (1, 4, 1)
    assert word & 0xFF == mavlink.FIRMWARE_VERSION_TYPE_DEV
