"""Whether the cable is taut, and what becomes of the error state when it comes taut or slack.

Taut, the load is where the cable ends and its error that of vehicle and cable; slack, it is tracked or lies
by itself. A tracked load tells by its distance. Else the pull tells: what the vehicle's acceleration leaves
of the believed thrust, m_Q (R a) - f R e3, along the cable.
"""

from __future__ import annotations

from autopilot.estimation.covariance import forget
from autopilot.estimation.records import (
    AIR,
    DIRECTION,
    LENGTH,
    POSITION,
    RATE,
    SIZE,
    TRACKER,
    VELOCITY,
    Array,
    EstimatorTuning,
    History,
    ImuReading,
    LoadEstimate,
    VehicleEstimate,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, column, cross, norm, sub
from autopilot.geometry.s2 import normalise, pull_of, tangent
from autopilot.geometry.so3 import rotation_from_quat

TAUT_ABOVE = 0.985  # share of the cable length at which a tracked load's slack cable counts as taut
SLACK_BELOW = 0.965  # and at which a taut one counts as slack
# A tracked load comes taut once its speed against the vehicle is known to this (m/s), or after a while: the
# filter is linear in a direction that a wrong speed would soon turn far.
SPEED_KNOWN, KNOWN_S = 0.2, 1.0
PULL_TAUT, PULL_SLACK = 0.8, 0.2  # share of the load's weight that must be felt, and that is too little
PULL_TAUT_S, PULL_SLACK_S = 0.2, 0.15  # for how long
PULL_DISTANCE = 0.75  # share of the cable length below which no pull is believed
PULL_TIME_S = 0.04  # in which the felt pull is smoothed
# For so long after the cable came taut a load that pulls less than this share of a hanging one's is taken as
# lying: pendulum and length then mean little.
LIFTING_S, LIFTING_PULL = 4.0, 0.8
REFUSED_LOOSE = 4.0  # readings refused in a row that show the same
# A taut cable whose felt pull is less than this share of the pendulum's does not carry, whatever its length.
LOOSE_PULL = 0.4
UNFELT_S = 2.0  # in which it is learned what of the pull is not felt
# A cable that begins to pull, at this share of the load's weight, stops vehicle and load along it at once: at
# about this speed (m/s) their ends part. It is over between two samples of the accelerometer.
JERK_PULL, JERK_SPEED = 0.3, 0.2
JERK_FELT_S = 0.015  # after which it is felt
# of the air's deviation, that a tracked load begins with: wind soon shows, and a law that lifts the load is
# spared the search for it
STILL_SHARE = 0.1
HOP_SPEED = 0.02  # m/s, across the cable, of a load that has begun to be pulled
SEEN_S = 1.0  # a cable is not taken as taut while a load that is seen has not been for so long


@kernel
def frame(q: Vec3, across: Vec3) -> Vec3:
    """A unit vector orthogonal to q, near `across` if that is possible."""
    flat = tangent(q, across)
    if norm(flat) < 0.1:
        flat = tangent(q, (1.0, 0.0, 0.0) if q[0] * q[0] < 0.5 else (0.0, 1.0, 0.0))
    return normalise(flat)


@kernel
def felt_pull(
    load: LoadEstimate, vehicle: VehicleEstimate, imu: ImuReading, thrust: float, mass: float
) -> float:
    """Force of the cable on the vehicle along q, N, from one sample, as it is felt along the rotors' axis:
    across that the air drags at rotors and frame, with as much as the load weighs."""
    axis = column(rotation_from_quat(vehicle.quat_wxyz), 2)
    left = mass * (imu.accel[2] - vehicle.accel_bias[2]) - thrust
    return pull_of(left, load.q_cable, axis)


@kernel
def loosely_tied(load: LoadEstimate, memory_s: float, unfelt: float) -> bool:
    """Whether a cable that counts as taut does not carry its load yet.

    A tracked load counts as tied some per cent of the cable's length before it is, and readings up to
    `memory_s` old still show that; and as long after it has come to lie. `unfelt` (N) is what of the pull has
    not been felt for long, by a wrong belief of thrust or mass.
    """
    if load.source == TRACKER and load.pull + unfelt < LOOSE_PULL * load.tension:
        return True
    if load.held_s > LIFTING_S:
        return False
    if load.source == TRACKER:
        return not load.pulled_s > memory_s or load.rejected >= REFUSED_LOOSE
    return load.pull + unfelt < LIFTING_PULL * load.tension


@kernel
def unfelt_pull(
    load: LoadEstimate, vehicle: VehicleEstimate, before: float, tuning: EstimatorTuning, dt: float
) -> float:
    """What of the pull has not been felt for long, N: less than nothing where rotors that give less than they
    are thought to are taken for a load. A camera's slack cable does not pull while its ends are near."""
    if load.source == TRACKER:
        if load.taut == 0.0:
            return 0.0
    elif load.taut == 0.0:
        if norm(sub(load.x_load, vehicle.x_quad)) > PULL_DISTANCE * tuning.cable_length:
            return before
        return min(before - dt / UNFELT_S * (load.pull + before), 0.0)
    elif load.held_s <= LIFTING_S:
        return before
    return before + dt / UNFELT_S * (load.tension - load.pull - before)


@kernel
def jerked(load: LoadEstimate, pull_before: float, history: History, tuning: EstimatorTuning) -> None:
    """Where the cable has begun to pull since the pull was so much (N), the vehicle's velocity along it is
    less well known."""
    begins = JERK_PULL * tuning.load_mass * tuning.gravity
    if pull_before >= begins or load.pull < begins:
        return
    P, q = history.covariance, load.q_cable
    std = JERK_SPEED * tuning.load_mass / (tuning.load_mass + tuning.quad_mass)
    for i in range(3):
        for j in range(3):
            variance = std * std * q[i] * q[j]
            P[VELOCITY + i, VELOCITY + j] += variance
            P[POSITION + i, VELOCITY + j] += JERK_FELT_S * variance
            P[VELOCITY + j, POSITION + i] += JERK_FELT_S * variance
            P[POSITION + i, POSITION + j] += 2.0 * JERK_FELT_S * JERK_FELT_S * variance


@kernel
def _with(load: LoadEstimate, taut: float, length: float, pull: float, pulled_s: float) -> LoadEstimate:
    return LoadEstimate(
        load.x_load,
        load.v_load,
        load.q_cable,
        load.q_cable_dot,
        load.across,
        length,
        load.covariance,
        taut,
        load.tension,
        pull,
        pulled_s,
        load.held_s if taut == load.taut else 0.0,
        load.age_s,
        load.rejected,
        load.source,
    )


@kernel
def _tie(P: Array, first: int, of: int, across: Vec3, along: Vec3, d: float) -> None:
    """Rows of b_i . (load - vehicle) / d, for a load whose error has nothing in common with the rest: what
    comes in through the vehicle. `of` lies before `first`, so that the rows' own block finds what was set."""
    for j in range(SIZE):
        p0, p1, p2 = P[of, j], P[of + 1, j], P[of + 2, j]
        one = -(across[0] * p0 + across[1] * p1 + across[2] * p2) / d
        two = -(along[0] * p0 + along[1] * p1 + along[2] * p2) / d
        P[first, j], P[j, first] = one, one
        P[first + 1, j], P[j, first + 1] = two, two


@kernel
def tauten(load: LoadEstimate, history: History, tuning: EstimatorTuning, length: float) -> LoadEstimate:
    """Direction and rate of the cable take over from the load's own position and velocity."""
    P = history.covariance
    forget(P, DIRECTION, 5)
    P[LENGTH, LENGTH] = tuning.length_std * tuning.length_std
    across, along = load.across, cross(load.q_cable, load.across)
    aa, ab, bb = load.covariance
    if load.source != TRACKER:
        bb += HOP_SPEED * HOP_SPEED
    else:
        doubt = STILL_SHARE * tuning.air_std
        forget(P, AIR, 2)
        P[AIR, AIR], P[AIR + 1, AIR + 1] = doubt * doubt, doubt * doubt
        _tie(P, DIRECTION, POSITION, across, along, length)
    _tie(P, RATE, VELOCITY, across, along, length)
    s = 1.0 / length
    for i in range(2):
        P[DIRECTION + i, DIRECTION + i] += s * s * aa
        P[DIRECTION + i, RATE + i] += s * s * ab
        P[RATE + i, DIRECTION + i] += s * s * ab
        P[RATE + i, RATE + i] += s * s * bb
    return _with(load, 1.0, length, load.pull, 0.0)


@kernel
def slacken(load: LoadEstimate, history: History, position_var: float, velocity_var: float) -> LoadEstimate:
    """The load by itself from now on, known to these variances; the cable's errors are dropped."""
    forget(history.covariance, DIRECTION, 5)
    resting = (0.0, 0.0, 0.0)
    return LoadEstimate(
        load.x_load,
        load.v_load if load.source == TRACKER else resting,
        load.q_cable,
        load.q_cable_dot,
        load.across,
        load.length,
        (position_var, 0.0, velocity_var),
        0.0,
        0.0,
        load.pull,
        0.0,
        0.0,
        load.age_s,
        load.rejected,
        load.source,
    )


@kernel
def watch(
    load: LoadEstimate,
    vehicle: VehicleEstimate,
    history: History,
    imu: ImuReading,
    thrust: float,
    unfelt: float,
    tuning: EstimatorTuning,
    dt: float,
) -> LoadEstimate:
    """The load with its cable found taut or slack; `unfelt` (N) as `unfelt_pull` has it."""
    share = dt / (PULL_TIME_S + dt)
    felt = felt_pull(load, vehicle, imu, thrust, tuning.quad_mass)
    pull = load.pull + share * (felt - load.pull)
    distance = norm(sub(load.x_load, vehicle.x_quad))
    if load.source == TRACKER:
        carries = load.taut > 0.0 and pull >= LIFTING_PULL * load.tension
        load = _with(load, load.taut, load.length, pull, load.pulled_s + dt if carries else 0.0)
        speed_var = load.covariance[2] + history.covariance[VELOCITY, VELOCITY]
        known = speed_var < SPEED_KNOWN * SPEED_KNOWN or load.held_s > KNOWN_S
        if load.taut == 0.0 and known and distance > TAUT_ABOVE * tuning.cable_length:
            return tauten(load, history, tuning, distance)
        return load
    weight = tuning.load_mass * tuning.gravity
    if load.taut == 0.0:
        pulled = pull + unfelt > PULL_TAUT * weight and distance > PULL_DISTANCE * tuning.cable_length
        load = _with(load, 0.0, load.length, pull, load.pulled_s + dt if pulled else 0.0)
        if load.pulled_s > PULL_TAUT_S and (load.age_s < SEEN_S or load.age_s == float("inf")):
            load = tauten(load, history, tuning, tuning.cable_length)
            x_load = axpy(load.length, load.q_cable, vehicle.x_quad)
            return moved(load, x_load)
        return load
    lost = pull + unfelt < PULL_SLACK * weight
    load = _with(load, 1.0, load.length, pull, load.pulled_s + dt if lost else 0.0)
    if load.pulled_s > PULL_SLACK_S:
        P = history.covariance
        L = load.length
        var = 0.5 * L * L * (P[DIRECTION, DIRECTION] + P[DIRECTION + 1, DIRECTION + 1])
        return slacken(load, history, var, 0.0)
    return load


@kernel
def moved(load: LoadEstimate, x_load: Vec3) -> LoadEstimate:
    """The load elsewhere."""
    return LoadEstimate(
        x_load,
        load.v_load,
        load.q_cable,
        load.q_cable_dot,
        load.across,
        load.length,
        load.covariance,
        load.taut,
        load.tension,
        load.pull,
        load.pulled_s,
        load.held_s,
        load.age_s,
        load.rejected,
        load.source,
    )
