"""Vibration: lines at the speeds of the rotors, as large as stated, aliased and filtered as by sampling."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from autopilot.vehicle.layout import PLUS, Layout
from autopilot.wire.convert.simulator import rotor_speed_rpm
from sitl.plant.rotors import FORCE, RotorRows, rotor_table, rotors_at_rest
from sitl.sensors.noise import Noise
from sitl.sensors.vibration import VibrationConfig, draw_phases, hover_force, rotor_vibration
from sitl.vehicles.truth import load_truth

TRUTH = load_truth("bebop")
TICK_S = 0.004
SAMPLES = 4096
HOVER = hover_force(TRUTH, 4)
STEADY = VibrationConfig(2.0, 0.1, 0.0, 0.0, TICK_S)
SIGMAS = 4.0  # suspicious distance of a statistic from its expectation, in its own standard errors
# the speed is a whole number of rpm, 1/60 Hz: over the 16 s of a test a line stays within a bin of its
# frequency
BIN_HZ = 1.0 / (SAMPLES * TICK_S)


def turning(*forces: float, layout: Layout = PLUS) -> RotorRows:
    rows = rotors_at_rest()
    rows[FORCE, : len(forces)] = forces
    return RotorRows(rotor_table(layout), rows)


def shaken(rotors: RotorRows, config: VibrationConfig, seed: int = 1, scale: float = 1.0):
    """(samples, 3) of acceleration and of body rate."""
    phases = np.zeros(14)
    count = len(rotors.table)
    draw_phases(phases, count, Noise(seed, 1, 0, scale))
    out = [rotor_vibration(rotors, TRUTH, phases, config, Noise(seed, 1, k, scale)) for k in range(SAMPLES)]
    return np.array([a for a, _ in out]), np.array([w for _, w in out])


def rms(samples: np.ndarray) -> np.ndarray:
    return np.sqrt((samples**2).mean(0))


def one_rotor(force: float) -> RotorRows:
    return turning(force, 0.0, 0.0, 0.0)


def line_hz(samples: np.ndarray) -> float:
    """Frequency of the strongest line."""
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))))
    return float(np.fft.rfftfreq(len(samples), TICK_S)[np.argmax(spectrum)])


def aliased(hz: float) -> float:
    rate = 1.0 / TICK_S
    return abs(hz - rate * round(hz / rate))


def speed_hz(force: float) -> float:
    return rotor_speed_rpm(force, TRUTH.rotor_max) / 60.0


def test_at_hover_it_is_as_large_as_stated_on_every_axis() -> None:
    # speeds that differ by some percent beat against each other; over 16 s the beats are averaged out
    forces = HOVER * np.array([0.92, 0.97, 1.03, 1.08])
    accel, gyro = shaken(turning(*forces), STEADY)
    # the mean of the squares is that of the four amplitudes, of order (F_i / F_h)^2 and F_i / F_h
    expected = 2.0 * sqrt(np.mean((forces / HOVER) ** 2))
    assert rms(accel) == pytest.approx(expected, rel=0.02)
    assert rms(gyro) == pytest.approx(0.1 * sqrt(np.mean(forces / HOVER)), rel=0.02)
    assert np.abs(accel.mean(0)).max() < 0.05 * expected  # its mean is about zero


def test_lines_stand_at_the_speed_of_the_rotor_and_fold_at_half_of_the_tick_rate() -> None:
    for share in (0.2, 0.5, 1.0):
        force = share * TRUTH.rotor_max
        accel, gyro = shaken(one_rotor(force), STEADY)
        once, twice = aliased(speed_hz(force)), aliased(2.0 * speed_hz(force))
        for samples in (accel[:, 0], accel[:, 1], *gyro.T):
            assert line_hz(samples) == pytest.approx(once, abs=BIN_HZ)
        assert line_hz(accel[:, 2]) == pytest.approx(twice, abs=BIN_HZ)
    assert once != speed_hz(force), "the fastest rotor must alias, or this test shows nothing of it"


def test_amplitudes_grow_with_the_square_of_the_speed_and_rates_with_the_speed() -> None:
    slow, fast = shaken(one_rotor(0.3 * HOVER), STEADY), shaken(one_rotor(1.2 * HOVER), STEADY)
    assert rms(fast[0]) / rms(slow[0]) == pytest.approx(4.0, rel=0.02)
    assert rms(fast[1]) / rms(slow[1]) == pytest.approx(2.0, rel=0.02)


def test_force_is_radial_and_its_torque_turns_the_body_a_quarter_of_a_turn_later() -> None:
    accel, gyro = shaken(one_rotor(HOVER), STEADY)
    radius = np.hypot(accel[:, 0], accel[:, 1])
    assert radius == pytest.approx(2.0 * sqrt(2.0 / 4.0), rel=1e-9)
    # of a rotor above the centre of mass: rate along -F_y and F_x, integrated
    along = np.mean(gyro[:, 0] * accel[:, 0]) / (rms(gyro[:, 0]) * rms(accel[:, 0]))
    across = np.mean(gyro[:, 0] * accel[:, 1]) / (rms(gyro[:, 0]) * rms(accel[:, 1]))
    assert abs(along) == pytest.approx(1.0, abs=0.01)
    assert abs(across) < 0.02


def test_rotors_of_opposite_sense_circle_in_opposite_senses() -> None:
    senses = []
    for i in range(4):
        # slow enough that the angle between two samples is below half a turn
        forces = [0.0] * 4
        forces[i] = 0.2 * TRUTH.rotor_max
        accel, _ = shaken(turning(*forces), STEADY)
        x, y = accel[:, 0], accel[:, 1]
        senses.append(float(np.sign(np.mean(x[:-1] * y[1:] - y[:-1] * x[1:]))))
    yaw = [rotor.yaw for rotor in PLUS]
    assert senses == [-np.sign(one) for one in yaw]  # the drag turns the body against the rotor


@pytest.mark.parametrize("cutoff_hz", [40.0, 98.0, 188.0])
def test_low_pass_is_butterworths_of_second_order(cutoff_hz: float) -> None:
    hz = speed_hz(HOVER)
    open_accel, open_gyro = shaken(one_rotor(HOVER), STEADY)
    accel, gyro = shaken(one_rotor(HOVER), STEADY._replace(cutoff_hz=cutoff_hz))
    once, twice = (1.0 / sqrt(1.0 + (f / cutoff_hz) ** 4) for f in (hz, 2.0 * hz))
    assert rms(accel) / rms(open_accel) == pytest.approx((once, once, twice), rel=1e-9)
    assert rms(gyro) / rms(open_gyro) == pytest.approx(once, rel=1e-9)


def test_broadband_part_is_white_and_has_its_share() -> None:
    rotors = turning(*[HOVER] * 4)
    lines, _ = shaken(rotors, STEADY)
    accel, gyro = shaken(rotors, STEADY._replace(broadband=0.5))
    _, silent = shaken(rotors, STEADY._replace(gyro=0.1))
    for samples, std in ((accel - lines, 1.0), (gyro - silent, 0.05)):
        assert np.all(np.abs(samples.std(0) / std - 1.0) < SIGMAS / (2 * SAMPLES) ** 0.5)
        neighbours = (samples[1:] * samples[:-1]).mean(0) / samples.var(0)
        assert np.all(np.abs(neighbours) < SIGMAS / SAMPLES**0.5)


def test_rotors_that_stand_shake_nothing() -> None:
    accel, gyro = shaken(turning(0.0, 0.0, 0.0, 0.0), STEADY._replace(broadband=1.0))
    assert not accel.any()
    assert not gyro.any()


def test_seed_and_scale() -> None:
    rotors = turning(*[HOVER] * 4)
    accel, gyro = shaken(rotors, STEADY)
    again, _ = shaken(rotors, STEADY)
    other, _ = shaken(rotors, STEADY, seed=2)
    double, faster = shaken(rotors, STEADY, scale=2.0)
    assert np.array_equal(accel, again)
    assert not np.allclose(accel, other)
    assert np.allclose(double, 2.0 * accel, rtol=1e-12)
    assert np.allclose(faster, 2.0 * gyro, rtol=1e-12)
