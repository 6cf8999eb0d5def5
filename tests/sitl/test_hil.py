"""The simulator's end of the link: bytes in, bytes out, the same every time, and no input harms it."""

from __future__ import annotations

from math import inf, isnan, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.geometry.frames import enu_from_ned
from autopilot.wire.codec import FrameWriter
from autopilot.wire.convert.battery import read_battery_status
from autopilot.wire.convert.flight import read_load_state
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import (
    ACCEL,
    GYRO,
    MAG,
    PRESSURE,
    load_sensor_record,
    odometry_record,
    padded_forces,
    read_hil_gps,
    read_hil_state_quaternion,
    rotor_speed_rpm,
)
from autopilot.wire.dialect import plumbline as mavlink
from sitl.hil import COMMAND_TIMEOUT_US, HilSimulator, PacingFigures
from sitl.messages import pressure_pa
from tests.doubles.messages import hil_actuator_controls_message

VEHICLES = "bebop, bebop-real, heavy, heavy-real, hexarotor, iris, octorotor, thesis"
PROFILES = ["field", "gps", "ideal", "lab", "lab-blind", "lab-real", "rtk", "rtk-blind"]
# float32 keeps 24 bits: at 4 m, half a unit in the last place is 2.4e-7 m
FLOAT32_M = 5e-7
FULL = (1.96,) * 4


def names(messages) -> list[str]:
    return [message.get_type() for message in messages]


@pytest.mark.parametrize("sensors", PROFILES)
def test_same_seed_and_commands_same_bytes(sensors: str, answerer) -> None:
    first, second = (answerer().fly(HilSimulator.build(sensors=sensors, seed=5), 200) for _ in range(2))
    assert first == second
    assert answerer().fly(HilSimulator.build(sensors=sensors, seed=6), 200) != first or sensors == "ideal"


def test_datagrams_are_the_same_until_the_tick_is_over() -> None:
    simulator = HilSimulator.build()
    assert simulator.sensor_datagram() is simulator.sensor_datagram()
    assert simulator.truth_datagram() is simulator.truth_datagram()


@pytest.mark.parametrize("sensors", PROFILES)
def test_every_tick_ends_with_the_clock(sensors: str, answerer, messages) -> None:
    simulator = HilSimulator.build(sensors=sensors)
    for tick in range(100):
        got = messages(simulator.sensor_datagram())
        assert names(got).count("HIL_SENSOR") == 1
        assert got[-1].get_type() == "HIL_SENSOR"
        assert got[-1].time_usec == simulator.now_us == tick * 4000
        assert all(message.time_usec <= simulator.now_us for message in got)
        answerer().fly(simulator, 1)


def test_ideal_sends_everything_at_every_tick(answerer, messages) -> None:
    simulator = HilSimulator.build(sensors="ideal")
    answerer((1.3, 1.31, 1.32, 1.33)).fly(simulator, 200)
    odometry, load, speeds, inertial = messages(simulator.sensor_datagram())
    state = simulator.core.state
    pose = odometry_record(odometry)
    assert pose.position == pytest.approx(state.x_quad, abs=FLOAT32_M)
    assert pose.velocity == pytest.approx(state.v_quad, abs=FLOAT32_M)
    assert pose.omega_body == pytest.approx(state.omega_body, abs=FLOAT32_M)
    assert pose.position_std == pytest.approx(1e-4)  # stated although there is no noise
    tracked = load_sensor_record(load)
    assert tracked.position == pytest.approx(state.x_load, abs=FLOAT32_M)
    assert tracked.velocity == pytest.approx(state.v_load, abs=FLOAT32_M)
    assert all(map(isnan, tracked.direction_body))
    assert tracked.velocity_std == pytest.approx(1e-3)
    assert odometry.time_usec == load.time_usec == speeds.time_usec == simulator.now_us
    greatest = simulator.core.truth.rotor_max
    assert speeds.index == 0
    told = [rotor_speed_rpm(force, greatest) for force in simulator.core.rotor_force]
    assert speeds.rpm == told
    assert len(set(speeds.rpm)) == 4  # of one rotor each
    assert inertial.fields_updated == ACCEL | GYRO


