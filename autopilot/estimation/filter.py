"""The estimator as the core uses it: one call for each tick's readings.

`control_state` is the state passed to the control laws. `vehicle_problem` and `load_problem` decide
whether the estimate is good enough for flight, `problem_texts` states why it is not, and `estimate_loss`
why it is not even good enough for a landing. `knows_attitude`, `knows_height` and `knows_speed` tell which
parts of the vehicle's estimate remain when the rest is not good enough.
"""

from __future__ import annotations

from math import isfinite, isinf, radians, sqrt

from autopilot.control.drag import Drag
from autopilot.control.records import Cable, State
from autopilot.estimation.inbox import (
    DIRECTION,
    FIELD,
    FIX,
    HEIGHT,
    IMU,
    KIND,
    LOAD,
    POSE,
    READING,
    age_of,
    is_valid_imu,
    read_direction,
    read_fix,
    read_load,
    read_pose,
    read_vector,
)
from autopilot.estimation.measurements.barometer import correct_barometer
from autopilot.estimation.measurements.direction import correct_direction
from autopilot.estimation.measurements.gnss import correct_gnss, initial_load
from autopilot.estimation.measurements.load import correct_load
from autopilot.estimation.measurements.magnetic import correct_magnetic
from autopilot.estimation.measurements.pose import correct_pose
from autopilot.estimation.measurements.pull import correct_pull
from autopilot.estimation.measurements.tautening import correct_tautening
from autopilot.estimation.measurements.zero_velocity import correct_zero_velocity
from autopilot.estimation.predict import predict
from autopilot.estimation.records import (
    CAMERA,
    NO_SENSOR,
    RECEIVER,
    TRACKER,
    Array,
    EstimatorState,
    EstimatorTuning,
    History,
    ImuReading,
)
from autopilot.estimation.release import release_load
from autopilot.estimation.tautness import is_never_observed, with_learned_mass
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, norm, sub
from autopilot.geometry.packed import unpack, with_field
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.vehicle.parameters import standing_height_m
from autopilot.wire.parameter_table import ParameterTable

POSITION_STD_TO_FLY = 0.05  # m, with trackers
FIX_STD_TO_FLY = 0.15  # m, beyond the deviation that a receiver states: margin for coasting or a float fix
SPEED_STD_TO_REPORT = 2.0  # m/s, above that of any start: an impact leaves more
ATTITUDE_STD_TO_FLY = 0.05  # rad
HEADING_STD_TO_FLY = 0.15  # rad, by a magnetometer
# m and rad relative to the vehicle, of a load that no tracker measures: one of them is enough
LOAD_STD_TO_FLY, CABLE_STD_TO_FLY = 0.1, 0.14
STATED_STD_FACTOR = 1.5  # times the deviation that the receiver states
MAX_FIX_AGE_S = 2.0  # for which the IMU bridges a gap between fixes, and between heights of the barometer
MAX_DIRECTION_AGE_S = 1.0  # for which the pendulum bridges a gap between directions to the load
# For which the pendulum bridges a gap between a tracker's readings, whose velocity starts it better: a load
# hidden for 5 s is 2 mm off in calm air and 8 mm in wind of 5 m/s with gusts of 1 m/s, as its covariance
# states. For the same time, a load whose cable is slack is assumed to rest.
MAX_LOAD_AGE_S = 2.0
# up to this age of a tracker's reading, the accuracy of a load on a slack cable is checked
FRESH_READING_S = 0.1
TILT_STD_TO_LAND = 0.2  # rad
POSITION_STD_TO_LAND = 10.0  # m
LOAD_TRACKER_WAIT_S = 0.5  # after this time without a tracker reading, the load is assumed to have no tracker
PULL_SETTLING_S = 1.0  # in which the pull of a cable that came taut shows its direction
MAX_IMU_AGE_S = 0.1  # for which an inertial sample replaces missing ones


