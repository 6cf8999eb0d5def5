"""Correction by a satellite navigation receiver: position, with an error that is partly slow, and velocity.

The first fix starts the estimate of the vehicle, levelled by the accelerometer, with its heading from the
magnetometer. The vehicle is then on the ground, at the height of its gear, with the load where the crew
put it; or, if its rotors carry it, it is in the air with the load below it, and later fixes refine the
estimate.
"""

from __future__ import annotations

from math import sqrt

from autopilot.estimation.cable_pull import MIN_CARRYING_SHARE
from autopilot.estimation.correction import (
    PastState,
    add_position_jacobian,
    add_velocity_jacobian,
    inject_error,
    past_state,
    restarted_vehicle,
    vehicle_with_status,
    with_capacity,
    with_load,
    with_sensor_errors,
    with_vehicle,
)
from autopilot.estimation.covariance import (
    add_jacobian_entry,
    compute_gain_rows,
    fuse_scalars,
    start_correction,
    start_scalar,
    within_gate,
    zero_covariance,
)
from autopilot.estimation.history import turning_velocity
from autopilot.estimation.measurements.magnetic import correct_magnetic, magnetic_north
from autopilot.estimation.measurements.pose import set_initial_covariance
from autopilot.estimation.measurements.zero_velocity import slides
from autopilot.estimation.records import (
    ACCEL_BIAS,
    ATTITUDE,
    CAMERA,
    FIX,
    GNSS,
    NO_SENSOR,
    PLAIN,
    POSITION,
    RECEIVER,
    RTK_FIXED,
    RTK_FLOAT,
    SIZE,
    TRACKER,
    VELOCITY,
    EstimatorState,
    EstimatorTuning,
    GnssReading,
    History,
    LoadEstimate,
    SensorErrors,
)
from autopilot.estimation.tautness import tauten
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    ZERO,
    Vec3,
    add,
    apply,
    apply_transposed,
    cross,
    from_columns,
    is_zero,
    norm,
    sub,
)
from autopilot.geometry.packed import with_field
from autopilot.geometry.s2 import normalise, tangent
from autopilot.geometry.so3 import quat_from_rotation, rotation_from_quat

FIXES_BEFORE_RESET = 8.0
MIN_FIX_PERIOD_S = 0.02  # between two fixes
# a slow error is a new one where its deviation was so many times as large before
SLOW_ERROR_RESTART_RATIO = 2.0
CLIMB_STD_RATIO = 1.7  # deviation of the climb over that of the horizontal speed
GROUND_HEIGHT_STD = 0.02  # m, of the height of a vehicle on the ground
INITIAL_SPEED_STD = 0.2  # m/s
# of a vehicle that is found in the air
SUSPENDED_PULL_SHARE = 0.5  # of the load's weight that must pull at the vehicle for the load to hang from it
AIRBORNE_SPEED_STD = 1.0  # m/s
AIRBORNE_TILT_STD = 0.15  # rad, by which acceleration tilts the measured vertical
SUSPENDED_STD, SUSPENDED_SPEED_STD = 0.3, 1.0  # of the cable's length, horizontal; m/s
UNKNOWN_POSITION_STD = 100.0  # m: the first fix decides the position
MAX_MAGNETIC_AGE_S = 0.2
MIN_SIN_ANGLE = 0.01  # sine of the angle between specific force and magnetic field
# With a slow error that returns to zero, the best estimate of the position is half of the first and half of
# the last fix: the position then follows each metre of a plain receiver's drift by half. In a short flight it
# should stay where it was and be carried by the velocities, so the drift is assumed to return to zero more
# slowly than it wanders. In a long one the random walk of the velocities must not add up: at this rate, the
# uncertainty of the position stays what the receiver states. In the first minute the position then follows a
# drift of 1.5 m by 0.38 m; at a tenth by 0.32 m, and the uncertainty would grow for hours.
PLAIN_REVERSION = 0.3


@kernel
def is_attitude_observable(accel: Vec3, field: Vec3) -> bool:
    """Whether the directions of specific force and magnetic field (body) differ enough to give tilt and
    heading."""
    return norm(cross(accel, field)) > MIN_SIN_ANGLE * norm(accel) * norm(field)


