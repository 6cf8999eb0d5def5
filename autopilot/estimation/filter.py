"""The estimator as the core uses it: one call for each tick's readings.

`control_state` is the state passed to the control laws; `complaints` states why the estimate is not good
enough for flight, `loss` why it is not even good enough for a landing.
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
    direction_in,
    fix_in,
    is_sane,
    load_in,
    pose_in,
    vector_in,
)
from autopilot.estimation.measurements.barometer import correct_barometer
from autopilot.estimation.measurements.direction import correct_direction
from autopilot.estimation.measurements.gnss import correct_gnss, found_load
from autopilot.estimation.measurements.load import correct_load
from autopilot.estimation.measurements.magnetic import correct_magnetic
from autopilot.estimation.measurements.pose import correct_pose
from autopilot.estimation.measurements.pull import correct_pull, unseen
from autopilot.estimation.measurements.standing import correct_standing
from autopilot.estimation.measurements.tautened import correct_tautened
from autopilot.estimation.predict import predict
from autopilot.estimation.records import (
    CAMERA,
    NOBODY,
    RECEIVER,
    TRACKER,
    Array,
    EstimatorState,
    EstimatorTuning,
    History,
    ImuReading,
)
from autopilot.estimation.release import parted
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, norm, sub
from autopilot.geometry.packed import unpack, with_field
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.wire.parameter_table import ParameterTable

POSITION_STD_TO_FLY = 0.05  # m, with trackers
FIX_STD_TO_FLY = 0.15  # m, beyond the deviation that a receiver states: margin for coasting or a float fix
ATTITUDE_STD_TO_FLY = 0.05  # rad
HEADING_STD_TO_FLY = 0.15  # rad, by a magnetometer
LOAD_STD_TO_FLY = 0.1  # m relative to the vehicle, of a load that a camera sees
PROMISE = 1.2  # times the deviation that the receiver states
COASTING_S = 2.0  # for which the IMU bridges a gap between fixes
SWINGING_S = 1.0  # for which the pendulum bridges a gap between sights of the load
# For which the pendulum bridges a gap between a tracker's readings, whose velocity starts it better: a load
# hidden for 5 s is 2 mm off in calm air and 8 mm in wind of 5 m/s with gusts of 1 m/s, as its covariance
# states. For the same time, a load whose cable is slack is assumed to lie still.
HIDDEN_S = 2.0
FRESH_S = 0.1  # up to this age of a tracker's reading, the accuracy of a load on a slack cable is checked
TILT_STD_TO_LAND = 0.2  # rad
POSITION_STD_TO_LAND = 10.0  # m
UNSEEN_S = 0.5  # after this time without a tracker reading, the load is assumed to have no tracker
TELLING_S = 1.0  # in which the pull of a cable that came taut shows its direction
INERTIAL_S = 0.1  # for which an inertial sample replaces missing ones


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
        gear_height=table["EST_GEAR_H"] + table["VEH_ATT_Z"],
        load_height=table["EST_LOAD_H"],
        laid_forward=table["EST_LAID_FWD"] * length,
        laid_std=table["EST_LAID_STD"] * length,
    )


@kernel
def lengthened(state: EstimatorState, grown: float) -> EstimatorState:
    """The estimate with a cable that has grown by `grown` metres; unchanged while the cable is slack."""
    load = state.load
    if grown == 0.0 or load.taut == 0.0:
        return state
    return with_field(state, "load", with_field(load, "length", load.length + grown))


@kernel
def estimate(
    state: EstimatorState,
    history: History,
    inbox: Array,
    count: int,
    now_us: int,
    tuning: EstimatorTuning,
    cable: Cable,
    grown: float,
    dt: float,
    thrust: float,
    moment: Vec3,
) -> EstimatorState:
    """The state after `dt` seconds and the first `count` readings of the inbox. `history` is written in
    place.

    `thrust` (N) and `moment` (N m, body) are those that the rotors are assumed to give; the cable has grown
    by `grown` (m) since the last tick. The estimator models a cable of constant length: the winch's speed is
    subtracted from the velocity that the load tracker measures, v_L = v_Q + L q' + L' q.
    """
    state = lengthened(state, grown)
    tuning = with_field(tuning, "cable_length", cable.length)
    reeled, along = cable.rate != 0.0 and state.load.taut != 0.0, state.load.q_cable
    if isinf(cable.length):
        state = parted(state, history, tuning)
    used = state.last_imu
    for i in range(count):
        if inbox[i, KIND] == IMU:
            imu = unpack(ImuReading, inbox[i], READING)
            if is_sane(imu):
                used = imu
    load = state.load
    state = predict(state, history, used, tuning, dt, thrust, moment)
    state = correct_tautened(state, history, load, tuning, dt)
    state = correct_pull(state, history, tuning, thrust)
    for i in range(count):
        if inbox[i, KIND] == POSE:
            believed, pose = pose_in(inbox[i], age_of(inbox[i], now_us, tuning.imu_age))
            if believed:
                state = correct_pose(state, history, pose, tuning)
    for i in range(count):
        if inbox[i, KIND] == FIELD:
            field = vector_in(inbox[i])
            size = norm(field)
            if isfinite(size) and size > 0.0:
                state = correct_magnetic(state, history, field, tuning.magnetic_age, tuning)
    for i in range(count):
        if inbox[i, KIND] == FIX:
            believed, fix = fix_in(inbox[i], age_of(inbox[i], now_us, tuning.imu_age))
            if believed:
                state = correct_gnss(state, history, fix, tuning, thrust)
    for i in range(count):
        if inbox[i, KIND] == HEIGHT and isfinite(inbox[i, READING]):
            state = correct_barometer(state, history, inbox[i, READING], tuning.barometer_age, tuning)
    accepted = state.vehicle.rejected == 0.0
    for i in range(count):
        if inbox[i, KIND] == LOAD:
            believed, reading = load_in(inbox[i], age_of(inbox[i], now_us, tuning.imu_age))
            if reeled:
                reading = with_field(reading, "v_load", axpy(-cable.rate, along, reading.v_load))
            if believed and accepted:
                state = correct_load(state, history, reading, tuning)
    for i in range(count):
        if inbox[i, KIND] == DIRECTION:
            believed, sight = direction_in(inbox[i], age_of(inbox[i], now_us, tuning.imu_age))
            if believed:
                state = correct_direction(state, history, sight, tuning)
    if state.vehicle.source == RECEIVER:
        state = correct_standing(state, history, tuning, thrust)
    if state.vehicle.source == TRACKER and state.load.source == NOBODY and state.time_s > UNSEEN_S:
        state = with_field(state, "load", found_load(state, history, tuning, thrust))
    return state


@kernel
def control_state(state: EstimatorState, cable: Cable) -> State:
    """State passed to the control laws.

    A plain receiver measures the position to metres, and each correction of the velocity moves the estimated
    position by decimetres at once. These corrections are passed on over seconds, so that the laws do not make
    the load follow them.
    """
    vehicle, load, debt = state.vehicle, state.load, state.aids.debt
    v_load = load.v_load
    if cable.rate != 0.0 and load.taut != 0.0:
        v_load = axpy(cable.rate, load.q_cable, v_load)
    return State(
        sub(load.x_load, debt),
        v_load,
        load.q_cable,
        load.q_cable_dot,
        sub(vehicle.x_quad, debt),
        vehicle.v_quad,
        rotation_from_quat(vehicle.quat_wxyz),
        vehicle.omega_body,
        vehicle.accel_quad,
    )


# why the estimate is not good enough for flight; 0: it is
NO_POSE, NO_FIX, POSITION_VAGUE, FIX_VAGUE, ATTITUDE_VAGUE, HEADING_VAGUE = 1, 2, 3, 4, 5, 6
NO_LOAD, NO_SIGHT, LOAD_VAGUE = 7, 8, 9
NO_INERTIAL = 10
_COMPLAINTS = {
    NO_POSE: "no vehicle pose from a tracker",
    NO_FIX: "no position from the receiver",
    POSITION_VAGUE: "vehicle position not settled",
    FIX_VAGUE: "vehicle position not settled, good to {:.1f} m",
    ATTITUDE_VAGUE: "vehicle attitude not settled",
    HEADING_VAGUE: "vehicle heading not settled",
    NO_LOAD: "no load position from a tracker",
    NO_SIGHT: "no direction to the load from the camera",
    LOAD_VAGUE: "load position not settled",
    NO_INERTIAL: "no reading of the inertial unit",
}


@kernel
def inertial_problem(silent_s: float) -> int:
    """What is wrong with the inertial unit, whose last new sample is `silent_s` old; 0 if nothing is."""
    return 0 if silent_s <= INERTIAL_S else NO_INERTIAL


@kernel
def vehicle_problem(state: EstimatorState, oldest_s: float) -> int:
    """What is wrong with the estimate of the vehicle; 0 if nothing is. The comparisons are written so that
    NaN is a complaint."""
    vehicle, doubt = state.vehicle, state.doubt
    if vehicle.source == RECEIVER:
        level = FIX_STD_TO_FLY + PROMISE * state.aids.horizontal_slow
        if not vehicle.age_s <= max(oldest_s, COASTING_S):
            return NO_FIX
        if not (doubt.horizontal <= level and doubt.relative <= level):
            return FIX_VAGUE
        if not doubt.tilt <= ATTITUDE_STD_TO_FLY:
            return ATTITUDE_VAGUE
        return 0 if doubt.heading <= HEADING_STD_TO_FLY else HEADING_VAGUE
    if not vehicle.age_s <= oldest_s:
        return NO_POSE
    if not (doubt.horizontal <= POSITION_STD_TO_FLY and doubt.vertical <= POSITION_STD_TO_FLY):
        return POSITION_VAGUE
    if not (doubt.tilt <= ATTITUDE_STD_TO_FLY and doubt.heading <= ATTITUDE_STD_TO_FLY):
        return ATTITUDE_VAGUE
    return 0


@kernel
def load_problem(state: EstimatorState, oldest_s: float) -> int:
    """What is wrong with the estimate of the load; 0 if nothing is."""
    load, doubt = state.load, state.doubt
    if load.source == CAMERA:
        if load.taut == 0.0:  # it lies where it was laid, seen or not
            return 0
        if unseen(load):
            return 0 if load.held_s < TELLING_S or doubt.load <= LOAD_STD_TO_FLY else LOAD_VAGUE
        if not load.age_s <= max(oldest_s, SWINGING_S):
            return NO_SIGHT
        return 0 if doubt.load <= LOAD_STD_TO_FLY else LOAD_VAGUE
    if not load.age_s <= max(oldest_s, HIDDEN_S):
        return NO_LOAD
    if load.taut == 0.0:
        # what the load may do unseen (fall, be kicked) is no reason to land: the limit of its age covers that
        seen = load.age_s <= FRESH_S
        return LOAD_VAGUE if seen and not sqrt(load.covariance[0]) <= POSITION_STD_TO_FLY else 0
    return 0 if doubt.load <= POSITION_STD_TO_FLY else LOAD_VAGUE


def complaints(
    state: EstimatorState, oldest_s: float, carries: bool = True, silent_s: float = 0.0
) -> tuple[str, ...]:
    """Why the estimate is not good enough for flight, in words for the operator; empty if it is.

    Where no load is carried, it need not be known. `silent_s`: age of the last new inertial sample.
    """
    found = [inertial_problem(silent_s) or vehicle_problem(state, oldest_s)]
    if carries:
        found.append(load_problem(state, oldest_s))
    return tuple(_COMPLAINTS[code].format(state.doubt.horizontal) for code in found if code)


def loss(state: EstimatorState, silent_s: float) -> str:
    """Why the estimate is not even good enough for a landing, in words; empty if it is. Written so that NaN
    is a loss."""
    doubt = state.doubt
    if inertial_problem(silent_s):
        return _COMPLAINTS[NO_INERTIAL]
    if state.vehicle.source == NOBODY or not doubt.tilt <= TILT_STD_TO_LAND:
        return _COMPLAINTS[ATTITUDE_VAGUE]
    slow = state.aids.horizontal_slow if state.vehicle.source == RECEIVER else 0.0
    if not (doubt.horizontal <= POSITION_STD_TO_LAND + PROMISE * slow):
        return _COMPLAINTS[FIX_VAGUE].format(doubt.horizontal)
    return ""
