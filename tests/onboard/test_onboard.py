"""The autopilot as a machine of datagrams: ticks, repeats, rubbish, rates, parameters, uploads."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.onboard.onboard import Onboard
from autopilot.onboard.simulator_parameters import SimulatorParameters
from autopilot.services.mission_store import StoredMission
from autopilot.services.records import SimulatorParametersSaved
from autopilot.supervisor.state import Phase
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import BENCH_MEASURED, autopilot_parameters
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.convert.simulator import read_hil_actuator_controls, read_hil_sensor
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from autopilot.wire.parameter_encoding import decode_parameter_value, encode_parameter_value
from gcs.closed_loop import Conditions, build_onboard
from missions.model import Delay, Land, ReturnHome, Step, Takeoff, Waypoint
from sitl.hil import HilSimulator
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth
from tests.doubles.craft import ACCEPTED, GCS, Craft, at_phase
from tests.doubles.messages import hil_sensor_message
from tests.doubles.motion import TICK_S

DENIED = mavlink.MAV_RESULT_DENIED
TICK_US = round(TICK_S * 1e6)
WRITER = FrameWriter(1, 26)


def onboard(**settings_: float) -> Onboard:
    autopilot = build_onboard(Conditions(settings=settings_), Home())
    autopilot.add_link(GCS)
    return autopilot


def sensors(time_us: int, accel: tuple[float, float, float] = (0.0, 0.0, 9.81)) -> bytes:
    """A datagram of HIL_SENSOR alone."""
    message = hil_sensor_message(time_us, accel, (0.0, 0.0, 0.0), (0.2, 0.0, -0.4), 101_325.0, 0.0, 20.0, 63)
    return WRITER.frame(message)


def controls(answer: bytes | None) -> Any:
    assert answer is not None
    return read_hil_actuator_controls(decode(answer)[0][0].message)


def test_the_helper_says_what_a_simulator_says() -> None:
    assert read_hil_sensor(decode(sensors(4000))[0][0].message).accel_body == pytest.approx(
        (0.0, 0.0, 9.81), abs=1e-5
    )


def test_a_new_tick_is_answered_with_its_own_time() -> None:
    autopilot = onboard()
    for time_us in (0, 4000, 8000):
        assert controls(autopilot.receive_sensors(sensors(time_us))).time_us == time_us
        assert autopilot.now_us == time_us
    assert autopilot.tick == 2


def test_the_simulator_knows_the_vehicle_by_one_number_whatever_ground_stations_call_it() -> None:
    answer = onboard(MAV_SYS_ID=7).receive_sensors(sensors(0))
    assert answer is not None
    assert decode(answer)[0][0].system == 1


def test_a_repeated_tick_gets_the_same_bytes_and_no_second_step() -> None:
    autopilot = onboard()
    autopilot.receive_sensors(sensors(0))
    first = autopilot.receive_sensors(sensors(4000))
    state = autopilot.core
    assert autopilot.receive_sensors(sensors(4000, (5.0, 5.0, 5.0))) == first
    assert autopilot.core is state
    assert autopilot.tick == 1


def test_a_tick_of_the_past_is_ignored_and_counted() -> None:
    autopilot = onboard()
    for time_us in (0, 4000, 8000):
        autopilot.receive_sensors(sensors(time_us))
    assert autopilot.receive_sensors(sensors(4000)) is None
    assert (autopilot.bad_time_ticks, autopilot.now_us, autopilot.tick) == (1, 8000, 2)
    autopilot.receive_sensors(sensors(12_000))
    assert autopilot.bad_time_ticks == 0


def test_a_tick_from_far_ahead_does_not_carry_the_clock_away() -> None:
    autopilot = onboard()
    autopilot.receive_sensors(sensors(0))
    assert autopilot.receive_sensors(sensors(2**60)) is None
    assert autopilot.bad_time_ticks == 1
    assert controls(autopilot.receive_sensors(sensors(4000))).time_us == 4000


@settings(max_examples=60)
@given(rubbish=st.binary(max_size=300))
def test_any_bytes_at_all_are_survived_on_both_links(rubbish: bytes) -> None:
    autopilot = onboard()
    autopilot.receive_sensors(sensors(0))
    assert autopilot.receive_sensors(rubbish) is None
    autopilot.receive_ground(rubbish, GCS)
    assert controls(autopilot.receive_sensors(sensors(4000))).time_us == 4000
    autopilot.ground_datagrams()


@settings(max_examples=60)
@given(at=st.integers(0, 400), to=st.integers(0, 255), cut=st.integers(0, 400))
def test_damaged_datagrams_are_survived(at: int, to: int, cut: int) -> None:
    whole = bytearray(Craft().simulator.sensor_datagram())
    whole[at % len(whole)] = to
    autopilot = onboard()
    autopilot.receive_sensors(bytes(whole[: len(whole) - cut % len(whole)]))
    assert autopilot.receive_sensors(sensors(4000)) is not None


def test_other_messages_are_no_tick() -> None:
    autopilot = onboard()
    heartbeat = WRITER.frame(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))
    assert autopilot.receive_sensors(heartbeat) is None
    assert autopilot.tick == -1


# ---- rates


def test_a_control_rate_that_does_not_fit_is_said_with_both_rates_and_nothing_arms() -> None:
    craft = Craft(watched=True, CTL_RATE_HZ=400.0)
    craft.wait(0.5)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == DENIED
    assert any("400 Hz" in text for text in craft.texts), craft.texts
    assert any("250 Hz" in text for text in craft.texts), craft.texts
    assert controls(craft.answers[-1]).forces == (0.0,) * 14


def test_a_tick_lost_at_the_start_does_not_change_what_the_sensor_rate_is() -> None:
    autopilot = onboard()
    for k in (0, 3, 4, 5):
        autopilot.receive_sensors(sensors(k * TICK_US))
    assert autopilot.fault == ""


def test_half_the_control_rate_flies() -> None:
    craft = Craft(Takeoff(1.0), Delay(1.0), Land(), watched=True, CTL_RATE_HZ=125.0)
    craft.begin()
    craft.run(at_phase(Phase.LOWER))
    assert "Flight given up" not in " ".join(craft.texts)
    forces = [controls(answer).forces for answer in craft.answers[-400:]]
    changes = [a != b for a, b in pairwise(forces)]
    assert sum(changes) in (199, 200), "a new command on every second tick"
    assert craft.worst_error < 0.02


def test_lost_ticks_and_a_sample_that_is_no_number_do_not_end_a_flight() -> None:
    """In real time the world continues without an answer."""
    craft = Craft(Takeoff(1.0), Delay(3.0), Land(), watched=True)
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    for k in range(500):
        if k % 50 in (10, 11):
            craft.simulator.advance()  # this tick's datagram is lost
        elif k % 50 == 30:
            real = craft.simulator.sensor_datagram()
            bad = read_hil_sensor(decode(real)[0][-1].message)
            nan = (math.nan, math.nan, math.nan)
            message = hil_sensor_message(
                bad.time_us, nan, bad.gyro_body, (0.2, 0.0, -0.4), 101_325.0, 0.0, 20.0, 63
            )
            answer = craft.onboard.receive_sensors(WRITER.frame(message))
            assert all(map(math.isfinite, controls(answer).forces))
            craft.simulator.receive(answer or b"")
            craft.simulator.advance()
        else:
            craft.tick()
    assert craft.flight.phase == Phase.MISSION, craft.texts
    assert craft.worst_error < 0.02


def test_trackers_that_fall_silent_are_told_and_the_vehicle_goes_down() -> None:
    craft = Craft(Takeoff(1.0), Delay(30.0), Land())
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    now = craft.onboard.now_us
    for k in range(1, 200):
        answer = craft.onboard.receive_sensors(sensors(now + k * TICK_US))
        if craft.flight.phase == Phase.LOWER:
            break
    assert craft.flight.phase == Phase.LOWER
    assert k * TICK_S == pytest.approx(0.5, abs=0.05), "FS_SENSOR_S"
    assert controls(answer).armed
    said = [r.message for _, datagram in craft.onboard.ground_datagrams() for r in decode(datagram)[0]]
    texts = [m.text for m in said if m.get_type() == "STATUSTEXT"]
    assert "Failsafe: no vehicle pose from a tracker, landing" in texts


# ---- parameters and missions


def test_a_parameter_set_in_flight_is_flown_with_at_once() -> None:
    craft = Craft(Takeoff(1.0), Delay(30.0), Land())
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    setup = craft.onboard.core.setup
    name, kind = b"QP_KX", mavlink.MAV_PARAM_TYPE_REAL32
    craft.send(mavlink.MAVLink_param_set_message(1, 1, name, 5.0, kind))
    craft.tick()
    assert craft.onboard.core.setup is not setup
    assert craft.onboard.core.setup.law.other_modes.position_gains.k_x[0] == 5.0
    assert craft.onboard.core.setup.control_every == setup.control_every
    craft.wait(1.0)
    assert craft.flight.phase == Phase.MISSION


def test_a_mission_is_not_uploaded_over_the_one_being_flown() -> None:
    craft = Craft(Takeoff(1.0), Delay(30.0), Land())
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    plan = craft.flight.mission.plan
    craft.send(mavlink.MAVLink_mission_count_message(1, 1, 2, 0))
    craft.tick()
    acks = [m.type for m in craft.heard if m.get_type() == "MISSION_ACK"]
    assert acks
    assert acks[-1] != mavlink.MAV_MISSION_ACCEPTED
    assert craft.flight.mission.plan is plan


def test_a_home_that_is_set_moves_the_places_of_the_mission_that_follow_from_it() -> None:
    """A height change after a return stays over the home to which the return leads."""
    home = Home()
    up, back, low = (
        WireItem(6, 22, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 4.0),
        WireItem(2, 20, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0),
        WireItem(2, 186, 0, 1, 2.0, 3.0, 0.0, 0.0, 0, 0, 0.0),
    )
    items = (up, back, low)
    stored = StoredMission(items)
    autopilot = build_onboard(Conditions(), home, stored)
    autopilot.add_link(GCS)
    autopilot.receive_sensors(sensors(0))
    plan = autopilot.core.flight.mission.plan
    assert plan.steps[-1] == Waypoint(0.0, 0.0, 2.0)
    east, north = 3.0, 1.0
    latitude, longitude, _ = geodetic_from_enu((east, north, 0.0), home)
    place = mavlink.MAVLink_command_int_message(
        1, 1, 6, 179, 0, 0, 0.0, 0.0, 0.0, 0.0, latitude, longitude, 0.0
    )
    autopilot.receive_ground(FrameWriter(255, 190).frame(place), GCS)
    flight = autopilot.core.flight
    assert flight.area.home[:2] == pytest.approx((east, north), abs=0.01)
    plan = flight.mission.plan
    assert plan.steps == (Takeoff(4.0), ReturnHome(), Waypoint(flight.area.home[0], flight.area.home[1], 2.0))
    assert len(plan.prepared.paths) == 3
    assert not plan.prepared.pending


def test_the_same_sensors_give_the_same_answers_and_the_same_telemetry() -> None:
    def run(seed: int) -> tuple[list[bytes], list[Any]]:
        craft = Craft(Takeoff(1.0), Waypoint(0.5, 0.0, 1.0), Land(), watched=True, seed=seed)
        craft.begin()
        craft.wait(3.0)
        return craft.answers, [m.to_dict() for m in craft.heard]

    assert run(1) == run(1)
    assert run(1)[0] != run(2)[0]


def test_arming_waits_for_the_estimate_and_says_so() -> None:
    autopilot = onboard()
    writer = FrameWriter(255, 190)
    autopilot.receive_sensors(sensors(0))
    arm = mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    autopilot.receive_ground(writer.frame(arm), GCS)
    messages = [r.message for _, d in autopilot.ground_datagrams() for r in decode(d)[0]]
    assert [m.result for m in messages if m.get_type() == "COMMAND_ACK"] == [DENIED]
    texts = [m.text for m in messages if m.get_type() == "STATUSTEXT"]
    assert texts == ["Arming denied: no vehicle pose from a tracker"]
    assert ACCEPTED == mavlink.MAV_RESULT_ACCEPTED


@pytest.mark.parametrize(
    ("north_m", "up_m", "text"),
    [
        (0.9, 0.0, ""),
        (111.0, 0.0, "the home of sitl is 111 m from that of autopilot: give both the same --home"),
        (0.0, 300.0, "the home of sitl is 300 m from that of autopilot: give both the same --home"),
    ],
)
def test_a_simulator_with_another_home_is_named_as_the_cause(north_m: float, up_m: float, text: str) -> None:
    craft = Craft(sensors="rtk")
    home = Home(Home().latitude_deg + north_m / 111_319.5, Home().longitude_deg, up_m)
    craft.simulator = HilSimulator.build(sensors="rtk", home=home)
    craft.wait(5.0)
    result = craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    assert result == (DENIED if text else ACCEPTED)
    assert "".join(craft.texts) == (f"Arming denied: {text}" if text else "")


def test_a_home_without_a_receiver_may_be_another_one() -> None:
    craft = Craft()
    craft.simulator = HilSimulator.build(home=Home(0.0, 0.0, 0.0))
    craft.wait(2.0)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED


def test_a_reboot_is_handed_to_the_simulator_and_both_begin_anew() -> None:
    craft = Craft(Takeoff(1.0), Land())
    craft.begin()
    craft.wait(1.0)
    reboot = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    assert craft.command(reboot, 1.0) == mavlink.MAV_RESULT_DENIED, "armed"
    craft.run(at_phase(Phase.DISARMED))
    assert craft.command(reboot, 1.0) == ACCEPTED
    craft.onboard.receive_sensors(craft.simulator.sensor_datagram())
    for _ in range(3):  # the answer that requests the reboot, and the ticks of the new world
        answer = craft.onboard.receive_sensors(craft.simulator.sensor_datagram())
        if answer is not None:
            craft.simulator.receive(answer)
        craft.simulator.advance()
    assert craft.simulator.now_us < 20_000
    for _ in range(4):
        craft.onboard.receive_sensors(craft.simulator.sensor_datagram())
    assert craft.onboard.bad_time_ticks >= 3, "by which the shell knows that it is to begin anew too"


def test_a_vehicle_whose_sensors_are_silent_still_says_that_it_is_there() -> None:
    craft = Craft(Takeoff(1.0), Land())
    craft.begin()
    (received,), _ = decode(craft.onboard.paused_heartbeat(GCS))
    assert received.message.system_status == mavlink.MAV_STATE_EMERGENCY
    assert received.message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


@pytest.mark.parametrize(
    "command",
    [
        (mavlink.MAV_CMD_NAV_LAND,),
        (mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, 1.0),
        (mavlink.MAV_CMD_CONDITION_YAW, 90.0),
        (mavlink.MAV_CMD_DO_SET_ROI_NONE,),
    ],
)
def test_nothing_is_flown_and_no_nose_is_turned_while_the_simulator_is_silent(command: Any) -> None:
    craft = Craft(Takeoff(1.0), Land())
    craft.begin()
    craft.run(at_phase(Phase.LIFT))
    craft.onboard.set_simulator_silent(True)
    assert craft.command(*command) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    assert craft.texts[-1] == "Not flown: the simulator is silent"
    craft.onboard.set_simulator_silent(False)
    assert craft.command(*command) == ACCEPTED


@pytest.mark.parametrize(("given", "believed"), [({}, 30.0), ({"VEH_IMU_DELAY": 20.0}, 20.0)])
def test_latency_of_the_sensors_is_believed_unless_a_belief_is_given(
    given: dict[str, float], believed: float
) -> None:
    onboard = build_onboard(Conditions(settings={"SIM_SENS_LAT_MS": 30.0, **given}), Home())
    assert onboard.parameters["VEH_IMU_DELAY"] == believed


@pytest.mark.parametrize(("name", "assumed"), BENCH_MEASURED.items())
def test_all_that_a_vehicle_can_be_late_by_may_be_believed(name: str, assumed: str) -> None:
    most = sim_parameters(load_truth("bebop")).describe(name).high
    onboard = build_onboard(Conditions(settings={name: most}), Home())
    assert onboard.parameters[assumed] == most


def test_the_saved_world_is_set_again_in_the_simulator() -> None:
    craft = Craft()
    craft.onboard.restore_simulator_parameters({"SIM_WIND_E": 2.5, "SIM_LOAD_MASS": 0.1, "SIM_NO_SUCH": 1.0})
    craft.run(lambda craft: craft.simulator.parameters.table["SIM_WIND_E"] == 2.5, 3.0)
    craft.wait(1.0)
    assert craft.onboard.parameters["SIM_WIND_E"] == 2.5
    assert "SIM_NO_SUCH" not in craft.onboard.parameters


def test_a_simulator_that_falls_silent_gets_the_saved_world_and_nothing_that_was_asked_for() -> None:
    world = SimulatorParameters(autopilot_parameters(load_vehicle("bebop")))
    world.restore({"SIM_WIND_E": 2.5})
    for name, index in (("SIM_WIND_E", 0), ("SIM_LOAD_MASS", 1)):
        world.receive(mavlink.MAVLink_param_value_message(name.encode(), 0.0, 9, 2, index))
    world.request("SIM_LOAD_MASS", 0.2)
    world.drop_unanswered()
    sent = [one for one in world.messages(0) if one.get_type() == "PARAM_SET"]
    assert [(one.param_id, one.param_value) for one in sent] == [("SIM_WIND_E", 2.5)]


def test_what_the_simulator_refuses_is_never_said_to_be_set() -> None:
    craft = Craft()
    craft.wait(1.0)
    for asked, told in ((-5.0, 0.1), (0.2, 0.2), (0.2, 0.2)):
        craft.heard.clear()
        message = mavlink.MAVLink_param_set_message(
            1, 1, b"SIM_LOAD_MASS", asked, mavlink.MAV_PARAM_TYPE_REAL32
        )
        craft.send(message)
        craft.wait(0.1)
        values = [one.param_value for one in craft.heard if one.get_type() == "PARAM_VALUE"]
        assert values == [pytest.approx(told)], asked
        refused = "SIM_LOAD_MASS = -5.0 kg; must be 0.001 ... 10"
        assert (refused in craft.texts) == (asked < 0.0)


def test_whole_numbers_of_the_simulator_are_int32_too_if_that_is_chosen() -> None:
    craft = Craft(MAV_PARAM_INT=1.0)
    craft.wait(1.0)
    whole, real = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32
    for name, kind, value in (
        (b"SIM_SENS_FAIL", whole, 64),
        (b"SIM_BATTERY", whole, 1),
        (b"SIM_WIND_E", real, 2.5),
    ):
        craft.heard.clear()
        sent = encode_parameter_value(value, kind == whole, bytewise=True)
        craft.send(mavlink.MAVLink_param_set_message(1, 1, name, *sent))
        craft.wait(0.1)
        (answer,) = (one for one in craft.heard if one.get_type() == "PARAM_VALUE")
        assert answer.param_type == kind
        assert decode_parameter_value(answer.param_value, kind) == value


def test_what_the_simulator_has_not_answered_yet_is_saved_as_it_was_asked_for() -> None:
    craft = Craft()
    craft.wait(1.0)
    before = craft.onboard.parameters["SIM_WIND_N"]
    message = mavlink.MAVLink_param_set_message(1, 1, b"SIM_WIND_E", 2.5, mavlink.MAV_PARAM_TYPE_REAL32)
    save = mavlink.MAVLink_command_long_message(
        1, 1, mavlink.MAV_CMD_PREFLIGHT_STORAGE, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )
    ground = FrameWriter(255, 190)
    events = craft.onboard.receive_ground(ground.frame(message) + ground.frame(save), GCS)
    (saved,) = (event for event in events if isinstance(event, SimulatorParametersSaved))
    assert (saved.values["SIM_WIND_E"], saved.values["SIM_WIND_N"]) == (2.5, before)


def test_the_loss_of_the_link_is_set_and_taken_back_whatever_is_lost_and_not_stored() -> None:
    craft = Craft()
    craft.wait(0.1)
    for percent in (100.0, 0.0):
        message = mavlink.MAVLink_param_set_message(
            1, 1, b"SIM_LOSS_PCT", percent, mavlink.MAV_PARAM_TYPE_REAL32
        )
        assert craft.onboard.receive_ground(FrameWriter(255, 190).frame(message), "gcs") == []
        assert craft.onboard.parameters["SIM_LOSS_PCT"] == percent
        if percent:
            craft.wait(0.1)
            ping = mavlink.MAVLink_ping_message(1, 2, 0, 0)
            craft.onboard.receive_ground(FrameWriter(255, 190).frame(ping), "gcs")
            assert craft.onboard.ground_datagrams() == []


def test_reset_of_parameters_reaches_the_simulator_and_waits_for_the_ground() -> None:
    craft = Craft()
    craft.wait(1.0)
    began = craft.onboard.parameters["SIM_WIND_E"]
    for name, value in ((b"SIM_WIND_E", 2.0), (b"MIS_SPEED", 2.0)):
        craft.send(mavlink.MAVLink_param_set_message(1, 1, name, value, mavlink.MAV_PARAM_TYPE_REAL32))
    craft.run(lambda craft: craft.simulator.parameters.table["SIM_WIND_E"] == 2.0, 3.0)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_PREFLIGHT_STORAGE, 2.0) == DENIED
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_PREFLIGHT_STORAGE, 2.0) == ACCEPTED
    craft.run(lambda craft: craft.simulator.parameters.table["SIM_WIND_E"] == began, 3.0)
    assert craft.onboard.parameters["MIS_SPEED"] == 1.5


def test_an_ardupilot_client_flies_without_any_stream() -> None:
    """Mode GUIDED, arm, take off, one place, land: as DroneKit's first example."""
    craft = Craft(MAV_IDENTITY=1.0)
    craft.wait(1.0)
    assert craft.command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, 4.0) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 1.0) == ACCEPTED
    craft.run(at_phase(Phase.HOLD))
    craft.send(
        mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, 0xDF8, 1.0, 0.5, -1.5, 0, 0, 0, 0, 0, 0, 0, 0
        )
    )
    craft.wait(6.0)
    assert craft.flight.phase == Phase.GUIDED
    # measured 1 mm
    assert math.dist(craft.truth.x_load, (0.5, 1.0, 1.5)) < 0.015
    assert craft.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    craft.run(at_phase(Phase.DISARMED))