def estimator_tuning(table: ParameterTable) -> EstimatorTuning:
    """The estimator's assumptions, from the parameters VEH_, EST_ and PLB_DRAG."""
    length = table["VEH_CABLE_LEN"]
    return EstimatorTuning(
        cable_length=length,
        quad_mass=table["VEH_QUAD_MASS"],
        load_mass=table["VEH_LOAD_MASS"],
        gravity=table["VEH_GRAVITY"],
        gyro_std=table["EST_GYRO_STD"],
        accel_std=table["EST_ACC_STD"],
        gyro_range=table["EST_GYRO_RANGE"],
        accel_range=table["EST_ACC_RANGE"],
        gyro_bias_std=table["EST_GYRO_BIAS"],
        accel_bias_std=table["EST_ACC_BIAS"],
        gyro_bias_walk=table["EST_GYRO_WALK"],
        accel_bias_walk=table["EST_ACC_WALK"],
        cable_accel_std=table["EST_CABLE_STD"],
        load_drag=table["EST_LOAD_DRAG"],
        air_std=table["EST_AIR_STD"],
        air_walk=table["EST_AIR_WALK"],
        push_std=table["EST_PUSH_STD"],
        push_walk=table["EST_PUSH_WALK"],
        drag=Drag(table["PLB_DRAG"], table["PLB_DRAG_2"]),
        inertia=(table["VEH_J_XX"], table["VEH_J_YY"], table["VEH_J_ZZ"]),
        turn_std=table["EST_TURN_STD"],
        length_std=table["EST_LEN_STD"],
        gate_sigma=table["EST_GATE"],
        imu_age=1e-3 * table["VEH_IMU_DELAY"],
        rtk_white=table["EST_RTK_NEW"],
        gnss_white=table["EST_GPS_NEW"],
        gnss_time=table["EST_GPS_TAU"],
        rtk_speed_std=table["EST_RTK_V_STD"],
        gnss_speed_std=table["EST_GPS_V_STD"],
        barometer_std=table["EST_BARO_STD"],
        barometer_walk=table["EST_BARO_WALK"],
        barometer_age=1e-3 * table["EST_BARO_LAT"],
        magnetic_std=table["EST_MAG_STD"],
        magnetic_bias=table["EST_MAG_BIAS"],
        magnetic_age=1e-3 * table["EST_MAG_LAT"],
        declination=radians(table["EST_MAG_DECL"]),
        mounting_std=table["EST_CAM_BIAS"],
        standing_height=standing_height_m(table),
        load_height=table["EST_LOAD_H"],
        initial_load_forward=table["EST_LAID_FWD"] * length,
        initial_load_std=table["EST_LAID_STD"] * length,
        imu_position=table.vector("VEH_IMU_POS_"),
        antenna_position=table.vector("VEH_GPS_POS_"),
    )


@kernel
def with_length_change(state: EstimatorState, length_change: float) -> EstimatorState:
    """The estimate with a cable longer by `length_change` (m); unchanged while the cable is slack."""
    load = state.load
    if length_change == 0.0 or load.taut == 0.0:
        return state
    return with_field(state, "load", with_field(load, "length", load.length + length_change))


@kernel
def estimate(
    state: EstimatorState,
    history: History,
    inbox: Array,
    count: int,
    now_us: int,
    tuning: EstimatorTuning,
    cable: Cable,
    length_change: float,
    dt: float,
    thrust: float,
    moment: Vec3,
) -> EstimatorState:
    """The state after `dt` seconds and the first `count` readings of the inbox. `history` is written in
    place.

    `thrust` (N) and `moment` (N m, body) are those that the rotors are assumed to give; the cable's
    length has changed by `length_change` (m) since the last tick. The estimator models a cable of constant
    length: the winch's speed is subtracted from the velocity that the load tracker measures,
    v_L = v_Q + L q' + L' q.
    """
    state = with_length_change(state, length_change)
    tuning = with_learned_mass(with_field(tuning, "cable_length", cable.length), state.slack_pull)
    reeling, along = cable.rate != 0.0 and state.load.taut != 0.0, state.load.q_cable
    if isinf(cable.length):
        state = release_load(state, history, tuning)
    latest_imu = state.last_imu
    for i in range(count):
        if inbox[i, KIND] == IMU:
            imu = unpack(ImuReading, inbox[i], READING)
            if is_valid_imu(imu):
                latest_imu = imu
    load = state.load
    state = predict(state, history, latest_imu, tuning, dt, thrust, moment)
    state = correct_tautening(state, history, load, tuning, dt)
    # readings that are older than the last impact are dropped
    max_age_s = state.clipping.impact_age_s
    if max_age_s > 0.0:
        state = correct_pull(state, history, tuning, thrust)
    for i in range(count):
        if inbox[i, KIND] == POSE:
            valid, pose = read_pose(inbox[i], age_of(inbox[i], now_us, tuning.imu_age))
            if valid and pose.age_s <= max_age_s:
                state = correct_pose(state, history, pose, tuning)
    for i in range(count):
        if inbox[i, KIND] == FIELD and tuning.magnetic_age <= max_age_s:
            field = read_vector(inbox[i])
            strength = norm(field)
            if isfinite(strength) and strength > 0.0:
                state = correct_magnetic(state, history, field, tuning.magnetic_age, tuning)
    for i in range(count):
        if inbox[i, KIND] == FIX:
            valid, fix = read_fix(inbox[i], age_of(inbox[i], now_us, tuning.imu_age))
            if valid and fix.age_s <= max_age_s:
                state = correct_gnss(state, history, fix, tuning, thrust)
    for i in range(count):
        is_height = inbox[i, KIND] == HEIGHT and isfinite(inbox[i, READING])
        if is_height and tuning.barometer_age <= max_age_s:
            state = correct_barometer(state, history, inbox[i, READING], tuning.barometer_age, tuning)
    # a load is measured together with the vehicle, whose position it would decide after an impact
    vehicle_accepted = state.vehicle.rejected == 0.0 and state.vehicle.age_s <= max_age_s
    for i in range(count):
        if inbox[i, KIND] == LOAD:
            valid, reading = read_load(inbox[i], age_of(inbox[i], now_us, tuning.imu_age))
            if reeling:
                reading = with_field(reading, "v_load", axpy(-cable.rate, along, reading.v_load))
            if valid and vehicle_accepted and reading.age_s <= max_age_s:
                state = correct_load(state, history, reading, tuning)
    for i in range(count):
        if inbox[i, KIND] == DIRECTION:
            valid, direction = read_direction(inbox[i], age_of(inbox[i], now_us, tuning.imu_age))
            if valid and direction.age_s <= max_age_s:
                state = correct_direction(state, history, direction, tuning)
    if state.vehicle.source == RECEIVER:
        state = correct_zero_velocity(state, history, tuning, thrust)
    if (
        state.vehicle.source == TRACKER
        and state.load.source == NO_SENSOR
        and state.time_s > LOAD_TRACKER_WAIT_S
    ):
        state = with_field(state, "load", initial_load(state, history, tuning, thrust))
    return state


