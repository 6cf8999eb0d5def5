"""Rates, latencies, delays and losses: exact to the microsecond, and the same in every run."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.wire.parameter_table import ParameterError

G = 9.81
# Free flight of a point mass is a polynomial of degree two in time, which the integrator computes exactly:
# what remains are some hundred roundings of numbers of order 50 m.
ROUNDING = 1e-11
FORCES = (2.0, 2.0, 2.0, 2.0)

IMU = "accel_noise_m_s2 = 0.0\ngyro_noise_rad_s = 0.0\n"


def with_mocap(lines: str, imu: str = "") -> str:
    """A profile of a perfect IMU and a perfect tracker with these lines."""
    return (
        f'description = "test"\n[imu]\n{IMU}{imu}\n[mocap]\nposition_noise_m = 0.0\n'
        f"attitude_noise_rad = 0.0\n{lines}\n"
    )


def fallen(core, t: float, thrust_from: float) -> float:
    """Height of the vehicle at time t, dropped at rest from 50 m, under thrust since `thrust_from`."""
    climb = 0.5 * sum(FORCES) / core.truth.quad_mass * max(t - thrust_from, 0.0) ** 2
    return 50.0 - 0.5 * G * t * t + climb


@pytest.mark.parametrize("rate", [100, 250, 1000])
@pytest.mark.parametrize("delay_ms", [0.0, 1.0, 5.5, 12.0, 20.001])
def test_command_takes_effect_after_the_delay(core_in_the_air, rate: int, delay_ms: float) -> None:
    core = core_in_the_air(SIM_RATE_HZ=rate, SIM_ACT_DELAY_MS=delay_ms)
    for _ in range(rate * 40 // 1000):
        core.tick(FORCES)
        t = core.now_us * 1e-6
        assert core.state.x_quad[2] == pytest.approx(fallen(core, t, delay_ms * 1e-3), abs=ROUNDING)
    assert core.now_us == 40_000


def test_commands_on_their_way_keep_their_order(core_in_the_air) -> None:
    core = core_in_the_air(SIM_ACT_DELAY_MS=10.0)
    sent = [(0.1 * k,) * 4 for k in range(8)]
    in_force = []
    for command in sent:
        core.tick(command)
        in_force.append(core.rotor_force)
    # command k takes effect at 4k + 10 ms, so the end of tick k + 3 (4k + 12 ms) shows it first
    assert in_force == [(0.0,) * 4] * 2 + sent[:6]


@pytest.mark.parametrize("delays_ms", [(10, 22, 1), (10, 1, 22), (0, 200, 0), (200, 0, 200)])
def test_commands_keep_their_order_where_the_delay_changes_in_flight(
    core_in_the_air, delays_ms: tuple[int, ...]
) -> None:
    """Commands on their way get the new delay; a command in force is never replaced by an older one."""
    core = core_in_the_air(SIM_ACT_DELAY_MS=delays_ms[0])
    sent, in_force, expected = [], [], []
    newest = -1
    for delay_ms in delays_ms:
        core.retune(core.truth, core.settings._replace(actuator_delay_us=1000 * delay_ms))
        for _ in range(60):
            sent.append((0.01 * (len(sent) + 1),) * 4)
            core.tick(sent[-1])
            in_force.append(core.rotor_force)
            # command k is sent at 4k ms and shows once its instant has passed
            newest = max(
                newest, *(k for k in range(-1, len(sent)) if k < 0 or 4 * k + delay_ms < 4 * len(sent))
            )
            expected.append(sent[newest] if newest >= 0 else (0.0,) * 4)
    assert in_force == expected


def test_rotors_stand_until_the_first_command(core_in_the_air) -> None:
    core = core_in_the_air(SIM_ACT_DELAY_MS=200.0)
    for _ in range(50):
        core.tick(FORCES)
        assert core.rotor_force == (0.0, 0.0, 0.0, 0.0)
    core.tick(FORCES)
    assert core.rotor_force == FORCES


@pytest.mark.parametrize(("rate", "latency_ms", "extra_ms"), [(200, 4.0, 0), (30, 50.0, 0), (333.3, 0.5, 7)])
def test_readings_show_their_instant_and_leave_in_time(
    core_in_the_air, rate: float, latency_ms: float, extra_ms: int
) -> None:
    core = core_in_the_air(
        with_mocap(f"rate_hz = {rate}\nlatency_ms = {latency_ms}"), SIM_SENS_LAT_MS=extra_ms
    )
    latency_us = (latency_ms + extra_ms) * 1000
    got = []
    for _ in range(50):  # 0.2 s: the cable is still slack
        for measured in core.tick(FORCES).mocap:
            got.append(measured.time_us)
            t = measured.time_us * 1e-6
            if got[-1] > 0:  # the reading of instant 0 was taken before the test lifted the vehicle
                assert measured.reading.position[2] == pytest.approx(fallen(core, t, 0.0), abs=ROUNDING)
            # at the first tick that is not before measurement + latency
            assert 0 <= core.now_us - measured.time_us - latency_us < core.settings.tick_us
    last = core.now_us - latency_us
    assert got == [round(n * 1e6 / rate) for n in range(1000) if round(n * 1e6 / rate) <= last]


def test_imu_shows_the_state_one_latency_ago(core_in_the_air) -> None:
    core = core_in_the_air(with_mocap("rate_hz = 1", imu="latency_ms = 5.0"), SIM_ACT_DELAY_MS=10.0)
    for _ in range(10):
        (measured,) = core.tick(FORCES).imu
        assert measured.time_us == max(core.now_us - 5000, 0)
        # thrust acts from 10 ms on; the sample of 10 ms itself was taken just before
        felt = sum(FORCES) / core.truth.quad_mass if measured.time_us > 10_000 else 0.0
        if measured.time_us > 0:
            assert measured.reading.accel_body[2] == pytest.approx(felt, abs=ROUNDING)


def test_a_sensor_at_the_tick_rate_without_latency_shows_now(core) -> None:
    flown = core("ideal")
    for _ in range(3):
        readings = flown.tick(FORCES)
        assert [m.time_us for m in readings.mocap] == [flown.now_us]
        assert readings.mocap[0].reading.position == flown.state.x_quad
        assert readings.load_tracker[0].reading.velocity == flown.state.v_load


def test_a_sensor_faster_than_the_ticks_loses_nothing(core) -> None:
    flown = core(with_mocap("rate_hz = 1000"))
    times = [m.time_us for _ in range(5) for m in flown.tick(FORCES).mocap]
    assert times == list(range(1000, 20_001, 1000))


def collected(flown, ticks: int) -> dict[str, dict[int, object]]:
    """Readings by sensor and instant."""
    out: dict[str, dict[int, object]] = {}
    for _ in range(ticks):
        for name, readings in flown.tick(FORCES)._asdict().items():
            for measured in readings:
                out.setdefault(name, {})[measured.time_us] = measured.reading
    return out


def test_loss_has_its_share_and_leaves_the_rest_unchanged(core) -> None:
    mocap = "position_bias_m = 0.1\nposition_walk_m = 0.1\nrate_hz = 1000"
    whole = collected(core(with_mocap(mocap)), 1000)["mocap"]
    lossy = collected(core(with_mocap(mocap + "\nloss = 0.2")), 1000)["mocap"]
    assert len(whole) == 4000
    # four standard deviations of a binomial count
    assert abs(len(lossy) - 3200) < 4.0 * (4000 * 0.2 * 0.8) ** 0.5
    assert all(whole[t].position == reading.position for t, reading in lossy.items())


def test_loss_by_parameter_spares_the_imu(core) -> None:
    lossy = collected(core("lab", SIM_DROP_PCT=50.0), 500)
    assert len(lossy["imu"]) == 500
    for name in ("mocap", "load_tracker"):
        assert abs(len(lossy[name]) - 200) < 4.0 * (400 * 0.25) ** 0.5
    assert not collected(core("lab", SIM_DROP_PCT=100.0), 50).get("mocap")


def test_outages_have_their_frequency_and_length(core) -> None:
    lines = "rate_hz = 1000\noutages_per_min = 300\noutage_s = 0.05"
    times = np.array(sorted(collected(core(with_mocap(lines)), 10_000)["mocap"]))
    gaps = np.diff(times)
    outages = gaps[gaps > 1000] * 1e-6
    # they begin 5 times a second of the time that is not itself outage: 1 in 0.2 + 0.05 s of the 40 s
    assert abs(len(outages) - 160) < 4.0 * 160**0.5
    # an outage of length x silences the sensor for x rounded up to whole milliseconds, plus the period
    assert abs(outages.mean() - 0.051) < 4.0 * 0.05 / len(outages) ** 0.5


def test_same_seed_same_readings_other_seed_other_readings(core) -> None:
    first, second, other = (collected(core("rtk", seed=seed), 100) for seed in (1, 1, 2))
    assert first == second
    assert all(first[name] != other[name] for name in first)


def test_one_sensor_does_not_touch_the_noise_of_another(core) -> None:
    gps, rtk = collected(core("gps"), 200), collected(core("rtk"), 200)
    for name in ("barometer", "magnetometer", "cable_sensor"):
        assert gps.get(name) == rtk.get(name)


def test_noise_scale(core) -> None:
    silent = collected(core("lab", SIM_NOISE_SCALE=0.0), 100)
    resting = core("lab").state
    assert all(r.position == resting.x_load for r in list(silent["load_tracker"].values())[:1])
    whole = np.array([r.gyro_body for r in collected(core("lab"), 50)["imu"].values()])
    double = np.array([r.gyro_body for r in collected(core("lab", SIM_NOISE_SCALE=2.0), 50)["imu"].values()])
    true = np.array([r.gyro_body for r in collected(core("lab", SIM_NOISE_SCALE=0.0), 50)["imu"].values()])
    assert np.allclose(double - true, 2.0 * (whole - true), rtol=0, atol=ROUNDING)


def test_wind_blows_and_gusts_vary_about_it(core) -> None:
    windy = core("ideal", vehicle="bebop", SIM_WIND_E=3.0, SIM_GUST_STD=1.0, SIM_GUST_TAU_S=0.05)
    blown = []
    for _ in range(4000):
        windy.tick((0.0, 0.0, 0.0, 0.0))
        blown.append(windy.wind)
    samples = np.array(blown)
    # 16 s with a correlation time of 0.05 s: 160 independent values per axis
    assert np.all(np.abs(samples.mean(0) - (3.0, 0.0, 0.0)) < 4.0 / 160**0.5)
    assert np.all(np.abs(samples.std(0) - 1.0) < 4.0 / 320**0.5)
    calm = core("ideal", vehicle="bebop", SIM_WIND_N=2.0)
    calm.tick(FORCES)
    assert calm.wind == (0.0, 2.0, 0.0)


def test_a_gust_pulse_is_added_from_tick_to_tick(core) -> None:
    pulse = {"SIM_GUST_E": 5.0, "SIM_GUST_U": -2.0, "SIM_GUST_AT_S": 0.01, "SIM_GUST_FOR_S": 0.02}
    blown = core("ideal", vehicle="bebop", SIM_WIND_E=1.0, **pulse)
    winds = []
    for _ in range(10):
        blown.tick(FORCES)
        winds.append(blown.wind)
    # 10 ms and 30 ms lie between ticks of 4 ms: the gust blows in those that begin at 12 ... 28 ms
    assert winds == [(1.0, 0.0, 0.0)] * 3 + [(6.0, 0.0, -2.0)] * 5 + [(1.0, 0.0, 0.0)] * 2


def test_a_gust_pulse_under_way_follows_its_strength_and_no_change_of_its_time(core) -> None:
    settings = {"SIM_GUST_E": 5.0, "SIM_GUST_AT_S": 0.0, "SIM_GUST_FOR_S": 1.0}
    blown = core("ideal", **settings)
    blown.tick(FORCES)
    assert blown.wind == (5.0, 0.0, 0.0)
    harder = blown.settings._replace(pulse=(7.0, 0.0, 0.0))
    blown.retune(blown.truth, harder)
    blown.tick(FORCES)
    assert blown.wind == (7.0, 0.0, 0.0)
    blown.retune(blown.truth, harder._replace(pulse_at_us=4000))
    blown.tick(FORCES)
    assert blown.wind == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("rate", [300, 333, 240])
def test_rates_that_do_not_divide_are_refused(core, rate: int) -> None:
    with pytest.raises(ParameterError, match=rf"SIM_RATE_HZ = {rate} Hz; .*1000000 us / {rate} is not"):
        core("ideal", SIM_RATE_HZ=rate)


def test_the_gripper_opens_at_its_tick_and_closes_on_a_load_within_reach(core) -> None:
    """A load that is released on the ground stays there; the gripper does not take it from afar, but from
    near."""
    flown = core(SIM_ACT_DELAY_MS=20.0)
    assert not flown.released
    flown.tick((0.0,) * 4, gripper_open=True)
    assert flown.released
    assert flown.truth.cable_length < 1.0
    for _ in range(200):  # up and away: nothing holds the vehicle back
        flown.tick((1.5,) * 4, gripper_open=True)
    assert flown.state.x_quad[2] > 1.0
    assert (flown.state.taut, flown.state.tension, flown.state.load_on_ground) == (0.0, 0.0, 1.0)
    flown.tick((1.5,) * 4, gripper_open=False)
    assert flown.released  # out of reach
    while flown.state.vehicle_on_ground == 0.0:
        flown.tick((0.0,) * 4, gripper_open=False)
    assert not flown.released


def test_the_winch_reaches_the_rate_it_is_told_by_the_next_tick(core) -> None:
    """The length is the integral of a rate that is linear between ticks, whatever instants of sensors divide
    them."""
    flown = core(SIM_ACT_DELAY_MS=20.0)
    rates = [0.3 * np.sin(0.02 * k) ** 2 for k in range(150)]
    for rate in rates:
        flown.tick((0.0,) * 4, reel_rate=rate)
    expected = 0.7 + 0.004 * (sum(rates) - 0.5 * rates[-1])
    assert flown.cable_length == pytest.approx(expected, abs=1e-13)
    for _ in range(3):
        flown.tick((0.0,) * 4)
    standing = flown.cable_length
    flown.tick((0.0,) * 4)
    assert flown.cable_length == standing
    flown.tick((0.0,) * 4, gripper_open=True, reel_rate=0.3)
    assert flown.cable_length == standing  # nothing hangs on it


def test_a_sensor_fails_at_the_time_and_for_the_time_that_are_set(core) -> None:
    """All its readings of this time are lost, and no others."""
    whole = collected(core("lab"), 200)
    brief = collected(core("lab", SIM_SENS_FAIL=2, SIM_SENS_AT_S=0.2, SIM_SENS_FOR_S=0.3), 200)
    lasting = collected(core("lab", SIM_SENS_FAIL=2, SIM_SENS_AT_S=0.2), 200)
    before = {time_us: one for time_us, one in whole["mocap"].items() if time_us < 200_000}
    after = {time_us: one for time_us, one in whole["mocap"].items() if time_us >= 500_000}
    assert before and after
    assert str(brief["mocap"]) == str(before | after)
    assert str(lasting["mocap"]) == str(before)
    assert str(brief["load_tracker"]) == str(whole["load_tracker"])


@pytest.mark.parametrize("failed", range(7))
@pytest.mark.parametrize("profile", ["lab", "rtk"])
def test_a_failed_sensor_is_silent_and_the_others_say_what_they_did(core, profile: str, failed: int) -> None:
    whole, less = collected(core(profile), 200), collected(core(profile, SIM_SENS_FAIL=1 << failed), 200)
    names = ("imu", "mocap", "load_tracker", "cable_sensor", "gnss", "barometer", "magnetometer")
    assert not less.get(names[failed])
    for name in set(whole) - {names[failed]}:
        assert str(less[name]) == str(whole[name]), name  # what was not measured is NaN
