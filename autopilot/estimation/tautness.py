"""Whether the cable is taut, and how the error state changes when it comes taut or slack.

While the cable is taut, the load is at its end, and the load's error is that of vehicle and cable. While it
is slack, the load is tracked separately or stays where it is on the ground. The distance of a
tracked load decides; without a tracker, the pull decides, as `cable_pull` measures it.
"""

from __future__ import annotations

from math import sqrt

from autopilot.estimation.covariance import zero_covariance
from autopilot.estimation.records import (
    AIR,
    ATTITUDE,
    CAMERA,
    DIRECTION,
    LENGTH,
    MOUNTING,
    NO_SENSOR,
    NOT_LAID,
    POSITION,
    RATE,
    SIZE,
    TRACKER,
    VELOCITY,
    Array,
    EstimatorTuning,
    History,
    LoadEstimate,
    VehicleEstimate,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, apply_transposed, axpy, cross, norm, sub
from autopilot.geometry.packed import with_field
from autopilot.geometry.s2 import normalise, tangent
from autopilot.geometry.so3 import rotation_from_quat

TAUT_ABOVE = 0.985  # share of the cable length above which a tracked load's slack cable counts as taut
SLACK_BELOW = 0.965  # and below which a taut one counts as slack
# A cable that is shorter than assumed never gets there. It is taut if it has pulled, at HELD_PULL of the
# load's weight, for HELD_S, in which the distance has not changed by HELD_RANGE (m): a vehicle that pulls it
# taut rises by more. This distance, at least SHORT_CABLE of the assumed length, replaces it in both shares.
SHORT_CABLE, HELD_PULL, HELD_S, HELD_RANGE = 0.9, 0.4, 0.3, 0.02
# The cable of a tracked load counts as taut only once the load's speed relative to the vehicle is known to
# KNOWN_SPEED_STD (m/s), or SPEED_KNOWN_AFTER_S (s) after it came slack: the filter is linear in the
# direction, which a wrong speed would soon turn far.
KNOWN_SPEED_STD, SPEED_KNOWN_AFTER_S = 0.2, 1.0
# shares: more of the load's weight means taut, less of the pull of a load that hangs means slack
PULL_TAUT, PULL_SLACK = 0.8, 0.2
MIN_FULL_PULL = 0.5  # share of the load's weight that this pull has at least
PULL_TAUT_S, PULL_SLACK_S = 0.2, 0.15  # for how long
# What takes the pull of a load away that is above the ground by IN_AIR_HEIGHT (m) and some deviations is a
# gust, or a slack cable that pulls again before anything could be done about it, as nothing shows where the
# load falls; unless it was lost, which is certain after LOST_S without a pull. A camera that sees the load
# where the pendulum says shows that it hangs: it is then lost only after LOST_IN_VIEW_S, longer than gusts
# last. This view may be MAX_VIEW_AGE_S old.
IN_AIR_HEIGHT, LOST_S, LOST_IN_VIEW_S, MAX_VIEW_AGE_S = 0.1, 1.0, 5.0, 0.3
# A pull counts above the second share of the cable length less some deviations of the distance, and not below
# the first, unless the load is above the ground by HELD_HEIGHT (m) and some deviations: only the cable can
# hold it there.
MIN_PULL_DISTANCE, PULL_DISTANCE, HELD_HEIGHT, HELD_SIGMAS = 0.75, 0.95, 0.5, 3.0
# A load that is being lifted is not below the height (m) at which it lay, beyond this and some deviations: it
# is a gust that pulls.
SUNK_HEIGHT = 0.05
# A cable whose upper end is this share of its length above the load, and some deviations of the height, must
# be taut: less pull is enough there, since the load may be lighter than assumed, and a gust may hide some.
STRETCHED_HEIGHT, STRETCHED_SIGMAS, STRETCHED_PULL = 1.02, 2.0, 0.4
PULL_TIME_S = 0.04  # time constant that smooths the measured pull
# For LIFTING_S after the cable came taut, a load that pulls less than LIFTING_PULL of the pull of a
# suspended load is assumed to be on the ground: pendulum and length then get little weight.
LIFTING_S, LIFTING_PULL = 4.0, 0.8
# m above where it lay, at which a tracked load is off the ground. Until then no pull is missing: a long cable
# counts as taut many seconds before it is.
LIFTED_HEIGHT = 0.05
# s and m/s: a tracked load that is this slow after this time without a pull of its cable lies somewhere
RESTED_S, RESTING_SPEED = 2.0, 0.2
REJECTIONS_UNLOADED = 4.0  # rejected readings in a row that show the same
# The taut cable of a tracked load does not carry, whatever its length, if its measured pull is less than this
# share of the pendulum's.
UNLOADED_PULL = 0.4
MISSING_PULL_TIME_S = 2.0  # time constant with which the missing part of the pull is learned
# of the pendulum's tension: a pull above it is that of a load that hangs
CERTAIN_PULL = 0.5
# of the cable's length above a load on the ground: higher up, the vehicle is off the ground
MIN_FLOWN_HEIGHT = 0.2
# What a slack cable seems to pull is an error of the vehicle's mass, or of the rotors' force. It is learned
# below SURELY_SLACK of the cable's length, with this time constant, while the rotors' axis is upright
# (cosine), up to MAX_SLACK_PULL of the vehicle's weight. EXPLAINED_PULL of the load's weight may be gusts.
SURELY_SLACK, SLACK_PULL_TIME_S, LEARNING_UPRIGHT = 0.8, 1.0, 0.985
MAX_SLACK_PULL, EXPLAINED_PULL = 0.4, 0.2
# A cable that begins to pull, at SNATCH_PULL of the load's weight, stops vehicle and load along it at once;
# before, its ends moved apart at about SNATCH_SPEED (m/s). This happens between two samples of the
# accelerometer.
SNATCH_PULL, SNATCH_SPEED = 0.3, 0.2
SNATCH_DELAY_S = 0.015  # time after which the measured pull shows it
# share of the air's deviation with which a load begins that a tracker measures: wind soon shows, and the law
# that lifts the load is not disturbed while the filter searches for it; and one that no sensor has ever
# measured: its pull shows only the sum of the wind on the load and the wind on the vehicle, and a wrong share
# of the load makes the law lean
INITIAL_AIR_SHARE = 0.2
LIFT_OFF_SPEED_STD = 0.025  # m/s, across the cable, of a load that the cable has begun to pull
# no cable comes taut while the last direction to the load is older, unless there never was one
MAX_DIRECTION_AGE_S = 1.0


@kernel
def is_never_observed(load: LoadEstimate) -> bool:
    """Whether no sensor has ever observed the load."""
    return load.source == CAMERA and load.age_s == float("inf")


@kernel
def orthogonal_axis(q: Vec3, across: Vec3) -> Vec3:
    """A unit vector orthogonal to q, near `across` if that is possible."""
    flat = tangent(q, across)
    if norm(flat) < 0.1:
        flat = tangent(q, (1.0, 0.0, 0.0) if q[0] * q[0] < 0.5 else (0.0, 1.0, 0.0))
    return normalise(flat)


@kernel
def load_vertical_var(
    load: LoadEstimate, history: History, vehicle: int, cable: int, of_length: float, noise_var: float
) -> float:
    """Variance of the height or the climb rate of a load at the end of its taut cable, and of a noise.

    `vehicle` is the row of the height or climb rate of the vehicle, `cable` the first of the direction of the
    cable or of its rate, and `of_length` what the height changes by with the length.
    """
    P, along, L = history.covariance, cross(load.q_cable, load.across), load.length
    rows = (vehicle, cable, cable + 1, LENGTH)
    factors = (1.0, L * load.across[2], L * along[2], of_length)
    variance = noise_var
    for i in range(4):
        for j in range(4):
            variance += factors[i] * factors[j] * P[rows[i], rows[j]]
    return variance


@kernel
def load_height_var(load: LoadEstimate, history: History) -> float:
    """Variance of the height (m^2) of a load at the end of its taut cable."""
    return load_vertical_var(load, history, POSITION + 2, DIRECTION, load.q_cable[2], 0.0)


@kernel
def has_risen(load: LoadEstimate, history: History) -> bool:
    """Whether a load on a taut cable that a camera has seen is above the place where it lay: it hangs,
    however little its cable seems to pull."""
    height_std = sqrt(max(0.0, load_height_var(load, history)))
    height = load.laid_height + LIFTED_HEIGHT + HELD_SIGMAS * height_std
    return load.source == CAMERA and not is_never_observed(load) and load.x_load[2] > height


@kernel
def cable_is_unloaded(load: LoadEstimate, history: History, memory_s: float, missing_pull: float) -> bool:
    """Whether a cable that counts as taut does not carry its load yet.

    The cable of a tracked load counts as taut some per cent of its length before it is, and readings up to
    `memory_s` old still show that; the same holds for this time after the load has come to the ground.
    `missing_pull` (N) is the part of the pull that has been missing for long, because the assumed thrust or
    mass is wrong.
    """
    if load.source == TRACKER and load.pull + missing_pull < UNLOADED_PULL * load.tension:
        return True
    if load.tautness_age_s > LIFTING_S:
        return False
    if load.source == TRACKER:
        return not load.pull_duration_s > memory_s or load.rejected >= REJECTIONS_UNLOADED
    return load.pull + missing_pull < LIFTING_PULL * load.tension and not has_risen(load, history)


@kernel
def _is_above_ground(load: LoadEstimate, history: History, height: float, tuning: EstimatorTuning) -> bool:
    """Whether a load without a tracker is above the ground by this height (m) and some deviations."""
    height_std = sqrt(history.covariance[POSITION + 2, POSITION + 2])
    return load.x_load[2] - tuning.load_height > height + HELD_SIGMAS * height_std


@kernel
def _has_rested(load: LoadEstimate) -> bool:
    """Whether a tracked load on a slack cable lies still, at whatever height: in the air it would fall."""
    return bool(
        load.source == TRACKER and load.tautness_age_s > RESTED_S and norm(load.v_load) < RESTING_SPEED
    )


@kernel
def _is_sunk(load: LoadEstimate, history: History) -> bool:
    """Whether a load without a tracker that is being lifted would be in the ground, so that its cable cannot
    be taut."""
    height_std = sqrt(history.covariance[POSITION + 2, POSITION + 2])
    lowest = load.laid_height - SUNK_HEIGHT - HELD_SIGMAS * height_std
    return load.tautness_age_s <= LIFTING_S and load.x_load[2] < lowest


@kernel
def _may_pull(
    load: LoadEstimate, vehicle: VehicleEstimate, history: History, tuning: EstimatorTuning
) -> bool:
    """Whether a cable that counts as slack, of a load without a tracker, may be what pulls at the vehicle."""
    distance_std = sqrt(history.covariance[POSITION + 2, POSITION + 2] + load.covariance[0])
    min_distance = PULL_DISTANCE * tuning.cable_length - HELD_SIGMAS * distance_std
    distance = norm(sub(load.x_load, vehicle.x_quad))
    is_long = distance > max(min_distance, MIN_PULL_DISTANCE * tuning.cable_length)
    return is_long or _is_above_ground(load, history, HELD_HEIGHT, tuning)


@kernel
def _is_surely_slack(
    load: LoadEstimate, vehicle: VehicleEstimate, history: History, tuning: EstimatorTuning
) -> bool:
    """Whether a cable that counts as slack, of a load without a tracker, is slack whatever seems to pull,
    also if the height is wrong by some deviations."""
    height_std = sqrt(history.covariance[POSITION + 2, POSITION + 2])
    distance = norm(sub(load.x_load, vehicle.x_quad)) + HELD_SIGMAS * height_std
    may_pull = _may_pull(load, vehicle, history, tuning)
    return distance < PULL_DISTANCE * tuning.cable_length and not may_pull


@kernel
def _with_held_time(
    load: LoadEstimate, distance: float, pull: float, tuning: EstimatorTuning, dt: float
) -> LoadEstimate:
    """A tracked load on a slack cable with the time for which it has pulled and kept its distance (m); this
    distance is its length meanwhile."""
    may_be_held = distance > SHORT_CABLE * tuning.cable_length
    is_pulling = may_be_held and pull > HELD_PULL * tuning.load_mass * tuning.gravity
    is_held = is_pulling and abs(distance - load.length) < HELD_RANGE
    length = distance if is_pulling and not is_held else load.length
    return _with_tautness(load, 0.0, length, pull, load.pull_duration_s + dt if is_held else 0.0)


@kernel
def _with_longer_cable(load: LoadEstimate, tuning: EstimatorTuning) -> LoadEstimate:
    """The load on a taut cable that counted as shorter than assumed, if it turns out to be longer than so."""
    share = max(load.length_share, load.length / tuning.cable_length)
    return with_field(load, "length_share", min(1.0, share))


@kernel
def _must_pull(
    load: LoadEstimate, vehicle: VehicleEstimate, history: History, tuning: EstimatorTuning
) -> bool:
    """Whether the vehicle is so high above a load without a tracker that the cable must be taut."""
    height_std = sqrt(history.covariance[POSITION + 2, POSITION + 2])
    height = vehicle.x_quad[2] - load.x_load[2]
    return height > STRETCHED_HEIGHT * tuning.cable_length + STRETCHED_SIGMAS * height_std


@kernel
def averaged_missing_pull(
    load: LoadEstimate,
    vehicle: VehicleEstimate,
    history: History,
    before: float,
    tuning: EstimatorTuning,
    dt: float,
) -> float:
    """Part of the pull that has been missing for long, N: negative where rotors that give less than assumed
    look like a load. With a camera, a slack cable does not pull while its ends are near each other and the
    load is on the ground."""
    if load.source == TRACKER:
        if load.taut == 0.0:
            return 0.0
        if load.laid_height > NOT_LAID:
            return before
    elif load.taut == 0.0:
        if not _is_surely_slack(load, vehicle, history, tuning):
            # a gust is over: what it made of the pull is not missing when the cable begins to pull
            return max(before, -max(load.pull, 0.0))
        return min(before - dt / MISSING_PULL_TIME_S * (load.pull + before), 0.0)
    elif load.tautness_age_s <= LIFTING_S:
        return before
    return before + dt / MISSING_PULL_TIME_S * (load.tension - load.pull - before)


@kernel
def averaged_slack_pull(
    before: float,
    measured: float,
    load: LoadEstimate,
    vehicle: VehicleEstimate,
    upward: float,
    history: History,
    tuning: EstimatorTuning,
    dt: float,
) -> float:
    """The pull (N) that the assumed mass of the vehicle would show while the cable is slack.

    `measured` (N) is the pull by this sample with the mass of `with_learned_mass`, `upward` the vertical part
    of the rotors' axis. It is learned while an upright vehicle in the air is nearer to its load than any
    cable that pulls. Were the vehicle standing, it would seem to be pushed up by more than MAX_SLACK_PULL.
    """
    if load.taut > 0.0 or load.source == NO_SENSOR or upward < LEARNING_UPRIGHT:
        return before
    height = vehicle.x_quad[2] - load.x_load[2]
    distance = norm(sub(load.x_load, vehicle.x_quad))
    height_std = sqrt(history.covariance[POSITION + 2, POSITION + 2])
    is_slack = distance + height_std < SURELY_SLACK * tuning.cable_length
    if load.source != TRACKER:
        is_slack = is_slack and _is_surely_slack(load, vehicle, history, tuning)
    in_air = height > MIN_FLOWN_HEIGHT * tuning.cable_length
    if not (is_slack and in_air) or abs(measured) > MAX_SLACK_PULL * tuning.quad_mass * tuning.gravity:
        return before
    raw = measured + beyond_noise(before, tuning)
    return before + dt / SLACK_PULL_TIME_S * (raw - before)


@kernel
def beyond_noise(slack_pull: float, tuning: EstimatorTuning) -> float:
    """The part of `slack_pull` (N) that neither gusts nor rotors explain, but a wrong mass."""
    explained = EXPLAINED_PULL * tuning.load_mass * tuning.gravity
    return slack_pull - min(explained, max(-explained, slack_pull))


@kernel
def with_learned_mass(tuning: EstimatorTuning, slack_pull: float) -> EstimatorTuning:
    """The tuning with the mass of the vehicle that the pull of a slack cable shows."""
    extra_mass = beyond_noise(slack_pull, tuning) / tuning.gravity
    return with_field(tuning, "quad_mass", tuning.quad_mass + extra_mass)


@kernel
def is_pull_known(
    load: LoadEstimate,
    vehicle: VehicleEstimate,
    history: History,
    missing_pull: float,
    tuning: EstimatorTuning,
) -> bool:
    """Whether the true pull is known, so that the force of the air on the vehicle is: it is that of the
    pendulum while the load hangs, and none while the vehicle flies with a cable that is slack."""
    if load.taut == 0.0:
        height = vehicle.x_quad[2] - load.x_load[2]
        in_air = height > MIN_FLOWN_HEIGHT * tuning.cable_length
        return load.source != TRACKER and in_air and _is_surely_slack(load, vehicle, history, tuning)
    hangs = load.laid_height <= NOT_LAID if load.source == TRACKER else load.tautness_age_s > LIFTING_S
    return hangs and load.pull + min(missing_pull, 0.0) > CERTAIN_PULL * load.tension


@kernel
def add_snatch_uncertainty(
    load: LoadEstimate, pull_before: float, history: History, tuning: EstimatorTuning
) -> None:
    """Where the cable has begun to pull since the pull was `pull_before` (N), make the vehicle's velocity
    along it less certain."""
    snatch_pull = SNATCH_PULL * tuning.load_mass * tuning.gravity
    if pull_before >= snatch_pull or load.pull < snatch_pull:
        return
    P, q = history.covariance, load.q_cable
    std = SNATCH_SPEED * tuning.load_mass / (tuning.load_mass + tuning.quad_mass)
    for i in range(3):
        for j in range(3):
            variance = std * std * q[i] * q[j]
            P[VELOCITY + i, VELOCITY + j] += variance
            P[POSITION + i, VELOCITY + j] += SNATCH_DELAY_S * variance
            P[VELOCITY + j, POSITION + i] += SNATCH_DELAY_S * variance
            P[POSITION + i, POSITION + j] += 2.0 * SNATCH_DELAY_S * SNATCH_DELAY_S * variance


@kernel
def _with_tautness(
    load: LoadEstimate, taut: float, length: float, pull: float, pull_duration_s: float
) -> LoadEstimate:
    load = with_field(load, "tautness_age_s", load.tautness_age_s if taut == load.taut else 0.0)
    load = with_field(with_field(load, "taut", taut), "length", length)
    return with_field(with_field(load, "pull", pull), "pull_duration_s", pull_duration_s)


@kernel
def _set_relative_rows(
    P: Array, cable_row: int, vehicle_row: int, across: Vec3, along: Vec3, distance: float
) -> None:
    """Set the rows of b_i . (load - vehicle) / d for a load whose error is uncorrelated with the rest: only
    the part of the vehicle. `vehicle_row` is before `cable_row`, so that the block of these rows uses
    values already set."""
    for j in range(SIZE):
        p0, p1, p2 = P[vehicle_row, j], P[vehicle_row + 1, j], P[vehicle_row + 2, j]
        first_value = -(across[0] * p0 + across[1] * p1 + across[2] * p2) / distance
        second_value = -(along[0] * p0 + along[1] * p1 + along[2] * p2) / distance
        P[cable_row, j], P[j, cable_row] = first_value, first_value
        P[cable_row + 1, j], P[j, cable_row + 1] = second_value, second_value


@kernel
def _set_seen_row(P: Array, row: int, axis: Vec3, q: Vec3, R: Mat3) -> None:
    """Set the row of b . q as a camera has seen the direction q, in body axes: an error of the attitude, and
    one of the camera's mounting, is one of the direction. Its variance comes last, from the whole row."""
    turn = cross(q, axis)
    mounting = apply_transposed(R, turn)
    for j in range(SIZE):
        value = turn[0] * P[ATTITUDE, j] + turn[1] * P[ATTITUDE + 1, j] + turn[2] * P[ATTITUDE + 2, j]
        value -= mounting[0] * P[MOUNTING, j] + mounting[1] * P[MOUNTING + 1, j]
        P[row, j], P[j, row] = value, value
    value = turn[0] * P[ATTITUDE, row] + turn[1] * P[ATTITUDE + 1, row] + turn[2] * P[ATTITUDE + 2, row]
    P[row, row] = value - mounting[0] * P[MOUNTING, row] - mounting[1] * P[MOUNTING + 1, row]


@kernel
def tauten(
    load: LoadEstimate, vehicle: VehicleEstimate, history: History, tuning: EstimatorTuning, length: float
) -> LoadEstimate:
    """The load on a taut cable: direction and rate of the cable replace its own position and velocity."""
    P = history.covariance
    is_in_air = _is_above_ground(load, history, IN_AIR_HEIGHT, tuning) and not _has_rested(load)
    load = with_field(load, "laid_height", NOT_LAID if is_in_air else load.x_load[2])
    zero_covariance(P, DIRECTION, 5)
    P[LENGTH, LENGTH] = tuning.length_std * tuning.length_std
    across, along = load.across, cross(load.q_cable, load.across)
    aa, ab, bb = load.covariance
    tracked = load.source == TRACKER
    seen = not tracked and not is_never_observed(load)
    if not tracked:
        bb += LIFT_OFF_SPEED_STD * LIFT_OFF_SPEED_STD
    if not seen:
        initial_air_std = INITIAL_AIR_SHARE * tuning.air_std
        zero_covariance(P, AIR, 2)
        P[AIR, AIR], P[AIR + 1, AIR + 1] = (
            initial_air_std * initial_air_std,
            initial_air_std * initial_air_std,
        )
    if tracked:
        _set_relative_rows(P, DIRECTION, POSITION, across, along, length)
    elif seen:
        R = rotation_from_quat(vehicle.quat_wxyz)
        _set_seen_row(P, DIRECTION, across, load.q_cable, R)
        _set_seen_row(P, DIRECTION + 1, along, load.q_cable, R)
        # what is left of the load's variance is independent of these errors
        aa = max(
            0.0, aa - 0.5 * length * length * (P[DIRECTION, DIRECTION] + P[DIRECTION + 1, DIRECTION + 1])
        )
    _set_relative_rows(P, RATE, VELOCITY, across, along, length)
    s = 1.0 / length
    for i in range(2):
        P[DIRECTION + i, DIRECTION + i] += s * s * aa
        P[DIRECTION + i, RATE + i] += s * s * ab
        P[RATE + i, DIRECTION + i] += s * s * ab
        P[RATE + i, RATE + i] += s * s * bb
    return _with_tautness(load, 1.0, length, load.pull, 0.0)


@kernel
def slacken(load: LoadEstimate, history: History, position_var: float, velocity_var: float) -> LoadEstimate:
    """The load tracked separately from now on, with these variances; the cable's errors are dropped. A load
    without a tracker that was being lifted lies at the height at which it lay before."""
    at_rest, x_load, laid_height_var = (0.0, 0.0, 0.0), load.x_load, load_height_var(load, history)
    if load.source != TRACKER and load.tautness_age_s <= LIFTING_S and load.laid_height > NOT_LAID:
        x_load, laid_height_var = (x_load[0], x_load[1], load.laid_height), load.laid_height_var
    zero_covariance(history.covariance, DIRECTION, 5)
    return LoadEstimate(
        x_load,
        load.v_load if load.source == TRACKER else at_rest,
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
        load.laid_height,
        laid_height_var,
        load.length_share,
    )


@kernel
def _slack_after_s(load: LoadEstimate, history: History, tuning: EstimatorTuning) -> float:
    """The time (s) without a pull after which the cable of a load without a tracker is slack."""
    if not _is_above_ground(load, history, IN_AIR_HEIGHT, tuning):
        return PULL_SLACK_S
    in_view = load.rejected == 0.0 and load.age_s < MAX_VIEW_AGE_S
    return LOST_IN_VIEW_S if in_view else LOST_S


@kernel
def detect_tautness(
    load: LoadEstimate,
    vehicle: VehicleEstimate,
    history: History,
    measured: float,
    missing_pull: float,
    tuning: EstimatorTuning,
    dt: float,
) -> LoadEstimate:
    """The load after the decision whether its cable is taut or slack.

    `measured` (N) is the pull by this sample, `missing_pull` (N) is from `averaged_missing_pull`.
    """
    share = dt / (PULL_TIME_S + dt)
    pull = load.pull + share * (measured - load.pull)
    if load.source == TRACKER:
        distance = norm(sub(load.x_load, vehicle.x_quad))
        if load.taut > 0.0:
            carried_s = load.pull_duration_s + dt if pull >= LIFTING_PULL * load.tension else 0.0
            load = _with_tautness(load, 1.0, load.length, pull, carried_s)
            if load.x_load[2] > load.laid_height + LIFTED_HEIGHT:
                load = with_field(load, "laid_height", NOT_LAID)
            return _with_longer_cable(load, tuning)
        load = _with_held_time(load, distance, pull, tuning, dt)
        P = history.covariance
        vehicle_var = max(P[VELOCITY, VELOCITY], P[VELOCITY + 1, VELOCITY + 1], P[VELOCITY + 2, VELOCITY + 2])
        speed_var = load.covariance[2] + vehicle_var
        speed_known = (
            speed_var < KNOWN_SPEED_STD * KNOWN_SPEED_STD or load.tautness_age_s > SPEED_KNOWN_AFTER_S
        )
        if not speed_known:
            return load
        if distance > TAUT_ABOVE * load.length_share * tuning.cable_length:
            return tauten(load, vehicle, history, tuning, distance)
        if load.pull_duration_s > HELD_S:
            load = with_field(load, "length_share", distance / tuning.cable_length)
            return tauten(load, vehicle, history, tuning, distance)
        return load
    weight = tuning.load_mass * tuning.gravity
    if load.taut == 0.0:
        is_pulling = (
            pull + missing_pull > PULL_TAUT * weight and _may_pull(load, vehicle, history, tuning)
        ) or (pull + missing_pull > STRETCHED_PULL * weight and _must_pull(load, vehicle, history, tuning))
        load = _with_tautness(load, 0.0, load.length, pull, load.pull_duration_s + dt if is_pulling else 0.0)
        if load.pull_duration_s > PULL_TAUT_S and (
            load.age_s < MAX_DIRECTION_AGE_S or load.age_s == float("inf")
        ):
            load = tauten(load, vehicle, history, tuning, tuning.cable_length)
            x_load = axpy(load.length, load.q_cable, vehicle.x_quad)
            return with_field(load, "x_load", x_load)
        return load
    # a gust, or a load lighter than assumed, takes from the pull that is left to fall
    full_pull = max(weight - max(missing_pull, 0.0), MIN_FULL_PULL * weight)
    is_slack = pull + min(missing_pull, 0.0) < PULL_SLACK * full_pull
    load = _with_tautness(load, 1.0, load.length, pull, load.pull_duration_s + dt if is_slack else 0.0)
    if load.pull_duration_s > _slack_after_s(load, history, tuning) or _is_sunk(load, history):
        P = history.covariance
        L = load.length
        var = 0.5 * L * L * (P[DIRECTION, DIRECTION] + P[DIRECTION + 1, DIRECTION + 1])
        return slacken(load, history, var, 0.0)
    return load
