"""What fails in flight, and the end that docs/faults.md promises."""

from __future__ import annotations

from math import acos, degrees, dist, isnan, nan

import pytest

from autopilot.geometry.linear import norm
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.supervisor.state import Phase
from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from gcs.closed_loop import Conditions, build_onboard
from missions.model import Delay, Land, Takeoff, Waypoint
from sitl.hil import HilSimulator
from tests.doubles.craft import ACCEPTED, GCS, LOAD_WEIGHT_N, Craft, at_phase

HEIGHT_M = 1.5
ROUTE = (Takeoff(HEIGHT_M), Waypoint(3.0, 0.0, HEIGHT_M), Waypoint(0.0, 0.0, HEIGHT_M), Land())
FIRM_M_S = 1.0
SOFT_M_S = 0.3  # vertical speed of a vehicle that is set down: it sinks at 0.2 m/s
INERTIAL, POSE, LOAD, CAMERA, RECEIVER, BAROMETER, MAGNETOMETER = (1 << bit for bit in range(7))


def set_parameter(craft: Craft, name: str, value: float) -> None:
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    craft.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind))


def system_status(craft: Craft) -> int:
    """MAV_STATE of the last heartbeat."""
    return [m.system_status for m in craft.heard if m.get_type() == "HEARTBEAT"][-1]


def under_way(sensors: str = "lab", speed: float = 0.5, lockstep: bool = True, **settings: float) -> Craft:
    """A craft on its mission, with the load hanging and moving at no less than this speed (m/s)."""
    craft = Craft(*ROUTE, sensors=sensors, lockstep=lockstep, **settings)
    craft.begin()
    craft.run(lambda c: c.flight.phase == Phase.MISSION and norm(c.truth.v_load) >= speed)
    craft.heard.clear()
    return craft


def landed(craft: Craft, limit_s: float = 60.0) -> float:
    """Fly until disarmed; return the vertical speed at which the vehicle touched the ground, m/s."""
    touched = None
    end_us = craft.onboard.now_us + round(limit_s * 1e6)
    while craft.flight.phase != Phase.DISARMED:
        sinking = -craft.truth.v_quad[2]
        craft.tick()
        if touched is None and craft.truth.vehicle_on_ground:
            touched = sinking
        assert craft.onboard.now_us < end_us, craft.texts
    assert touched is not None
    return touched


def restart(craft: Craft, sensors: str = "lab") -> None:
    """As after kill -9 and a new start: the new autopilot knows the stored mission, and what it receives."""
    mission = craft.onboard.endpoint.mission
    craft.onboard = build_onboard(Conditions(sensors=sensors), Home(), mission)
    craft.onboard.add_link(GCS)
    craft.heard.clear()
    craft.simulator.announce_boot()
    craft.tick()


def lose_ticks(craft: Craft, seconds: float) -> None:
    """Let the world continue without an autopilot, as in real time; then the autopilot is back."""
    end_us = craft.simulator.now_us + round(seconds * 1e6)
    while craft.simulator.now_us < end_us:
        craft.simulator.advance()
    for _ in range(2):  # a clock that far ahead is accepted when three ticks state it
        craft.onboard.receive_sensors(craft.simulator.sensor_datagram())
        craft.simulator.advance()


# ---- the autopilot, restarted


@pytest.mark.parametrize("sensors", ["lab", "ideal", "rtk"])
@pytest.mark.parametrize("speed", [0.1, 0.7, 1.2])
def test_an_autopilot_that_is_started_again_in_the_air_holds_the_load(sensors: str, speed: float) -> None:
    craft = under_way(sensors, speed)
    slack = craft.truth.slack_events
    restart(craft, sensors)
    assert craft.onboard.armed
    lowest = HEIGHT_M
    for _ in range(2500):
        craft.tick()
        lowest = min(lowest, craft.truth.x_load[2])
    assert craft.flight.phase == Phase.HOLD
    assert craft.texts == ["Restarted in flight: holding"]
    assert norm(craft.truth.v_load) < 0.1
    assert craft.truth.slack_events == slack
    assert lowest > 0.5 * HEIGHT_M
    assert craft.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    assert landed(craft) < SOFT_M_S


