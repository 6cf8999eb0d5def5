"""Records that a custom estimator receives and returns at a tick, and how they are filled.

World ENU, body FLU, SI. Times are on the vehicle's clock; an estimate is that of the instant that the
inertial unit shows.
"""

from __future__ import annotations

from math import inf, isfinite, isnan, nan
from typing import Any, NamedTuple

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
    SAMPLE_TIME_US,
    age_of,
    is_valid_imu,
    read_direction,
    read_fix,
    read_load,
    read_pose,
    read_vector,
)
from autopilot.estimation.records import Array, EstimatorTuning, ImuReading
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import IDENTITY, ZERO, Mat3, Vec3, dot, norm
from autopilot.geometry.magnitude import (
    BOUNDED_TEXT,
    MAX_MAGNITUDE_TEXT,
    is_bounded,
    is_bounded_vector,
)
from autopilot.geometry.packed import unpack, width, with_field
from autopilot.geometry.so3 import is_rotation, rotation_from_quat
from autopilot.vehicle.layout import MAX_ROTORS

NEVER = -inf  # time of the last reading of a sensor that never sent one
NOT_GIVEN: Vec3 = (nan, nan, nan)  # an acceleration that an estimate does not contain
UNIT_TOLERANCE = 0.02  # of the square of a length that must be 1

Forces = tuple[  # of each rotor, N; zeros for rotors that do not exist
    float, float, float, float, float, float, float, float, float, float, float, float, float, float
]
NO_FORCES: Forces = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
assert len(NO_FORCES) == MAX_ROTORS


class InertialSample(NamedTuple):
    """The inertial unit's last sample."""

    new: bool  # at this tick
    time_s: float  # of the instant that it shows; -inf: there was no sample yet
    gyro: Vec3  # rad/s, body
    accel: Vec3  # specific force, m/s^2, body


class PoseSample(NamedTuple):
    """The pose tracker's last reading of the vehicle."""

    new: bool
    time_s: float
    x_quad: Vec3  # m
    R: Mat3  # body to world
    v_quad: Vec3  # m/s
    position_std: float  # m, as the tracker states it
    attitude_std: float  # rad
    velocity_std: float  # m/s; negative: velocity is not measured


class LoadSample(NamedTuple):
    """The load tracker's last reading."""

    new: bool
    time_s: float
    x_load: Vec3  # m
    v_load: Vec3  # m/s
    position_std: float  # m
    velocity_std: float  # m/s; negative: velocity is not measured


class DirectionSample(NamedTuple):
    """The last reading of the cable sensor (camera or encoder)."""

    new: bool
    time_s: float
    direction_body: Vec3  # unit vector from vehicle to load, body
    direction_std: float  # rad


class FixSample(NamedTuple):
    """The satellite navigation receiver's last fix."""

    new: bool
    time_s: float
    position: Vec3  # m, from home
    velocity: Vec3  # m/s
    horizontal_std: float  # m
    vertical_std: float  # m
    rtk: bool  # with carrier phase


class FieldSample(NamedTuple):
    """The magnetometer's last reading."""

    new: bool
    time_s: float
    field_body: Vec3  # gauss, body


class HeightSample(NamedTuple):
    """The barometer's last reading."""

    new: bool
    time_s: float
    height: float  # m above home


class Driven(NamedTuple):
    """Commands to the rotors at the last tick, and what the rotors are assumed to give at this tick."""

    thrust: float  # N along the thrust axis, commanded
    moment: Vec3  # N m, body, commanded
    forces: Forces  # N, of each rotor, commanded
    given_thrust: float  # N, assumed, after delay and lag of the rotors
    given_moment: Vec3  # N m


