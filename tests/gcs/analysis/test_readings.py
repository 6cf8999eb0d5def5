"""Tables of the readings: what the autopilot received, beside the state of the world."""

from __future__ import annotations

import json
import re
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from pyulog import ULog
from scipy.spatial.transform import Rotation

import plumbline
from autopilot.geometry.frames import frd_from_flu, ned_from_enu, quat_ned_frd_from_enu_flu
from autopilot.own.own_code import OwnCode
from autopilot.wire.tlog import TlogWriter
from gcs import closed_loop
from gcs.analysis.readings import Readings, readings_of
from gcs.cli import gcs
from gcs.closed_loop import Conditions
from missions.model import Land, Mission, Takeoff, Waypoint
from plumbline.estimators import Estimate, Sensed, estimated
from sitl.hil import HilSimulator
from sitl.sensor_log import COLUMNS, Instant, SensorLog
from tests.gcs.test_closed_ticks import Frames
from tests.gcs.tolerances import ROUNDING, WIRE_M

SHORT = Mission("short", "Short", "", (), (Takeoff(0.4), Waypoint(0.0, 0.0, 0.4, hold_s=0.5), Land()))
# HIL_GPS: degrees and centimetres
FIX_M = 0.012
FIX_M_S = 0.0051
SINGLE = 6e-8  # relative resolution of a float32
HEARD: list[Sensed] = []


class Listens:
    """The estimate of the built-in filter; keeps what the autopilot passes to an estimator."""

    def estimate(self, memory: Any, now: Sensed) -> tuple[Any, Estimate]:
        HEARD.append(now)
        return memory, estimated(*now.built_in)


def flown(conditions: Conditions, **how: Any) -> tuple[Readings, Frames]:
    log, frames = BytesIO(), Frames()
    outcome = closed_loop.fly(SHORT, conditions, frames, log_sensors=log.write, **how)
    assert outcome.name == "completed", outcome
    return readings_of(log.getvalue(), 1e6), frames


def columns(readings: Readings, table: str, *names: str) -> Any:
    """Columns of a table, side by side; NaN for null."""
    found = [readings.tables[table][name].to_numpy() for name in names]
    return np.stack(found, axis=-1) if len(found) > 1 else found[0]


def axes(name: str, unit: str = "") -> list[str]:
    return ["_".join(filter(None, (name, axis, unit))) for axis in "xyz"]


@pytest.mark.parametrize("sensors", ["lab-real", "field"])
def test_the_readings_are_those_that_the_autopilot_receives(sensors: str) -> None:
    HEARD.clear()
    readings, _ = flown(Conditions(sensors=sensors, own=OwnCode(estimator=f"{__name__}:Listens")))
    heard = {round(now.time_s * 1e6): now for now in HEARD}
    assert len(heard) > 2000

    def received(table: str, sensor: str, *names: str) -> tuple[Any, Any]:
        """The rows of the table, and what the estimator was given at the ticks at which they arrived."""
        ticks = np.rint(columns(readings, table, "time_s") * 1e6).astype(int)
        last = np.append(ticks[1:] != ticks[:-1], True)  # of two at one tick, the estimator gets the later
        kept = last & np.isin(ticks, list(heard))
        given = [getattr(heard[tick], sensor) for tick in ticks[kept].tolist()]
        assert len(given) > 20
        assert all(one.new for one in given if sensor != "inertial")
        if table in ("mocap", "load_tracker", "cable_sensor", "gnss"):
            stamps = columns(readings, table, "measured_s")[kept]
            assert np.allclose(stamps, [one.time_s for one in given], rtol=0.0, atol=ROUNDING * 1e3)
        rows = columns(readings, table, *names)[kept]
        return rows, given

    rows, given = received("imu", "inertial", *axes("gyro", "rad_s"), *axes("accel", "m_s2"))
    assert np.array_equal(rows, [[*one.gyro, *one.accel] for one in given])
    if sensors == "lab-real":
        rows, given = received("mocap", "pose", *axes("", "m"), "position_std_m", "attitude_std_rad")
        assert np.array_equal(rows, [[*one.x_quad, one.position_std, one.attitude_std] for one in given])
        rows, given = received("load_tracker", "load", *axes("", "m"), "position_std_m")
        assert np.array_equal(rows, [[*one.x_load, one.position_std] for one in given])
    else:
        rows, given = received("cable_sensor", "direction", *axes("direction"), "direction_std_rad")
        # which the autopilot brings back to unit length
        stated = [[*one.direction_body, one.direction_std] for one in given]
        assert np.allclose(rows, stated, rtol=0.0, atol=SINGLE)
        rows, given = received("gnss", "fix", *axes("", "m"), *axes("velocity", "m_s"), "vertical_std_m")
        assert np.array_equal(rows, [[*one.position, *one.velocity, one.vertical_std] for one in given])
        rows, given = received("barometer", "height", "altitude_m")
        assert np.array_equal(rows, [one.height for one in given])
        rows, given = received("magnetometer", "field", *axes("field", "gauss"))
        assert np.array_equal(rows, [one.field_body for one in given])