def send_load(craft: Craft, east_m: float, speed: float) -> None:
    """Send the load, as `goto` does, to this place on the line through home, at the height where it hangs."""
    lat, lon, _ = geodetic_from_enu((east_m, 0.0, 0.0), Home())
    frame, ahead = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, (speed, 1.0, 0.0, nan)
    go = mavlink.MAV_CMD_DO_REPOSITION
    craft.send(mavlink.MAVLink_command_int_message(1, 1, frame, go, 0, 0, *ahead, lat, lon, HEIGHT_M))


def test_one_that_finds_its_load_accelerating_takes_the_swing_out_before_it_holds() -> None:
    craft = Craft(Takeoff(HEIGHT_M), Delay(60.0))
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    send_load(craft, -1.0, 0.5)
    craft.wait(1.0)
    send_load(craft, 0.5, -1.0)
    craft.wait(3.0)
    slack = craft.truth.slack_events
    restart(craft)
    steepest, lowest = 1.0, HEIGHT_M
    for _ in range(1500):
        craft.tick()
        steepest = min(steepest, rotation_from_quat(craft.truth.quat_wxyz)[2][2])
        lowest = min(lowest, craft.truth.x_load[2])
    assert (craft.flight.phase, craft.texts) == (Phase.HOLD, ["Restarted in flight: holding"])
    assert craft.truth.slack_events == slack
    assert lowest > 0.9 * HEIGHT_M
    assert degrees(acos(steepest)) < 30.0
    assert norm(craft.truth.v_load) < 0.1


@pytest.mark.parametrize("phase", [Phase.LIFT, Phase.LOWER])
def test_one_that_waits_for_its_receiver_neither_climbs_nor_sinks_meanwhile(phase: Phase) -> None:
    craft = Craft(Takeoff(HEIGHT_M), Land(), sensors="rtk")
    craft.begin()
    craft.run(lambda c: c.flight.phase == phase and abs(c.truth.v_load[2]) >= 0.3)
    found = craft.truth.x_load[2]
    restart(craft, "rtk")
    farthest = 0.0
    for _ in range(1750):
        craft.tick()
        farthest = max(farthest, abs(craft.truth.x_load[2] - found))
    assert (craft.flight.phase, craft.texts) == (Phase.HOLD, ["Restarted in flight: holding"])
    assert farthest < 0.6
    assert norm(craft.truth.v_load) < 0.2


@pytest.mark.parametrize("sensors", ["lab", "rtk"])
@pytest.mark.parametrize("phase", [Phase.TAUTEN, Phase.SET_DOWN])
def test_one_that_finds_its_load_on_the_ground_lands_beside_it(sensors: str, phase: Phase) -> None:
    craft = Craft(Takeoff(1.0), Land(), sensors=sensors)
    craft.begin()
    craft.run(at_phase(phase))
    craft.wait(1.0)
    restart(craft, sensors)
    # with a receiver, the vehicle flies without a known position for two seconds, a metre above the ground
    assert landed(craft) < (SOFT_M_S if sensors == "lab" else FIRM_M_S)
    assert craft.texts[0].startswith("Restarted in flight: ")
    assert craft.texts[-1] == "Landed, disarmed"


def test_one_that_flies_without_a_load_holds_the_vehicle() -> None:
    craft = Craft(Takeoff(1.5), Delay(60.0), Land())
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    assert craft.command(mavlink.MAV_CMD_DO_GRIPPER, 1.0, mavlink.GRIPPER_ACTION_RELEASE) == ACCEPTED
    craft.wait(4.0)
    before = craft.truth.x_quad
    restart(craft)
    craft.wait(5.0)
    assert (craft.flight.phase, craft.flight.cable.released) == (Phase.HOLD, True)
    assert dist(craft.truth.x_quad, before) < 0.5
    assert norm(craft.truth.v_quad) < 0.05


def test_one_that_finds_a_cable_that_was_let_out_knows_its_length() -> None:
    craft = Craft(Takeoff(1.5), Delay(60.0), Land())
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    assert craft.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    craft.wait(3.0)
    winch = (1.0, mavlink.WINCH_RELATIVE_LENGTH_CONTROL, 0.4, 0.2)
    assert craft.command(mavlink.MAV_CMD_DO_WINCH, *winch) == ACCEPTED
    craft.wait(6.0)
    long_m = craft.world.cable_length
    restart(craft)
    craft.wait(6.0)
    assert craft.flight.phase == Phase.HOLD
    assert craft.flight.cable.length_m == pytest.approx(long_m, abs=1e-6)  # single precision
    assert long_m == pytest.approx(1.1, abs=0.01)
    assert norm(craft.truth.v_load) < 0.05