def test_lab_sends_poses_without_velocities(answerer, messages) -> None:
    simulator = HilSimulator.build(sensors="lab")
    got = [message for d in answerer().fly(simulator, 250) for message in messages(d)]
    poses = [m for m in got if m.get_type() == "ODOMETRY"]
    loads = [m for m in got if m.get_type() == "LOAD_SENSOR"]
    # 200 Hz from instant 0, 4 ms late: instants 0, 5 ... 990 ms leave within the first 249 ticks (0.996 s)
    assert [m.time_usec for m in poses] == [m.time_usec for m in loads] == list(range(0, 992_001, 5000))
    assert all(isnan(m.velocity_covariance[0]) and isnan(m.vx) for m in poses)
    assert {m.fields for m in loads} == {mavlink.PLUMBLINE_LOAD_POSITION}
    assert odometry_record(poses[0]).position_std == pytest.approx(1e-3)
    assert odometry_record(poses[0]).attitude_std == pytest.approx(7e-4)


@pytest.mark.parametrize(
    ("sensors", "fix", "rate", "latency_us"), [("rtk", 6, 10, 100_000), ("gps", 3, 5, 120_000)]
)
def test_outdoor_profiles(sensors: str, fix: int, rate: int, latency_us: int, answerer, messages) -> None:
    home = Home(10.0, 20.0, 500.0)
    simulator = HilSimulator.build(sensors=sensors, home=home)
    # 1.45 N a rotor lifts both; the load hangs in the camera's cone after a second
    sent = answerer((1.45, 1.45, 1.45, 1.45)).fly(simulator, 500)
    got = [message for datagram in sent for message in messages(datagram)]
    fixes = [m for m in got if m.get_type() == "HIL_GPS"]
    assert [m.time_usec for m in fixes] == list(range(0, 2_000_000 - latency_us, 1_000_000 // rate))
    assert {m.fix_type for m in fixes} == {fix}
    assert all(m.eph > 0 and m.epv > 0 for m in fixes)
    assert read_hil_gps(fixes[0], home).position == pytest.approx((0.0, 0.0, 0.0), abs=10.0)
    bearings = [m for m in got if m.get_type() == "LOAD_SENSOR"]
    assert {(m.fields, m.sensor_id) for m in bearings} == {(mavlink.PLUMBLINE_LOAD_DIRECTION, 1)}
    assert bearings[-1].dz > 0.5
    inertial = [m for m in got if m.get_type() == "HIL_SENSOR"]
    fresh = [m for m in inertial if m.fields_updated & PRESSURE]
    assert len(fresh) == 100
    assert fresh[0].abs_pressure * 100.0 == pytest.approx(pressure_pa(500.0), abs=30.0)
    assert len([m for m in inertial if m.fields_updated & MAG]) == 100
    assert "ODOMETRY" not in names(got)


def test_pressure_of_the_standard_atmosphere() -> None:
    # ICAO Doc 7488: 1013.25 hPa at sea level, 898.74 hPa at 1000 m, 540.20 hPa at 5000 m
    for altitude, expected in [(0.0, 101_325.0), (1000.0, 89_874.6), (5000.0, 54_019.9)]:
        assert pressure_pa(altitude) == pytest.approx(expected, abs=10.0)


@pytest.mark.parametrize(("lockstep", "told"), [(True, [0, 250]), (False, [0, 50, 100, 150, 200, 250])])
def test_truth_goes_out_on_every_second_tick_and_status_now_and_then(
    answerer, messages, lockstep: bool, told: list[int]
) -> None:
    simulator = HilSimulator.build(truth_every=2, lockstep=lockstep)
    kinds = []
    for _ in range(252):
        truth = simulator.truth_datagram()
        kinds.append(names(messages(truth)) if truth else [])
        answerer().fly(simulator, 1)
    assert kinds[1::2] == [[]] * 126
    full = ["HIL_STATE_QUATERNION", "LOAD_STATE", "ROTOR_STATE"]
    assert all(kind[:3] == full for kind in kinds[::2])
    assert [tick for tick, kind in enumerate(kinds) if "SIM_STATUS" in kind] == told


def test_truth_is_the_truth(answerer, messages) -> None:
    simulator = HilSimulator.build(vehicle="bebop", sensors="lab")
    answerer((1.45, 1.45, 1.45, 2.5)).fly(simulator, 250)
    vehicle, load, rotors, _, status = messages(simulator.truth_datagram())
    state = simulator.core.state
    got = read_load_state(load)
    assert got.source == mavlink.PLUMBLINE_SOURCE_TRUTH
    assert got.x_load == pytest.approx(state.x_load, abs=FLOAT32_M)
    assert got.taut == bool(state.taut)
    # distance and direction give the vehicle's position without HIL_STATE_QUATERNION's 11 mm steps
    rebuilt = [x - got.distance * q for x, q in zip(got.x_load, got.q_cable, strict=True)]
    assert rebuilt == pytest.approx(state.x_quad, abs=4.0 * FLOAT32_M)
    assert read_hil_state_quaternion(vehicle, Home()).position == pytest.approx(state.x_quad, abs=0.01)
    assert rotors.force == pytest.approx(simulator.core.rotor_force, abs=FLOAT32_M)
    assert (rotors.saturated, rotors.force_max) == (0b1000, pytest.approx(1.96))
    assert status.time_usec == simulator.now_us
    assert (status.vehicle_on_ground, status.load_on_ground) == (
        state.vehicle_on_ground,
        state.load_on_ground,
    )


def test_a_plant_that_diverged_says_so(answerer, messages) -> None:
    simulator = HilSimulator.build(vehicle="thesis")
    sent = answerer((300.0, 0.0, 0.0, 0.0)).fly(simulator, 251)  # spins up beyond all bounds
    assert simulator.diverged
    texts = [m for datagram in sent for m in messages(datagram) if m.get_type() == "STATUSTEXT"]
    assert texts
    assert all(text.text == "Simulation stopped: outside its model" for text in texts)
    assert messages(simulator.sensor_datagram())[-1].time_usec == simulator.now_us == 1_004_000


def test_only_the_answer_to_this_tick_counts(answerer) -> None:
    simulator, pilot = HilSimulator.build(), answerer()
    pilot.fly(simulator, 3)
    for time_us in (0, 8000, 16_000, 2**63):
        assert not simulator.receive(pilot.answer(time_us))
    assert simulator.receive(pilot.answer(12_000))


def test_doubled_late_and_foreign_datagrams_change_nothing(answerer) -> None:
    plain, troubled = HilSimulator.build(), HilSimulator.build()
    pilot, stranger = answerer(), answerer(system=2)
    expected = answerer().fly(plain, 50)
    sent = []
    for tick in range(50):
        truth = troubled.truth_datagram()
        sent += [truth] if truth else []
        sent.append(troubled.sensor_datagram())
        now = troubled.now_us
        assert not troubled.receive(stranger.answer(now, FULL))
        assert not troubled.receive(pilot.answer(max(now - 4000, 0) if tick else 99, FULL))
        assert not troubled.receive(b"")
        assert troubled.receive(pilot.answer(now))
        assert troubled.receive(pilot.answer(now))
        assert troubled.receive(pilot.answer(now, FULL))  # the first answer stands
        troubled.advance()
    assert sent == expected


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=400), st.integers(0, 120), st.integers(0, 255))
def test_rubbish_is_harmless(noise: bytes, place: int, value: int) -> None:
    simulator = HilSimulator.build()
    before = simulator.sensor_datagram()
    frame = bytearray(
        FrameWriter(1, 1).frame(hil_actuator_controls_message(0, padded_forces((1.0,) * 4), True, True))
    )
    frame[place % len(frame)] ^= value or 1
    for datagram in (noise, bytes(frame), bytes(frame[:place]), noise + bytes(frame)):
        assert not simulator.receive(datagram)
        assert not simulator.has_heartbeat(datagram)
    assert simulator.sensor_datagram() == before


