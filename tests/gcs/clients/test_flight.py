"""The flight machine: the happy path and every way a flight can end, on fake time."""

from __future__ import annotations

import math

import pytest

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.flight import (
    FIND_LIMIT_US,
    READY_LIMIT_US,
    REPORT_INTERVAL_US,
    REPORT_MESSAGES,
    FlightClient,
    Stage,
)
from gcs.failure_reason import AFTERMATH_US

EXPECTED_S = 20.0
PX4_MISSION, PX4_LAND = 0x04040000, 0x06040000


def normal_flight(vehicle, t):
    """Take-off, mission, landing, rotors off."""
    last = len(vehicle.mission) - 1
    timetable = (
        (1.0, mavlink.PLUMBLINE_PHASE_ARMED, 0),
        (3.0, mavlink.PLUMBLINE_PHASE_TAUTEN, 0),
        (6.0, mavlink.PLUMBLINE_PHASE_LIFT, 0),
        (14.0, mavlink.PLUMBLINE_PHASE_MISSION, 1),
        (17.0, mavlink.PLUMBLINE_PHASE_LOWER, last),
        (19.0, mavlink.PLUMBLINE_PHASE_SET_DOWN, last),
    )
    for end, phase, item in timetable:
        if t < end:
            vehicle.phase, vehicle.item = phase, item
            return
    if vehicle.armed:
        vehicle.arm(False)


def then(flight, at, action):
    """A script that runs `flight` until `at` s, then `action(vehicle)` once, then nothing."""
    done = []

    def script(vehicle, t):
        if t < at:
            flight(vehicle, t)
        elif not done:
            done.append(True)
            action(vehicle)

    return script


@pytest.fixture
def fly(world, items):
    """Fly; return the client and the stages it went through."""

    def fly(seconds=200.0, **options):
        client = FlightClient(items[:3] + items[-1:], EXPECTED_S, **options)
        stages = [client.stage]

        def receive(datagram, now_us):
            client.receive(datagram, now_us)

        for _ in world.ticks(receive, client.poll, seconds):
            if client.stage is not stages[-1]:
                stages.append(client.stage)
            if client.outcome is not None:
                break
        return client, stages

    world.vehicle.script = normal_flight
    return fly


def test_a_flight_goes_through_its_stages_and_is_completed(world, fly, items):
    client, stages = fly()
    assert client.outcome is not None
    assert (client.outcome.name, client.outcome.reason) == ("completed", "")
    # this vehicle is ready immediately, so READY does not last a tick
    assert stages == [s for s in Stage if s not in (Stage.READY, Stage.DISARM)]
    assert [item.command for item in world.vehicle.mission] == [22, 16, 16, 21]
    assert client.progress.fraction == 1.0


def test_the_messages_of_the_report_are_asked_for(world, fly):
    fly()
    asked = {
        int(m.param1): int(m.param2)
        for m in world.vehicle.commands
        if m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    }
    assert asked == dict.fromkeys(REPORT_MESSAGES, REPORT_INTERVAL_US)


def test_parameters_are_asked_for_while_the_flight_is_prepared_and_never_in_the_air(world, fly):
    vehicle = world.vehicle
    vehicle.script, vehicle.ready = normal_flight, False  # so that there is time for the parameters
    vehicle.lost_list_indices = set(range(3, 119, 7))
    told, value = [], vehicle.on_param_request_read

    def note(message):
        told.append((message.param_index, vehicle.started_us))
        value(message)

    vehicle.on_param_request_read = note
    client, _ = fly()
    assert client.outcome.name == "completed"
    assert sorted(told) == [(index, None) for index in sorted(vehicle.lost_list_indices)]


def test_a_vehicle_without_parameters_is_flown(world, fly):
    world.vehicle.parameters = {}
    world.vehicle.script, world.vehicle.ready = normal_flight, False
    assert fly()[0].outcome.name == "completed"


def test_a_message_that_is_not_served_does_not_stop_the_flight(world, fly):
    world.vehicle.command_results[mavlink.MAV_CMD_SET_MESSAGE_INTERVAL] = [mavlink.MAV_RESULT_UNSUPPORTED] * 5
    assert fly()[0].outcome.name == "completed"


def test_progress_stays_at_the_last_item_when_the_vehicle_counts_from_the_beginning_again(world, fly):
    def landing(vehicle):
        vehicle.phase, vehicle.item = mavlink.PLUMBLINE_PHASE_LOWER, len(vehicle.mission) - 1

    def rewound(vehicle):
        vehicle.item = 0

    world.vehicle.script = then(then(normal_flight, 10.0, landing), 11.0, rewound)
    client, _ = fly(seconds=12.0)
    assert (client.progress.item, client.progress.items) == (3, 4)


