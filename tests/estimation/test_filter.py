"""The estimator against a motion that shares no code with it: consistency, delay, outliers, drop-out."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from autopilot.estimation.history import correct_past_states, interpolate3, interpolate4, row_before
from autopilot.estimation.measurements.load import correct_load
from autopilot.estimation.measurements.pose import correct_pose
from autopilot.estimation.predict import predict
from autopilot.estimation.records import (
    ACCEL_BIAS,
    ATTITUDE,
    DIRECTION,
    GYRO_BIAS,
    POSITION,
    QUAT,
    RATE,
    VELOCITY,
    X_QUAD,
    EstimatorState,
    History,
    ImuReading,
    LoadReading,
    PoseReading,
    blank_state,
    new_history,
)
from autopilot.geometry.linear import ZERO
from tests.doubles.estimate_problems import estimate_problems
from tests.doubles.motion import CABLE_LENGTH, TICK_S, Array, Motion, Noise, Trace, bebop_tuning, track
from tests.doubles.readings import Readings, estimate

SETTLED_S = 3.0
# Mean of error^2 / stated variance per axis. 1 is exact; one path of 17 s is a small sample of slow errors,
# and a delay of 60 ms leaves out the noise of that time.
CONSISTENT = (0.4, 2.0)
# Share of the samples that may lie beyond the 99.9 % bound of chi-square; samples are correlated in time
BEYOND = 0.03
# Stated standard deviations by which the mean error of 5 s may be off: the rest of the gyro bias makes the
# attitude's error slow, up to 0.9
MEAN_ERROR = 1.2
IDEAL_M, IDEAL_RAD = 1e-3, 1e-3
ROUNDING = 1e-9  # of the least eigenvalue of a correlation matrix, with readings of 0.02 mm after metres

NO_NOISE = Noise(0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 250.0)


def errors(trace: Trace, motion: Motion) -> dict[str, tuple[Array, Array, int]]:
    """Error (n, 3), stated variance (n,) and degrees of freedom of each quantity, once settled."""
    s = slice(round(SETTLED_S / TICK_S), None)
    t = trace.t[s]
    turned = Rotation.from_quat(trace.of(lambda e: e.vehicle.quat_wxyz)[s], scalar_first=True)
    q, q_dot = motion.cable(t)
    P = np.array(trace.covariances[s])
    variance = np.diagonal(P, axis1=1, axis2=2)

    def mean(first: int, count: int) -> Array:
        return np.asarray(variance[:, first : first + count].mean(axis=1))

    rate = mean(VELOCITY, 3) + CABLE_LENGTH**2 * 2.0 / 3.0 * mean(RATE, 2)
    for i, axis in enumerate((trace.of(lambda e: e.load.across)[s], along(trace)[s])):
        shared = (P[:, VELOCITY : VELOCITY + 3, RATE + i] * axis).sum(axis=1)
        rate = rate + 2.0 / 3.0 * CABLE_LENGTH * shared
    return {
        "x_quad": (trace.of(lambda e: e.vehicle.x_quad)[s] - motion.x_quad(t), mean(POSITION, 3), 3),
        "v_quad": (trace.of(lambda e: e.vehicle.v_quad)[s] - motion.x_quad(t, 1), mean(VELOCITY, 3), 3),
        "attitude": ((turned * motion.attitude(t).inv()).as_rotvec(), mean(ATTITUDE, 3), 3),
        "x_load": (
            trace.of(lambda e: e.load.x_load)[s] - motion.x_load(t),
            trace.of(lambda e: e.uncertainty.load)[s] ** 2,
            3,
        ),
        "v_load": (trace.of(lambda e: e.load.v_load)[s] - motion.v_load(t), rate, 3),
        "q_cable": (trace.of(lambda e: e.load.q_cable)[s] - q, mean(DIRECTION, 2), 2),
        "q_cable_dot": (trace.of(lambda e: e.load.q_cable_dot)[s] - q_dot, mean(RATE, 2), 2),
    }


def along(trace: Trace) -> Array:
    """The cable's second axis."""
    return np.cross(trace.of(lambda e: e.load.q_cable), trace.of(lambda e: e.load.across))


