"""Correction by a magnetometer: the heading alone; strength and dip of the field need not be known.

With u = R m the measured field in the world and e magnetic north, a small attitude error phi appears as the
angle from e to the horizontal part of u, phi . (e3 - (u_z / |u_level|) e): in a steep field, a tilt looks
like a heading error.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

from autopilot.estimation.correction import (
    add_attitude_jacobian,
    inject_error,
    past_state,
    with_capacity,
    with_sensor_errors,
)
from autopilot.estimation.covariance import (
    add_jacobian_entry,
    compute_gain_rows,
    fuse_scalars,
    start_correction,
    start_scalar,
    within_gate,
)
from autopilot.estimation.records import (
    HEADING,
    MAGNETIC,
    RECEIVER,
    SIZE,
    EstimatorState,
    EstimatorTuning,
    History,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, apply, dot
from autopilot.geometry.packed import with_field
from autopilot.geometry.so3 import rotation_from_quat

MIN_HORIZONTAL_SHARE = 0.05  # share of the field that must be horizontal to give a heading


@kernel
def magnetic_north(declination: float) -> Vec3:
    """Magnetic north: unit vector, ENU."""
    return (sin(declination), cos(declination), 0.0)


@kernel
def with_magnetic_reading(state: EstimatorState, field: Vec3, age: float) -> EstimatorState:
    """The state with the magnetometer's last reading."""
    sensor_errors = with_field(with_field(state.sensor_errors, "field", field), "magnetic_age", age)
    return with_sensor_errors(state, sensor_errors)


@kernel
def correct_magnetic(
    state: EstimatorState, history: History, field: Vec3, age: float, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after a reading of the field (body axes, any unit), which corrects the estimate only with a
    satellite receiver."""
    state = with_magnetic_reading(state, field, age)
    if state.vehicle.source != RECEIVER:
        return state
    state = with_capacity(state, age, SIZE)
    n = state.size
    past = past_state(state, history, tuning, age)
    u = apply(rotation_from_quat(past.quat_wxyz), field)
    horizontal = sqrt(u[0] * u[0] + u[1] * u[1])
    if not horizontal > MIN_HORIZONTAL_SHARE * sqrt(dot(u, u)):
        return state
    north = magnetic_north(tuning.declination)
    angle = atan2(u[0] * north[1] - u[1] * north[0], u[0] * north[0] + u[1] * north[1])
    innovation = angle - state.sensor_errors.heading
    steep = u[2] / horizontal
    start_scalar(history, 0, innovation, tuning.magnetic_std * tuning.magnetic_std)
    add_attitude_jacobian(history, 0, past, (-steep * north[0], -steep * north[1], 1.0))
    add_jacobian_entry(history, 0, HEADING, 1.0)
    compute_gain_rows(history, 0, 1, n)
    if not within_gate(history, MAGNETIC, 1, tuning.gate_sigma):
        return state
    start_correction(history)
    nis = fuse_scalars(history, 1, n)
    history.consistency[MAGNETIC, 0] += 1.0
    history.consistency[MAGNETIC, 1] += nis
    return inject_error(state, history)