def test_progress_tells_where_the_flight_is(world, fly):
    world.vehicle.script = then(normal_flight, 10.0, lambda vehicle: None)
    client, _ = fly(seconds=12.0)
    progress = client.progress
    assert progress.phase == "mission"
    assert (progress.item, progress.items) == (1, 4)
    assert progress.load_error_m == pytest.approx(0.005)  # 3-4-5, in float32
    assert progress.rotor_use == pytest.approx(0.75)
    assert 0.4 < progress.fraction < 0.6
    assert progress.sim_time_s == pytest.approx(12.0, abs=0.1)  # of the last tick


def test_a_flight_survives_a_bad_link(world, fly):
    world.lossy(0.2)
    assert fly()[0].outcome.name == "completed"


def test_a_take_off_that_waits_for_arming_is_withdrawn_before(world, fly):
    world.vehicle.custom_mode = 4 << 16 | 2 << 24  # PX4: auto, take-off
    assert fly()[0].outcome.name == "completed"
    arming = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    assert [m.param1 for m in world.vehicle.commands if m.command == arming] == [0.0, 1.0]


def test_arming_refused(world, fly):
    vehicle = world.vehicle
    vehicle.command_results[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = [mavlink.MAV_RESULT_DENIED]
    original = vehicle.on_command_long

    def with_reason(message):
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            vehicle.say("Arming denied: load not on the ground")
        original(message)

    vehicle.on_command_long = with_reason
    client, _ = fly()
    assert client.outcome.name == "refused"
    assert client.outcome.reason == "Arming denied: load not on the ground"


def test_never_ready(world, fly):
    """After a while the vehicle is asked to arm nevertheless, and its answer says what is wrong."""
    world.vehicle.ready = False
    world.vehicle.command_results[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = [mavlink.MAV_RESULT_DENIED]
    client, _ = fly()
    assert (client.outcome.name, client.outcome.reason) == ("refused", "arm: denied")
    assert world.now_us >= READY_LIMIT_US


def test_mission_refused(world, fly):
    world.vehicle.refuse_item = 2
    client, _ = fly()
    assert (client.outcome.name, client.outcome.reason) == ("refused", "upload: item 2 refused: unsupported")
    assert not world.vehicle.armed


def test_start_refused_disarms(world, fly):
    world.vehicle.command_results[mavlink.MAV_CMD_MISSION_START] = [mavlink.MAV_RESULT_TEMPORARILY_REJECTED]
    client, stages = fly()
    assert (client.outcome.name, client.outcome.reason) == ("refused", "start: temporarily rejected")
    assert Stage.DISARM in stages
    assert not world.vehicle.armed


def test_one_that_disarms_before_the_start_arrives_is_armed_again(world, fly):
    """Ten seconds of a fast simulation are a moment of a busy machine."""
    vehicle = world.vehicle

    def script(vehicle, t):
        arms = [one for one in vehicle.commands if one.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM]
        if len(arms) == 1:
            vehicle.armed = False
            vehicle.started_us = vehicle.now_us
        else:
            normal_flight(vehicle, t)

    vehicle.script = script
    client, stages = fly()
    assert (client.outcome.name, client.outcome.reason) == ("completed", "")
    assert stages[-4:] == [Stage.FLY, Stage.ARM, Stage.FLY, Stage.OVER]
    starts = [one for one in vehicle.commands if one.command == mavlink.MAV_CMD_MISSION_START]
    assert len(starts) == 1, "it begins what waits"


def test_one_that_cannot_be_kept_armed_is_not_armed_for_ever(world, fly):
    def script(vehicle, t):
        vehicle.armed = False

    world.vehicle.script = script
    client, _ = fly()
    assert client.outcome.name == "timeout"
    arms = [one for one in world.vehicle.commands if one.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM]
    assert len(arms) == 4


def test_armed_already(world, fly):
    world.vehicle.armed = True
    client, _ = fly()
    assert client.outcome.name == "refused"
    assert not world.vehicle.commands, "a flying vehicle is left alone"


def test_failsafe_is_diverged_and_its_aftermath_is_captured(world, fly):
    def give_up(vehicle):
        vehicle.say("Load 5.1 m off: motors stopped", mavlink.MAV_SEVERITY_EMERGENCY)
        vehicle.phase = mavlink.PLUMBLINE_PHASE_FAILSAFE
        vehicle.arm(False)
        vehicle.phase = mavlink.PLUMBLINE_PHASE_FAILSAFE

    world.vehicle.script = then(normal_flight, 8.0, give_up)
    client, _ = fly()
    assert client.outcome.name == "diverged"
    assert client.outcome.reason == "Load 5.1 m off: motors stopped"
    failed_us = world.vehicle.started_us + 8_000_000
    assert world.now_us - failed_us == pytest.approx(AFTERMATH_US, abs=50_000)  # two ticks


def test_a_critical_text_in_the_air_is_diverged(world, fly):
    world.vehicle.script = then(
        normal_flight, 8.0, lambda vehicle: vehicle.say("Estimator lost", mavlink.MAV_SEVERITY_CRITICAL)
    )
    client, _ = fly()
    assert (client.outcome.name, client.outcome.reason) == ("diverged", "Estimator lost")


def test_the_reason_tells_what_led_to_the_failure_and_how_it_ended(world, fly):
    told = {
        2.5: (mavlink.MAV_SEVERITY_WARNING, "Path waits: load 5.1 m off its path"),  # long before
        7.5: (mavlink.MAV_SEVERITY_WARNING, "Battery low, 15 % left"),  # the failure itself would say so
        7.7: (mavlink.MAV_SEVERITY_WARNING, "Cable slack"),
        7.8: (mavlink.MAV_SEVERITY_INFO, "Load caught"),
        8.0: (mavlink.MAV_SEVERITY_CRITICAL, "Failsafe: vehicle position not settled"),
        8.5: (mavlink.MAV_SEVERITY_WARNING, "Cable slack again"),
        8.7: (mavlink.MAV_SEVERITY_CRITICAL, "Failsafe: vehicle position not settled"),
        9.5: (mavlink.MAV_SEVERITY_EMERGENCY, "Flight given up: tilt 121 deg"),
        10.5: (mavlink.MAV_SEVERITY_EMERGENCY, "never heard"),
    }

    def script(vehicle, t):
        normal_flight(vehicle, t)
        for at_s, (severity, text) in told.items():
            if abs(t - at_s) < 0.01:
                vehicle.say(text, severity)

    world.vehicle.script = script
    client, _ = fly()
    assert (client.outcome.name, client.outcome.reason) == (
        "diverged",
        "Cable slack; Failsafe: vehicle position not settled; Flight given up: tilt 121 deg",
    )


def test_a_critical_text_on_the_ground_or_a_warning_in_the_air_is_not(world, fly):
    def script(vehicle, t):
        normal_flight(vehicle, t)
        if abs(t - 0.5) < 0.01:
            vehicle.say("Battery is critical", mavlink.MAV_SEVERITY_CRITICAL)
        if abs(t - 8.0) < 0.01:
            vehicle.say("Rotor 2 saturated", mavlink.MAV_SEVERITY_WARNING)

    world.vehicle.script = script
    assert fly()[0].outcome.name == "completed"


def test_timeout_on_the_clock_of_the_vehicle(world, fly):
    world.vehicle.script = then(normal_flight, 10.0, lambda vehicle: None)
    client, _ = fly()
    assert client.outcome.name == "timeout"
    assert "90 s" in client.outcome.reason and "mission" in client.outcome.reason  # 1.5 * 20 + 60
    assert world.now_us - world.vehicle.started_us == pytest.approx(90e6, abs=1e6)


def test_a_limit_of_the_user_is_kept(world, fly):
    world.vehicle.script = then(normal_flight, 10.0, lambda vehicle: None)
    client, _ = fly(limit_s=12.0)
    assert client.outcome.name == "timeout"
    assert world.now_us - world.vehicle.started_us == pytest.approx(12e6, abs=1e6)


def test_the_link_lost_in_the_air(world, fly):
    def vanish(vehicle):
        vehicle.silent = True

    world.vehicle.script = then(normal_flight, 10.0, vanish)
    client, _ = fly()
    assert (client.outcome.name, client.outcome.reason) == ("lost", "the vehicle fell silent while flying")
    client.explain_silence("autopilot (process 7) stopped by a signal")
    why = "autopilot (process 7) stopped by a signal; the vehicle fell silent while flying"
    assert (client.outcome.name, client.outcome.reason) == ("lost", why)


def test_nobody_there(world, fly):
    world.vehicle.silent = True
    client, _ = fly()
    assert client.outcome.name == "lost"
    assert world.now_us == pytest.approx(FIND_LIMIT_US, abs=100_000)


def test_a_command_without_answer_is_lost(world, fly):
    world.vehicle.silent_commands = {mavlink.MAV_CMD_MISSION_START}
    client, _ = fly()
    assert client.outcome.name == "lost"
    assert client.outcome.reason.startswith("start: no answer")


def test_a_repeated_start_does_not_begin_the_mission_again(world, fly):
    """A vehicle that is faster than the wall clock flies for long before the repetition arrives."""
    world.vehicle.silent_commands = {mavlink.MAV_CMD_MISSION_START}
    fly()
    starts = [one for one in world.vehicle.commands if one.command == mavlink.MAV_CMD_MISSION_START]
    assert len(starts) > 1
    assert all(math.isnan(one.param1) for one in starts)


def test_interrupted_by_the_user(world, fly, items):
    client = FlightClient(items, EXPECTED_S)
    client.interrupt()
    assert client.outcome.name == "interrupted"
    assert client.poll(0) == []


@pytest.mark.parametrize("told_on_the_ground", [0, 1])
def test_disarmed_by_somebody_else(world, fly, told_on_the_ground):
    """The stated item is the last in the air, although the mission begins anew on the ground."""

    def disarm(vehicle):
        vehicle.arm(False)
        vehicle.item = told_on_the_ground

    world.vehicle.script = then(normal_flight, 10.0, disarm)
    client, _ = fly()
    assert client.outcome.name == "interrupted"
    assert "at item 1 of 3" in client.outcome.reason


@pytest.mark.parametrize(
    ("mode", "said", "by_hand", "told"),
    [
        (PX4_LAND, "", False, "landing commanded by another ground station; the vehicle was disarmed before"),
        (PX4_LAND, "Battery low: landing", False, "Battery low: landing; the vehicle was disarmed before"),
        (PX4_LAND, "", True, "the vehicle was disarmed before"),
        (PX4_MISSION, "", False, "the vehicle was disarmed before"),
    ],
)
def test_who_ended_the_mission_is_told(world, items, mode, said, by_hand, told):
    client = FlightClient(items[:3] + items[-1:], EXPECTED_S)

    def script(vehicle, t):
        if t < 10.0:
            vehicle.custom_mode = PX4_MISSION
            normal_flight(vehicle, t)
        elif vehicle.custom_mode != mode:
            if said:
                vehicle.say(said)
            vehicle.custom_mode = mode
            vehicle.heartbeat()
        elif t > 12.0 and vehicle.armed:
            vehicle.arm(False)

    world.vehicle.script = script
    if by_hand:
        client.start_manual_control()
    for _ in world.ticks(client.receive, client.poll, 40.0):
        if client.outcome is not None:
            break
    assert client.outcome is not None
    assert client.outcome.name == "interrupted"
    assert client.outcome.reason.startswith(told)
    assert client.outcome.reason.endswith("before the end of the mission, at item 1 of 3")


def test_disarmed_before_take_off(world, fly):
    def script(vehicle, t):
        if vehicle.armed and t > 1.0:
            vehicle.say("Disarmed: no take-off")
            vehicle.arm(False)

    world.vehicle.script = script
    client, _ = fly()
    assert client.outcome.name == "refused"
    assert client.outcome.reason == "the vehicle disarmed before take-off; Disarmed: no take-off"


def test_a_failure_outlives_an_interruption(world, fly):
    """Ctrl-C during the aftermath does not hide why the flight was lost."""
    world.vehicle.script = then(
        normal_flight, 8.0, lambda vehicle: vehicle.say("Estimator lost", mavlink.MAV_SEVERITY_CRITICAL)
    )
    client, _ = fly(seconds=9.0)
    assert client.outcome is None
    client.interrupt()
    assert client.outcome.name == "diverged"


def test_the_same_flight_says_the_same_bytes(new_world, items):
    def sent():
        world = new_world()
        world.lossy(0.1)
        world.vehicle.script = normal_flight
        client = FlightClient(items, EXPECTED_S)
        said = []

        def poll(now_us):
            datagrams = client.poll(now_us)
            said.extend(datagrams)
            return datagrams

        for _ in world.ticks(client.receive, poll, 60.0):
            if client.outcome is not None:
                break
        assert client.outcome is not None and client.outcome.name == "completed"
        return said

    assert sent() == sent()