@pytest.mark.parametrize("latency_s", [0.0, 0.004, 0.02, 0.06])
def test_errors_are_as_large_as_the_estimator_says_whatever_the_latency(
    motion: Motion, latency_s: float
) -> None:
    trace = track(motion, 20.0, Noise(latency_s=latency_s), seed=1)
    assert trace.states[-1].resets == 2.0, "each tracker starts the estimate once"
    for name, (error, variance, axes) in errors(trace, motion).items():
        normalised = (error**2).sum(axis=1) / variance
        assert CONSISTENT[0] < normalised.mean() / axes < CONSISTENT[1], (name, normalised.mean() / axes)
        beyond = np.mean(normalised > chi2.ppf(0.999, axes) * CONSISTENT[1])
        assert beyond < BEYOND, (name, beyond)


@pytest.mark.parametrize("latency_s", [0.0, 0.004, 0.02, 0.06])
def test_a_delay_leaves_no_bias_while_accelerating(latency_s: float) -> None:
    """At 2 m/s^2 a reading 60 ms old is 3.6 mm and 0.12 m/s behind a vehicle at rest in its own frame, and
    ever further behind in the world."""
    motion = Motion(8.0, accel=2.0)
    noise = Noise(latency_s=latency_s)
    for name, (error, variance, _) in errors(track(motion, 8.0, noise, seed=2), motion).items():
        mean = np.abs(error.mean(axis=0)).max() / np.sqrt(variance.mean())
        assert mean < MEAN_ERROR, (name, mean)


def test_biases_are_learned(motion: Motion) -> None:
    noise = Noise()
    trace = track(motion, 20.0, noise, seed=3)
    last = trace.states[-1].vehicle
    gyro = np.subtract(last.gyro_bias, noise.gyro_bias)
    accel = np.subtract(last.accel_bias, noise.accel_bias)
    stated = np.diagonal(trace.covariances[-1])
    assert gyro @ gyro < chi2.ppf(0.999, 3) * stated[GYRO_BIAS : GYRO_BIAS + 3].max()
    assert accel @ accel < chi2.ppf(0.999, 3) * stated[ACCEL_BIAS : ACCEL_BIAS + 3].max()
    assert np.abs(gyro).max() < 0.3 * abs(noise.gyro_bias[0])
    assert np.abs(accel).max() < 0.3 * abs(noise.accel_bias[0])


def test_perfect_sensors_give_a_perfect_estimate(motion: Motion) -> None:
    worst = {
        name: np.abs(error).max()
        for name, (error, _, _) in errors(track(motion, 10.0, NO_NOISE, seed=1), motion).items()
    }
    assert max(worst["x_quad"], worst["x_load"]) < IDEAL_M
    assert max(worst["attitude"], worst["q_cable"]) < IDEAL_RAD


def outlier(t: float, x: Array, who: str, victim: str) -> Array:
    return x + np.array([0.3, 0.0, -0.2]) if who == victim and round(t * 200.0) % 40 == 0 and t > 2.0 else x


@pytest.mark.parametrize("victim", ["vehicle", "load"])
def test_an_outlier_is_refused(motion: Motion, victim: str) -> None:
    trace = track(motion, 8.0, Noise(), seed=4, tampered=partial(outlier, victim=victim))
    assert trace.states[-1].resets == 2.0
    refused = trace.of(lambda e: e.vehicle.rejected if victim == "vehicle" else e.load.rejected)
    assert refused.max() == 1.0
    for name, (error, variance, axes) in errors(trace, motion).items():
        assert (error**2).sum(axis=1).mean() / axes / variance.mean() < CONSISTENT[1], name


