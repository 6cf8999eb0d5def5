"""Prediction over one IMU sample: strapdown for the vehicle, a driven pendulum for the cable.

The pendulum needs neither thrust nor masses: while the cable is taut, only gravity, cable and air act on the
load, so that the direction q from vehicle to load obeys

    L q'' = -P_q (x_Q'' + g e3 - d) - L |q'|^2 q,        P_q = I - q q^T,

where x_Q'' + g e3 = R a is the reading of the accelerometer, and d, which is estimated, is the horizontal
acceleration of the load by the air: drag and wind divided by the load's mass.
"""

from __future__ import annotations

from math import sqrt

from autopilot.estimation.air import air_walk, predict_air
from autopilot.estimation.cable_pull import (
    force_beyond_thrust,
    learned_frame_share,
    measured_pull,
    rotor_drag_growth,
    without_climb_drag,
)
from autopilot.estimation.clipping import add_impact_noise, update_clipping
from autopilot.estimation.covariance import PropagationInputs, propagate_covariance
from autopilot.estimation.history import store_state
from autopilot.estimation.imu_height import learned_imu_height
from autopilot.estimation.records import (
    AIDED_SIZE,
    ATTITUDE,
    DIRECTION,
    GNSS,
    LENGTH,
    POSITION,
    RING_LENGTH,
    TRACKER,
    VELOCITY,
    AirEstimate,
    Covariance2,
    EstimatorState,
    EstimatorTuning,
    History,
    ImuReading,
    LoadEstimate,
    Uncertainty,
    VehicleEstimate,
)
from autopilot.estimation.tautness import (
    add_snatch_uncertainty,
    averaged_missing_pull,
    averaged_slack_pull,
    cable_is_unloaded,
    detect_tautness,
    is_pull_known,
    orthogonal_axis,
)
from autopilot.estimation.vibration import accel_noise, gyro_noise, update_vibration
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    Mat3,
    Vec3,
    add,
    apply,
    axpy,
    cross,
    dot,
    norm,
    scale,
    sub,
)
from autopilot.geometry.packed import with_field
from autopilot.geometry.rigid_body import angular_accel, arm_accel
from autopilot.geometry.s2 import normalise, tangent
from autopilot.geometry.so3 import quat_exp, quat_multiply, quat_normalise, rotation_from_quat

SLACK_ACCEL_STD = 10.0  # m/s^2, of a tracked load: whether it falls freely or rests on the ground is unknown
# rad/s^2, error of the pendulum model of a cable that does not carry its load; the same of a tracked load in
# calm air, and the share of d by which the air moves a load that rests on the ground less than one that hangs
LIFTING_ACCEL_STD, LIFTING_TRACKED_ACCEL_STD, RESTING_AIR_SHARE = 5.0, 0.05, 0.7
# m/s, speed at which a tracked load and the vehicle move apart until the cable carries
SEPARATION_SPEED_STD = 0.3
PENDING_CORRECTION_TIME_S = 4.0  # time constant with which a plain receiver's corrections are passed on
SPEED_ERROR_TIME_S = 1.0  # for which an error of the vehicle's velocity lasts
# A load on the ground that is estimated farther from the vehicle than this share of its cable, and this many
# deviations, is dragged along; how far beside it is not known where the vehicle is nearly as high (share)
DRAGGING_SHARE, DRAGGING_SIGMAS, MIN_DRAGGING_SHARE = 1.05, 3.0, 0.3
LEARNING_STEPS = 4  # after which the place of the inertial unit is learned from one more sample
LEAST_STEP = 1e-9  # s, in place of a step of no duration
LOAD_ON_GROUND_WALK = 0.01  # m per square root of a second, of a load that stays where it is on the ground


@kernel
def propagate_covariance2(cov: Covariance2, dt: float, accel_std: float) -> Covariance2:
    """Covariance of (value, rate) after dt with white noise of `accel_std` dt on the rate."""
    aa, ab, bb = cov
    return (aa + 2.0 * dt * ab + dt * dt * bb, ab + dt * bb, bb + accel_std * accel_std * dt * dt)


@kernel
def _mean(a: Vec3, b: Vec3) -> Vec3:
    return scale(0.5, add(a, b))


