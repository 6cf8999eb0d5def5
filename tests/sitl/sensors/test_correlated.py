"""Correlated errors: of motion capture, in time and in space, and of multipath; against their statistics."""

from __future__ import annotations

from math import exp, sqrt

import numpy as np
import pytest

from sitl.sensors.files import load_profile, parse_profile
from sitl.sensors.noise import Noise
from sitl.sensors.room import Room, distortion

SIGMAS = 4.0  # suspicious distance of a statistic from its expectation, in its own standard errors
LYING = (0.0, 0.0, 0.0, 0.0)

TRACKED = """
description = "trackers without white noise"
[imu]
accel_noise_m_s2 = 0.0
gyro_noise_rad_s = 0.0
[mocap]
rate_hz = 50
position_noise_m = 0.0
attitude_noise_rad = 0.0
[load_tracker]
rate_hz = 50
position_noise_m = 0.0
"""
RECEIVED = """
description = "receiver without white noise"
[imu]
accel_noise_m_s2 = 0.0
gyro_noise_rad_s = 0.0
[gnss]
fix = "rtk"
rate_hz = 10
horizontal_noise_m = 0.0
vertical_noise_m = 0.0
horizontal_velocity_noise_m_s = 0.0
vertical_velocity_noise_m_s = 0.0
"""


def errors(flown, sensor: str, place, seconds: float) -> np.ndarray:
    """(readings, 3) errors of position of a vehicle at rest in a known place."""
    found = []
    for _ in range(round(seconds * 1e6 / flown.settings.tick_us)):
        found += [np.subtract(m.reading.position, place) for m in getattr(flown.tick(LYING), sensor)]
    return np.array(found)


def assert_markov(samples: np.ndarray, std, per_sample: float) -> None:
    """Gauss-Markov of first order: each sample is `per_sample` times the one before plus a fresh part."""
    std = np.broadcast_to(std, 3)
    fresh = samples[1:] - per_sample * samples[:-1]
    drive = std * sqrt(1.0 - per_sample**2)
    count = len(fresh)
    assert np.all(np.abs(fresh.std(0) / drive - 1.0) < SIGMAS / sqrt(2 * count))
    assert np.all(np.abs(fresh.mean(0)) < SIGMAS * drive / sqrt(count))
    neighbours = (fresh[1:] * fresh[:-1]).mean(0) / fresh.var(0)
    assert np.all(np.abs(neighbours) < SIGMAS / sqrt(count))


@pytest.mark.parametrize(("sensor", "body"), [("mocap", "x_quad"), ("load_tracker", "x_load")])
def test_trackers_wander(core, sensor: str, body: str) -> None:
    flown = core(TRACKED, SIM_TRK_ERR_M=0.002, SIM_TRK_ERR_S=0.5, SIM_RATE_HZ=100)
    samples = errors(flown, sensor, getattr(flown.state, body), 80.0)
    assert_markov(samples, 0.002, exp(-0.02 / 0.5))
    # the error has its full deviation from the beginning
    first = [
        errors(core(TRACKED, seed=k, SIM_TRK_ERR_M=0.002), sensor, getattr(flown.state, body), 0.02)[0]
        for k in range(100)
    ]
    assert np.std(first) == pytest.approx(0.002, rel=SIGMAS / sqrt(600))


