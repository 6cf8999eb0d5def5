"""The on-board log of a flight: when it begins and ends, what is in it; the flight does not notice it."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyulog import ULog

from autopilot.onboard.flight_log import FAST, MOST_WAITING, SLOW, TAIL_US, FlightLog, LogChunk
from autopilot.onboard.onboard import Onboard
from autopilot.onboard.snapshot import Options
from autopilot.services.identity import Identity
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.convert import Home
from autopilot.wire.tlog import TlogWriter
from gcs import closed_loop
from missions.fileformat import load_mission

BOOT_US = closed_loop.LOCKSTEP_BOOT_UNIX_US


class Flown:
    """A flight in one process, with what the shell would store."""

    def __init__(self, log: bool, **settings: float) -> None:
        self.chunks: list[LogChunk] = []
        built: list[Onboard] = []
        conditions = closed_loop.Conditions(sensors="ideal", seed=1, settings=settings)

        def build(conditions: Any, home: Home, mission: Any = None) -> Onboard:
            table = original(conditions, home, mission).parameters
            onboard = Onboard(table, Identity(), Options(home, BOOT_US, log=log), mission)
            receive = onboard.receive_sensors

            def receive_and_take(datagram: bytes) -> bytes | None:
                answer = receive(datagram)
                chunk = onboard.take_log(8192)
                if chunk is not None:
                    self.chunks.append(chunk)
                return answer

            onboard.receive_sensors = receive_and_take  # type: ignore[method-assign]
            built.append(onboard)
            return onboard

        original = closed_loop.build_onboard
        out = io.BytesIO()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(closed_loop, "build_onboard", build)
            self.outcome = closed_loop.fly(load_mission("hover"), conditions, TlogWriter(out))
        self.telemetry = out.getvalue()
        (self.onboard,) = built
        self.onboard.end_log()
        last = self.onboard.take_log()
        if last is not None:
            self.chunks.append(last)


@pytest.fixture(scope="module")
def flown() -> Flown:
    return Flown(True)


@pytest.fixture(scope="module")
def log(flown: Flown, tmp_path_factory: pytest.TempPathFactory) -> ULog:
    path: Path = tmp_path_factory.mktemp("log") / "flight.ulg"
    path.write_bytes(b"".join(chunk.data for chunk in flown.chunks))
    return ULog(str(path))


def test_the_flight_is_the_same_bit_for_bit(flown: Flown) -> None:
    assert flown.outcome.name == "completed"
    assert Flown(False).telemetry == flown.telemetry


def test_one_log_from_arming_to_disarming(flown: Flown, log: ULog) -> None:
    assert {chunk.path for chunk in flown.chunks} == {("log", "2026-01-01_00-00-00.ulg")}
    assert [chunk.ended for chunk in flown.chunks] == [False] * (len(flown.chunks) - 1) + [True]
    assert not log.file_corruption
    assert log.dropouts == []
    states = log.get_dataset("vehicle_status").data["arming_state"]
    assert states[0] == 2
    assert states[-1] in (1, 2)


def test_fifty_records_a_second_of_every_topic(log: ULog) -> None:
    assert {data.name for data in log.data_list} == {topic.name for topic, _ in (*FAST, *SLOW)}
    for topic, _ in FAST:
        steps = np.diff(log.get_dataset(topic.name).data["timestamp"].astype(np.int64))
        assert steps.max() <= 20_000, topic.name
        assert np.median(steps) == 20_000


def test_the_load_was_held_where_the_mission_says(log: ULog) -> None:
    """NED: up is negative. `hover` holds the load 2 m up; ideal sensors."""
    load, vehicle = log.get_dataset("load_state").data, log.get_dataset("vehicle_local_position").data
    setpoint = log.get_dataset("load_setpoint").data
    held = (setpoint["phase"] == 5) | (setpoint["phase"] == 4)
    assert np.median(load["position[2]"][held]) == pytest.approx(
        np.median(setpoint["position[2]"][held]), abs=0.02
    )
    assert np.median(load["position[2]"][held]) < -0.5
    distance = np.median(load["distance"][held])
    assert np.median((load["position[2]"] - vehicle["z"])[held]) == pytest.approx(distance, abs=0.01)
    assert np.median(load["cable[2]"][held]) == pytest.approx(1.0, abs=0.01)
    forces = sum(log.get_dataset("rotor_forces").data[f"force[{i}]"][held] for i in range(4))
    table = autopilot_parameters(load_vehicle("bebop"))
    weight = (table["VEH_QUAD_MASS"] + table["VEH_LOAD_MASS"]) * table["VEH_GRAVITY"]
    assert np.median(forces) == pytest.approx(weight, rel=0.02)
    # what does not move feels gravity upwards, which is negative in FRD
    accel = log.get_dataset("sensor_combined").data["accelerometer_m_s2[2]"][held]
    assert np.median(accel) == pytest.approx(-table["VEH_GRAVITY"], abs=0.02)


def test_parameters_and_texts_are_in_it(log: ULog, flown: Flown) -> None:
    assert log.initial_parameters.items() >= {"NGC_KX": 6.0, "LOG_RATE_HZ": 50.0}.items()
    lines = [line.message for line in log.logged_messages]
    assert any("Landed" in line for line in lines)


def test_no_log_where_none_is_wanted() -> None:
    assert Flown(True, LOG_RATE_HZ=0.0).chunks == []


def make_log() -> FlightLog:
    return FlightLog(autopilot_parameters(load_vehicle("bebop")), "0.1.0", BOOT_US)


def no_sample() -> Any:
    raise AssertionError("not due")


def test_a_second_flight_gets_a_name_of_its_own() -> None:
    log = make_log()
    with pytest.raises(AssertionError):  # due at once
        log.step(0, True, 50.0, lambda: {"2026-01-01_00-00-00.ulg", "2026-01-01_00-00-00_001.ulg"}, no_sample)
    assert log.path == ("log", "2026-01-01_00-00-00_002.ulg")


def test_texts_before_arming_begin_the_log_and_a_changed_parameter_is_in_it(
    tmp_path: Path, flown: Flown
) -> None:
    table = autopilot_parameters(load_vehicle("bebop"))
    log = FlightLog(table, "0.1.0", BOOT_US)
    sample = flown.onboard.log_sample
    log.say(10, 4, "not ready")
    log.step(1000, True, 50.0, set, sample)
    table.set("NGC_KX", 7.0)
    log.step(5000, True, 50.0, set, no_sample)
    log.step(20_000, True, 50.0, set, sample)
    log.step(30_000, False, 50.0, set, no_sample)
    log.step(30_000 + TAIL_US, False, 50.0, set, no_sample)
    chunk = log.take()
    assert chunk is not None
    assert chunk.ended
    assert log.take() is None
    path = tmp_path / "log.ulg"
    path.write_bytes(chunk.data)
    read = ULog(str(path))
    assert [line.message for line in read.logged_messages] == ["not ready"]
    assert [(name, value) for _, name, value in read.changed_parameters] == [("NGC_KX", 7.0)]
    assert read.get_dataset("load_state").data["timestamp"].tolist() == [1000, 20_000]


def test_records_that_nobody_takes_are_dropped_and_the_gap_is_told(tmp_path: Path, flown: Flown) -> None:
    log = make_log()
    sample = flown.onboard.log_sample()
    now_us = 0
    first: LogChunk | None = None
    while now_us < 200_000_000:
        log.step(now_us, True, 50.0, set, lambda: sample)
        now_us += 20_000
        if now_us == 199_000_000:
            first = log.take()
    assert first is not None
    assert len(first.data) <= MOST_WAITING
    log.end()
    rest = log.take()
    assert rest is not None
    path = tmp_path / "log.ulg"
    path.write_bytes(first.data + rest.data)
    read = ULog(str(path))
    assert not read.file_corruption
    gap_ms = sum(gap.duration for gap in read.dropouts)
    stamps = read.get_dataset("load_state").data["timestamp"].astype(np.int64)
    assert gap_ms == pytest.approx(np.diff(stamps).max() / 1000, abs=20)  # one period


def test_a_diverged_flight_is_still_logged(flown: Flown) -> None:
    sample = flown.onboard.log_sample()
    sample.snapshot.x_load, sample.snapshot.seq = (1e300, -1e300, 0.0), 70_000
    log = make_log()
    log.step(0, True, 50.0, set, lambda: sample)
    assert log.take() is not None
