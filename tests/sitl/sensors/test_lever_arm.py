"""Inertial unit and antenna away from the centre of mass, compared with the motion of their points, which is
differentiated numerically; errors of the inertial unit's axes."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, inf, radians, sin

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.wire.parameter_table import ParameterError
from sitl.plant.records import PlantState
from sitl.plant.step import initial_state
from sitl.sensors import gnss, imu
from sitl.sensors.files import load_profile
from sitl.sensors.noise import Drift, Noise
from sitl.settings import settings_of
from sitl.vehicles.sim_parameters import apply, sim_parameters
from sitl.vehicles.truth import load_truth
from sitl.world import model_of
from tests.doubles.motion import GRAVITY, Motion

NONE = Drift(0.0, 1.0, 0.0)
IMU = imu.ImuConfig(0.0, NONE, inf, 0.0, NONE, inf, GRAVITY)
GNSS = gnss.GnssConfig(ZERO, ZERO, ZERO, NONE, ZERO, NONE, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1)
SILENT = Noise(1, 1, 0, 0.0)
ARM: Vec3 = (0.05, -0.12, 0.2)  # m; far from the centre, so that an error of a single term shows
# derivatives from five points: truncation is 1e-9 of motions below 1 Hz, and rounding 1e-10
STENCIL = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
FIRST, SECOND = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0, np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
STEP_S = 2e-3
DIFFERENTIATED = 1e-6
UPWARD = np.array([0.0, 0.0, GRAVITY])
ROUNDING = 1e-12  # a few hundred roundings of numbers of order 10

Array = NDArray[np.float64]


def points(motion: Motion, t: float, arm: Vec3) -> Array:
    """(5, 3) where the point is about the time t."""
    times = t + STEP_S * STENCIL
    return np.asarray(motion.x_quad(times) + motion.attitude(times).apply(arm))


def plant_state(motion: Motion, t: float) -> PlantState:
    """The vehicle of `motion` at t; its rotation is that of five attitudes."""
    matrices = motion.attitude(t + STEP_S * STENCIL).as_matrix()
    R = matrices[2]
    R_dot, R_ddot = np.tensordot(FIRST, matrices, 1) / STEP_S, np.tensordot(SECOND, matrices, 1) / STEP_S**2
    rate, change = R.T @ R_dot, R.T @ R_ddot + R_dot.T @ R_dot

    def vector(skew: Array) -> Vec3:
        return (float(skew[2, 1]), float(skew[0, 2]), float(skew[1, 0]))

    quat = Rotation.from_matrix(R).as_quat(scalar_first=True)
    return initial_state(load_truth("bebop"))._replace(
        x_quad=tuple(motion.x_quad(t).tolist()),
        v_quad=tuple(motion.x_quad(t, 1).tolist()),
        accel_quad=tuple(motion.x_quad(t, 2).tolist()),
        quat_wxyz=tuple(quat.tolist()),
        omega_body=vector(rate),
        omega_dot_body=vector(change),
    )


@pytest.mark.parametrize("t", [0.3, 1.1, 2.9])
def test_what_is_measured_is_the_motion_of_the_point(t: float) -> None:
    motion = Motion(4.0)
    state, places = plant_state(motion, t), points(motion, t, ARM)
    config = IMU._replace(position=ARM)
    reading, _ = imu.sample(state, imu.start(config, SILENT), config, SILENT)
    accel = SECOND @ places / STEP_S**2
    expected = motion.attitude(t).inv().apply(accel + UPWARD)[0]
    assert reading.accel_body == pytest.approx(expected, abs=DIFFERENTIATED)
    assert reading.gyro_body == state.omega_body
    here = motion.attitude(t).inv().apply(state.accel_quad + UPWARD)[0]
    assert np.linalg.norm(expected - here) > 0.05, "the rotation is meant to show"
    antenna = GNSS._replace(antenna=ARM)
    fix, _ = gnss.sample(state, gnss.start(antenna, SILENT), antenna, SILENT)
    assert fix.position == pytest.approx(places[2], abs=DIFFERENTIATED)
    assert fix.velocity == pytest.approx(FIRST @ places / STEP_S, abs=DIFFERENTIATED)


@pytest.mark.parametrize(("links", "tolerance"), [(0, 1e-4), (3, 0.02)])
def test_the_plant_says_how_its_rotation_changes(
    core: Callable[..., object], links: int, tolerance: float
) -> None:
    """Rotors, drag and the pull of a cable beside the centre of mass turn the vehicle. What its inertial unit
    measures is the motion of the unit's point through five ticks. An implicit step of the cable of links is
    exact to the first order only."""
    places = {"SIM_ATT_X": 0.02, "SIM_ATT_Y": -0.01, "SIM_ATT_Z": -0.05}
    places |= {f"SIM_IMU_POS_{axis}": value for axis, value in zip("XYZ", ARM, strict=True)}
    flown = core(vehicle="bebop", SIM_RATE_HZ=1000, SIM_CBL_LINKS=links, **places)
    truth = flown.truth
    flown.state = initial_state(truth)._replace(
        x_quad=(0.0, 0.0, 50.0),
        x_load=(*truth.attachment[:2], 50.0 + truth.attachment[2] - truth.cable_length),
        q_cable=(0.0, 0.0, -1.0),
        taut=1.0,
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
    )
    states, readings = [], []
    for _ in range(200):
        readings.append(flown.tick((1.40, 1.42, 1.38, 1.41)).imu[0].reading)
        states.append(flown.state)
    points = [np.array(s.x_quad) + turned(s).apply(ARM) for s in states]
    shown = []
    for k in range(100, 190, 10):
        accel = SECOND @ points[k - 2 : k + 3] / 1e-6
        expected = turned(states[k]).inv().apply(accel + UPWARD)
        assert readings[k].accel_body == pytest.approx(expected, abs=tolerance)
        centre = turned(states[k]).inv().apply(states[k].accel_quad + UPWARD)
        shown.append(np.linalg.norm(expected - centre))
    assert min(shown) > 10.0 * tolerance, "the rotation is meant to show"


def turned(state: PlantState) -> Rotation:
    return Rotation.from_quat(state.quat_wxyz, scalar_first=True)


def test_scale_and_alignment_of_the_axes() -> None:
    """Each sensor measures the components along its own axes, each of them on its own scale."""
    settings = {
        "SIM_ACC_SCALE": (1.0, -2.0, 3.0),
        "SIM_ACC_ALIGN": (2.0, -1.0, 3.0),
        "SIM_GYR_SCALE": (-1.0, 0.5, 2.0),
        "SIM_GYR_ALIGN": (-2.0, 4.0, 1.0),
    }
    truth = load_truth("bebop")
    table = sim_parameters(truth)
    for name, values in settings.items():
        for axis, value in zip("XYZ", values, strict=True):
            table.set(f"{name}_{axis}", value)
    config = model_of(truth, load_profile("ideal"), settings_of(table), -1).imu
    state = plant_state(Motion(2.0), 1.1)
    reading, _ = imu.sample(state, imu.start(config, SILENT), config, SILENT)
    plain, _ = imu.sample(state, imu.start(IMU, SILENT), IMU, SILENT)
    for kind, measured, true in (
        ("ACC", reading.accel_body, plain.accel_body),
        ("GYR", reading.gyro_body, plain.gyro_body),
    ):
        scale = 1.0 + np.array(settings[f"SIM_{kind}_SCALE"]) / 100.0
        mounting = Rotation.from_rotvec(settings[f"SIM_{kind}_ALIGN"], degrees=True)
        assert measured == pytest.approx(scale * mounting.inv().apply(true), abs=ROUNDING)
    # bias and noise are those of the reading
    biased, _ = imu.sample(state, imu.ImuState((0.1, 0.2, 0.3), ZERO), config, SILENT)
    assert np.subtract(biased.accel_body, reading.accel_body) == pytest.approx((0.1, 0.2, 0.3), abs=ROUNDING)


def test_a_sensor_that_is_turned_about_the_forward_axis_sees_a_level_vehicle_lean() -> None:
    """Turned by a positive angle, its left axis points up: at rest it measures a part of the weight."""
    axes = imu.sensor_axes(ZERO, (radians(1.0), 0.0, 0.0))
    assert np.array(axes) @ (0.0, 0.0, 1.0) == pytest.approx((0.0, sin(radians(1.0)), cos(radians(1.0))))


def test_without_offsets_and_errors_readings_keep_their_bits() -> None:
    truth = load_truth("bebop")
    model = model_of(truth, load_profile("rtk"), settings_of(sim_parameters(truth)), -1)
    assert (model.imu.position, model.imu.calibrated, model.gnss.antenna) == (ZERO, 1.0, ZERO)
    state = plant_state(Motion(2.0), 0.7)
    reading, _ = imu.sample(state, imu.start(IMU, SILENT), IMU, SILENT)
    turning, _ = imu.sample(
        state._replace(omega_dot_body=(9.0, 9.0, 9.0)), imu.start(IMU, SILENT), IMU, SILENT
    )
    assert reading == turning


@pytest.mark.parametrize("name", ["SIM_IMU_POS_X", "SIM_GPS_POS_Z", "SIM_ACC_SCALE_Y", "SIM_GYR_ALIGN_Z"])
def test_values_out_of_range_are_refused(name: str) -> None:
    table = sim_parameters(load_truth("bebop"))
    for value in (1.01 * table.describe(name).high, 1.01 * table.describe(name).low, float("nan")):
        with pytest.raises(ParameterError, match=name):
            table.set(name, value)


def test_places_of_sensors_reach_the_model() -> None:
    truth = load_truth("bebop")
    table = sim_parameters(truth)
    for name, place in (("IMU", (0.1, -0.2, 0.3)), ("GPS", (-0.4, 0.5, 0.6))):
        for axis, value in zip("XYZ", place, strict=True):
            table.set(f"SIM_{name}_POS_{axis}", value)
    model = model_of(apply(truth, table), load_profile("rtk"), settings_of(table), -1)
    assert (model.imu.position, model.gnss.antenna) == ((0.1, -0.2, 0.3), (-0.4, 0.5, 0.6))