@pytest.mark.parametrize("latency_s", [0.0, 0.06, 0.15])
def test_after_a_long_jump_the_estimate_starts_anew_where_the_trackers_say(latency_s: float) -> None:
    """The tracker's origin moves by a metre: not an outlier but the truth from now on."""
    motion = Motion(6.0, accel=0.0)

    def moved(t: float, x: Array, who: str) -> Array:
        return x + np.array([1.0, 0.0, 0.0]) if t > 3.0 else x

    trace = track(motion, 6.0, Noise(latency_s=latency_s), seed=5, tampered=moved)
    last = trace.states[-1]
    assert last.resets == 3.0, "two at the start, one at the jump: the load hangs from the vehicle"
    assert last.vehicle.x_quad[0] == pytest.approx(1.0, abs=0.005)
    assert last.load.x_load[0] == pytest.approx(1.0, abs=0.005)


def test_a_drop_out_grows_the_covariance_and_readings_end_it(motion: Motion) -> None:
    def silent(t: float, x: Array, who: str) -> Array | None:
        return None if 5.0 < t < 6.0 else x

    trace = track(motion, 8.0, Noise(), seed=6, tampered=silent)
    for pick in (lambda e: e.uncertainty.horizontal, lambda e: e.uncertainty.load):
        std = trace.of(pick)
        gone = slice(round(5.02 / TICK_S), round(5.99 / TICK_S))
        assert (np.diff(std[gone]) > 0.0).all()
        assert std[gone][-1] > 10.0 * std[round(4.9 / TICK_S)]
        assert std[-1] == pytest.approx(std[round(4.9 / TICK_S)], rel=0.1)
    assert trace.states[-1].resets == 2.0, "a second without readings is bridged, not started over"
    # the pendulum keeps the load's position known for longer
    assert estimate_problems(trace.states[round(5.9 / TICK_S)], 0.5) == ("no vehicle pose from a tracker",)
    assert estimate_problems(trace.states[-1], 0.5) == ()


def test_slack_and_taut_are_told_by_the_distance() -> None:
    """The vehicle rises from 0.6 cable lengths over a resting load until the cable is taut, and sinks
    again."""
    state, history, tuning = blank_state(), new_history(), bebop_tuning()
    taut_at: list[float] = []
    for k in range(2000):
        t = TICK_S * k
        share = 0.6 + 0.4 * min(1.0, t / 3.0) - 0.2 * max(0.0, min(1.0, t - 6.0))
        over = (0.0, 0.0, share * CABLE_LENGTH)
        still = Readings(
            ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, tuning.gravity)),
            (PoseReading(0.0, over, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.001, 0.001, -1.0),),
            (LoadReading(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.001, -1.0),),
        )
        before = state.load.taut
        state = estimate(state, history, still, tuning, TICK_S)
        if state.load.taut != before:
            taut_at.append(share)
        if state.load.taut == 0.0:
            assert state.load.tension == 0.0
    assert len(taut_at) == 2, "taut once and slack once, however near the threshold the noise is"
    assert taut_at[0] > 0.97
    assert 0.9 < taut_at[1] < 0.98


def test_a_quiet_tracker_is_believed_while_the_cable_comes_taut() -> None:
    """The cable counts as taut before it is: the vehicle then continues to rise, and the load on it still
    lies.

    Readings with 0.1 mm deviation that move apart at 0.15 m/s must not be tied to a cable of constant length.
    """
    state, history, tuning = blank_state(), new_history(), bebop_tuning()
    refused = wrong = fastest = 0.0
    for k in range(1250):
        height = min(0.6 * CABLE_LENGTH + 0.15 * max(0.0, TICK_S * k - 1.0), CABLE_LENGTH)
        pulls = height == CABLE_LENGTH
        force = tuning.gravity * (1.0 + (tuning.load_mass / tuning.quad_mass if pulls else 0.0))
        readings = Readings(
            ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, tuning.gravity)),
            (PoseReading(0.0, (0.0, 0.0, height), (1.0, 0.0, 0.0, 0.0), ZERO, 1e-4, 1e-4, -1.0),),
            (LoadReading(0.0, ZERO, ZERO, 1e-4, -1.0),),
        )
        state = estimate(state, history, readings, tuning, TICK_S, tuning.quad_mass * force)
        refused = max(refused, state.load.rejected)
        if state.load.taut > 0.0:
            wrong = max(wrong, float(np.linalg.norm(state.load.x_load)))
            fastest = max(fastest, abs(state.vehicle.v_quad[2]))
    assert state.load.taut == 1.0
    assert refused == 0.0
    # the vehicle stops from one tick to the next, which is accepted after four readings of 0.6 mm: 2.3 mm
    assert wrong < 4e-3
    assert fastest < 0.2
    assert state.load.length == pytest.approx(CABLE_LENGTH, abs=2e-4)


