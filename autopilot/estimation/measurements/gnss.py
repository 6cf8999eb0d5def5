"""Correction by a satellite navigation receiver: position, with an error that is partly slow, and velocity.

The first fix starts the estimate of the vehicle, levelled by the accelerometer, with its heading from the
magnetometer. The vehicle then stands on the ground, at the height of its gear, with the load where the crew
laid it; or, if its rotors carry it, it is in the air with the load below it, and later fixes refine the
estimate.
"""

from __future__ import annotations

from math import sqrt

from autopilot.estimation.correction import (
    enter_position,
    enter_velocity,
    heard,
    inject,
    look_back,
    vehicle_at,
    with_aids,
    with_load,
    with_vehicle,
)
from autopilot.estimation.covariance import absorb, begin, enter, forget, gather, scalar, within_gate
from autopilot.estimation.history import renew
from autopilot.estimation.measurements.magnetic import correct_magnetic, magnetic_north
from autopilot.estimation.measurements.pose import spread_out
from autopilot.estimation.records import (
    ACCEL_BIAS,
    ATTITUDE,
    CAMERA,
    FIX,
    GNSS,
    NOBODY,
    PLAIN,
    POSITION,
    QUAT,
    RECEIVER,
    RTK_FIXED,
    RTK_FLOAT,
    SIZE,
    TRACKER,
    V_QUAD,
    VELOCITY,
    X_QUAD,
    AidEstimate,
    EstimatorState,
    EstimatorTuning,
    GnssReading,
    History,
    LoadEstimate,
    VehicleEstimate,
)
from autopilot.estimation.tautness import tauten
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add, apply_transposed, cross, from_columns, norm, sub
from autopilot.geometry.packed import with_field
from autopilot.geometry.s2 import normalise, tangent
from autopilot.geometry.so3 import quat_from_rotation, rotation_from_quat

FIXES_BEFORE_RESET = 8.0
LEAST_PERIOD_S = 0.02  # between two fixes
SETTLED = 2.0  # a slow error is a new one where its deviation was so many times as large before
CLIMB_WORSE = 1.7  # deviation of the climb over that of the horizontal speed
STANDING_STD = 0.02  # m, of the height of a standing vehicle
STARTING_SPEED_STD = 0.2  # m/s
# of a vehicle that is found in the air
CARRIED_SHARE = 0.5  # of its weight: above this thrust, the rotors carry it
LOADED_SHARE = 0.5  # of the load's weight that must pull at the vehicle for the load to hang from it
FLYING_SPEED_STD, FLYING_TILT_STD = 1.0, 0.15  # m/s; rad, by which acceleration tilts the measured vertical
HANGING_STD, SWINGING_STD = 0.3, 1.0  # of the cable's length, horizontal; m/s
ANYWHERE_STD = 100.0  # m: the first fix decides the position
MAGNETIC_FRESH_S = 0.2
LEAST_SLANT = 0.01  # sine of the angle between specific force and magnetic field
# With a slow error that returns to zero, the best estimate of the position is half of the first and half of
# the last fix: the position then follows each metre of a plain receiver's drift by half. It should stay where
# it was and be carried by the velocities, so the drift is assumed to return to zero ten times as slowly as it
# wanders.
PLAIN_REVERSION = 0.1


@kernel
def tells_attitude(accel: Vec3, field: Vec3) -> bool:
    """Whether the directions of specific force and magnetic field (body) differ enough to give tilt and
    heading."""
    return norm(cross(accel, field)) > LEAST_SLANT * norm(accel) * norm(field)