def test_one_that_finds_no_tracker_gives_up_and_says_so() -> None:
    craft = under_way()
    set_parameter(craft, "SIM_SENS_FAIL", POSE)
    craft.tick()
    restart(craft)
    craft.run(at_phase(Phase.FAILSAFE), 5.0)
    said = "".join(craft.texts)
    assert said == "Flight given up: restarted in flight, no vehicle pose from a tracker"


def test_on_the_ground_it_stays_disarmed() -> None:
    craft = Craft(*ROUTE)
    craft.wait(1.0)
    restart(craft)
    craft.wait(1.0)
    assert (craft.flight.phase, craft.texts) == (Phase.DISARMED, [])
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    craft.wait(0.1)
    restart(craft)
    craft.wait(1.0)
    assert (craft.flight.phase, craft.texts) == (Phase.DISARMED, ["Restarted on the ground: disarmed"])


def test_in_real_time_the_rotors_have_stopped_before_it_is_back_and_it_says_so() -> None:
    craft = under_way(lockstep=False)
    lose_ticks(craft, 2.0)
    restart(craft)
    craft.wait(1.0)
    assert craft.flight.phase == Phase.DISARMED
    assert "".join(craft.texts) == "Restarted in flight after the rotors had stopped: disarmed"


def test_one_that_is_back_while_the_vehicle_falls_says_that_it_is_in_the_air_until_it_rests() -> None:
    craft = under_way(lockstep=False)
    lose_ticks(craft, 0.7)
    restart(craft)
    states = []
    while (state := craft.onboard.log_sample().snapshot.landed_state) != mavlink.MAV_LANDED_STATE_ON_GROUND:
        states.append(state)
        craft.tick()
        assert len(states) < 2000
    assert set(states) == {mavlink.MAV_LANDED_STATE_IN_AIR}
    assert craft.truth.vehicle_on_ground
    assert norm(craft.truth.v_quad) < 0.02


# ---- the simulator, restarted; lost ticks


def test_a_simulator_that_is_started_again_is_known_by_its_own_word() -> None:
    craft = under_way()
    other = HilSimulator.build(boot_id=7)
    assert craft.onboard.receive_sensors(other.sensor_datagram()) is None
    assert craft.onboard.restarted


def test_its_clock_alone_is_no_sign_of_another_run() -> None:
    craft = under_way()
    older = [craft.simulator.sensor_datagram()]
    for _ in range(10):
        craft.tick()
    for _ in range(10):
        craft.onboard.receive_sensors(older[0])
    assert not craft.onboard.restarted


def test_a_few_lost_ticks_are_flown_over() -> None:
    craft = under_way(lockstep=False)
    lose_ticks(craft, 0.1)
    craft.wait(1.0)
    assert (craft.flight.phase, craft.texts) == (Phase.MISSION, [])


@pytest.mark.parametrize("seconds", [0.6, 5.0, 20.0])
def test_ticks_that_are_lost_for_long_end_the_flight_and_are_no_restart(seconds: float) -> None:
    craft = under_way(lockstep=False)
    before = craft.onboard
    lose_ticks(craft, seconds)
    craft.tick()
    assert not craft.onboard.restarted
    assert craft.flight.phase == Phase.FAILSAFE
    assert not any(craft.world.command)
    craft.run(at_phase(Phase.DISARMED), 5.0)
    said = "".join(craft.texts)
    assert said.startswith(f"Flight given up: no tick of the simulator for {seconds:.1f} s")
    assert craft.onboard is before
    craft.wait(2.0)
    assert not craft.onboard.core.view(craft.onboard.now_us).estimate_problems, (
        "the sensors are heard as before"
    )


# ---- single sensors

ENDS = {
    ("lab", POSE): "Failsafe: no vehicle pose from a tracker, landing",
    ("lab", LOAD): "Failsafe: no load position from a tracker, landing",
    ("rtk", CAMERA): "Failsafe: no direction to the load from the camera, landing",
    ("rtk", RECEIVER): "Failsafe: no position from the receiver, landing",
    ("gps", RECEIVER): "Failsafe: no position from the receiver, landing",
}