@kernel
def control_state(state: EstimatorState, cable: Cable) -> State:
    """State passed to the control laws.

    A plain receiver measures the position to metres, and each correction of the velocity moves the estimated
    position by decimetres at once. These corrections are passed on over seconds, so that the laws do not make
    the load follow them.
    """
    vehicle, load, pending_correction = state.vehicle, state.load, state.sensor_errors.pending_correction
    v_load = load.v_load
    if cable.rate != 0.0 and load.taut != 0.0:
        v_load = axpy(cable.rate, load.q_cable, v_load)
    return State(
        sub(load.x_load, pending_correction),
        v_load,
        load.q_cable,
        load.q_cable_dot,
        sub(vehicle.x_quad, pending_correction),
        vehicle.v_quad,
        rotation_from_quat(vehicle.quat_wxyz),
        vehicle.omega_body,
        vehicle.accel_quad,
    )


# why the estimate is not good enough for flight; 0: it is
NO_POSE, NO_FIX, POSITION_UNSETTLED, FIX_UNSETTLED, ATTITUDE_UNSETTLED, HEADING_UNSETTLED = 1, 2, 3, 4, 5, 6
NO_LOAD, NO_LOAD_DIRECTION, LOAD_UNSETTLED = 7, 8, 9
NO_INERTIAL = 10
_PROBLEM_TEXTS = {
    NO_POSE: "no vehicle pose from a tracker",
    NO_FIX: "no position from the receiver",
    POSITION_UNSETTLED: "vehicle position not settled",
    FIX_UNSETTLED: "vehicle position not settled, good to {:.1f} m",
    ATTITUDE_UNSETTLED: "vehicle attitude not settled",
    HEADING_UNSETTLED: "vehicle heading not settled",
    NO_LOAD: "no load position from a tracker",
    NO_LOAD_DIRECTION: "no direction to the load from the camera",
    LOAD_UNSETTLED: "load position not settled",
    NO_INERTIAL: "no reading of the inertial unit",
}
_UNSETTLED = (POSITION_UNSETTLED, FIX_UNSETTLED, ATTITUDE_UNSETTLED, HEADING_UNSETTLED, LOAD_UNSETTLED)
IMPACT_TOLD_S = 1.0  # after an impact, for which it counts as the cause of what is not settled


@kernel
def inertial_problem(silent_s: float) -> int:
    """What is wrong with the inertial unit, whose last new sample is `silent_s` old; 0 if nothing is."""
    return 0 if silent_s <= MAX_IMU_AGE_S else NO_INERTIAL