def newest_errors(flown) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the positions of vehicle and load, after a few readings."""
    vehicle, load = flown.state.x_quad, flown.state.x_load
    for _ in range(25):
        readings = flown.tick(LYING)
        if readings.mocap:
            found = readings.mocap[0].reading.position, readings.load_tracker[0].reading.position
    return np.subtract(found[0], vehicle), np.subtract(found[1], load)


def test_trackers_err_apart_in_time_and_alike_in_place(core) -> None:
    vehicle, load = newest_errors(core(TRACKED, SIM_TRK_ERR_M=0.002))
    assert not np.allclose(vehicle, load, rtol=0, atol=1e-5)
    # in a room whose error hardly varies, the load beside the vehicle has the same error
    vehicle, load = newest_errors(core(TRACKED, SIM_TRK_CAL_M=0.002, SIM_TRK_CAL_LEN=1000.0))
    assert np.allclose(vehicle, load, rtol=0, atol=1e-5)
    assert np.linalg.norm(vehicle) > 1e-4


def test_a_distorted_room_errs_by_place_alone() -> None:
    room = Room(0.003, 2.0)
    places = np.random.default_rng(1).uniform(-20.0, 20.0, (4000, 3))
    for seed in (1, 2):
        noise = Noise(seed, 2, 17, 1.0)
        found = np.array([distortion(tuple(place), room, noise) for place in places])
        # a wave has its stated deviation over places that are unrelated to its length
        assert np.all(np.abs(found.std(0) / 0.003 - 1.0) < 0.05)
        assert np.all(np.abs(found.mean(0)) < SIGMAS * 0.003 / sqrt(len(places)))
        assert np.abs(found).max() <= sqrt(2.0) * 0.003 * (1.0 + 1e-12)
        later = Noise(seed, 3, 99, 1.0)  # another tracker, another instant
        assert distortion((1.0, 2.0, 3.0), room, noise) == distortion((1.0, 2.0, 3.0), room, later)
    assert not np.allclose(found[0], distortion(tuple(places[0]), room, Noise(1, 2, 17, 1.0)))
    assert distortion((1.0, 2.0, 3.0), room, Noise(1, 2, 0, 0.0)) == (0.0, 0.0, 0.0)


def test_a_distortion_varies_over_its_length() -> None:
    noise = Noise(5, 2, 0, 1.0)
    for length in (0.5, 5.0):
        room = Room(0.003, length)
        steps = np.arange(4000) * length / 200.0
        for way in np.eye(3):
            found = np.array([distortion(tuple(step * way), room, noise) for step in steps])
            slope = np.abs(np.diff(found, axis=0)).max() / (length / 200.0)
            # no steeper than a wave of this length, whatever the direction
            assert slope <= 2.0 * np.pi / length * sqrt(2.0) * 0.003 * (1.0 + 1e-3)
            assert found.std(0).max() > 0.001


def test_multipath_wanders_and_is_not_stated(core) -> None:
    flown = core(RECEIVED, SIM_GPS_MP_M=0.2, SIM_GPS_MP_S=3.0, SIM_RATE_HZ=100)
    samples = errors(flown, "gnss", flown.state.x_quad, 200.0)
    assert_markov(samples, (0.2, 0.2, 0.3), exp(-0.1 / 3.0))
    assert parse_profile(RECEIVED, "x.toml").gnss.config(0.004).multipath.drive == 0.0


def test_hidden_markers_come_in_bursts(core) -> None:
    flown = core(TRACKED, SIM_OCC_LOAD=60.0, SIM_OCC_S=0.2, SIM_RATE_HZ=100)
    seen, poses = [], 0
    for _ in range(20_000):
        readings = flown.tick(LYING)
        seen += [m.time_us for m in readings.load_tracker]
        poses += len(readings.mocap)
    gaps = np.diff(seen) * 1e-6
    hidden = gaps[gaps > 0.021]
    # hidden once a second while it is seen, on average for 0.2 s and the rest of a period
    assert len(hidden) == pytest.approx(200.0 / 1.2, abs=SIGMAS * sqrt(170.0))
    assert hidden.mean() == pytest.approx(0.23, abs=SIGMAS * 0.2 / sqrt(len(hidden)))
    assert poses == 10_000  # the vehicle has other markers


def test_the_real_profiles_have_every_effect() -> None:
    lab, field = load_profile("lab-real"), load_profile("field")
    assert lab.mocap is not None
    assert lab.load_tracker is not None
    for tracker in (lab.mocap, lab.load_tracker):
        assert tracker.jitter_ms == 5.0
        assert min(tracker.position_correlated_m, tracker.calibration_error_m, tracker.outages_per_min) > 0.0
    assert field.gnss is not None
    assert field.magnetometer is not None
    gnss = field.gnss
    assert min(gnss.horizontal_multipath_m, gnss.float_per_min, gnss.lost_per_min, gnss.jitter_ms) > 0.0
    assert field.magnetometer.motor_field_gauss > 0.0
    for profile in (lab, field):
        assert (
            min(profile.imu.vibration_m_s2, profile.imu.vibration_rad_s, profile.imu.lowpass_hz or 0.0) > 0.0
        )