class Sensed(NamedTuple):
    """Input of an estimator at a tick."""

    begins: bool  # the first tick, or the first after a time without ticks
    time_s: float  # the instant for which the estimate is required
    period_s: float  # since the last tick; 0 at the first
    inertial: InertialSample
    pose: PoseSample
    load: LoadSample
    direction: DirectionSample
    fix: FixSample
    field: FieldSample
    height: HeightSample
    driven: Driven
    cable: Cable  # length, rate and acceleration, according to the winch
    taut: bool  # the cable is taut according to the built-in filter
    built_in: State  # the built-in filter's estimate


class Estimate(NamedTuple):
    """Output of an estimator."""

    known: bool  # False: there is no estimate yet
    state: State  # a_quad may be NOT_GIVEN
    tension: float  # N of the cable; NaN: not given
    horizontal_std: float  # m, of the vehicle's position, each axis; NaN: not given
    vertical_std: float


REST = State(ZERO, ZERO, (0.0, 0.0, -1.0), ZERO, ZERO, ZERO, IDENTITY, ZERO)
NO_ESTIMATE = Estimate(False, REST, nan, nan, nan)
NOTHING_SENSED = Sensed(
    True,
    0.0,
    0.0,
    InertialSample(False, NEVER, ZERO, ZERO),
    PoseSample(False, NEVER, ZERO, IDENTITY, ZERO, 0.0, 0.0, 0.0),
    LoadSample(False, NEVER, ZERO, ZERO, 0.0, 0.0),
    DirectionSample(False, NEVER, (0.0, 0.0, -1.0), 0.0),
    FixSample(False, NEVER, ZERO, ZERO, 0.0, 0.0, False),
    FieldSample(False, NEVER, ZERO),
    HeightSample(False, NEVER, 0.0),
    Driven(0.0, ZERO, NO_FORCES, 0.0, ZERO),
    Cable(1.0),
    False,
    REST,
)
ESTIMATE_OFFSET = width(Sensed)  # where the estimate begins in the row
ESTIMATOR_OFFSET = ESTIMATE_OFFSET + width(Estimate)  # from here on, the row holds the estimator's own data


@kernel
def with_readings(sensed: Sensed, inbox: Array, count: int, now_us: int, tuning: EstimatorTuning) -> Sensed:
    """`sensed`, updated with the first `count` readings of the inbox.

    Readings that the built-in filter would drop are dropped here too; of two readings of one sensor at one
    tick, the later row is used.
    """
    time_s = now_us * 1e-6 - tuning.imu_age
    inertial = with_field(sensed.inertial, "new", False)
    pose, load = with_field(sensed.pose, "new", False), with_field(sensed.load, "new", False)
    direction, fix = with_field(sensed.direction, "new", False), with_field(sensed.fix, "new", False)
    field, height = with_field(sensed.field, "new", False), with_field(sensed.height, "new", False)
    for i in range(count):
        row, kind = inbox[i], inbox[i, KIND]
        if kind == IMU:
            imu = unpack(ImuReading, row, READING)
            if row[SAMPLE_TIME_US] == now_us and is_valid_imu(imu):
                inertial = InertialSample(True, time_s, imu.gyro, imu.accel)
        elif kind == POSE:
            age = age_of(row, now_us, tuning.imu_age)
            valid, p = read_pose(row, age)
            if valid:
                R = rotation_from_quat(p.quat_wxyz)
                std = (p.position_std, p.attitude_std, p.velocity_std)
                pose = PoseSample(True, time_s - age, p.x_quad, R, p.v_quad, std[0], std[1], std[2])
        elif kind == LOAD:
            age = age_of(row, now_us, tuning.imu_age)
            valid, p_load = read_load(row, age)
            if valid:
                load = LoadSample(
                    True, time_s - age, p_load.x_load, p_load.v_load, p_load.position_std, p_load.velocity_std
                )
        elif kind == DIRECTION:
            age = age_of(row, now_us, tuning.imu_age)
            valid, d = read_direction(row, age)
            if valid:
                direction = DirectionSample(True, time_s - age, d.direction_body, d.direction_std)
        elif kind == FIX:
            age = age_of(row, now_us, tuning.imu_age)
            valid, f = read_fix(row, age)
            if valid:
                std2 = (f.horizontal_std, f.vertical_std)
                fix = FixSample(True, time_s - age, f.position, f.velocity, std2[0], std2[1], f.rtk != 0.0)
        elif kind == FIELD:
            gauss = read_vector(row)
            strength = norm(gauss)
            if isfinite(strength) and strength > 0.0:
                field = FieldSample(True, time_s - tuning.magnetic_age, gauss)
        elif kind == HEIGHT and isfinite(row[READING]):
            height = HeightSample(True, time_s - tuning.barometer_age, row[READING])
    return Sensed(
        sensed.begins,
        time_s,
        sensed.period_s,
        inertial,
        pose,
        load,
        direction,
        fix,
        field,
        height,
        sensed.driven,
        sensed.cable,
        sensed.taut,
        sensed.built_in,
    )