@pytest.mark.parametrize("std", [5e-4, 1e-4])
def test_a_knock_between_two_samples_of_the_accelerometer_is_followed_at_once(std: float) -> None:
    """The vehicle sinks beside its load and stands from one tick to the next; no sample shows the impact.

    Waiting for a restart of the estimate would take 50 refused poses, and the load's doubt would grow beyond
    the limit for flight.
    """
    state, history, tuning = blank_state(), new_history(), bebop_tuning()
    refused, uncertainty = 0.0, 0.0
    for k in range(500):
        t = TICK_S * k
        height = 0.06 + 0.3 * max(0.0, 1.0 - t)
        still = Readings(
            ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, tuning.gravity)),
            (PoseReading(0.0, (0.35, 0.0, height), (1.0, 0.0, 0.0, 0.0), ZERO, std, std, -1.0),),
            (LoadReading(0.0, (0.0, 0.0, 0.02), ZERO, std, -1.0),),
        )
        state = estimate(state, history, still, tuning, TICK_S)
        refused = max(refused, state.vehicle.rejected)
        if t > 0.5:
            uncertainty = max(uncertainty, state.uncertainty.load)
    assert 0.0 < refused <= 5.0
    assert uncertainty < 0.01
    assert state.resets == 2.0
    assert state.vehicle.x_quad[2] == pytest.approx(0.06, abs=5e-4)
    assert abs(state.vehicle.v_quad[2]) < 0.01


def test_a_cable_a_little_too_short_to_be_taut_is_found_slack() -> None:
    """At more than 96.5 % of its length, where the readings of its load would be refused for a quarter of a
    second."""
    state, history, tuning = blank_state(), new_history(), bebop_tuning()
    since = 0.0
    for k in range(500):
        t = TICK_S * k
        over = (0.0, 0.0, (1.0 if t < 1.0 else max(0.968, 1.0 - 0.5 * (t - 1.0))) * CABLE_LENGTH)
        readings = Readings(
            ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, tuning.gravity)),
            (PoseReading(0.0, over, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 5e-4, 5e-4, -1.0),),
            (LoadReading(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 5e-4, -1.0),),
        )
        state = estimate(state, history, readings, tuning, TICK_S)
        if state.load.taut > 0.0:
            since = t
    assert since < 1.15
    assert state.uncertainty.load < 0.01


def held(steps: list[tuple[float, float, float]]) -> list[tuple[float, float]]:
    """Whether the cable counts as taut, and its length, after each of `steps`: so many seconds at this
    distance above a resting load and at this pull (N), by noiseless trackers."""
    state, history, tuning = blank_state(), new_history(), bebop_tuning()
    found = []
    for seconds, distance, pull in steps:
        thrust = tuning.quad_mass * tuning.gravity + pull
        readings = Readings(
            ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, tuning.gravity)),
            (PoseReading(0.0, (0.0, 0.0, distance), (1.0, 0.0, 0.0, 0.0), ZERO, 5e-4, 5e-4, -1.0),),
            (LoadReading(0.0, ZERO, ZERO, 5e-4, -1.0),),
        )
        for _ in range(round(seconds / TICK_S)):
            state = estimate(state, history, readings, tuning, TICK_S, thrust)
        found.append((state.load.taut, state.load.length))
    return found


def test_a_cable_that_is_shorter_than_assumed_is_slack_by_its_own_length() -> None:
    """Not at 92 % of the assumed length, at which a cable as long as assumed is slack."""
    own, weight = 0.92 * CABLE_LENGTH, bebop_tuning().load_mass * bebop_tuning().gravity
    slack, taut, stays, again = held(
        [(2.0, own, 0.0), (1.0, own, weight), (9.0, own, weight), (0.5, 0.95 * own, 0.0)]
    )
    assert slack[0] == 0.0
    assert taut == (1.0, pytest.approx(own, abs=1e-3))
    assert stays[0] == 1.0
    assert again[0] == 0.0