def test_rubbish_around_an_answer_does_not_hide_it(answerer) -> None:
    simulator = HilSimulator.build()
    assert simulator.receive(b"\xfd\xff" + answerer().answer(0) + b"\xfe")


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_controls_that_are_no_numbers_are_refused(bad: float, answerer) -> None:
    simulator, pilot = HilSimulator.build(vehicle="thesis"), answerer((0.5,) * 4)
    pilot.fly(simulator, 2)
    assert simulator.receive(pilot.answer(simulator.now_us, (0.7, bad, 0.7, 0.7)))
    simulator.advance()
    assert simulator.rejected == 1
    assert simulator.core.command == pytest.approx((0.5,) * 4)


def test_disarmed_rotors_stand(answerer) -> None:
    simulator, pilot = HilSimulator.build(), answerer()
    assert simulator.receive(pilot.answer(0, FULL, armed=False))
    simulator.advance()
    assert simulator.core.command == (0.0, 0.0, 0.0, 0.0)


def test_greeting_is_a_heartbeat_of_the_vehicle(answerer) -> None:
    simulator = HilSimulator.build()
    beat = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)
    assert simulator.has_heartbeat(FrameWriter(1, 1).frame(beat))
    assert not simulator.has_heartbeat(FrameWriter(255, 190).frame(beat))
    assert not simulator.has_heartbeat(answerer().answer(0))
    assert not simulator.receive(FrameWriter(1, 1).frame(beat))