@pytest.mark.parametrize(("sensors", "failed"), ENDS)
def test_a_sensor_that_is_lost_leads_to_a_soft_landing(sensors: str, failed: int) -> None:
    craft = under_way(sensors, 0.3)
    set_parameter(craft, "SIM_SENS_FAIL", failed)
    assert landed(craft) < SOFT_M_S
    assert "".join(craft.texts).startswith(ENDS[(sensors, failed)])
    assert craft.texts[-1] == "Landed, disarmed"


@pytest.mark.parametrize(
    ("sensors", "failed", "text"),
    [
        ("lab", POSE, "no vehicle pose from a tracker"),
        ("rtk", RECEIVER, "no position from the receiver"),
        ("rtk", MAGNETOMETER, "no reading of the magnetometer"),
        ("rtk", INERTIAL | RECEIVER, "no reading of the inertial unit"),
    ],
)
def test_a_sensor_that_never_worked_is_named_before_arming(sensors: str, failed: int, text: str) -> None:
    craft = Craft(sensors=sensors, SIM_SENS_FAIL=failed)
    craft.wait(3.0)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == mavlink.MAV_RESULT_DENIED
    assert "".join(craft.texts) == f"Arming denied: {text}"


GYROSCOPE, MAGNETIC, PRESSURE, GNSS, VISION = (
    mavlink.FAILURE_UNIT_SENSOR_GYRO,
    mavlink.FAILURE_UNIT_SENSOR_MAG,
    mavlink.FAILURE_UNIT_SENSOR_BARO,
    mavlink.FAILURE_UNIT_SENSOR_GPS,
    mavlink.FAILURE_UNIT_SENSOR_VIO,
)


@pytest.mark.parametrize(
    ("sensors", "carried", "missing"),
    [
        ("lab", (GYROSCOPE, VISION), (MAGNETIC, PRESSURE, GNSS)),
        ("rtk", (MAGNETIC, PRESSURE, GNSS), (VISION,)),
    ],
)
def test_a_sensor_that_is_not_carried_does_not_fail(
    sensors: str, carried: tuple[int, ...], missing: tuple[int, ...]
) -> None:
    """The fix that is made from a tracked pose does not hide it."""
    craft = Craft(sensors=sensors)
    craft.wait(3.0)
    off, ok = mavlink.FAILURE_TYPE_OFF, mavlink.FAILURE_TYPE_OK
    for unit in missing:
        result = craft.command(mavlink.MAV_CMD_INJECT_FAILURE, unit, off, 0)
        assert result == mavlink.MAV_RESULT_UNSUPPORTED
        assert "no such sensor is carried" in "".join(craft.texts)
        assert craft.command(mavlink.MAV_CMD_INJECT_FAILURE, unit, ok, 0) == ACCEPTED
    assert craft.onboard.parameters["SIM_SENS_FAIL"] == 0
    for unit in carried:
        assert craft.command(mavlink.MAV_CMD_INJECT_FAILURE, unit, off, 0) == ACCEPTED
    assert craft.onboard.parameters["SIM_SENS_FAIL"] > 0


def hide_load(craft: Craft, seconds: float) -> float:
    """Hide the load from its tracker; return the greatest error of its estimated position meanwhile, m."""
    set_parameter(craft, "SIM_SENS_FAIL", LOAD)
    worst = 0.0
    end_us = craft.onboard.now_us + round(seconds * 1e6)
    while craft.onboard.now_us < end_us:
        craft.tick()
        worst = max(worst, dist(craft.onboard.core.estimator.load.x_load, craft.truth.x_load))
    set_parameter(craft, "SIM_SENS_FAIL", 0)
    return worst


def test_a_load_that_is_hidden_for_a_moment_is_flown_on_by_the_pendulum() -> None:
    craft = under_way("lab", 0.3)
    assert hide_load(craft, 1.8) < 0.01
    craft.wait(0.5)
    assert (craft.flight.phase, craft.texts) == (Phase.MISSION, [])