@kernel
def filtered_body_rate(
    vehicle: VehicleEstimate, gyro: Vec3, moment: Vec3, gyro_var: float, tuning: EstimatorTuning, dt: float
) -> Vec3:
    """Body rate (rad/s): propagated by the rotors' moment (N m), and corrected by the gyroscope as far as its
    noise is small beside the error of this propagation."""
    W = vehicle.omega_body
    predicted = axpy(dt, angular_accel(W, moment, tuning.inertia), W)
    model_std = tuning.turn_std * dt
    ratio = model_std * model_std / gyro_var
    share = 0.5 * (sqrt(ratio * ratio + 4.0 * ratio) - ratio)
    return axpy(share, sub(sub(gyro, vehicle.gyro_bias), predicted), predicted)


@kernel
def predict_vehicle(
    vehicle: VehicleEstimate,
    imu: ImuReading,
    last: ImuReading,
    moment: Vec3,
    gyro_var: float,
    imu_height: float,
    tuning: EstimatorTuning,
    dt: float,
) -> tuple[VehicleEstimate, Mat3]:
    """Strapdown integration by the trapezoidal rule over the last two samples; also R at half a step."""
    gyro = sub(_mean(imu.gyro, last.gyro), vehicle.gyro_bias)
    omega = filtered_body_rate(vehicle, imu.gyro, moment, gyro_var, tuning, dt)
    position = add(tuning.imu_position, (0.0, 0.0, imu_height))
    omega_dot = scale(1.0 / max(dt, LEAST_STEP), sub(omega, vehicle.omega_body))
    turning = arm_accel(gyro, omega_dot, position)
    accel = sub(sub(_mean(imu.accel, last.accel), vehicle.accel_bias), turning)
    R = rotation_from_quat(quat_multiply(vehicle.quat_wxyz, quat_exp(scale(0.5 * dt, gyro))))
    force = apply(R, accel)  # specific force, ENU
    accel_quad = (force[0], force[1], force[2] - tuning.gravity)
    predicted = VehicleEstimate(
        x_quad=axpy(0.5 * dt * dt, accel_quad, axpy(dt, vehicle.v_quad, vehicle.x_quad)),
        v_quad=axpy(dt, accel_quad, vehicle.v_quad),
        quat_wxyz=quat_normalise(quat_multiply(vehicle.quat_wxyz, quat_exp(scale(dt, gyro)))),
        omega_body=omega,
        gyro_bias=vehicle.gyro_bias,
        accel_bias=vehicle.accel_bias,
        accel_quad=accel_quad,
        age_s=vehicle.age_s + dt,
        rejected=vehicle.rejected,
        source=vehicle.source,
        turning_accel=turning,
    )
    return predicted, R


@kernel
def predict_taut(
    load: LoadEstimate, vehicle: VehicleEstimate, air: AirEstimate, tuning: EstimatorTuning, dt: float
) -> LoadEstimate:
    """The pendulum; `vehicle` is already at the new time."""
    q, q_dot, d = load.q_cable, load.q_cable_dot, air.load_accel
    accel_quad = vehicle.accel_quad
    force = (accel_quad[0] - d[0], accel_quad[1] - d[1], accel_quad[2] + tuning.gravity)
    half = normalise(axpy(0.5 * dt, q_dot, q))  # since `force` is that of half a step
    q_ddot = axpy(-dot(q_dot, q_dot), half, scale(-1.0 / load.length, tangent(half, force)))
    tension = max(0.0, -tuning.load_mass * (load.length * dot(half, q_ddot) + dot(half, force)))
    q_next = normalise(axpy(0.5 * dt * dt, q_ddot, axpy(dt, q_dot, q)))
    rate = tangent(q_next, axpy(dt, q_ddot, q_dot))
    return LoadEstimate(
        axpy(load.length, q_next, vehicle.x_quad),
        axpy(load.length, rate, vehicle.v_quad),
        q_next,
        rate,
        normalise(tangent(q_next, load.across)),
        load.length,
        load.covariance,
        load.taut,
        tension,
        load.pull,
        load.pull_duration_s,
        load.tautness_age_s + dt,
        load.age_s + dt,
        load.rejected,
        load.source,
        load.laid_height,
        load.laid_height_var,
        load.length_share,
    )


@kernel
def dragged_along(x_load: Vec3, vehicle: VehicleEstimate, distance_var: float, cable_length: float) -> Vec3:
    """Where a load on the ground is whose estimated place is farther from the vehicle than its cable allows,
    by more than the error of their distance (variance in m^2)."""
    reach = DRAGGING_SHARE * cable_length + DRAGGING_SIGMAS * sqrt(distance_var)
    east, north, height = sub(x_load, vehicle.x_quad)
    level = sqrt(east * east + north * north)
    allowed = max(sqrt(max(0.0, reach * reach - height * height)), MIN_DRAGGING_SHARE * cable_length)
    if level <= allowed:
        return x_load
    share = allowed / level
    return (vehicle.x_quad[0] + share * east, vehicle.x_quad[1] + share * north, x_load[2])