@kernel
def attitude_from_vectors(accel: Vec3, field: Vec3, north: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """R whose third row is the measured vertical and which turns the measured field to `north`."""
    up_b = normalise(accel)
    north_b = normalise(tangent(up_b, field))
    west_b = cross(up_b, north_b)
    body_axes = (north_b, west_b, up_b)  # rows: the axes magnetic north, west, up, seen from the body
    world_axes = from_columns(north, (-north[1], north[0], 0.0), (0.0, 0.0, 1.0))
    return (
        apply_transposed(body_axes, world_axes[0]),
        apply_transposed(body_axes, world_axes[1]),
        apply_transposed(body_axes, world_axes[2]),
    )


@kernel
def with_slow_error(
    sensor_errors: SensorErrors, horizontal: float, vertical: float, reversion: float
) -> SensorErrors:
    """The sensor errors with the deviations of the receiver's slow error."""
    sensor_errors = with_field(sensor_errors, "horizontal_slow_std", horizontal)
    sensor_errors = with_field(sensor_errors, "vertical_slow_std", vertical)
    return with_field(sensor_errors, "reversion", reversion)


@kernel
def load_ahead(state: EstimatorState, tuning: EstimatorTuning) -> LoadEstimate:
    """The load at its initial place: ahead of the vehicle, on the same ground."""
    load, vehicle = state.load, state.vehicle
    R = rotation_from_quat(vehicle.quat_wxyz)
    x = vehicle.x_quad
    x_load = (
        x[0] + tuning.initial_load_forward * R[0][0],
        x[1] + tuning.initial_load_forward * R[1][0],
        x[2] - tuning.standing_height + tuning.load_height,
    )
    return LoadEstimate(
        x_load,
        ZERO,
        load.q_cable,
        load.q_cable_dot,
        load.across,
        tuning.cable_length,
        (tuning.initial_load_std * tuning.initial_load_std, 0.0, 0.0),
        0.0,
        0.0,
        load.pull,
        0.0,
        0.0,
        load.age_s,
        0.0,
        CAMERA,
        load.laid_height,
        GROUND_HEIGHT_STD * GROUND_HEIGHT_STD,
        load.length_share,
    )


@kernel
def suspended_load(state: EstimatorState, history: History, tuning: EstimatorTuning) -> LoadEstimate:
    """The load on a taut cable below the vehicle, moving with it."""
    load, x = state.load, state.vehicle.x_quad
    std = SUSPENDED_STD * tuning.cable_length
    at_end = LoadEstimate(
        (x[0], x[1], x[2] - tuning.cable_length),
        state.vehicle.v_quad,
        (0.0, 0.0, -1.0),
        ZERO,
        load.across,
        tuning.cable_length,
        (std * std, 0.0, SUSPENDED_SPEED_STD * SUSPENDED_SPEED_STD),
        0.0,
        0.0,
        tuning.load_mass * tuning.gravity,
        0.0,
        0.0,
        load.age_s,
        0.0,
        CAMERA,
        load.laid_height,
        load.laid_height_var,
        load.length_share,
    )
    return tauten(at_end, state.vehicle, history, tuning, tuning.cable_length)


@kernel
def load_below(state: EstimatorState, tuning: EstimatorTuning) -> LoadEstimate:
    """The load on the ground, somewhere below a vehicle that flies without it."""
    load, x = load_ahead(state, tuning), state.vehicle.x_quad
    x_load = (x[0], x[1], min(tuning.load_height, x[2]))
    return with_field(load, "x_load", x_load)


@kernel
def initial_load(
    state: EstimatorState, history: History, tuning: EstimatorTuning, thrust: float
) -> LoadEstimate:
    """The load when a vehicle starts with its rotors giving `thrust` (N): it is ahead of a vehicle on the
    ground, is suspended from one that accelerates less than its rotors would make it, and otherwise is on
    the ground below it."""
    if not thrust > MIN_CARRYING_SHARE * tuning.quad_mass * tuning.gravity:
        return load_ahead(state, tuning)
    pull = thrust - tuning.quad_mass * state.last_imu.accel[2]
    if pull > SUSPENDED_PULL_SHARE * tuning.load_mass * tuning.gravity:
        return suspended_load(state, history, tuning)
    return load_below(state, tuning)


@kernel
def start_from_fix(
    state: EstimatorState, history: History, fix: GnssReading, tuning: EstimatorTuning, thrust: float
) -> EstimatorState:
    """The state with the vehicle started by the fix, except for its exact position, which the ordinary
    correction gives; also of a vehicle that slides over the ground, whose acceleration looked like a tilt as
    long as it was assumed to rest. `thrust` in N."""
    old, accel, g = state.vehicle, state.last_imu.accel, tuning.gravity
    airborne = thrust > MIN_CARRYING_SHARE * tuning.quad_mass * g
    speed_var = AIRBORNE_SPEED_STD * AIRBORNE_SPEED_STD if airborne else INITIAL_SPEED_STD * INITIAL_SPEED_STD
    R = attitude_from_vectors(accel, state.sensor_errors.field, magnetic_north(tuning.declination))
    quat = quat_from_rotation(R)
    bias_var = tuning.accel_bias_std * tuning.accel_bias_std
    tilt_var = (bias_var + tuning.accel_std * tuning.accel_std) / (g * g)
    if airborne:
        tilt_var += AIRBORNE_TILT_STD * AIRBORNE_TILT_STD
    set_initial_covariance(history, UNKNOWN_POSITION_STD * UNKNOWN_POSITION_STD, speed_var, tilt_var, tuning)
    P = history.covariance
    if not airborne:
        P[POSITION + 2, POSITION + 2] = GROUND_HEIGHT_STD * GROUND_HEIGHT_STD
    P[ATTITUDE + 2, ATTITUDE + 2] = 1.0
    # a bias of the accelerometer tilts the attitude that it levels
    for j in range(3):
        about_x, about_y = -R[1][j] * bias_var / g, R[0][j] * bias_var / g
        P[ATTITUDE, ACCEL_BIAS + j], P[ACCEL_BIAS + j, ATTITUDE] = about_x, about_x
        P[ATTITUDE + 1, ACCEL_BIAS + j], P[ACCEL_BIAS + j, ATTITUDE + 1] = about_y, about_y
    state = restart_slow_error(state, history)
    x_quad, v_quad = sub(fix.position, apply(R, tuning.antenna_position)), fix.velocity
    if not airborne:
        x_quad = (x_quad[0], x_quad[1], old.x_quad[2] if old.source == RECEIVER else tuning.standing_height)
        v_quad = (v_quad[0], v_quad[1], 0.0) if old.source == RECEIVER else ZERO
    vehicle = restarted_vehicle(old, history, x_quad, v_quad, quat, fix.age_s, RECEIVER)
    state = with_vehicle(state, vehicle, state.resets + 1.0)
    state = correct_magnetic(state, history, state.sensor_errors.field, 0.0, tuning)
    if state.load.source != TRACKER:
        state = with_load(state, initial_load(state, history, tuning, thrust), state.resets)
    return state


@kernel
def restart_slow_error(state: EstimatorState, history: History) -> EstimatorState:
    """Restart the receiver's slow error: zero, with the deviation stated now."""
    P, sensor_errors = history.covariance, state.sensor_errors
    zero_covariance(P, GNSS, 3)
    for i in range(3):
        slow_std = sensor_errors.horizontal_slow_std if i < 2 else sensor_errors.vertical_slow_std
        P[GNSS + i, GNSS + i] = slow_std * slow_std
    return with_sensor_errors(state, with_field(sensor_errors, "gnss", ZERO))


@kernel
def reset_position_uncertainty(state: EstimatorState, history: History) -> EstimatorState:
    """Make position and velocity as uncertain as after a long silence, so that the next fix decides them."""
    P = history.covariance
    for i in range(3):
        P[POSITION + i, POSITION + i] += UNKNOWN_POSITION_STD * UNKNOWN_POSITION_STD
        P[VELOCITY + i, VELOCITY + i] += 1.0
    v = state.vehicle
    return with_vehicle(state, vehicle_with_status(v, v.age_s, 0.0), state.resets + 1.0)


@kernel
def past_antenna(
    past: PastState, state: EstimatorState, history: History, tuning: EstimatorTuning
) -> PastState:
    """The past state with position and velocity of the antenna.

    At r from the centre of mass they are x + R r and v + (R r)'. An error of the attitude adds attitude x R r
    and attitude x (R r)' to theirs; that of the gyroscope's bias in (R r)' is left out.
    """
    r = tuning.antenna_position
    if is_zero(r):
        return past
    arm = apply(rotation_from_quat(past.quat_wxyz), r)
    arm_velocity = turning_velocity(state.head, history.ring, state.time_s - past.age, r)
    past = with_field(past, "x_quad", add(past.x_quad, arm))
    past = with_field(past, "v_quad", add(past.v_quad, arm_velocity))
    past = with_field(past, "displacement", add(past.displacement, arm))
    return with_field(past, "velocity_gain", sub(past.velocity_gain, arm_velocity))


@kernel
def correct_gnss(
    state: EstimatorState, history: History, fix: GnssReading, tuning: EstimatorTuning, thrust: float
) -> EstimatorState:
    """The state after the fix; `history` is corrected along with it. `thrust` (N): assumed of the rotors.

    Ignored where a tracker measures the position of the vehicle.
    """
    if state.vehicle.source == TRACKER:
        return state
    state = with_capacity(state, fix.age_s, SIZE)
    n = state.size
    share = tuning.rtk_white if fix.rtk > PLAIN else tuning.gnss_white
    speed_std = tuning.rtk_speed_std if fix.rtk > PLAIN else tuning.gnss_speed_std
    starting = state.vehicle.source == NO_SENSOR or slides(state, tuning, thrust, fix.velocity, speed_std)
    # the error of a float fix is not that of the fixes before, and stays the same until the carrier is fixed
    # again: all readings within EST_GPS_TAU together count as one
    is_float = fix.rtk == RTK_FLOAT and not starting
    new_share, slow_share = share, sqrt(1.0 - share * share)
    if is_float:
        period_s = max(MIN_FIX_PERIOD_S, state.vehicle.age_s - fix.age_s)
        new_share = sqrt(max(1.0, 2.0 * tuning.gnss_time / period_s))
    last_slow_std = state.sensor_errors.horizontal_slow_std
    sensor_errors = with_slow_error(
        state.sensor_errors,
        state.sensor_errors.horizontal_slow_std if is_float else slow_share * fix.horizontal_std,
        state.sensor_errors.vertical_slow_std if is_float else slow_share * fix.vertical_std,
        1.0 if fix.rtk > PLAIN else PLAIN_REVERSION,
    )
    state = with_sensor_errors(state, sensor_errors)
    # once the carrier's waves are counted, the earlier error no longer exists
    if (
        fix.rtk == RTK_FIXED
        and not starting
        and last_slow_std > SLOW_ERROR_RESTART_RATIO * sensor_errors.horizontal_slow_std
    ):
        state = restart_slow_error(state, history)
    if starting:
        if not (
            sensor_errors.magnetic_age <= MAX_MAGNETIC_AGE_S
            and is_attitude_observable(state.last_imu.accel, sensor_errors.field)
        ):
            return state
        state = start_from_fix(state, history, fix, tuning, thrust)
    past = past_antenna(past_state(state, history, tuning, fix.age_s), state, history, tuning)
    innovation = sub(fix.position, add(past.x_quad, state.sensor_errors.gnss))
    difference = sub(fix.velocity, past.v_quad)
    horizontal_std, vertical_std = new_share * fix.horizontal_std, new_share * fix.vertical_std
    climb_std = CLIMB_STD_RATIO * speed_std
    position_var = (
        horizontal_std * horizontal_std,
        horizontal_std * horizontal_std,
        vertical_std * vertical_std,
    )
    velocity_var = (speed_std * speed_std, speed_std * speed_std, climb_std * climb_std)
    for i in range(3):
        start_scalar(history, i, innovation[i], position_var[i])
        add_position_jacobian(history, i, past, i)
        add_jacobian_entry(history, i, GNSS + i, 1.0)
        start_scalar(history, 3 + i, difference[i], velocity_var[i])
        add_velocity_jacobian(history, 3 + i, past, i)
    compute_gain_rows(history, 0, 6, n)
    if not within_gate(history, FIX, 6, tuning.gate_sigma):
        vehicle = state.vehicle
        if vehicle.rejected + 1.0 < FIXES_BEFORE_RESET:
            rejected_vehicle = vehicle_with_status(vehicle, vehicle.age_s, vehicle.rejected + 1.0)
            return with_vehicle(state, rejected_vehicle, state.resets)
        return reset_position_uncertainty(state, history)
    start_correction(history)
    nis = fuse_scalars(history, 6, n)
    history.consistency[FIX, 0] += 1.0
    history.consistency[FIX, 1] += nis
    state = inject_error(state, history)
    return with_vehicle(state, vehicle_with_status(state.vehicle, fix.age_s, 0.0), state.resets)