def test_a_load_that_is_hidden_while_its_cable_is_tautened_lies_where_it_was_seen() -> None:
    craft = Craft(*ROUTE)
    craft.begin()
    craft.run(at_phase(Phase.TAUTEN))
    craft.wait(0.5)
    assert hide_load(craft, 0.5) < 0.1  # a tracker gives its velocity to within 0.1 m/s
    craft.run(at_phase(Phase.MISSION), 20.0)
    assert not any("Failsafe" in text for text in craft.texts)


def cable_told(craft: Craft) -> tuple[float, int]:
    """Tension and tautness as the vehicle reported them last."""
    told = [m for m in craft.heard if m.get_type() == "LOAD_STATE"][-1]
    return told.tension, told.taut


def test_on_the_ground_nothing_is_told_of_the_cable_of_a_load_that_is_not_seen() -> None:
    craft = under_way("lab", 0.3)
    craft.wait(0.3)
    assert cable_told(craft) == (pytest.approx(LOAD_WEIGHT_N, rel=0.2), 1)
    set_parameter(craft, "SIM_SENS_FAIL", LOAD)
    landed(craft)
    craft.wait(1.0)
    tension, taut = cable_told(craft)
    assert (isnan(tension), taut) == (True, 0)
    set_parameter(craft, "SIM_SENS_FAIL", 0)
    craft.wait(1.0)
    assert cable_told(craft) == (0.0, 0)


@pytest.mark.parametrize("failed", [BAROMETER, MAGNETOMETER])
def test_without_barometer_or_magnetometer_the_mission_is_flown_to_its_end(failed: int) -> None:
    craft = under_way("rtk")
    set_parameter(craft, "SIM_SENS_FAIL", failed)
    assert landed(craft) < SOFT_M_S
    assert craft.flight.mission.done
    assert not any("Failsafe" in text for text in craft.texts)


@pytest.mark.parametrize("sensors", ["lab", "rtk"])
def test_without_the_inertial_unit_the_rotors_stop_at_once(sensors: str) -> None:
    craft = under_way(sensors)
    failed_us = craft.onboard.now_us
    set_parameter(craft, "SIM_SENS_FAIL", INERTIAL)
    craft.run(at_phase(Phase.FAILSAFE), 1.0)
    assert craft.onboard.now_us - failed_us < 150_000
    craft.run(at_phase(Phase.DISARMED), 5.0)
    assert craft.texts == ["Flight given up: no reading of the inertial unit", "Disarmed after termination"]
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == mavlink.MAV_RESULT_DENIED


def test_a_sensor_that_comes_back_lets_the_vehicle_be_commanded_again() -> None:
    craft = under_way()
    set_parameter(craft, "SIM_SENS_FAIL", POSE)
    craft.run(at_phase(Phase.LOWER), 2.0)
    craft.wait(0.1)
    assert system_status(craft) == mavlink.MAV_STATE_CRITICAL
    refused = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    assert craft.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == refused
    assert craft.texts[-1] == "Landing continues: no vehicle pose from a tracker"
    assert craft.flight.phase == Phase.LOWER, "while it is missing, nothing else is flown"
    set_parameter(craft, "SIM_SENS_FAIL", 0)
    craft.wait(0.5)
    assert craft.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    craft.wait(5.0)
    assert craft.flight.phase == Phase.HOLD
    assert system_status(craft) == mavlink.MAV_STATE_ACTIVE
    assert norm(craft.truth.v_load) < 0.05


def test_a_termination_is_told_and_shown() -> None:
    craft = under_way()
    assert craft.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1.0) == ACCEPTED
    assert craft.texts == ["Flight terminated by command, rotors stopped"]
    craft.tick()
    assert system_status(craft) == mavlink.MAV_STATE_FLIGHT_TERMINATION
    craft.run(at_phase(Phase.DISARMED), 5.0)
    assert craft.texts[-1] == "Disarmed after termination"


def test_what_the_simulator_refuses_is_told_in_full() -> None:
    craft = Craft(*ROUTE)
    craft.wait(1.0)
    set_parameter(craft, "SIM_ATT_X", 0.1)
    craft.wait(0.1)
    assert "".join(craft.texts) == "SIM_ATT_X is fixed while running; restart with --set SIM_ATT_X=0.1"


# ---- the ground station

HEARTBEAT = mavlink.MAVLink_heartbeat_message(
    mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
)
PATIENCE_S = 2.0


