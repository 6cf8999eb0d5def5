"""Correction by the effect of the load on the vehicle, where no sensor ever saw the load.

The force on the vehicle besides weight, rotors and air is the pull of the cable,

    m_Q (R (a - bias) - D/m_Q - p) - f R e_3 = T q,

where D is the assumed drag and p, which is estimated, the acceleration by the air beyond it. The pull points
along the cable; its size T is taken as it is. A wind on the vehicle looks like a slant of the cable. Two
things distinguish them: the pendulum, which predicts how the cable must swing, and the wind that was
estimated while nothing pulled.
"""

from __future__ import annotations

from autopilot.control.drag import drag_force
from autopilot.estimation.correction import enter_attitude, enter_direction, heard, inject, look_back
from autopilot.estimation.covariance import absorb, begin, enter, gather, scalar, within_gate
from autopilot.estimation.records import (
    ACCEL_BIAS,
    CAMERA,
    NOBODY,
    PULL,
    PUSH,
    SIZE,
    EstimatorState,
    EstimatorTuning,
    History,
    LoadEstimate,
)
from autopilot.estimation.vibration import accel_noise
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, apply, apply_transposed, axpy, column, cross, dot, scale, sub
from autopilot.geometry.so3 import rotation_from_quat

FIRM, LOOSE = (
    0.3,
    0.05,
)  # of the load's weight: a stronger pull shows the cable's direction; a weaker one is none
HIGH = 0.2  # of the cable's length above the load: higher up, the vehicle is off the ground
SLANT_STD = 0.005  # rad, between the rotors' force and the body's axis


@kernel
def unseen(load: LoadEstimate) -> bool:
    """Whether no sensor has ever seen the load."""
    return load.source == CAMERA and load.age_s == float("inf")


@kernel
def pulling(state: EstimatorState, tuning: EstimatorTuning, thrust: float) -> Vec3:
    """Force of the cable on the vehicle, N, world, by the last sample of the accelerometer."""
    vehicle, push = state.vehicle, state.air.vehicle
    R = rotation_from_quat(vehicle.quat_wxyz)
    a = apply(R, sub(state.last_imu.accel, vehicle.accel_bias))
    known = axpy(thrust, column(R, 2), drag_force(vehicle.v_quad, tuning.drag))
    return sub(scale(tuning.quad_mass, (a[0] - push[0], a[1] - push[1], a[2])), known)


@kernel
def correct_pull(
    state: EstimatorState, history: History, tuning: EstimatorTuning, thrust: float
) -> EstimatorState:
    """The state after a prediction; `thrust` (N) is that which the rotors are assumed to give.

    While the cable is slack, the remaining force is the wind alone; while it comes taut or slack, nothing is
    measured.
    """
    load = state.load
    if state.vehicle.source == NOBODY or not unseen(load):
        return state
    state = heard(state, 0.0, SIZE)
    weight = tuning.load_mass * tuning.gravity
    taut = load.taut > 0.0
    if taut:
        told = load.pull > FIRM * weight
    else:
        over = state.vehicle.x_quad[2] - load.x_load[2]
        told = abs(load.pull) < LOOSE * weight and over > HIGH * tuning.cable_length
    if not told:
        return state
    n = state.size
    past = look_back(state, history, tuning, 0.0)
    r = pulling(state, tuning, thrust)
    # slack: the remaining acceleration, east and north; taut: the direction of the pull
    by = 1.0 / dot(r, past.q_cable) if taut else 1.0 / tuning.quad_mass
    if not by > 0.0:
        return state
    share, slant = tuning.quad_mass * by, SLANT_STD * thrust * by
    variance = share * share * accel_noise(state.vibration, tuning) + slant * slant
    for i in range(2):
        axis = (1.0 - i, float(i), 0.0)
        if taut:
            axis = past.across if i == 0 else past.along
        scalar(history, i, by * dot(r, axis), variance)
        enter_attitude(history, i, past, scale(by, cross(axis, r)))
        if taut:
            enter_direction(history, i, past, 1.0 if i == 0 else 0.0, 0.0 if i == 0 else 1.0)
        about = apply_transposed(past.R, axis)
        for j in range(3):
            enter(history, i, ACCEL_BIAS + j, share * about[j])
        enter(history, i, PUSH, share * axis[0])
        enter(history, i, PUSH + 1, share * axis[1])
    gather(history, 0, 2, n)
    if not within_gate(history, PULL, 2, tuning.gate_sigma):
        return state
    begin(history)
    nis = absorb(history, 2, n)
    history.consistency[PULL, 0] += 1.0
    history.consistency[PULL, 1] += nis
    return inject(state, history)