# what is wrong with an estimate
VALID, NOT_BOUNDED, NOT_A_ROTATION, NOT_A_UNIT_VECTOR, NOT_A_DEVIATION, LOST = range(6)


@kernel
def _is_deviation(std: float) -> bool:
    """Whether this is a standard deviation, or not given."""
    return isnan(std) or (std >= 0.0 and is_bounded(std))


@kernel
def estimate_fault(estimate: Estimate) -> int:
    """What is wrong with a known estimate: VALID if nothing is."""
    s = estimate.state
    places = is_bounded_vector(s.x_load) and is_bounded_vector(s.x_quad) and is_bounded_vector(s.q_cable)
    motions = is_bounded_vector(s.v_load) and is_bounded_vector(s.v_quad)
    rates = is_bounded_vector(s.omega_body) and is_bounded_vector(s.q_cable_dot)
    a_quad_given = not (isnan(s.a_quad[0]) and isnan(s.a_quad[1]) and isnan(s.a_quad[2]))
    if not (places and motions and rates) or (a_quad_given and not is_bounded_vector(s.a_quad)):
        return NOT_BOUNDED
    if not (isnan(estimate.tension) or is_bounded(estimate.tension)):
        return NOT_BOUNDED
    if not abs(dot(s.q_cable, s.q_cable) - 1.0) < UNIT_TOLERANCE:
        return NOT_A_UNIT_VECTOR
    if not (_is_deviation(estimate.horizontal_std) and _is_deviation(estimate.vertical_std)):
        return NOT_A_DEVIATION
    return VALID if is_rotation(s.R) else NOT_A_ROTATION


def fault_text(estimate: Estimate, fault: int) -> str:
    """What is wrong with an estimate, in words."""
    state = estimate.state
    if fault == LOST:
        return "gives no estimate any more"
    if fault == NOT_A_UNIT_VECTOR:
        return f"gives q_cable = {_formatted(state.q_cable)}, which is no unit vector"
    if fault == NOT_A_ROTATION:
        return f"gives R = {_formatted(state.R)}, which is no rotation"
    if fault == NOT_A_DEVIATION:
        wrong = "vertical_std" if _is_deviation(estimate.horizontal_std) else "horizontal_std"
        limits = f"must be 0 ... {MAX_MAGNITUDE_TEXT}, and left out if not known"
        return f"gives {wrong} = {getattr(estimate, wrong):.4g}; {limits}"
    for name in ("x_load", "v_load", "q_cable", "q_cable_dot", "x_quad", "v_quad", "omega_body", "a_quad"):
        vector = getattr(state, name)
        if not is_bounded_vector(vector):
            return f"gives {name} = {_formatted(vector)}; {BOUNDED_TEXT}"
    return f"gives tension = {_formatted(estimate.tension)}; {BOUNDED_TEXT}"


def _formatted(value: Any) -> str:
    if isinstance(value, tuple):
        return f"({', '.join(map(_formatted, value))})"
    return f"{value:.4g}"