@pytest.mark.parametrize(
    ("action", "phase", "word"),
    [(1, Phase.HOLD, "holding"), (2, Phase.RETURN, "returning"), (3, Phase.LOWER, "landing")],
)
def test_a_ground_station_that_falls_silent_leads_to_what_was_set(
    action: int, phase: Phase, word: str
) -> None:
    craft = under_way(NAV_DLL_ACT=action, COM_DL_LOSS_T=PATIENCE_S)
    craft.wait(1.5 * PATIENCE_S)
    assert craft.flight.phase == Phase.MISSION, "none was ever heard"
    craft.send(HEARTBEAT)
    craft.wait(0.9 * PATIENCE_S)
    assert craft.flight.phase == Phase.MISSION
    craft.wait(0.2 * PATIENCE_S)
    assert craft.flight.phase == phase
    assert craft.texts == [f"Ground station lost: {word}"]
    craft.send(HEARTBEAT)
    craft.wait(0.1)
    assert craft.texts[-1] == "Ground station heard again"
    assert craft.flight.phase == phase


@pytest.mark.parametrize(("action", "phase"), [(2, Phase.SET_DOWN), (3, Phase.SET_DOWN)])
def test_a_ground_station_that_falls_silent_before_the_load_is_lifted(action: int, phase: Phase) -> None:
    craft = Craft(*ROUTE, NAV_DLL_ACT=action, COM_DL_LOSS_T=PATIENCE_S)
    craft.begin()
    craft.run(at_phase(Phase.TAUTEN))
    craft.send(HEARTBEAT)
    craft.wait(1.1 * PATIENCE_S)
    assert craft.flight.phase == phase


def test_a_reaction_that_is_switched_off_claims_no_ground_station() -> None:
    craft = under_way(NAV_DLL_ACT=1, COM_DL_LOSS_T=PATIENCE_S)
    craft.send(HEARTBEAT)
    craft.wait(1.1 * PATIENCE_S)
    assert craft.texts == ["Ground station lost: holding"]
    set_parameter(craft, "NAV_DLL_ACT", 0)
    craft.wait(1.0)
    assert craft.texts == ["Ground station lost: holding"]


def test_a_vehicle_whose_ground_station_is_silent_is_not_armed() -> None:
    craft = Craft(*ROUTE, NAV_DLL_ACT=2, COM_DL_LOSS_T=PATIENCE_S)
    craft.wait(1.0)
    craft.send(HEARTBEAT)
    craft.wait(1.1 * PATIENCE_S)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == mavlink.MAV_RESULT_DENIED
    assert "".join(craft.texts).endswith("Arming denied: ground station silent (COM_DL_LOSS_T)")
    craft.send(HEARTBEAT)
    craft.wait(0.1)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == mavlink.MAV_RESULT_ACCEPTED


def test_a_ground_station_is_not_missed_unless_that_is_asked_for() -> None:
    craft = under_way(COM_DL_LOSS_T=1.0)
    craft.send(HEARTBEAT)
    craft.wait(2.0)
    assert (craft.flight.phase, craft.texts) == (Phase.MISSION, [])


# ---- the vehicle


@pytest.mark.parametrize("rotor", [1, 3])
def test_a_rotor_that_fails_ends_the_flight(rotor: int) -> None:
    craft = under_way()
    told = len(craft.texts)
    set_parameter(craft, "SIM_ENGINE_FAIL", 1 << (rotor - 1))
    craft.run(at_phase(Phase.FAILSAFE), 3.0)
    craft.tick()
    assert not any(craft.world.command)
    craft.run(at_phase(Phase.DISARMED), 5.0)
    first, *given_up, last = craft.texts[told:]
    assert first == f"Failsafe: rotor {rotor} lost, the others cannot fly it"
    assert "".join(given_up).startswith("Flight given up: ")
    assert last == "Disarmed after termination"


def test_a_load_that_is_lost_leaves_the_vehicle_holding() -> None:
    craft = under_way()
    assert craft.command(mavlink.MAV_CMD_DO_GRIPPER, 1.0, mavlink.GRIPPER_ACTION_RELEASE) == ACCEPTED
    craft.wait(5.0)
    assert craft.flight.phase == Phase.HOLD
    assert norm(craft.truth.v_quad) < 0.05