@pytest.mark.parametrize(
    "conditions",
    [
        Conditions(sensors="field", seed=2),
        Conditions("hexarotor", "lab", 3, {"SIM_RATE_HZ": 500.0, "SIM_CBL_LINKS": 3.0}),
    ],
    ids=["field", "six rotors at 500 Hz"],
)
def test_ticks_without_python_are_logged_as_those_with_it_and_flown_as_without_a_log(
    conditions: Conditions,
) -> None:
    fast, frames = flown(conditions)
    slow, _ = flown(conditions, watch=lambda *_: True)
    end_s = slow.tables["truth"]["time_s"][-1].as_py()  # that of the end of the flight
    assert fast.calibration == slow.calibration
    for name, table in slow.tables.items():
        same = fast.tables[name].slice(0, len(table))
        assert same.equals(table), name
        assert columns(fast, name, "time_s")[len(table) :].min(initial=np.inf) > end_s
    unlogged = Frames()
    closed_loop.fly(SHORT, conditions, unlogged)
    assert unlogged.written == frames.written


def test_the_truth_is_that_of_the_telemetry() -> None:
    flight = plumbline.fly(SHORT, sensors="lab", settings={"SIM_WIND_E": 2.0}, log_sensors=True)
    telemetry, truth = flight.telemetry("arrow"), flight.readings("truth", "arrow")
    ticks = np.searchsorted(truth["time_s"].to_numpy(), telemetry["time_s"].to_numpy() - 1e-9)
    same = [name for name in telemetry.column_names if name in truth.column_names]
    assert len(same) > 35
    sent, there = ({name: table[name].to_numpy() for name in same} for table in (telemetry, truth))
    quaternions = [name for name in same if name.startswith("vehicle_quaternion")]
    cosines = sum(sent[name] * there[name][ticks] for name in quaternions)
    assert np.abs(cosines) == pytest.approx(1.0, abs=1e-6)  # the same attitude may have either sign
    for name in set(same) - set(quaternions):
        # HIL_STATE_QUATERNION has whole centimetres per second
        tolerance = 0.0051 if name.startswith("vehicle_velocity") else WIRE_M
        values, expected = sent[name].astype(float), there[name][ticks].astype(float)
        known = ~np.isnan(values)
        known[-1] &= not name.startswith("rotor_command")  # the last tick was not answered
        assert np.allclose(values[known], expected[known], rtol=1e-6, atol=tolerance), name
    assert truth["time_s"][-1] == telemetry["time_s"][-1]


def at(readings: Readings, time_s: Any, *names: str) -> Any:
    """Columns of the truth at times that are ticks."""
    ticks = np.searchsorted(columns(readings, "truth", "time_s"), time_s - 1e-9)
    return columns(readings, "truth", *names)[ticks]