def definite(state: EstimatorState, history: History) -> bool:
    """Whether the used part of the covariance is symmetric to the bit and positive except for rounding."""
    used = [i for i in range(state.size) if history.covariance[i, i] != 0.0]
    P = history.covariance[np.ix_(used, used)]
    if not used:
        return True  # no reading has placed anything
    scale = 1.0 / np.sqrt(np.diag(P))
    if not np.isfinite(scale).all() or not (P == P.T).all():
        return False
    return bool(np.linalg.eigvalsh(P * np.outer(scale, scale))[0] > -ROUNDING)


@settings(max_examples=40)
@given(
    script=st.lists(
        st.tuples(
            st.sampled_from([0.001, 0.004, 0.01]),
            st.sampled_from(["pose", "load", "both", "none"]),
            st.floats(0.0, 0.3),
            st.sampled_from([2e-5, 1e-3, 0.1]),
            st.sampled_from([-1.0, 2e-4, 0.05]),
        ),
        min_size=60,
        max_size=60,
    )
)
def test_covariances_stay_positive_definite_at_any_rate_age_and_precision(
    script: list[tuple[float, str, float, float, float]],
) -> None:
    state, history, tuning = blank_state(), new_history(), bebop_tuning()
    imu = ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, tuning.gravity))
    zero = (0.0, 0.0, 0.0)
    for dt, who, age, std, velocity_std in script * 3:
        state = predict(state, history, imu, tuning, dt, 0.0, ZERO)
        if who in ("pose", "both"):
            pose = PoseReading(age, (0.0, 0.0, 0.7), (1.0, 0.0, 0.0, 0.0), zero, std, std, velocity_std)
            state = correct_pose(state, history, pose, tuning)
        if who in ("load", "both"):
            state = correct_load(state, history, LoadReading(age, zero, zero, std, velocity_std), tuning)
        assert definite(state, history)


def test_looking_back_sees_the_past_and_a_correction_moves_all_of_it_that_matters() -> None:
    state, history, tuning = blank_state(), new_history(), bebop_tuning()
    start = PoseReading(0.0, (1.0, 0.0, 2.0), (1.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0), 1e-4, 1e-4, 1e-4)
    imu = ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, tuning.gravity))
    state = correct_pose(predict(state, history, imu, tuning, 0.0, 0.0, ZERO), history, start, tuning)
    for _ in range(700):  # more than the ring holds
        state = predict(state, history, imu, tuning, TICK_S, 0.0, ZERO)
    now, ring = state.time_s, history.ring

    def x_at(age: float) -> float:
        return interpolate3(ring, *row_before(state.head, ring, now - age), X_QUAD)[0]

    for age in (0.0, 0.001, 0.004, 0.0213, 0.3):
        assert x_at(age) == pytest.approx(state.vehicle.x_quad[0] - 2.0 * age, abs=1e-9)
    assert x_at(1e8) == x_at(1e9), "beyond the ring: its oldest row"

    before = {age: x_at(age) for age in (0.0, 0.011, 0.019, 0.1)}
    error = history.error[0]
    error[:] = 0.0
    error[POSITION], error[VELOCITY] = 0.5, 3.0
    error[ATTITUDE + 2] = np.pi
    correct_past_states(state.head, history, 0.021)
    for age, moved in ((0.0, 0.5), (0.011, 0.5 - 0.033), (0.019, 0.5 - 0.057), (0.1, 0.0)):
        assert x_at(age) - before[age] == pytest.approx(moved, abs=1e-12), age
    for age, turned in ((0.021, 1.0), (0.1, 0.0)):
        at = row_before(state.head, ring, now - age)
        assert abs(interpolate4(ring, *at, QUAT)[3]) == pytest.approx(turned, abs=1e-9)