@kernel
def level_heading(accel: Vec3, field: Vec3, north: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """R whose third row is the measured vertical and which turns the measured field to `north`."""
    up_b = normalise(accel)
    north_b = normalise(tangent(up_b, field))
    west_b = cross(up_b, north_b)
    body = (north_b, west_b, up_b)  # rows: the axes magnetic north, west, up, seen from the body
    world = from_columns(north, (-north[1], north[0], 0.0), (0.0, 0.0, 1.0))
    return (
        apply_transposed(body, world[0]),
        apply_transposed(body, world[1]),
        apply_transposed(body, world[2]),
    )


@kernel
def with_slow(aids: AidEstimate, horizontal: float, vertical: float, reversion: float) -> AidEstimate:
    """The aids with the deviations of the receiver's slow error."""
    return AidEstimate(
        aids.mounting,
        aids.heading,
        aids.barometer,
        aids.gnss,
        horizontal,
        vertical,
        reversion,
        aids.debt,
        aids.field,
        aids.magnetic_age,
        aids.barometer_age,
        aids.rejected,
    )


@kernel
def laid(state: EstimatorState, tuning: EstimatorTuning) -> LoadEstimate:
    """The load where it was laid: ahead of the standing vehicle, on its ground."""
    load, vehicle = state.load, state.vehicle
    ahead = rotation_from_quat(vehicle.quat_wxyz)
    x = vehicle.x_quad
    x_load = (
        x[0] + tuning.laid_forward * ahead[0][0],
        x[1] + tuning.laid_forward * ahead[1][0],
        x[2] - tuning.gear_height + tuning.load_height,
    )
    return LoadEstimate(
        x_load,
        ZERO,
        load.q_cable,
        load.q_cable_dot,
        load.across,
        tuning.cable_length,
        (tuning.laid_std * tuning.laid_std, 0.0, 0.0),
        0.0,
        0.0,
        load.pull,
        0.0,
        0.0,
        load.age_s,
        0.0,
        CAMERA,
    )


@kernel
def hanging(state: EstimatorState, history: History, tuning: EstimatorTuning) -> LoadEstimate:
    """The load on a taut cable below the vehicle, moving with it."""
    load, x = state.load, state.vehicle.x_quad
    std = HANGING_STD * tuning.cable_length
    below = LoadEstimate(
        (x[0], x[1], x[2] - tuning.cable_length),
        state.vehicle.v_quad,
        (0.0, 0.0, -1.0),
        ZERO,
        load.across,
        tuning.cable_length,
        (std * std, 0.0, SWINGING_STD * SWINGING_STD),
        0.0,
        0.0,
        tuning.load_mass * tuning.gravity,
        0.0,
        0.0,
        load.age_s,
        0.0,
        CAMERA,
    )
    return tauten(below, history, tuning, tuning.cable_length)


@kernel
def below(state: EstimatorState, tuning: EstimatorTuning) -> LoadEstimate:
    """The load on the ground, somewhere below a vehicle that flies without it."""
    load, x = laid(state, tuning), state.vehicle.x_quad
    x_load = (x[0], x[1], min(tuning.load_height, x[2]))
    return with_field(load, "x_load", x_load)


@kernel
def found_load(
    state: EstimatorState, history: History, tuning: EstimatorTuning, thrust: float
) -> LoadEstimate:
    """The load when a vehicle starts with its rotors giving `thrust` (N): it was laid ahead of a standing
    vehicle, hangs from one that accelerates less than its rotors would make it, and otherwise lies below
    it."""
    if not thrust > CARRIED_SHARE * tuning.quad_mass * tuning.gravity:
        return laid(state, tuning)
    pull = thrust - tuning.quad_mass * state.last_imu.accel[2]
    if pull > LOADED_SHARE * tuning.load_mass * tuning.gravity:
        return hanging(state, history, tuning)
    return below(state, tuning)


@kernel
def start_by_fix(
    state: EstimatorState, history: History, fix: GnssReading, tuning: EstimatorTuning, thrust: float
) -> EstimatorState:
    """The state with the vehicle started by the fix, except for its exact position, which the ordinary
    correction gives. `thrust` in N."""
    old, accel, g = state.vehicle, state.last_imu.accel, tuning.gravity
    flies = thrust > CARRIED_SHARE * tuning.quad_mass * g
    speed_var = FLYING_SPEED_STD * FLYING_SPEED_STD if flies else STARTING_SPEED_STD * STARTING_SPEED_STD
    R = level_heading(accel, state.aids.field, magnetic_north(tuning.declination))
    quat = quat_from_rotation(R)
    bias_var = tuning.accel_bias_std * tuning.accel_bias_std
    tilt_var = (bias_var + tuning.accel_std * tuning.accel_std) / (g * g)
    if flies:
        tilt_var += FLYING_TILT_STD * FLYING_TILT_STD
    spread_out(history, ANYWHERE_STD * ANYWHERE_STD, speed_var, tilt_var, tuning)
    P = history.covariance
    if not flies:
        P[POSITION + 2, POSITION + 2] = STANDING_STD * STANDING_STD
    P[ATTITUDE + 2, ATTITUDE + 2] = 1.0
    # a bias of the accelerometer tilts the attitude that it levels
    for j in range(3):
        about_x, about_y = -R[1][j] * bias_var / g, R[0][j] * bias_var / g
        P[ATTITUDE, ACCEL_BIAS + j], P[ACCEL_BIAS + j, ATTITUDE] = about_x, about_x
        P[ATTITUDE + 1, ACCEL_BIAS + j], P[ACCEL_BIAS + j, ATTITUDE + 1] = about_y, about_y
    state = settled(state, history)
    x_quad, v_quad = fix.position, fix.velocity
    if not flies:
        x_quad, v_quad = (x_quad[0], x_quad[1], tuning.gear_height), ZERO
    vehicle = VehicleEstimate(
        x_quad,
        v_quad,
        quat,
        old.omega_body,
        old.gyro_bias,
        old.accel_bias,
        old.accel_quad,
        fix.age_s,
        0.0,
        RECEIVER,
    )
    renew(history, X_QUAD, 3, (x_quad[0], x_quad[1], x_quad[2], 0.0))
    renew(history, V_QUAD, 3, (v_quad[0], v_quad[1], v_quad[2], 0.0))
    renew(history, QUAT, 4, quat)
    state = with_vehicle(state, vehicle, state.resets + 1.0)
    state = correct_magnetic(state, history, state.aids.field, 0.0, tuning)
    if state.load.source != TRACKER:
        state = with_load(state, found_load(state, history, tuning, thrust), state.resets)
    return state


@kernel
def settled(state: EstimatorState, history: History) -> EstimatorState:
    """Start the receiver's slow error anew: zero, with the deviation stated now."""
    P, aids = history.covariance, state.aids
    forget(P, GNSS, 3)
    for i in range(3):
        slow = aids.horizontal_slow if i < 2 else aids.vertical_slow
        P[GNSS + i, GNSS + i] = slow * slow
    return with_aids(state, with_field(aids, "gnss", ZERO))


@kernel
def doubt_place(state: EstimatorState, history: History) -> EstimatorState:
    """Make position and velocity as uncertain as after a long silence, so that the next fix decides them."""
    P = history.covariance
    for i in range(3):
        P[POSITION + i, POSITION + i] += ANYWHERE_STD * ANYWHERE_STD
        P[VELOCITY + i, VELOCITY + i] += 1.0
    v = state.vehicle
    return with_vehicle(state, vehicle_at(v, v.age_s, 0.0), state.resets + 1.0)


@kernel
def correct_gnss(
    state: EstimatorState, history: History, fix: GnssReading, tuning: EstimatorTuning, thrust: float
) -> EstimatorState:
    """The state after the fix; `history` is corrected along with it. `thrust` (N): assumed of the rotors.

    Ignored where a tracker measures the position of the vehicle.
    """
    if state.vehicle.source == TRACKER:
        return state
    state = heard(state, fix.age_s, SIZE)
    n = state.size
    share = tuning.rtk_white if fix.rtk > PLAIN else tuning.gnss_white
    starting = state.vehicle.source == NOBODY
    # the error of a float fix is not that of the fixes before, and stays the same until the carrier is fixed
    # again: all readings within EST_GPS_TAU together count as one
    floats = fix.rtk == RTK_FLOAT and not starting
    white, slow = share, sqrt(1.0 - share * share)
    if floats:
        since = max(LEAST_PERIOD_S, state.vehicle.age_s - fix.age_s)
        white = sqrt(max(1.0, 2.0 * tuning.gnss_time / since))
    before = state.aids.horizontal_slow
    aids = with_slow(
        state.aids,
        state.aids.horizontal_slow if floats else slow * fix.horizontal_std,
        state.aids.vertical_slow if floats else slow * fix.vertical_std,
        1.0 if fix.rtk > PLAIN else PLAIN_REVERSION,
    )
    state = with_aids(state, aids)
    # once the carrier's waves are counted, the earlier error no longer exists
    if fix.rtk == RTK_FIXED and not starting and before > SETTLED * aids.horizontal_slow:
        state = settled(state, history)
    if starting:
        if not (aids.magnetic_age <= MAGNETIC_FRESH_S and tells_attitude(state.last_imu.accel, aids.field)):
            return state
        state = start_by_fix(state, history, fix, tuning, thrust)
    past = look_back(state, history, tuning, fix.age_s)
    innovation = sub(fix.position, add(past.x_quad, state.aids.gnss))
    difference = sub(fix.velocity, past.v_quad)
    level, climb = white * fix.horizontal_std, white * fix.vertical_std
    speed = tuning.rtk_speed_std if fix.rtk > PLAIN else tuning.gnss_speed_std
    worse = CLIMB_WORSE * speed
    position_var = (level * level, level * level, climb * climb)
    velocity_var = (speed * speed, speed * speed, worse * worse)
    for i in range(3):
        scalar(history, i, innovation[i], position_var[i])
        enter_position(history, i, past, i)
        enter(history, i, GNSS + i, 1.0)
        scalar(history, 3 + i, difference[i], velocity_var[i])
        enter_velocity(history, 3 + i, past, i)
    gather(history, 0, 6, n)
    if not within_gate(history, FIX, 6, tuning.gate_sigma):
        vehicle = state.vehicle
        if vehicle.rejected + 1.0 < FIXES_BEFORE_RESET:
            refused = vehicle_at(vehicle, vehicle.age_s, vehicle.rejected + 1.0)
            return with_vehicle(state, refused, state.resets)
        return doubt_place(state, history)
    begin(history)
    nis = absorb(history, 6, n)
    history.consistency[FIX, 0] += 1.0
    history.consistency[FIX, 1] += nis
    state = inject(state, history)
    return with_vehicle(state, vehicle_at(state.vehicle, fix.age_s, 0.0), state.resets)