def test_real_time_counts_missed_commands_and_uses_late_ones(answerer) -> None:
    simulator, pilot = HilSimulator.build(vehicle="thesis", lockstep=False), answerer()
    simulator.advance()
    assert simulator.missed == 1
    assert simulator.receive(pilot.answer(simulator.now_us, (0.5,) * 4))
    simulator.advance()
    assert simulator.missed == 1
    simulator.advance()
    late = simulator.now_us - 4000
    assert not simulator.receive(pilot.answer(late, (0.6,) * 4))
    simulator.advance()
    assert simulator.missed == 3
    assert simulator.core.command == pytest.approx((0.6,) * 4)
    assert not simulator.receive(pilot.answer(late - 4000, (0.9,) * 4))  # older than the last answer
    assert not simulator.receive(pilot.answer(simulator.now_us + 4000, (0.9,) * 4))
    simulator.advance()
    assert simulator.core.command == pytest.approx((0.6,) * 4)


def test_real_time_rotors_stop_when_commands_stay_away(answerer) -> None:
    simulator, pilot = HilSimulator.build(vehicle="thesis", lockstep=False), answerer((0.5,) * 4)
    pilot.fly(simulator, 1)
    for _ in range(COMMAND_TIMEOUT_US // 4000):
        simulator.advance()
        assert simulator.core.command == pytest.approx((0.5,) * 4)
    simulator.advance()
    assert simulator.core.command == (0.0, 0.0, 0.0, 0.0)


def told_winds(simulator: HilSimulator, answerer, messages, ticks: int) -> list[tuple]:
    """Time (us), mean and pulse (ENU) of every WIND_STATE of this number of ticks."""
    winds = []
    for datagram in answerer().fly(simulator, ticks):
        for message in messages(datagram):
            if message.get_type() == "WIND_STATE":
                east_north_up = (enu_from_ned(tuple(one)) for one in (message.wind, message.gust))
                winds.append((message.time_usec, *east_north_up))
    return winds


def test_a_gust_is_told_with_the_ticks_of_its_edges(answerer, messages) -> None:
    settings = {"SIM_WIND_E": 3.0, "SIM_GUST_N": 5.0, "SIM_GUST_AT_S": 0.5, "SIM_GUST_FOR_S": 0.25}
    winds = told_winds(HilSimulator.build(settings=settings), answerer, messages, 250)
    calm, blown = (0.0, 0.0, 0.0), (0.0, 5.0, 0.0)
    assert {wind for _, wind, _ in winds} == {(3.0, 0.0, 0.0)}
    expected = {0: calm, 500: blown, 752: calm}
    # 750 ms is no tick: the next one is at 752 ms
    assert [(time_us // 1000, gust) for time_us, _, gust in winds] == list(expected.items())


def test_another_mean_wind_is_told_at_once(answerer, messages) -> None:
    simulator = HilSimulator.build(settings={"SIM_WIND_E": 3.0})
    answerer().fly(simulator, 100)
    set_parameter(simulator, answerer, "SIM_WIND_E", 4.0)
    winds = told_winds(simulator, answerer, messages, 40)
    assert [(time_us // 1000, mean[0]) for time_us, mean, _ in winds] == [(404, 4.0)]


def set_parameter(simulator: HilSimulator, answerer, name: str, value: float) -> None:
    """Send PARAM_SET together with the answer to the present tick."""
    pilot = answerer()
    message = mavlink.MAVLink_param_set_message(1, 26, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
    assert simulator.receive(pilot.answer(simulator.now_us) + pilot.writer.frame(message))
    simulator.advance()


def test_a_gust_can_be_triggered_at_once(answerer, messages) -> None:
    simulator = HilSimulator.build(settings={"SIM_GUST_E": 4.0, "SIM_GUST_FOR_S": 0.1})
    answerer().fly(simulator, 100)
    set_parameter(simulator, answerer, "SIM_GUST_NOW", 1.0)
    values = {
        m.param_id: m.param_value for m in messages(simulator.sensor_datagram()) if hasattr(m, "param_id")
    }
    assert values["SIM_GUST_NOW"] == 0.0
    assert values["SIM_GUST_AT_S"] == pytest.approx(0.404)
    winds = told_winds(simulator, answerer, messages, 40)
    assert [time_us // 1000 for time_us, _, gust in winds if gust != (0.0, 0.0, 0.0)] == [404]
    assert [time_us // 1000 for time_us, _, gust in winds if gust == (0.0, 0.0, 0.0)] == [504]


def test_a_gust_of_the_past_does_nothing(answerer, messages) -> None:
    simulator = HilSimulator.build(settings={"SIM_GUST_E": 4.0, "SIM_GUST_FOR_S": 10.0})
    answerer().fly(simulator, 100)
    set_parameter(simulator, answerer, "SIM_GUST_AT_S", 0.2)
    winds = told_winds(simulator, answerer, messages, 200)
    assert winds
    assert {gust for _, _, gust in winds} == {(0.0, 0.0, 0.0)}
    set_parameter(simulator, answerer, "SIM_GUST_AT_S", 1.4)  # a time in the future takes effect
    assert (4.0, 0.0, 0.0) in {gust for _, _, gust in told_winds(simulator, answerer, messages, 100)}


def test_a_cable_that_comes_taut_is_told_of(answerer, messages) -> None:
    simulator = HilSimulator.build(sensors="ideal")
    sent = answerer((1.45,) * 4).fly(simulator, 300)  # lifts vehicle and load
    (snap,) = [m for d in sent for m in messages(d) if m.get_type() == "CABLE_SNAP"]
    truth = simulator.core.truth
    reduced_mass = truth.quad_mass * truth.load_mass / (truth.quad_mass + truth.load_mass)
    assert snap.speed > 0.5  # m/s, it climbs at about 2 m/s^2 over 0.7 m
    assert snap.impulse == pytest.approx(reduced_mass * snap.speed, rel=1e-6)
    loads = [m for d in sent for m in messages(d) if m.get_type() == "LOAD_STATE"]
    first_taut = min(m.time_usec for m in loads if m.taut)
    assert 0 <= first_taut - snap.time_usec <= 4000  # truth goes out on every second tick


def test_a_reboot_begins_anew_with_the_parameters_in_force(answerer, messages) -> None:
    plain = answerer().fly(HilSimulator.build(seed=4, settings={"SIM_WIND_E": 2.0}), 100)
    simulator = HilSimulator.build(seed=4)
    answerer().fly(simulator, 60)
    set_parameter(simulator, answerer, "SIM_WIND_E", 2.0)
    answerer().fly(simulator, 20)
    pilot = answerer()
    reboot = mavlink.MAVLink_command_long_message(1, 26, 246, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert simulator.receive(pilot.answer(simulator.now_us) + pilot.writer.frame(reboot))
    simulator.advance()
    assert simulator.now_us == 0

    def told(datagrams: list[bytes]) -> tuple[list[str], set[int]]:
        """All messages without sequence numbers, except the number of the run; and that number."""
        found = [message for datagram in datagrams for message in messages(datagram)]
        rest = [str(message) for message in found if message.get_type() != "SIM_BOOT"]
        return rest, {message.boot_id for message in found if message.get_type() == "SIM_BOOT"}

    again = told(answerer().fly(simulator, 100))
    assert again[0] == told(plain)[0]
    assert told(plain)[1] == {0}
    assert again[1] == {1}, "it is another run of the world, and says so"


def test_status_carries_what_the_shell_measured(answerer, messages) -> None:
    simulator = HilSimulator.build(lockstep=False)
    simulator.advance()
    answerer().fly(simulator, 49)
    simulator.pacing = PacingFigures(2.0, 499.5, 3, 40, 500)
    status = messages(simulator.truth_datagram())[-1]
    assert (status.speed_factor, status.rate_hz, status.late_p50_us) == (2.0, 499.5, 3)
    assert (status.late_p99_us, status.late_max_us, status.missed) == (40, 500, 1)


def test_settings_of_the_other_process_are_passed_over() -> None:
    simulator = HilSimulator.build(settings={"SIM_RATE_HZ": 500.0, "SIM_LOSS_PCT": 20.0, "K_X": 3.0})
    assert simulator.tick_us == 2000


@pytest.mark.parametrize(
    ("kwargs", "complaint"),
    [
        ({"settings": {"SIM_WIND": 1.0}}, "SIM_WIND: no such parameter; did you mean SIM_WIND_"),
        ({"settings": {"SIM_WIND_E": nan}}, "SIM_WIND_E = nan m/s; must be -50 ... 50"),
        (
            {"sensors": "perfect"},
            f"unknown sensors 'perfect'; shipped: {', '.join(PROFILES)}; or the path",
        ),
        ({"vehicle": "saucer"}, f"unknown vehicle 'saucer'; shipped: {VEHICLES}; or the path"),
    ],
)
def test_bad_options_are_told_in_one_line(kwargs, complaint: str) -> None:
    with pytest.raises(ValueError) as error:
        HilSimulator.build(**kwargs)
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)


def boots(simulator: HilSimulator, messages) -> list:
    return [m for m in messages(simulator.sensor_datagram()) if m.get_type() == "SIM_BOOT"]


def test_which_run_it_is_is_told_at_first_each_second_and_to_who_comes(answerer, messages) -> None:
    simulator, pilot = HilSimulator.build(boot_id=2**63 - 1), answerer()
    told = []
    for tick in range(501):
        if boots(simulator, messages):
            told.append(tick)
        pilot.fly(simulator, 1)
    assert told == [0, 250, 500]
    plain = simulator.sensor_datagram()
    simulator.announce_boot()
    (boot,) = boots(simulator, messages)
    assert (boot.time_usec, boot.boot_id) == (simulator.now_us, 2**63 - 1)
    assert simulator.sensor_datagram().endswith(plain), "with the sensors of this tick"
    pilot.fly(simulator, 1)
    assert len(boots(simulator, messages)) == 1, "and of the next, which may be the first that is heard"
    pilot.fly(simulator, 1)
    assert not boots(simulator, messages)


def test_a_world_with_a_receiver_tells_where_on_earth_it_is(messages) -> None:
    home = Home(47.4, -8.5, 480.0)
    for sensors, told in (("rtk", [(474_000_000, -85_000_000, 480_000)]), ("lab", [])):
        simulator = HilSimulator.build(sensors=sensors, home=home)
        origins = [m for m in messages(simulator.sensor_datagram()) if m.get_type() == "GPS_GLOBAL_ORIGIN"]
        assert [(m.latitude, m.longitude, m.altitude) for m in origins] == told


def test_who_comes_is_told_what_the_rotors_do(answerer, messages) -> None:
    simulator, pilot = HilSimulator.build(lockstep=False), answerer((1.0, 1.5, 1.0, 1.5))

    def rotors() -> tuple[int, list[float]]:
        for _ in range(2):
            simulator.advance()
        simulator.announce_boot()
        boot = boots(simulator, messages)[0]
        return boot.rotors, list(boot.force)

    assert rotors()[0] == mavlink.PLUMBLINE_ROTORS_DISARMED
    pilot.fly(simulator, 3)
    assert rotors() == (mavlink.PLUMBLINE_ROTORS_OBEYING, pytest.approx([1.0, 1.5, 1.0, 1.5]))
    while simulator.now_us < 2 * COMMAND_TIMEOUT_US:
        simulator.advance()
    assert rotors() == (mavlink.PLUMBLINE_ROTORS_UNHEARD, [0.0] * 4)
    simulator.receive(pilot.answer(simulator.now_us, armed=False))
    assert rotors()[0] == mavlink.PLUMBLINE_ROTORS_DISARMED


def test_a_battery_is_told_five_times_a_second(answerer, messages) -> None:
    """It comes with the sensors, as from a power module; a vehicle without a battery reports nothing."""
    settings_ = {"SIM_BATTERY": 1.0, "SIM_BAT_CHARGE": 50.0}
    simulator = HilSimulator.build(settings=settings_)
    told = []
    for tick in range(260):
        got = [x for x in messages(simulator.sensor_datagram()) if x.get_type() == "BATTERY_STATUS"]
        told += [(tick, read_battery_status(x)) for x in got]
        answerer((1.2,) * 4).fly(simulator, 1)
    assert [tick for tick, _ in told] == [0, 50, 100, 150, 200, 250]
    supply = simulator.core.world.supply
    last = told[-1][1]
    assert last.voltage == pytest.approx(supply.voltage, abs=0.002)
    assert last.current == pytest.approx(supply.current, rel=0.01)
    assert last.remaining == pytest.approx(0.5, abs=0.01)
    assert told[0][1].voltage == pytest.approx(3 * 3.82, abs=0.001)
    assert last.voltage < told[0][1].voltage - 0.3
    plain = HilSimulator.build()
    said = [name for d in answerer().fly(plain, 60) for name in names(messages(d))]
    assert "BATTERY_STATUS" not in said


def test_a_sagging_battery_takes_thrust(answerer) -> None:
    """Speed controllers at full throttle: the force falls with the square of the voltage."""
    curve = {"SIM_THR_CURVE": 1.0, "SIM_THR_KNOWN": 1.0, "SIM_BATTERY": 1.0, "SIM_BAT_CHARGE": 20.0}
    simulator = HilSimulator.build(settings=curve)
    answerer(FULL).fly(simulator, 100)
    share = simulator.core.world.supply.share
    assert 0.75 < share < 0.88
    assert simulator.core.rotor_force == pytest.approx((1.96 * share**2,) * 4, rel=1e-3)


def test_a_snap_beside_the_centre_turns_the_vehicle_and_tells_its_own_impulse(answerer, messages) -> None:
    """The impulse in CABLE_SNAP follows from the mass that the cable feels, which is less than the reduced
    mass of vehicle and load."""
    simulator = HilSimulator.build(settings={"SIM_ATT_X": 0.05})
    core, L = simulator.core, simulator.core.truth.cable_length
    core.state = core.state._replace(
        x_quad=(0.0, 0.0, 50.0),
        x_load=(0.05, 0.0, 50.0 - L + 0.001),
        v_load=(0.0, 0.0, -1.0),
        q_cable=(0.0, 0.0, -1.0),
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
    )
    answerer().fly(simulator, 1)
    (snap,) = (x for x in messages(simulator.truth_datagram()) if x.get_type() == "CABLE_SNAP")
    truth = core.truth
    n = (0.0, 0.05, 0.0)  # rho x q
    mu = 1.0 / (1.0 / truth.load_mass + 1.0 / truth.quad_mass + n[1] ** 2 / truth.inertia[1])
    assert snap.impulse == pytest.approx(mu * snap.speed, rel=1e-3)
    assert core.state.omega_body[1] == pytest.approx(0.05 * snap.impulse / truth.inertia[1], rel=0.01)


def test_five_times_a_second_the_truth_says_whose_it_is_in_numbers_of_its_own(answerer, messages) -> None:
    simulator, pilot = HilSimulator.build(boot_id=41, lockstep=False), answerer()
    told = {}
    for tick in range(101):
        datagram = simulator.run_datagram()
        if datagram is not None:
            (told[tick],) = messages(datagram)
        pilot.fly(simulator, 1)
    assert list(told) == [0, 50, 100]
    assert {(boot.get_type(), boot.boot_id) for boot in told.values()} == {("SIM_BOOT", 41)}
    simulator.restart()
    (boot,) = messages(simulator.run_datagram())
    assert boot.boot_id == 42