@kernel
def predict_slack(
    load: LoadEstimate, vehicle: VehicleEstimate, history: History, cable_length: float, dt: float
) -> LoadEstimate:
    """A load on a slack cable: a tracked load continues at its velocity, any other stays where it is, unless
    the vehicle drags it along.

    The covariance of a load on the ground is that of its position relative to the vehicle, which the error
    of the vehicle's velocity shifts.
    """
    x_load, v_load, covariance = load.x_load, load.v_load, load.covariance
    if load.source == TRACKER:
        x_load = axpy(dt, v_load, x_load)
        covariance = propagate_covariance2(covariance, dt, SLACK_ACCEL_STD)
    else:
        aa, ab, bb = covariance
        P = history.covariance
        speed_var = 0.5 * (P[VELOCITY, VELOCITY] + P[VELOCITY + 1, VELOCITY + 1])
        covariance = (
            aa + (LOAD_ON_GROUND_WALK * LOAD_ON_GROUND_WALK + SPEED_ERROR_TIME_S * speed_var) * dt,
            ab,
            bb,
        )
        x_load = dragged_along(x_load, vehicle, P[POSITION + 2, POSITION + 2] + aa, cable_length)
    separation = sub(x_load, vehicle.x_quad)
    distance = norm(separation)
    q, across, q_dot = load.q_cable, load.across, load.q_cable_dot
    # the estimates of load and vehicle may coincide: the direction is then kept
    if distance > 0.01:
        q = scale(1.0 / distance, separation)
        across = orthogonal_axis(q, across)
        q_dot = scale(1.0 / distance, tangent(q, sub(v_load, vehicle.v_quad)))
    return LoadEstimate(
        x_load,
        v_load,
        q,
        q_dot,
        across,
        load.length,
        covariance,
        load.taut,
        0.0,
        load.pull,
        load.pull_duration_s,
        load.tautness_age_s + dt,
        load.age_s + dt,
        load.rejected,
        load.source,
        load.laid_height,
        load.laid_height_var,
        load.length_share,
    )


@kernel
def state_uncertainty(history: History, load: LoadEstimate, size: int) -> Uncertainty:
    """Standard deviations by the covariance."""
    P = history.covariance
    horizontal_var = 0.5 * (P[POSITION, POSITION] + P[POSITION + 1, POSITION + 1])
    relative_var = horizontal_var
    if size >= AIDED_SIZE:
        relative_var += P[POSITION, GNSS] + P[POSITION + 1, GNSS + 1]
        relative_var += 0.5 * (P[GNSS, GNSS] + P[GNSS + 1, GNSS + 1])
    load_var = load.covariance[0]
    if load.taut > 0.0:
        L = load.length
        load_var = L * L * (P[DIRECTION, DIRECTION] + P[DIRECTION + 1, DIRECTION + 1]) + P[LENGTH, LENGTH]
        if load.source == TRACKER:
            a, b = load.across, cross(load.q_cable, load.across)
            for i in range(3):
                load_var += P[POSITION + i, POSITION + i]
                load_var += (
                    2.0 * L * (a[i] * P[POSITION + i, DIRECTION] + b[i] * P[POSITION + i, DIRECTION + 1])
                )
                load_var += 2.0 * load.q_cable[i] * P[POSITION + i, LENGTH]
        load_var /= 3.0
    return Uncertainty(
        sqrt(horizontal_var),
        sqrt(P[POSITION + 2, POSITION + 2]),
        sqrt(0.5 * (P[ATTITUDE, ATTITUDE] + P[ATTITUDE + 1, ATTITUDE + 1])),
        sqrt(P[ATTITUDE + 2, ATTITUDE + 2]),
        sqrt(load_var),
        sqrt(relative_var),
        sqrt(max(P[VELOCITY, VELOCITY], P[VELOCITY + 1, VELOCITY + 1], P[VELOCITY + 2, VELOCITY + 2])),
    )


@kernel
def pendulum_error(state: EstimatorState, history: History, tuning: EstimatorTuning) -> tuple[float, float]:
    """Standard deviations of the pendulum's acceleration (rad/s^2), and of the speed at which the ends of
    the cable move apart (m/s)."""
    load, d = state.load, state.air.load_accel
    if load.taut == 0.0 or not cable_is_unloaded(load, history, state.memory_s, state.missing_pull):
        return tuning.cable_accel_std, 0.0
    if load.source != TRACKER:
        return LIFTING_ACCEL_STD, 0.0
    by_air = RESTING_AIR_SHARE / load.length
    variance = LIFTING_TRACKED_ACCEL_STD * LIFTING_TRACKED_ACCEL_STD
    return sqrt(variance + by_air * by_air * (d[0] * d[0] + d[1] * d[1])), SEPARATION_SPEED_STD


