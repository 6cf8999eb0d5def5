"""Each sensor without noise against SciPy, and with noise against the deviations of its configuration."""

from __future__ import annotations

from math import cos, inf, nan, radians, sin

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sitl.plant.step import initial_state
from sitl.sensors import (
    barometer,
    cable_sensor,
    gnss,
    imu,
    load_tracker,
    magnetometer,
    pose_tracker,
)
from sitl.sensors.noise import Drift, Noise
from sitl.sensors.room import Room
from sitl.vehicles.truth import load_truth

NONE = Drift(0.0, 1.0, 0.0)
UNDISTORTED = Room(0.0, 1.0)
NOT = (0.0, 0.0, 0.0)
GNSS = gnss.GnssConfig(NOT, NOT, NOT, NONE, NOT, NONE, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1)
SILENT = Noise(1, 1, 0, 0.0)
DRAWS = 4000
SIGMAS = 4.0  # suspicious distance of a statistic from its expectation, in its own standard errors
ROUNDING = 1e-12  # a few hundred roundings of numbers of order 10

TURN = Rotation.from_rotvec([0.4, -0.7, 1.1])
X, Y, Z, W = TURN.as_quat()
STATE = initial_state(load_truth("bebop"))._replace(
    x_quad=(1.0, -2.0, 3.0),
    v_quad=(0.4, 0.5, -0.6),
    quat_wxyz=(float(W), float(X), float(Y), float(Z)),
    omega_body=(0.1, -0.2, 0.3),
    accel_quad=(0.7, -1.3, 2.2),
    x_load=(1.2, -2.1, 2.4),
    v_load=(-0.3, 0.2, 0.1),
    taut=1.0,
)
CABLE = np.subtract(STATE.x_load, STATE.x_quad)
DIRECTION = TURN.inv().apply(CABLE / np.linalg.norm(CABLE))


def readings(sensor, config, count: int = DRAWS):
    """Readings of one noise stream, the state carried along."""
    state = sensor.start(config, Noise(7, 1, 0, 1.0))
    out = []
    for step in range(count):
        reading, state = sensor.sample(STATE, state, config, Noise(7, 1, step, 1.0))
        out.append(reading)
    return out


def silent(sensor, config):
    return sensor.sample(STATE, sensor.start(config, SILENT), config, SILENT)[0]


def assert_white(samples: np.ndarray, mean, std) -> None:
    """Independent normal samples about `mean` with `std`, per axis."""
    samples = np.atleast_2d(samples.T).T
    std = np.broadcast_to(std, samples.shape[1:])
    assert np.all(np.abs(samples.mean(0) - mean) < SIGMAS * std / DRAWS**0.5)
    assert np.all(np.abs(samples.std(0) / std - 1.0) < SIGMAS / (2 * DRAWS) ** 0.5)
    centred = samples - samples.mean(0)
    neighbours = (centred[1:] * centred[:-1]).mean(0) / centred.var(0)
    assert np.all(np.abs(neighbours) < SIGMAS / DRAWS**0.5)


IMU = imu.ImuConfig(0.05, NONE, inf, 0.005, NONE, inf, 9.81)
FORCE = TURN.inv().apply(np.add(STATE.accel_quad, (0.0, 0.0, 9.81)))


def test_imu_feels_all_but_gravity() -> None:
    reading = silent(imu, IMU)
    assert np.allclose(reading.accel_body, FORCE, rtol=0, atol=ROUNDING)
    assert reading.gyro_body == STATE.omega_body


def test_imu_noise() -> None:
    got = readings(imu, IMU)
    assert_white(np.array([r.accel_body for r in got]), FORCE, 0.05)
    assert_white(np.array([r.gyro_body for r in got]), STATE.omega_body, 0.005)


def test_imu_is_cut_at_full_scale() -> None:
    config = IMU._replace(accel_range=1.0, gyro_range=0.15)
    reading = imu.clip_reading(silent(imu, config), config)
    assert np.array_equal(reading.accel_body, np.clip(FORCE, -1.0, 1.0))
    assert reading.gyro_body == (0.1, -0.15, 0.15)


def test_imu_bias_stays_through_a_flight_and_differs_between_flights() -> None:
    config = IMU._replace(accel_noise=0.0, gyro_noise=0.0, accel_drift=Drift(0.3, 1.0, 0.0))
    got = readings(imu, config, 10)
    assert len({r.accel_body for r in got}) == 1
    biases = [imu.start(config, Noise(seed, 1, 0, 1.0)).accel_bias for seed in range(1000)]
    assert abs(np.std(biases) - 0.3) < SIGMAS * 0.3 / 6000**0.5


POSE = pose_tracker.PoseConfig(0.001, 0.0007, 0.01, 0.02, NONE, NONE, UNDISTORTED)


def test_pose_tracker_without_noise() -> None:
    reading = silent(pose_tracker, POSE)
    assert reading.position == STATE.x_quad
    assert reading.velocity == STATE.v_quad
    assert reading.omega_body == STATE.omega_body
    assert np.allclose(reading.quat_wxyz, STATE.quat_wxyz, rtol=0, atol=ROUNDING)


