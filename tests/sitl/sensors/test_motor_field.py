"""The field of the motors' currents against the sums of its formula, taken with NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.vehicle.layout import PLUS
from sitl.plant.rotors import FORCE, RotorRows, rotor_table, rotors_at_rest
from sitl.sensors.motor_field import motor_field
from sitl.sensors.vibration import hover_force
from sitl.vehicles.truth import load_truth

TRUTH = load_truth("bebop")
HOVER = hover_force(TRUTH, 4)
STRENGTH = 0.03


def field(*forces: float) -> np.ndarray:
    rows = rotors_at_rest()
    rows[FORCE, :4] = forces
    return np.array(motor_field(RotorRows(rotor_table(PLUS), rows), TRUTH, STRENGTH))


def test_at_hover_the_leads_of_the_battery_remain() -> None:
    assert field(*[HOVER] * 4) == pytest.approx([0.0, STRENGTH, 0.0], abs=1e-15)


def test_currents_go_with_the_thrust_to_three_halves() -> None:
    assert field(*[4.0 * HOVER] * 4) == pytest.approx([0.0, 8.0 * STRENGTH, 0.0], abs=1e-15)
    assert not field(0.0, 0.0, 0.0, 0.0).any()


def test_each_arm_adds_a_field_across_it() -> None:
    forces = HOVER * np.array([0.5, 0.8, 1.1, 1.6])
    currents = (forces / HOVER) ** 1.5
    arms = np.array([(rotor.x, rotor.y, 0.0) for rotor in PLUS])
    arms /= np.linalg.norm(arms, axis=1)[:, None]
    fields = np.cross(arms, (0.0, 0.0, 1.0))
    fields[:, 1] += 1.0
    expected = STRENGTH / 4.0 * (currents[:, None] * fields).sum(0)
    assert field(*forces) == pytest.approx(expected, abs=1e-15)


def test_the_magnetometer_feels_it_in_body_axes(core) -> None:
    sensors = """
    description = "silent"
    [imu]
    accel_noise_m_s2 = 0.0
    gyro_noise_rad_s = 0.0
    [mocap]
    rate_hz = 100
    position_noise_m = 0.0
    attitude_noise_rad = 0.0
    [magnetometer]
    rate_hz = "tick"
    strength_gauss = 0.48
    inclination_deg = 60.0
    noise_gauss = 0.0
    """
    forces = tuple(HOVER * share for share in (0.5, 0.8, 1.1, 1.6))
    clean, disturbed = core(sensors, vehicle="bebop"), core(sensors, vehicle="bebop", SIM_MAG_MOT=STRENGTH)
    for _ in range(5):
        before, after = clean.tick(forces).magnetometer, disturbed.tick(forces).magnetometer
    ((_, one),), ((_, other),) = before, after
    given = field(*disturbed.rotor_force)
    assert np.subtract(other.field_body, one.field_body) == pytest.approx(given, abs=1e-15)
    assert np.linalg.norm(given) > 0.01 * STRENGTH