@kernel
def predict(
    state: EstimatorState,
    history: History,
    imu: ImuReading,
    tuning: EstimatorTuning,
    dt: float,
    thrust: float,
    moment: Vec3,
) -> EstimatorState:
    """The state dt seconds later; the rotors are assumed to give `thrust` (N) and `moment` (N m, body)."""
    load, sensor_errors, air = state.load, state.sensor_errors, state.air
    vibration = update_vibration(state.vibration, imu, state.last_imu, tuning, dt)
    accel_var = accel_noise(vibration, tuning)
    gyro_var = gyro_noise(vibration, tuning)
    clipping = update_clipping(state.clipping, state.vibration, imu, state.last_imu, tuning, dt)
    if clipping.gyro > 0.0:
        gyro_var = max(gyro_var, tuning.gyro_range * tuning.gyro_range)
    vehicle, R = predict_vehicle(
        state.vehicle, imu, state.last_imu, moment, gyro_var, state.imu_height.height, tuning, dt
    )
    a = vehicle.accel_quad
    cable_accel_std, separation_std = pendulum_error(state, history, tuning)
    inputs = PropagationInputs(
        (a[0], a[1], a[2] + tuning.gravity),
        R,
        load.q_cable,
        load.across,
        cross(load.q_cable, load.across),
        load.q_cable_dot,
        load.length,
        load.taut,
        sensor_errors.horizontal_slow_std,
        sensor_errors.vertical_slow_std,
        sensor_errors.reversion,
        accel_var,
        gyro_var,
        air_walk(load, air, a, tuning),
        cable_accel_std,
        separation_std,
    )
    if vehicle.source > 0.0:
        propagate_covariance(history, inputs, tuning, dt, state.size)
        if clipping.impact_age_s == 0.0:
            add_impact_noise(
                history,
                clipping,
                R,
                state.vehicle.v_quad,
                inputs.across,
                inputs.along,
                inputs.length,
                inputs.taut,
            )
    if load.taut > 0.0:
        predicted_load = predict_taut(load, vehicle, air, tuning, dt)
    else:
        predicted_load = predict_slack(load, vehicle, history, tuning.cable_length, dt)
    frame_share = state.frame_share
    growth = rotor_drag_growth(thrust, state.last_thrust, frame_share, tuning)
    force = without_climb_drag(
        force_beyond_thrust(vehicle, imu, thrust, tuning), predicted_load, vehicle, frame_share, tuning
    )
    measured = measured_pull(force, predicted_load, vehicle, frame_share)
    load = detect_tautness(predicted_load, vehicle, history, measured, state.missing_pull, tuning, dt)
    add_snatch_uncertainty(load, state.load.pull, history, tuning)
    if is_pull_known(load, vehicle, history, state.missing_pull, tuning):
        frame_share = learned_frame_share(force, load, vehicle, frame_share, tuning, dt)
    imu_height = state.imu_height
    if state.head % LEARNING_STEPS == 0:
        step = LEARNING_STEPS * dt
        imu_height = learned_imu_height(
            imu_height, force, measured, load, vehicle, thrust, moment, tuning, step
        )
    pending = scale(1.0 - dt / PENDING_CORRECTION_TIME_S, sensor_errors.pending_correction)
    sensor_errors = with_field(sensor_errors, "pending_correction", pending)
    sensor_errors = with_field(sensor_errors, "magnetic_age", sensor_errors.magnetic_age + dt)
    sensor_errors = with_field(sensor_errors, "barometer_age", sensor_errors.barometer_age + dt)
    predicted = EstimatorState(
        state.time_s + dt,
        vehicle,
        load,
        sensor_errors,
        predict_air(air, state.load, load, history.covariance, growth, tuning, dt),
        state_uncertainty(history, load, state.size),
        imu,
        vibration,
        clipping,
        averaged_missing_pull(load, vehicle, history, state.missing_pull, tuning, dt),
        averaged_slack_pull(state.slack_pull, measured, load, vehicle, R[2][2], history, tuning, dt),
        imu_height,
        frame_share,
        thrust,
        state.resets,
        state.memory_s,
        (state.head + 1) % RING_LENGTH,
        state.size,
    )
    store_state(predicted, history)
    return predicted
