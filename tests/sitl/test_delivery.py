"""When readings arrive: each with its own delay, out of order, dated by a clock that is off."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest

from autopilot.core.sensor_inbox import SensorInbox
from autopilot.estimation.inbox import KIND, POSE, SAMPLE_TIME_US, age_of, new_inbox
from autopilot.wire.convert.geodesy import Home
from sitl.hil import HilSimulator

SIGMAS = 4.0  # suspicious distance of a statistic from its expectation, in its own standard errors
FORCES = (1.0, 1.0, 1.0, 1.0)


def mocap(lines: str) -> str:
    return f"""
    description = "test"
    [imu]
    accel_noise_m_s2 = 0.01
    gyro_noise_rad_s = 0.0
    [mocap]
    position_noise_m = 0.001
    attitude_noise_rad = 0.0
    {lines}
    """


def arrivals(flown, ticks: int) -> list[tuple[int, int, object]]:
    """(tick of arrival, time carried, both us, position) of poses, in the order of their arrival."""
    return [
        (flown.now_us, m.time_us, m.reading.position) for _ in range(ticks) for m in flown.tick(FORCES).mocap
    ]


def test_random_latency_is_exponential_and_cut(core) -> None:
    jitter = "rate_hz = 1000\nlatency_ms = 2\njitter_ms = 8\njitter_max_ms = 20"
    got = arrivals(core(mocap(jitter), SIM_RATE_HZ=1000), 8000)
    late_ms = np.array([(at - shown) / 1000.0 - 2.0 for at, shown, _ in got if shown < 7_900_000])
    assert late_ms.min() == 1.0  # it leaves with the first tick that is not earlier
    assert late_ms.max() == 20.0
    for limit in (2, 5, 10, 15):
        expected, share = exp(-limit / 8.0), np.mean(late_ms > limit)
        error = (expected * (1.0 - expected) / len(late_ms)) ** 0.5
        assert abs(share - expected) < SIGMAS * error
    neighbours = np.corrcoef(
        late_ms[np.argsort([s for _, s, _ in got if s < 7_900_000])][:-1:2], late_ms[1::2]
    )
    assert abs(neighbours[0, 1]) < SIGMAS / (len(late_ms) / 2) ** 0.5


def test_readings_overtake_each_other_and_none_is_lost(core) -> None:
    plain = "rate_hz = 200\nlatency_ms = 4"
    punctual = arrivals(core(mocap(plain)), 2000)
    got = arrivals(core(mocap(plain + "\njitter_ms = 5")), 2000)
    times = [shown for _, shown, _ in got]
    place = {shown: i for i, shown in enumerate(times)}
    pairs = [(place[t], place[t + 5000]) for t in times if t + 5000 in place]
    # one is overtaken by the next, 5 ms younger, where j1 > j2 + 5 ms
    expected, overtaken = 0.5 * exp(-1.0), np.mean([first > second for first, second in pairs])
    assert abs(overtaken - expected) < SIGMAS * (expected * (1.0 - expected) / len(pairs)) ** 0.5
    last = times[-1] - 40_000  # the longest that one can be on its way
    assert sorted(t for t in times if t <= last) == [shown for _, shown, _ in punctual if shown <= last]
    readings = {shown: reading for _, shown, reading in punctual}
    assert all(readings[shown] == reading for _, shown, reading in got), "lateness has touched the noise"
    assert all(at - shown >= 4000 for at, shown, _ in got)


def test_the_random_latency_depends_on_the_seed_alone(core) -> None:
    first, second = (arrivals(core("lab-real", seed=3), 300) for _ in range(2))
    assert first == second
    other = arrivals(core("lab-real", seed=4), 300)
    assert [shown for _, shown, _ in other] != [shown for _, shown, _ in first]


def test_a_clock_that_is_off_dates_the_readings_and_delays_none(core) -> None:
    plain = "rate_hz = 200\nlatency_ms = 4"
    right = arrivals(core(mocap(plain)), 100)
    for own_ms, offset_ms in ((2.5, 0.0), (-1.0, -2.0)):
        us = round((own_ms + offset_ms) * 1000.0)
        off = arrivals(core(mocap(f"{plain}\ntime_offset_ms = {own_ms}"), SIM_SENS_OFS_MS=offset_ms), 100)
        assert off == [(at, max(shown + us, 0), reading) for at, shown, reading in right]


@pytest.mark.parametrize(("settings", "kept"), [({}, True), ({"SIM_SENS_JIT_MS": 0.0}, False)])
def test_the_parameter_takes_the_place_of_the_profile(core, settings: dict[str, float], kept: bool) -> None:
    times = [shown for _, shown, _ in arrivals(core("lab-real", **settings), 300)]
    assert (times != sorted(times)) == kept


def test_a_rebooted_parameter_of_lateness_reaches_all_that_carries_a_time(core) -> None:
    flown = core("rtk", SIM_SENS_JIT_MS=30.0)
    times: dict[str, list[int]] = {"gnss": [], "cable_sensor": [], "barometer": []}
    late: dict[str, set[int]] = {name: set() for name in times}
    for _ in range(2500):
        for name, readings in flown.tick(FORCES)._asdict().items():
            for measured in readings:
                if name in times:
                    times[name].append(measured.time_us)
                    late[name].add(flown.now_us - measured.time_us)
    assert times["cable_sensor"] != sorted(times["cable_sensor"])
    assert max(late["gnss"]) > 130_000 > min(late["gnss"])
    assert times["barometer"] == sorted(times["barometer"])
    assert max(late["barometer"]) < 14_000  # latency and a tick: it is wired to the autopilot itself


def test_the_autopilots_inbox_takes_them_all_as_they_come(answerer) -> None:
    simulator = HilSimulator.build(sensors="lab-real", settings={"SIM_OCC_VEH": 0.0})
    inbox = SensorInbox(Home(), new_inbox())
    taken = []
    for _ in range(1000):
        tick = inbox.read(simulator.sensor_datagram(), simulator.now_us - 1)
        assert tick is not None
        rows = inbox.rows[: tick.readings]
        poses = rows[rows[:, KIND] == POSE]
        # a reading is refused if it is of the future, or older than the estimator's memory
        assert all(np.isfinite(age_of(row, simulator.now_us, 0.0)) for row in poses)
        taken += poses[:, SAMPLE_TIME_US].astype(int).tolist()
        answerer().fly(simulator, 1)
    assert taken != sorted(taken)
    last = max(taken) - 40_000  # the longest that one can be on its way
    assert sorted(t for t in taken if t <= last) == list(range(1000, last + 1, 5000))