def test_a_sensor_without_noise_shows_the_truth_at_the_time_of_its_measurement() -> None:
    quiet = {"SIM_NOISE_SCALE": 0.0, "SIM_SENS_LAT_MS": 4.0}
    outdoors, _ = flown(Conditions(sensors="rtk", settings=quiet))
    for table, names, true, error in (
        ("imu", axes("gyro", "rad_s"), axes("vehicle_rate", "rad_s"), SINGLE),
        ("barometer", ["altitude_m"], ["vehicle_true_z_m"], SINGLE),
        ("gnss", axes("", "m"), axes("vehicle_true", "m"), FIX_M),
        ("gnss", axes("velocity", "m_s"), axes("vehicle_velocity_true", "m_s"), FIX_M_S),
    ):
        measured_s = columns(outdoors, table, "measured_s")
        assert np.allclose(
            columns(outdoors, table, *names), at(outdoors, measured_s, *true), rtol=SINGLE, atol=error
        ), table
        delay_s = columns(outdoors, table, "time_s") - measured_s
        latency_s = outdoors.calibration["sensors"][table]["latency_ms"] * 1e-3
        assert (delay_s[5:] >= latency_s - 1e-9).all() and (delay_s[5:] < latency_s + 0.004).all(), table
    q = at(
        outdoors,
        columns(outdoors, "magnetometer", "measured_s"),
        *(f"vehicle_quaternion_{i}" for i in "wxyz"),
    )
    field = columns(outdoors, "magnetometer", *axes("field", "gauss"))
    north_up = np.array(outdoors.calibration["sensors"]["magnetometer"]["field_east_north_up_gauss"])
    assert np.allclose(
        field + 2 * np.cross(q[:, 1:], np.cross(q[:, 1:], field) + q[:, :1] * field), north_up, atol=1e-6
    )
    indoors, _ = flown(Conditions(sensors="lab", settings=quiet))
    stamps = columns(indoors, "load_tracker", "measured_s")
    on_tick = np.isclose(np.rint(stamps / 0.004) * 0.004, stamps, rtol=0.0, atol=1e-9)
    assert on_tick.sum() > 300
    seen, there = (
        columns(indoors, "load_tracker", *axes("", "m")),
        at(indoors, stamps, *axes("load_true", "m")),
    )
    assert np.allclose(seen[on_tick], there[on_tick], rtol=SINGLE, atol=SINGLE)


def test_the_biases_are_those_that_the_readings_contain() -> None:
    noisy, _ = flown(Conditions(sensors="rtk", settings={"SIM_GYR_NOISE": 0.0, "SIM_ACC_NOISE": 0.0}))
    measured = columns(noisy, "imu", *axes("gyro", "rad_s"))
    there, bias = (
        columns(noisy, "truth", *axes(name, "rad_s")) for name in ("vehicle_rate", "imu_gyro_bias")
    )
    assert np.abs(bias).min() > 1e-5
    assert np.allclose(measured[1:], there[1:] + bias[:-1], rtol=0.0, atol=SINGLE)


def test_the_calibration_tells_how_the_inertial_unit_measures_the_truth() -> None:
    places = {"SIM_IMU_POS_X": 0.02, "SIM_IMU_POS_Z": 0.03, "SIM_GPS_POS_Z": 0.1}
    misaligned = {"SIM_ACC_SCALE_Z": 1.0, "SIM_ACC_ALIGN_X": 0.5, "SIM_GYR_SCALE_Y": -1.0}
    readings, _ = flown(Conditions(sensors="rtk", settings={"SIM_NOISE_SCALE": 0.0, **places, **misaligned}))
    known = readings.calibration
    unit, arm = known["sensors"]["imu"], np.array(known["sensors"]["imu"]["lever_arm_m"])
    assert (arm.tolist(), known["sensors"]["gnss"]["lever_arm_m"]) == ([0.02, 0.0, 0.03], [0.0, 0.0, 0.1])
    assert known["sensors"]["barometer"]["lever_arm_m"] == [0.0, 0.0, 0.0]
    rate, change, accel, quat = (
        columns(readings, "truth", *names)
        for names in (
            axes("vehicle_rate", "rad_s"),
            axes("vehicle_angular_acceleration", "rad_s2"),
            axes("vehicle_acceleration", "m_s2"),
            [f"vehicle_quaternion_{part}" for part in "wxyz"],
        )
    )
    attitude = Rotation.from_quat(quat, scalar_first=True)
    force = attitude.inv().apply(accel + np.array([0.0, 0.0, known["gravity_m_s2"]]))
    force += np.cross(change, arm) + np.cross(rate, np.cross(rate, arm))
    for name, unit_name, true in (("accel", "m_s2", force), ("gyro", "rad_s", rate)):
        expected = true @ np.array(unit[f"{name}_axes"]).T
        measured = columns(readings, "imu", *axes(name, unit_name))
        assert np.allclose(measured[1:], expected[1:], rtol=SINGLE, atol=SINGLE)
        assert np.abs(true - expected).max() > 1e-3


