"""Correction by the effect of the load on the vehicle, where no sensor ever saw the load.

The force on the vehicle besides weight, rotors and air is the pull of the cable,

    m_Q (R (a - bias) - D/m_Q - p) - f R e_3 = T q,

where D is the assumed drag and p, which is estimated, the acceleration by the air beyond it. The pull points
along the cable; its size T is taken as it is. A wind on the vehicle looks like a slant of the cable. Two
things distinguish them: the pendulum, which predicts how the cable must swing, and the wind that was
estimated while nothing pulled.
"""

from __future__ import annotations

from autopilot.control.drag import air_free_direction, drag_force
from autopilot.estimation.cable_pull import force_beyond_thrust
from autopilot.estimation.correction import (
    add_attitude_jacobian,
    add_direction_jacobian,
    inject_error,
    past_state,
    with_capacity,
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
    ACCEL_BIAS,
    NO_SENSOR,
    PULL,
    PUSH,
    SIZE,
    EstimatorState,
    EstimatorTuning,
    History,
)
from autopilot.estimation.tautness import MIN_FLOWN_HEIGHT, is_never_observed
from autopilot.estimation.vibration import accel_noise
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, apply_transposed, column, cross, dot, scale, sub
from autopilot.geometry.so3 import rotation_from_quat

# of the load's weight: a stronger pull shows the cable's direction; a weaker one is none
FIRM_PULL, NO_PULL = 0.3, 0.05
SLANT_STD = 0.005  # rad, between the rotors' force and the body's axis


@kernel
def cable_force(state: EstimatorState, tuning: EstimatorTuning, thrust: float) -> Vec3:
    """Force of the cable on the vehicle, N, world, by the last sample of the accelerometer."""
    vehicle, push = state.vehicle, state.air.vehicle_accel
    drag, m = drag_force(vehicle.v_quad, tuning.drag), tuning.quad_mass
    level = (m * push[0] + drag[0], m * push[1] + drag[1])
    e = air_free_direction(column(rotation_from_quat(vehicle.quat_wxyz), 2), state.frame_share)
    upward = drag[2] - (e[0] * level[0] + e[1] * level[1]) / e[2]
    force = force_beyond_thrust(vehicle, state.last_imu, thrust, tuning)
    return sub(force, (level[0], level[1], upward))


@kernel
def correct_pull(
    state: EstimatorState, history: History, tuning: EstimatorTuning, thrust: float
) -> EstimatorState:
    """The state after a prediction; `thrust` (N) is that which the rotors are assumed to give.

    While the cable is slack, the remaining force is the wind alone; while it comes taut or slack, nothing is
    measured.
    """
    load = state.load
    if state.vehicle.source == NO_SENSOR or not is_never_observed(load):
        return state
    state = with_capacity(state, 0.0, SIZE)
    weight = tuning.load_mass * tuning.gravity
    taut = load.taut > 0.0
    if taut:
        is_informative = load.pull > FIRM_PULL * weight
    else:
        height = state.vehicle.x_quad[2] - load.x_load[2]
        is_informative = abs(load.pull) < NO_PULL * weight and height > MIN_FLOWN_HEIGHT * tuning.cable_length
    if not is_informative:
        return state
    n = state.size
    past = past_state(state, history, tuning, 0.0)
    force = cable_force(state, tuning, thrust)
    # slack: the remaining acceleration, east and north; taut: the direction of the pull
    factor = 1.0 / dot(force, past.q_cable) if taut else 1.0 / tuning.quad_mass
    if not factor > 0.0:
        return state
    share, slant_std = tuning.quad_mass * factor, SLANT_STD * thrust * factor
    variance = share * share * accel_noise(state.vibration, tuning) + slant_std * slant_std
    for i in range(2):
        axis = (1.0 - i, float(i), 0.0)
        if taut:
            axis = past.across if i == 0 else past.along
        start_scalar(history, i, factor * dot(force, axis), variance)
        add_attitude_jacobian(history, i, past, scale(factor, cross(axis, force)))
        if taut:
            add_direction_jacobian(history, i, past, 1.0 if i == 0 else 0.0, 0.0 if i == 0 else 1.0)
        body_axis = apply_transposed(past.R, axis)
        for j in range(3):
            add_jacobian_entry(history, i, ACCEL_BIAS + j, share * body_axis[j])
        add_jacobian_entry(history, i, PUSH, share * axis[0])
        add_jacobian_entry(history, i, PUSH + 1, share * axis[1])
    compute_gain_rows(history, 0, 2, n)
    if not within_gate(history, PULL, 2, tuning.gate_sigma):
        return state
    start_correction(history)
    nis = fuse_scalars(history, 2, n)
    history.consistency[PULL, 0] += 1.0
    history.consistency[PULL, 1] += nis
    return inject_error(state, history)