def test_pose_tracker_noise() -> None:
    got = readings(pose_tracker, POSE)
    assert_white(np.array([r.position for r in got]), STATE.x_quad, 0.001)
    assert_white(np.array([r.velocity for r in got]), STATE.v_quad, 0.01)
    assert_white(np.array([r.omega_body for r in got]), STATE.omega_body, 0.02)
    measured = Rotation.from_quat([(q[1], q[2], q[3], q[0]) for q in (r.quat_wxyz for r in got)])
    assert_white((TURN.inv() * measured).as_rotvec(), 0.0, 0.0007)


def test_pose_tracker_says_what_it_does_not_measure() -> None:
    reading = silent(pose_tracker, POSE._replace(velocity_noise=nan, rate_noise=nan))
    assert np.isnan(reading.velocity).all()
    assert np.isnan(reading.omega_body).all()
    assert reading.position == STATE.x_quad


def test_load_tracker() -> None:
    config = load_tracker.LoadConfig(0.002, 0.03, NONE, NONE, UNDISTORTED)
    reading = silent(load_tracker, config)
    assert (reading.position, reading.velocity) == (STATE.x_load, STATE.v_load)
    got = readings(load_tracker, config)
    assert_white(np.array([r.position for r in got]), STATE.x_load, 0.002)
    assert_white(np.array([r.velocity for r in got]), STATE.v_load, 0.03)
    assert np.isnan(silent(load_tracker, config._replace(velocity_noise=nan)).velocity).all()


CAMERA = cable_sensor.CableConfig(0.003, NONE, cos(radians(60.0)), 0.0)


def test_cable_sensor_points_from_vehicle_to_load() -> None:
    reading = silent(cable_sensor, CAMERA)
    assert np.allclose(reading.direction_body, DIRECTION, rtol=0, atol=ROUNDING)


def test_cable_sensor_noise_is_an_angle() -> None:
    got = np.array([r.direction_body for r in readings(cable_sensor, CAMERA)])
    assert np.allclose(np.linalg.norm(got, axis=1), 1.0, rtol=0, atol=ROUNDING)
    across = np.cross(DIRECTION, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    # for small angles the direction moves by the angle in each of the two tangent directions; the second
    # order shifts the mean by less than 1e-5, a fifth of the statistical bound
    assert_white(got @ across, 0.0, 0.003)
    assert_white(got @ np.cross(DIRECTION, across), 0.0, 0.003)


@pytest.mark.parametrize("margin_deg", [-1.0, 1.0])
def test_camera_sees_within_its_cone(margin_deg: float) -> None:
    off_axis = np.arccos(-DIRECTION[2]) + radians(margin_deg)
    reading = silent(cable_sensor, CAMERA._replace(cone_cosine=float(np.cos(off_axis))))
    assert reading.detected == (1.0 if margin_deg > 0 else 0.0)


def test_encoder_reads_a_taut_cable_only() -> None:
    encoder = CAMERA._replace(cone_cosine=-1.0, taut_only=1.0)
    assert silent(cable_sensor, encoder).detected == 1.0
    slack = STATE._replace(taut=0.0)
    assert cable_sensor.sample(slack, cable_sensor.start(encoder, SILENT), encoder, SILENT)[0].detected == 0.0


def test_cable_sensor_survives_a_load_at_the_vehicle() -> None:
    together = STATE._replace(x_load=STATE.x_quad)
    reading = cable_sensor.sample(together, cable_sensor.start(CAMERA, SILENT), CAMERA, SILENT)[0]
    assert reading.detected == 0.0
    assert np.isfinite(reading.direction_body).all()


def test_gnss() -> None:
    still = Drift(1.0, 1.0, 0.0)
    config = GNSS._replace(
        position_noise=(0.2, 0.2, 0.4), velocity_noise=(0.05, 0.05, 0.1), correlation=still
    )
    reading = silent(gnss, config)
    assert (reading.position, reading.velocity) == (STATE.x_quad, STATE.v_quad)
    got = readings(gnss, config)
    assert_white(np.array([r.position for r in got]), STATE.x_quad, (0.2, 0.2, 0.4))
    assert_white(np.array([r.velocity for r in got]), STATE.v_quad, (0.05, 0.05, 0.1))


def test_gnss_correlated_error_is_scaled_per_axis() -> None:
    config = GNSS._replace(position_error=(1.5, 1.5, 2.5), correlation=Drift(1.0, 1.0, 0.0))
    state = gnss.start(config, Noise(5, 1, 0, 1.0))
    reading, _ = gnss.sample(STATE, state, config, Noise(5, 1, 0, 1.0))
    expected = np.add(STATE.x_quad, np.multiply((1.5, 1.5, 2.5), state.error))
    assert np.allclose(reading.position, expected, rtol=0, atol=ROUNDING)


def test_barometer() -> None:
    config = barometer.BarometerConfig(0.1, NONE)
    assert silent(barometer, config).height == STATE.x_quad[2]
    assert_white(np.array([r.height for r in readings(barometer, config)]), STATE.x_quad[2], 0.1)


def test_magnetometer() -> None:
    dip, turn = radians(63.5), radians(3.0)
    field = (0.48 * cos(dip) * sin(turn), 0.48 * cos(dip) * cos(turn), -0.48 * sin(dip))
    config = magnetometer.MagnetometerConfig(field, 0.003, NONE)
    expected = TURN.inv().apply(field)
    assert np.allclose(silent(magnetometer, config).field_body, expected, rtol=0, atol=ROUNDING)
    got = readings(magnetometer, config)
    assert_white(np.array([r.field_body for r in got]), expected, 0.003)