@pytest.mark.parametrize("sensors", ["lab", "rtk"])
def test_the_ulog_has_the_readings_in_the_axes_of_px4(sensors: str, tmp_path: Path) -> None:
    readings, _ = flown(Conditions(sensors=sensors))
    (tmp_path / "sensors.ulg").write_bytes(readings.ulog)
    log = ULog(str(tmp_path / "sensors.ulg"))
    assert not log.file_corruption

    def same(topic: str, field: str, table: str, names: list[str], turned: Any) -> None:
        data, rows = log.get_dataset(topic).data, columns(readings, table, *names)
        logged = np.stack([data[f"{field}[{i}]"] for i in range(len(names))], axis=-1)
        times = columns(readings, table, "time_s")
        assert np.array_equal(data["timestamp"], np.rint(times * 1e6).astype(int)), topic
        if "timestamp_sample" in data:
            measured = columns(readings, table, "measured_s")
            assert np.array_equal(data["timestamp_sample"], np.rint(measured * 1e6).astype(int)), topic
        assert np.allclose(logged, [turned(tuple(row)) for row in rows], rtol=SINGLE, atol=SINGLE), topic

    quaternion = [f"vehicle_quaternion_{part}" for part in "wxyz"]
    same("sensor_combined", "gyro_rad", "imu", axes("gyro", "rad_s"), frd_from_flu)
    same("sensor_combined", "accelerometer_m_s2", "imu", axes("accel", "m_s2"), frd_from_flu)
    same("vehicle_attitude_groundtruth", "q", "truth", quaternion, quat_ned_frd_from_enu_flu)
    same("load_state_groundtruth", "cable", "truth", axes("cable_true"), ned_from_enu)
    place = log.get_dataset("vehicle_local_position_groundtruth").data
    assert np.allclose(-place["z"], columns(readings, "truth", "vehicle_true_z_m"), rtol=SINGLE, atol=SINGLE)
    if sensors == "lab":
        same("vehicle_mocap_odometry", "position", "mocap", axes("", "m"), ned_from_enu)
        same("load_position", "position", "load_tracker", axes("", "m"), ned_from_enu)
        deviation = log.get_dataset("vehicle_mocap_odometry").data["orientation_variance[2]"] ** 0.5
        assert np.allclose(deviation, columns(readings, "mocap", "attitude_std_rad"))
        return
    same("vehicle_magnetometer", "magnetometer_ga", "magnetometer", axes("field", "gauss"), frd_from_flu)
    same("load_direction", "direction", "cable_sensor", axes("direction"), frd_from_flu)
    fix = log.get_dataset("sensor_gps").data
    assert np.array_equal(fix["latitude_deg"], columns(readings, "gnss", "latitude_deg"))
    assert np.allclose(fix["vel_n_m_s"], columns(readings, "gnss", "velocity_y_m_s"))
    assert set(fix["fix_type"]) == {6}
    pressure = log.get_dataset("sensor_baro").data["pressure"]
    assert np.allclose(pressure, columns(readings, "barometer", "pressure_pa"), rtol=SINGLE)