@pytest.mark.parametrize("behind", [(), (Waypoint(1.0, 0.0, 2.0), Land())])
def test_items_behind_a_landing_are_reported(behind: tuple[Step, ...]) -> None:
    craft = Craft(Takeoff(2.0), Waypoint(0.0, 1.0, 2.0), Land(), *behind)
    found = [(text.severity, text.text) for text in craft.onboard.endpoint.kept_texts.texts]
    told = (mavlink.MAV_SEVERITY_WARNING, "Mission ends with the landing of item 2; no later item is flown")
    assert (told in found) == bool(behind)


@pytest.mark.parametrize(
    ("commands", "items"),
    [
        ((206,), "DO_SET_CAM_TRIGG_DIST (item 1)"),
        ((206, 203, 206), "DO_SET_CAM_TRIGG_DIST (items 1, 3), DO_DIGICAM_CONTROL (item 2)"),
        (
            (203, 205, 181, 183),
            "DO_DIGICAM_CONTROL (item 1), DO_MOUNT_CONTROL (item 2), DO_SET_RELAY (item 3), ...",
        ),
    ],
)
def test_items_that_are_kept_but_not_flown_are_named(commands: tuple[int, ...], items: str) -> None:
    kept = [WireItem(2, command, 0, 1, 25.0, 0.0, 0.0, 0.0, 0, 0, 0.0) for command in commands]
    craft = Craft(Takeoff(2.0), *kept, Land())
    found = [(text.severity, text.text) for text in craft.onboard.endpoint.kept_texts.texts]
    assert (mavlink.MAV_SEVERITY_INFO, f"Kept, but not flown: {items}") in found