@kernel
def vehicle_problem(state: EstimatorState, max_age_s: float) -> int:
    """What is wrong with the estimate of the vehicle; 0 if nothing is. The comparisons are written so that
    NaN is a problem."""
    vehicle, uncertainty = state.vehicle, state.uncertainty
    if vehicle.source == RECEIVER:
        std_limit = FIX_STD_TO_FLY + STATED_STD_FACTOR * state.sensor_errors.horizontal_slow_std
        if not vehicle.age_s <= max(max_age_s, MAX_FIX_AGE_S):
            return NO_FIX
        if not (uncertainty.horizontal <= std_limit and uncertainty.relative <= std_limit):
            return FIX_UNSETTLED
        if not uncertainty.tilt <= ATTITUDE_STD_TO_FLY:
            return ATTITUDE_UNSETTLED
        return 0 if uncertainty.heading <= HEADING_STD_TO_FLY else HEADING_UNSETTLED
    if not vehicle.age_s <= max_age_s:
        return NO_POSE
    if not (uncertainty.horizontal <= POSITION_STD_TO_FLY and uncertainty.vertical <= POSITION_STD_TO_FLY):
        return POSITION_UNSETTLED
    if not (uncertainty.tilt <= ATTITUDE_STD_TO_FLY and uncertainty.heading <= ATTITUDE_STD_TO_FLY):
        return ATTITUDE_UNSETTLED
    return 0


@kernel
def knows_attitude(state: EstimatorState, problem: int) -> bool:
    """Whether the attitude, with this problem of the vehicle or of its inertial unit, is good enough for a
    landing. Written so that NaN is not."""
    return bool(
        problem != NO_INERTIAL
        and state.vehicle.source != NO_SENSOR
        and state.uncertainty.tilt <= TILT_STD_TO_LAND
    )


@kernel
def knows_speed(state: EstimatorState) -> bool:
    """Whether the vehicle's velocity is known: an impact beyond the range of the accelerometer hides it until
    the next readings. Written so that NaN is not."""
    return bool(state.uncertainty.speed <= SPEED_STD_TO_REPORT)


@kernel
def knows_height(state: EstimatorState, problem: int) -> bool:
    """Whether the height, with this problem of the vehicle or of its inertial unit, is good enough for a
    landing: the barometer measures it, which is used beside a receiver only."""
    return bool(
        knows_attitude(state, problem)
        and state.vehicle.source == RECEIVER
        and state.sensor_errors.barometer_age <= MAX_FIX_AGE_S
        and state.uncertainty.vertical <= POSITION_STD_TO_LAND
    )


@kernel
def load_problem(state: EstimatorState, max_age_s: float) -> int:
    """What is wrong with the estimate of the load; 0 if nothing is."""
    load, uncertainty = state.load, state.uncertainty
    if load.source == CAMERA:
        if load.taut == 0.0:  # it stays where it is on the ground, observed or not
            return 0
        if is_never_observed(load):
            if load.tautness_age_s < PULL_SETTLING_S:
                return 0
        elif not load.age_s <= max(max_age_s, MAX_DIRECTION_AGE_S):
            return NO_LOAD_DIRECTION
        std_limit = max(LOAD_STD_TO_FLY, CABLE_STD_TO_FLY * load.length)
        return 0 if uncertainty.load <= std_limit else LOAD_UNSETTLED
    if not load.age_s <= max(max_age_s, MAX_LOAD_AGE_S):
        return NO_LOAD
    if load.taut == 0.0:
        # what the load may do while it is not observed (fall, be kicked) is no reason to land: the limit of
        # its age covers that
        fresh = load.age_s <= FRESH_READING_S
        return LOAD_UNSETTLED if fresh and not sqrt(load.covariance[0]) <= POSITION_STD_TO_FLY else 0
    return 0 if uncertainty.load <= POSITION_STD_TO_FLY else LOAD_UNSETTLED


def problem_texts(state: EstimatorState, *problems: int) -> tuple[str, ...]:
    """Why the estimate is not good enough for flight, in words for the operator; empty if it is.

    `problems` are results of `inertial_problem`, `vehicle_problem` and `load_problem`.
    """
    return tuple(_problem_text(state, code) for code in problems if code)


def _problem_text(state: EstimatorState, code: int) -> str:
    """One of these problems in words, with the impact that has caused it if there was one."""
    text = _PROBLEM_TEXTS[code].format(state.uncertainty.horizontal)
    follows_impact = code in _UNSETTLED and state.clipping.impact_age_s <= IMPACT_TOLD_S
    return f"{text} after an impact" if follows_impact else text


def estimate_loss(state: EstimatorState, problem: int) -> str:
    """Why the estimate, with this problem of the vehicle or of its inertial unit, is not even good enough for
    a landing, in words; empty if it is. Written so that NaN is a loss."""
    uncertainty = state.uncertainty
    if problem == NO_INERTIAL:
        return _problem_text(state, NO_INERTIAL)
    if not knows_attitude(state, problem):
        return _problem_text(state, ATTITUDE_UNSETTLED)
    slow_std = state.sensor_errors.horizontal_slow_std if state.vehicle.source == RECEIVER else 0.0
    if not (uncertainty.horizontal <= POSITION_STD_TO_LAND + STATED_STD_FACTOR * slow_std):
        return _problem_text(state, FIX_UNSETTLED)
    return ""