def test_a_log_that_is_cut_off_or_restarted_is_read() -> None:
    log = BytesIO()
    simulator = HilSimulator.build(sensors="rtk", log=SensorLog(log.write))
    for _ in range(30):
        simulator.advance()
    whole = readings_of(log.getvalue(), 1.0)
    assert columns(whole, "truth", "time_s") == pytest.approx(0.004 * np.arange(31))
    cut = readings_of(log.getvalue()[:-1], 1.0)
    assert cut.tables["imu"].equals(whole.tables["imu"].slice(0, 30))
    assert len(readings_of(log.getvalue(), 0.04).tables["truth"]) == 11
    assert len(readings_of(log.getvalue(), -1.0).tables["imu"]) == 0
    simulator.restart()
    simulator.advance()
    again = readings_of(log.getvalue(), 1.0)
    assert again.tables["imu"].equals(whole.tables["imu"].slice(0, 2))


@pytest.mark.parametrize("sensors", ["lab", "rtk"])
def test_every_column_is_described(sensors: str) -> None:
    page = (Path(__file__).parents[3] / "docs" / "sensors.md").read_text(encoding="utf-8")
    log = BytesIO()
    HilSimulator.build(sensors=sensors, log=SensorLog(log.write))
    for table in readings_of(log.getvalue(), 1.0).tables.values():
        for name in table.column_names:
            first = re.sub(r"(?<![a-z])[yz](?=_|$)", "x", re.sub(r"rotor(.*)_\d_", r"rotor\1_1_", name))
            assert f"`{first.replace('quaternion_x', 'quaternion_w')}`" in page, name


def test_the_log_names_each_number_of_a_tick() -> None:
    assert len(COLUMNS) == len(set(COLUMNS))
    assert json.loads(logged_header())["columns"] == list(COLUMNS)
    assert Instant._fields[0] == "now_us" and COLUMNS[0] == "time_us"


def logged_header() -> bytes:
    log = BytesIO()
    HilSimulator.build(vehicle="octorotor", sensors="ideal", log=SensorLog(log.write))
    return log.getvalue().partition(b"\n")[0]


def test_a_report_makes_tables_of_the_log_of_a_simulator_that_ran_by_itself(tmp_path: Path) -> None:
    log, frames = BytesIO(), Frames()
    closed_loop.fly(SHORT, Conditions(), frames, log_sensors=log.write)
    with (tmp_path / "flight.tlog").open("wb") as file:
        for unix_us, frame in frames.written:
            TlogWriter(file).write(unix_us, frame)
    (tmp_path / "sensors.log").write_bytes(log.getvalue())
    assert CliRunner().invoke(gcs, ["report", str(tmp_path), "--quiet"]).exit_code == 0
    assert not (tmp_path / "sensors.log").exists()
    flight = plumbline.Flight.load(tmp_path)
    assert flight.readings("truth", "arrow")["time_s"][-1] == flight.telemetry("arrow")["time_s"][-1]


def test_tables_are_written_read_and_replaced(tmp_path: Path) -> None:
    flight = plumbline.fly(SHORT, sensors="lab", log_sensors=True)
    flight.report(tmp_path)
    again = plumbline.Flight.load(tmp_path)
    assert again.readings("imu").equals(flight.readings("imu"))
    assert again.calibration == flight.calibration
    again.report(tmp_path / "copy")
    assert (tmp_path / "copy" / "sensors" / "imu.parquet").read_bytes() == (
        tmp_path / "sensors" / "imu.parquet"
    ).read_bytes()
    other = plumbline.fly(SHORT, sensors="lab", seed=2)
    other.report(tmp_path, overwrite=True)
    assert not (tmp_path / "sensors").exists()
    with pytest.raises(plumbline.Error, match="were not kept; fly it with log_sensors=True"):
        other.readings("imu")
    with pytest.raises(plumbline.Error, match="did you mean imu"):
        flight.readings("imo")