def test_it_tells_in_which_run_of_the_simulated_world_it_flies() -> None:
    autopilot, writer = onboard(), FrameWriter(255, 190)
    request = mavlink.MAVLink_command_long_message(
        1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, mavlink.MAVLINK_MSG_ID_SIM_BOOT, *(0.0,) * 6
    )

    def answers(time_us: int) -> list[Any]:
        autopilot.receive_ground(writer.frame(request), GCS)
        autopilot.receive_sensors(sensors(time_us))
        sent = [one for _, datagram in autopilot.ground_datagrams() for one in decode(datagram)[0]]
        return [one for one in sent if one.message.get_type() in ("SIM_BOOT", "COMMAND_ACK")]

    assert [one.message.result for one in answers(0)] == [mavlink.MAV_RESULT_UNSUPPORTED], "nobody has said"
    boot = mavlink.MAVLink_sim_boot_message(4000, 2**63 - 1, [0.0] * 4, 0.0, 0, 0)
    autopilot.receive_sensors(WRITER.frame(boot) + sensors(4000))
    found = {one.message.get_type(): one for one in answers(8000)}
    assert found["COMMAND_ACK"].message.result == ACCEPTED
    assert found["SIM_BOOT"].message.boot_id == 2**63 - 1
    assert found["SIM_BOOT"].component == 25, "messages of the dialect are those of a component of their own"
