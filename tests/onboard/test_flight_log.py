"""The on-board log of a flight: when it begins and ends, what is in it; it does not affect the flight."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyulog import ULog

from autopilot.estimation.records import ImuReading
from autopilot.geometry.frames import frd_from_flu, ned_from_enu, quat_ned_frd_from_enu_flu
from autopilot.geometry.packed import pack, packed, unpack, width
from autopilot.onboard.flight_log import MAX_WAITING_BYTES, TAIL_US, FlightLog, LogChunk
from autopilot.onboard.log_topics import FAST, SLOW
from autopilot.onboard.onboard import Onboard
from autopilot.onboard.snapshot import Options
from autopilot.services.identity import Identity
from autopilot.services.instant import Instant
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
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
    assert [chunk.is_last for chunk in flown.chunks] == [False] * (len(flown.chunks) - 1) + [True]
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
    # an accelerometer at rest measures gravity upwards, which is negative in FRD
    accel = log.get_dataset("sensor_combined").data["accelerometer_m_s2[2]"][held]
    assert np.median(accel) == pytest.approx(-table["VEH_GRAVITY"], abs=0.02)


def test_parameters_and_texts_are_in_it(log: ULog, flown: Flown) -> None:
    assert log.initial_parameters.items() >= {"NGC_KX": 6.0, "LOG_RATE_HZ": 50.0}.items()
    lines = [line.message for line in log.logged_messages]
    assert any("Landed" in line for line in lines)


def test_no_log_where_none_is_wanted() -> None:
    assert Flown(True, LOG_RATE_HZ=0.0).chunks == []


def make_log() -> FlightLog:
    return FlightLog(autopilot_parameters(load_vehicle("bebop")), "0.1.0", BOOT_US, Home())


def no_sample() -> Any:
    raise AssertionError("not due")


def test_a_second_flight_gets_a_name_of_its_own() -> None:
    log = make_log()
    with pytest.raises(AssertionError):  # due immediately
        log.step(0, True, lambda: {"2026-01-01_00-00-00.ulg", "2026-01-01_00-00-00_001.ulg"}, no_sample)
    assert log.path == ("log", "2026-01-01_00-00-00_002.ulg")


@pytest.mark.parametrize(
    ("wall_s", "used", "name"),
    [
        (0, {"2026-01-01_00-00-00.ulg"}, "2026-01-01_00-00-00_001.ulg"),
        (
            60,
            {"2026-01-01_00-00-00.ulg", "2027.ulg", "2027-02-02_00-00-00_mine.ulg"},
            "2026-01-01_00-01-00.ulg",
        ),
        (60, {"2026-03-04_05-06-07.ulg"}, "2026-03-04_05-06-07_001.ulg"),  # by a clock that was ahead
        (60, {"2026-03-04_05-06-07_001.ulg"}, "2026-03-04_05-06-07_002.ulg"),  # the first one was deleted
    ],
)
def test_logs_are_in_the_order_of_their_names_whatever_the_clocks(
    wall_s: int, used: set[str], name: str
) -> None:
    log = make_log()
    log.set_wall_clock(BOOT_US + wall_s * 1_000_000)
    with pytest.raises(AssertionError):  # due immediately
        log.step(500_000_000, True, lambda: used, no_sample)
    assert log.path == ("log", name)


def test_a_log_that_cannot_be_stored_is_not_begun_again_in_the_same_flight(flown: Flown) -> None:
    log, begun_us = make_log(), []
    for now_us in range(0, 20_000_000, 100_000):
        armed = not 8_000_000 <= now_us < 12_000_000
        if log.is_due(now_us, armed):
            log.step(now_us, armed, set, flown.onboard.log_sample)
        if log.path is not None:
            begun_us.append(now_us)
            log.abandon()
    assert begun_us == [0, 12_000_000]


def test_texts_before_arming_begin_the_log_and_a_changed_parameter_is_in_it(
    tmp_path: Path, flown: Flown
) -> None:
    table = autopilot_parameters(load_vehicle("bebop"))
    log = FlightLog(table, "0.1.0", BOOT_US, Home())
    sample = flown.onboard.log_sample
    log.add_text(10, 4, "not ready")
    log.step(1000, True, set, sample)
    table.set("NGC_KX", 7.0)
    log.step(5000, True, set, no_sample)
    log.step(20_000, True, set, sample)
    log.step(30_000, False, set, no_sample)
    log.step(30_000 + TAIL_US, False, set, no_sample)
    chunk = log.take_chunk()
    assert chunk is not None
    assert chunk.is_last
    assert log.take_chunk() is None
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
        log.step(now_us, True, set, lambda: sample)
        now_us += 20_000
        if now_us == 199_000_000:
            first = log.take_chunk()
    assert first is not None
    assert len(first.data) <= MAX_WAITING_BYTES
    log.end()
    rest = log.take_chunk()
    assert rest is not None
    path = tmp_path / "log.ulg"
    path.write_bytes(first.data + rest.data)
    read = ULog(str(path))
    assert not read.file_corruption
    gap_ms = sum(gap.duration for gap in read.dropouts)
    stamps = read.get_dataset("load_state").data["timestamp"].astype(np.int64)
    assert gap_ms == pytest.approx(np.diff(stamps).max() / 1000, abs=20)  # one period


def test_a_diverged_flight_is_still_logged(flown: Flown, tmp_path: Path) -> None:
    sample = flown.onboard.log_sample()
    instant = unpack(Instant, sample.instant, 0)
    pack(instant._replace(x_load=(1e300, -1e300, 0.0), seq=70_000), sample.instant, 0)
    log = make_log()
    log.step(0, True, set, lambda: sample)
    chunk = log.take_chunk()
    assert chunk is not None
    path = tmp_path / "log.ulg"
    path.write_bytes(chunk.data)
    position = ULog(str(path)).get_dataset("load_state").data
    most = np.finfo(np.float32).max
    assert (position["position[0]"][0], position["position[1]"][0]) == (-most, most)


def test_a_record_has_what_the_moment_says(flown: Flown, tmp_path: Path) -> None:
    """All numbers of an instant differ, so that none can stand in another's place."""
    sample = flown.onboard.log_sample()
    rng = np.random.default_rng(3)
    row = np.zeros(width(Instant))
    row[:] = rng.normal(size=len(row))
    numbers = {"seq": 9, "phase": 5, "control_mode": 2, "saturated": 3, "rotors": 6}
    height_only = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_POS_VERT_ABS
    pack(unpack(Instant, row, 0)._replace(**numbers, estimator_flags=height_only), row, 0)
    said, imu = unpack(Instant, row, 0), packed(ImuReading((0.1, 0.2, 0.3), (1.0, 2.0, 3.0)))
    log = make_log()
    log.step(7, True, set, lambda: sample._replace(instant=row, imu=imu, imu_is_sane=True))
    log.step(20_000, True, set, lambda: sample._replace(instant=row, imu=imu, imu_is_sane=False))
    path = tmp_path / "log.ulg"
    path.write_bytes(log.take_chunk().data)  # type: ignore[union-attr]
    read = ULog(str(path))

    def logged(topic: str, *names: str) -> tuple[float, ...]:
        data = read.get_dataset(topic).data
        return tuple(float(data[name][0]) for name in names)

    def vector(topic: str, name: str, count: int = 3) -> tuple[float, ...]:
        return logged(topic, *(f"{name}[{i}]" for i in range(count)))

    def float32(numbers: Any) -> tuple[float, ...]:
        return tuple(float(np.float32(number)) for number in numbers)

    assert logged("vehicle_local_position", "x", "y", "z") == float32(ned_from_enu(said.x_quad))
    assert logged("vehicle_local_position", "vx", "vy", "vz") == float32(ned_from_enu(said.v_quad))
    assert logged("vehicle_local_position", "ax", "ay", "az") == float32(ned_from_enu(said.accel_quad))
    assert logged("vehicle_local_position", "ref_lat", "ref_lon") == Home()[:2]
    assert logged("vehicle_local_position", "eph", "epv") == float32((said.horizontal_std, said.vertical_std))
    assert logged("vehicle_local_position", "xy_valid", "v_xy_valid", "xy_global") == (0.0, 0.0, 0.0)
    assert logged("vehicle_local_position", "z_valid", "v_z_valid", "z_global") == (1.0, 1.0, 1.0)
    assert vector("vehicle_attitude", "q", 4) == float32(quat_ned_frd_from_enu_flu(said.quat_wxyz))
    assert vector("vehicle_attitude_setpoint", "q_d", 4) == float32(
        quat_ned_frd_from_enu_flu(said.quat_c_wxyz)
    )
    assert vector("vehicle_angular_velocity", "xyz") == float32(frd_from_flu(said.omega_body))
    assert vector("sensor_combined", "gyro_rad") == float32((0.1, -0.2, -0.3))
    assert vector("sensor_combined", "accelerometer_m_s2") == (1.0, -2.0, -3.0)
    assert len(read.get_dataset("sensor_combined").data["timestamp"]) == 1  # one was not sane
    most = said.rotor_max if said.rotor_max > 0.0 else 1.0
    shares = [min(max(force / most, 0.0), 1.0) for force in said.forces[:6]]
    assert vector("actuator_motors", "control", 6) == float32(shares)
    assert np.isnan(vector("actuator_motors", "control", 14)[6:]).all()  # rotors that do not exist
    assert logged("actuator_outputs", "noutputs") == (6.0,)
    assert vector("actuator_outputs", "output", 16) == float32(
        (*(1000.0 + 1000.0 * one for one in shares), *(0.0,) * 10)
    )
    for name, field in {
        "position": said.x_load_d,
        "velocity": said.v_load_d,
        "acceleration": said.a_load_d,
        "position_asked": said.x_load_requested,
        "velocity_asked": said.v_load_requested,
        "cable": said.q_cable_c,
    }.items():
        assert vector("load_setpoint", name) == float32(ned_from_enu(field))
    assert logged("load_setpoint", "item", "phase", "control_mode") == (9.0, 5.0, 2.0)
    assert logged("load_setpoint", "elapsed", "duration") == float32((said.elapsed_s, said.duration_s))
    for name, field in {
        "position": said.x_load,
        "velocity": said.v_load,
        "cable": said.q_cable,
        "cable_rate": said.q_cable_dot,
    }.items():
        assert vector("load_state", name) == float32(ned_from_enu(field))
    assert logged("load_state", "distance", "tension") == float32((said.distance, said.tension))
    for name in ("e_x", "e_v", "e_q", "e_q_dot"):
        assert vector("cascade_errors", name) == float32(ned_from_enu(getattr(said, name)))
    assert vector("cascade_errors", "e_omega") == float32(frd_from_flu(said.e_Omega))
    assert vector("cascade_errors", "moment") == float32(frd_from_flu(said.moment))
    assert vector("rotor_forces", "force", 14) == float32(said.forces)
    assert logged("rotor_forces", "force_min", "force_max", "saturated") == float32(
        (said.rotor_min, said.rotor_max, 3.0)
    )
