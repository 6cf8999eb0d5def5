"""The errors with which a cable begins that comes taut, compared with those of what measured its load."""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from autopilot.estimation.predict import DRAGGING_SHARE, MIN_DRAGGING_SHARE, dragged_along
from autopilot.estimation.records import (
    ATTITUDE,
    CAMERA,
    DIRECTION,
    MOUNTING,
    NOT_LAID,
    POSITION,
    RATE,
    SIZE,
    TRACKER,
    VELOCITY,
    LoadEstimate,
    blank_state,
    new_history,
)
from autopilot.estimation.tautness import (
    EXPLAINED_PULL,
    LIFT_OFF_SPEED_STD,
    LIFTED_HEIGHT,
    RESTED_S,
    RESTING_SPEED,
    averaged_missing_pull,
    averaged_slack_pull,
    cable_is_unloaded,
    detect_tautness,
    is_pull_known,
    tauten,
    with_learned_mass,
)
from autopilot.geometry.linear import Vec3, apply, apply_transposed, cross
from autopilot.geometry.so3 import exp, quat_exp, rotation_from_quat
from tests.doubles.motion import bebop_tuning

Array = NDArray[np.float64]
LENGTH = 0.7
Q: Vec3 = (0.36, 0.48, -0.8)
ACROSS: Vec3 = (0.8, -0.6, 0.0)
AXES = np.array([ACROSS, cross(Q, ACROSS)])
VEHICLE = blank_state().vehicle._replace(quat_wxyz=quat_exp((0.3, -0.2, 1.1)))
LOAD = blank_state().load._replace(q_cable=Q, across=ACROSS, age_s=0.1)


def tautened(source: float, covariance: tuple[float, float, float]) -> tuple[Array, Array]:
    """The covariance before and after the cable of such a load comes taut."""
    history = new_history()
    root = np.random.default_rng(3).normal(size=(SIZE, SIZE)) * 0.01
    history.covariance[:SIZE, :SIZE] = root @ root.T
    before = history.covariance.copy()
    load = LOAD._replace(source=source, covariance=covariance)
    tauten(load, VEHICLE, history, bebop_tuning(), LENGTH)
    return before, history.covariance


def rows(P: Array, *first_and_count: tuple[int, int]) -> Any:
    """The covariance of these parts of the error."""
    at = np.concatenate([np.arange(first, first + count) for first, count in first_and_count])
    return P[np.ix_(at, at)]


def seen_from_camera(errors: Array) -> Array:
    """The direction that a camera reading means if attitude and mounting are wrong by this much."""
    R = rotation_from_quat(VEHICLE.quat_wxyz)
    turn, mounting = exp(tuple(errors[:3])), exp((-errors[3], -errors[4], 0.0))
    return np.array(apply(turn, apply(R, apply(mounting, apply_transposed(R, Q)))))


def test_a_direction_that_a_camera_saw_has_the_error_of_attitude_and_mounting() -> None:
    step = 1e-6
    J = np.array([AXES @ (seen_from_camera(step * e) - np.array(Q)) / step for e in np.eye(5)]).T
    left = 0.004  # m^2, of the load's position, besides
    before, _ = tautened(CAMERA, (0.0, 0.0, 0.0))
    expected = J @ rows(before, (ATTITUDE, 3), (MOUNTING, 2)) @ J.T
    shared = 0.5 * LENGTH**2 * np.trace(expected)
    _, after = tautened(CAMERA, (shared + left, 0.0, 0.0))
    assert rows(after, (DIRECTION, 2)) == pytest.approx(expected + np.eye(2) * left / LENGTH**2, rel=1e-4)
    with_attitude = J[:, :3] @ rows(before, (ATTITUDE, 3)) + J[:, 3:] @ before[MOUNTING : MOUNTING + 2, 6:9]
    assert after[DIRECTION : DIRECTION + 2, ATTITUDE : ATTITUDE + 3] == pytest.approx(with_attitude, rel=1e-4)
    assert np.linalg.eigvalsh(after[:SIZE, :SIZE]).min() > -1e-12


@pytest.mark.parametrize(("source", "lift_off_std"), [(TRACKER, 0.0), (CAMERA, LIFT_OFF_SPEED_STD)])
def test_the_rate_has_the_error_of_both_velocities(source: float, lift_off_std: float) -> None:
    before, after = tautened(source, (0.0, 0.0, 0.002))
    expected = AXES @ rows(before, (VELOCITY, 3)) @ AXES.T + np.eye(2) * (0.002 + lift_off_std**2)
    assert rows(after, (RATE, 2)) == pytest.approx(expected / LENGTH**2, rel=1e-9)


def test_a_tracked_direction_has_the_error_of_both_positions() -> None:
    before, after = tautened(TRACKER, (0.001, 0.0, 0.0))
    expected = AXES @ rows(before, (POSITION, 3)) @ AXES.T + np.eye(2) * 0.001
    assert rows(after, (DIRECTION, 2)) == pytest.approx(expected / LENGTH**2, rel=1e-9)


# ---- taut or slack by the pull alone

DT = 0.004
TUNING = bebop_tuning()
WEIGHT = TUNING.load_mass * TUNING.gravity
HEIGHT_STD = 0.01


def after(
    load: LoadEstimate,
    pull: float,
    missing: float,
    height: float,
    seconds: float,
    height_std: float = HEIGHT_STD,
) -> LoadEstimate:
    """A load that a camera sees, with the vehicle level at a height over it (cable lengths) and this pull
    (weights of the load), of which this part has been missing for long."""
    history = new_history()
    history.covariance[POSITION + 2, POSITION + 2] = height_std**2
    vehicle = blank_state().vehicle._replace(x_quad=(0.0, 0.0, load.x_load[2] + height * TUNING.cable_length))
    for _ in range(round(seconds / DT)):
        load = detect_tautness(load, vehicle, history, pull * WEIGHT, missing * WEIGHT, TUNING, DT)
    return load


def laid(height_m: float = TUNING.load_height) -> LoadEstimate:
    """A load whose cable is slack, at this height."""
    load = blank_state().load
    return load._replace(
        x_load=(0.0, 0.0, height_m),
        q_cable=(0.0, 0.0, -1.0),
        age_s=0.1,
        source=CAMERA,
        length=LENGTH,
    )


def pulled(share: float, pull: float, rise_m_s: float) -> LoadEstimate:
    """A tracked load whose vehicle rises from this share of the cable's length above it, at this pull
    (weights of the load)."""
    load = laid()._replace(source=TRACKER, covariance=(0.0, 0.0, 0.0), tautness_age_s=9.0)
    history, height = new_history(), load.x_load[2] + share * LENGTH
    for k in range(round(0.45 / DT)):
        vehicle = blank_state().vehicle._replace(x_quad=(0.0, 0.0, height + rise_m_s * DT * k))
        load = detect_tautness(load, vehicle, history, pull * WEIGHT, 0.0, TUNING, DT)
    return load


@pytest.mark.parametrize(
    ("share", "pull", "rise_m_s", "is_taut"),
    [
        (0.97, 1.0, 0.0, True),
        (0.91, 0.45, 0.0, True),  # the load is lighter than assumed, or the vehicle
        (0.97, 0.35, 0.0, False),
        (0.89, 1.0, 0.0, False),  # too short to be the cable that is assumed
        (0.91, 1.0, 0.1, False),  # a gust, or weak rotors: at this pull the vehicle rises on
        (0.99, 0.0, 0.1, True),  # by its length
    ],
)
def test_a_tracked_cable_that_is_too_short_is_taut_by_a_pull_that_stops_the_vehicle(
    share: float, pull: float, rise_m_s: float, is_taut: bool
) -> None:
    load = pulled(share, pull, rise_m_s)
    assert (load.taut > 0.0) == is_taut
    if is_taut:
        assert load.length == pytest.approx(share * LENGTH)
        assert load.length_share == pytest.approx(share if share < 0.985 else 1.0)


def test_a_short_cable_that_turns_out_longer_counts_as_longer_and_never_as_longer_than_assumed() -> None:
    short = pulled(0.92, 1.0, 0.0)
    vehicle, history = blank_state().vehicle, new_history()
    for length, share in ((0.95 * LENGTH, 0.95), (0.93 * LENGTH, 0.95), (1.1 * LENGTH, 1.0)):
        short = detect_tautness(short._replace(length=length), vehicle, history, WEIGHT, 0.0, TUNING, DT)
        assert short.length_share == pytest.approx(share)


@pytest.mark.parametrize(
    ("pull", "missing", "height", "is_taut"),
    [
        (1.0, 0.0, 0.99, True),
        (0.7, 0.0, 0.99, False),  # a gust, or weak rotors: it is not certain that the cable pulls
        (0.5, 0.0, 1.01, False),
        (0.5, 0.0, 1.06, True),  # half the weight assumed, or a gust upward
        (0.3, 0.0, 1.2, False),
        (1.0, -0.3, 0.99, False),  # rotors weaker than assumed pull as much before
        (1.0, -0.3, 1.06, True),
        (1.0, 0.0, 0.5, False),
    ],
)
def test_a_cable_is_taut_by_its_pull_and_height(
    pull: float, missing: float, height: float, is_taut: bool
) -> None:
    assert after(laid(), pull, missing, height, 0.5).taut == is_taut


def test_a_load_above_the_ground_hangs_however_near_it_is_estimated() -> None:
    """Of a cable that a gust made look slack, the load is estimated to stay where it was, in the air."""
    assert after(laid(2.0), 1.0, 0.0, 0.5, 0.5).taut > 0.0
    assert after(laid(), 1.0, 0.0, 0.5, 0.5).taut == 0.0


@pytest.mark.parametrize("missing", [-0.3, 0.0, 0.35, 0.9])
def test_a_load_that_comes_to_the_ground_slackens_the_cable_whatever_was_missing(missing: float) -> None:
    hanging = laid()._replace(taut=1.0, pull=(1.0 - missing) * WEIGHT, tension=WEIGHT)
    assert after(hanging, -min(missing, 0.0), missing, 1.0, 0.6).taut == 0.0
    assert after(hanging, 1.0 - missing, missing, 1.0, 0.6).taut == (1.0 if missing < 0.9 else 0.0)


IN_VIEW: dict[str, float] = {}
HIDDEN, ELSEWHERE = {"age_s": 0.4}, {"rejected": 1.0}


@pytest.mark.parametrize(
    ("height_m", "seconds", "seen", "is_taut"),
    [
        (2.0, 0.9, HIDDEN, True),  # a gust hides the pull, or the load is in the air for a moment
        (2.0, 1.2, HIDDEN, False),  # the load was lost
        (2.0, 1.2, ELSEWHERE, False),
        (2.0, 4.9, IN_VIEW, True),  # it swings on
        (2.0, 5.2, IN_VIEW, False),
        (TUNING.load_height + 0.2, 0.9, IN_VIEW, True),
        (TUNING.load_height + 0.1, 0.4, IN_VIEW, False),  # perhaps on the ground
    ],
)
def test_the_cable_of_a_load_in_the_air_is_not_slack_because_its_pull_is_gone_for_a_moment(
    height_m: float, seconds: float, seen: dict[str, float], is_taut: bool
) -> None:
    hanging = laid(height_m)._replace(taut=1.0, pull=WEIGHT, tension=WEIGHT, **seen)
    assert after(hanging, 0.0, 0.0, 1.0, seconds).taut == is_taut


@pytest.mark.parametrize(
    ("sunk_m", "age_s", "is_taut"),
    [(0.07, 1.0, True), (0.09, 1.0, False), (0.09, 4.1, True)],  # 0.05 m and three deviations
)
def test_a_load_that_is_lifted_and_would_be_in_the_ground_lies_where_it_lay(
    sunk_m: float, age_s: float, is_taut: bool
) -> None:
    """A gust pulls at a vehicle that sinks."""
    lay_m = 0.4  # the ground is not everywhere as high as at home
    lifted = laid(lay_m - sunk_m)._replace(
        taut=1.0, pull=WEIGHT, tension=WEIGHT, tautness_age_s=age_s, laid_height=lay_m
    )
    found = after(lifted, 1.0, 0.0, 1.0, DT)
    assert (found.taut > 0.0, found.x_load[2]) == (is_taut, lay_m - sunk_m if is_taut else lay_m)


def test_a_load_whose_cable_comes_taut_in_the_air_has_lain_nowhere() -> None:
    def taut_at(height_m: float) -> LoadEstimate:
        return after(laid(height_m), 1.0, 0.0, 0.99, 0.5)

    assert taut_at(TUNING.load_height).laid_height == TUNING.load_height
    assert taut_at(2.0).laid_height == NOT_LAID
    falling = taut_at(2.0)._replace(x_load=(0.0, 0.0, 1.0), tension=WEIGHT)
    assert after(falling, 1.0, 0.0, 1.0, 0.5).taut > 0.0
    assert after(falling, 0.0, 0.0, 1.0, 5.5).x_load[2] == 1.0


@pytest.mark.parametrize(
    ("place_std_m", "height_std_m", "height", "is_taut"),
    [
        (0.0, 0.01, 0.89, False),
        (0.0, 0.01, 0.92, True),  # 0.95 of the cable less three deviations
        (0.02, 0.01, 0.89, True),
        (0.0, 0.05, 0.76, True),
        (0.05, 0.05, 0.74, False),
    ],
)
def test_a_pull_counts_where_the_cable_may_be_long_enough(
    place_std_m: float, height_std_m: float, height: float, is_taut: bool
) -> None:
    load = laid()._replace(covariance=(place_std_m**2, 0.0, 0.0))
    assert (after(load, 1.0, 0.0, height, 0.28, height_std_m).taut > 0.0) == is_taut


def missed(
    load: LoadEstimate, before: float, height: float, seconds: float, height_std: float = 0.0
) -> float:
    """What counts as missing, in weights, after this time."""
    history = new_history()
    history.covariance[POSITION + 2, POSITION + 2] = height_std**2
    vehicle = blank_state().vehicle._replace(x_quad=(0.0, 0.0, load.x_load[2] + height * TUNING.cable_length))
    missing = before * WEIGHT
    for _ in range(round(seconds / DT)):
        missing = averaged_missing_pull(load, vehicle, history, missing, TUNING, DT)
    return missing / WEIGHT


def test_what_a_gust_adds_to_the_pull_is_missing_only_as_long_as_it_blows() -> None:
    pulled = laid()._replace(pull=0.4 * WEIGHT)
    learned = missed(pulled, 0.0, 0.6, 8.0)
    assert learned == pytest.approx(-0.4, abs=0.01)
    assert missed(pulled, learned, 0.9, 1.0) == learned
    assert missed(laid()._replace(pull=0.1 * WEIGHT), learned, 0.9, DT) == pytest.approx(-0.1)


def test_a_pull_is_neither_drag_nor_missing_where_the_height_is_too_uncertain_to_exclude_it() -> None:
    """0.7 of the cable's length apart, and 0.1 of it uncertain: three deviations more, and the cable is taut.
    With 0.75 as the least distance of a cable that pulls, it was taken to be slack: its pull was learned as
    drag of the rotors, and hidden by this for as long as it pulled."""
    pulled = laid()._replace(pull=0.5 * WEIGHT)
    vehicle = blank_state().vehicle._replace(x_quad=(0.0, 0.0, pulled.x_load[2] + 0.7 * TUNING.cable_length))
    history = new_history()
    assert is_pull_known(pulled, vehicle, history, 0.0, TUNING)
    history.covariance[POSITION + 2, POSITION + 2] = (0.1 * TUNING.cable_length) ** 2
    assert not is_pull_known(pulled, vehicle, history, 0.0, TUNING)
    assert missed(pulled, 0.0, 0.7, 8.0) == pytest.approx(-0.5, abs=0.02)
    assert missed(pulled, 0.0, 0.7, 8.0, 0.1 * TUNING.cable_length) == 0.0


@pytest.mark.parametrize("source", [TRACKER, CAMERA])
@pytest.mark.parametrize(
    ("shown", "height", "upward", "learned"),
    [
        (0.8, 0.6, 1.0, 0.8),
        (-0.8, 0.6, 1.0, -0.8),
        (0.8, 0.82, 1.0, 0.0),  # a cable that is shorter than assumed may pull
        (0.8, 0.15, 1.0, 0.0),  # the vehicle may stand
        (-2.0, 0.6, 1.0, 0.0),  # it stands
        (0.8, 0.6, 0.97, 0.0),  # wind, against which it leans
    ],
)
def test_the_pull_of_a_slack_cable_is_learned_as_an_error_of_the_mass(
    source: float, shown: float, height: float, upward: float, learned: float
) -> None:
    """In weights of the load, of which the pull is measured with what was learned until then."""
    load, history, slack_pull = laid()._replace(source=source), new_history(), 0.0
    x_quad = (0.0, 0.0, load.x_load[2] + height * TUNING.cable_length)
    vehicle = blank_state().vehicle._replace(x_quad=x_quad)

    def learn(load: LoadEstimate) -> float:
        tuning = with_learned_mass(TUNING, slack_pull)
        measured = shown * WEIGHT - (tuning.quad_mass - TUNING.quad_mass) * TUNING.gravity
        return averaged_slack_pull(slack_pull, measured, load, vehicle, upward, history, tuning, DT)

    for _ in range(round(6.0 / DT)):
        slack_pull = learn(load)
    assert slack_pull == pytest.approx(learned * WEIGHT, abs=0.01 * WEIGHT)
    assert learn(load._replace(taut=1.0)) == slack_pull
    extra_kg = with_learned_mass(TUNING, slack_pull).quad_mass - TUNING.quad_mass
    explained = copysign(min(abs(learned), EXPLAINED_PULL), learned)
    assert extra_kg == pytest.approx((learned - explained) * TUNING.load_mass, abs=0.01 * TUNING.load_mass)


def test_a_pull_that_disturbs_nothing_leaves_the_mass_as_it_is_to_the_bit() -> None:
    assert with_learned_mass(TUNING, 0.19 * WEIGHT) == TUNING
    assert with_learned_mass(TUNING, -0.19 * WEIGHT) == TUNING


def test_the_pull_of_a_load_in_the_air_is_not_learned_as_missing() -> None:
    assert missed(laid(2.0)._replace(pull=WEIGHT), 0.0, 0.5, 8.0) == 0.0
    assert missed(laid()._replace(pull=WEIGHT), 0.0, 0.5, 8.0) < -0.9


def test_no_pull_of_a_tracked_load_is_missing_before_it_was_lifted() -> None:
    """A long cable counts as taut many seconds before it is: 100 m of it 1.5 m before, 10 s at 0.15 m/s."""
    lies = laid()._replace(source=TRACKER, taut=1.0, tension=WEIGHT, laid_height=TUNING.load_height)
    assert missed(lies, 0.0, 0.99, 10.0) == 0.0
    assert cable_is_unloaded(lies._replace(tautness_age_s=10.0), new_history(), 0.01, 0.0)
    lifted = lies._replace(x_load=(0.0, 0.0, TUNING.load_height + LIFTED_HEIGHT + 0.01))
    lifted = after(lifted, 0.3, 0.0, 1.0, DT)
    assert lifted.laid_height == NOT_LAID
    assert missed(lifted._replace(pull=0.3 * WEIGHT), 0.0, 1.0, 10.0) == pytest.approx(0.7, abs=0.01)


@pytest.mark.parametrize(
    ("height_m", "slack_s", "speed", "lies"),
    [
        (0.0, 0.1, 0.0, True),
        (0.3, 2.0 * RESTED_S, 0.0, True),  # on something that is higher than home
        (0.3, 0.5 * RESTED_S, 0.0, False),  # a vehicle that is found in flight
        (0.3, 2.0 * RESTED_S, 2.0 * RESTING_SPEED, False),  # it falls
    ],
)
def test_a_tracked_load_that_has_been_still_on_a_slack_cable_lies_at_whatever_height(
    height_m: float, slack_s: float, speed: float, lies: bool
) -> None:
    height_m += TUNING.load_height
    load = laid(height_m)._replace(source=TRACKER, tautness_age_s=slack_s, v_load=(0.0, 0.0, -speed))
    taut = tauten(load, blank_state().vehicle, new_history(), TUNING, LENGTH)
    assert taut.laid_height == (height_m if lies else NOT_LAID)
    seen = laid(height_m)._replace(tautness_age_s=slack_s)
    seen_taut = tauten(seen, blank_state().vehicle, new_history(), TUNING, LENGTH)
    assert (seen_taut.laid_height == NOT_LAID) == (height_m > TUNING.load_height), "only a tracker shows it"


@pytest.mark.parametrize(
    ("changes", "pull", "missing", "known"),
    [
        ({"taut": 1.0}, 0.6, 0.0, True),
        ({"taut": 1.0}, 0.4, 0.0, False),  # it may be lost: what is missing of its pull is no drag
        ({"taut": 1.0}, 1.2, -0.8, False),
        ({"taut": 1.0, "tautness_age_s": 3.0}, 1.0, 0.0, False),  # it may still be on the ground
        ({"taut": 1.0, "source": TRACKER, "laid_height": TUNING.load_height}, 1.0, 0.0, False),
        ({"taut": 1.0, "source": TRACKER}, 1.0, 0.0, True),
        ({}, 0.0, 0.0, True),
        ({"source": TRACKER}, 0.0, 0.0, False),
    ],
)
def test_the_drag_is_learned_where_the_true_pull_is_known(
    changes: dict[str, float], pull: float, missing: float, known: bool
) -> None:
    tension = WEIGHT if changes.get("taut") else 0.0
    load = laid()._replace(pull=pull * WEIGHT, tension=tension, tautness_age_s=9.0)._replace(**changes)
    above = load.x_load[2] + 0.6 * TUNING.cable_length
    vehicle = blank_state().vehicle._replace(x_quad=(0.0, 0.0, above))
    assert is_pull_known(load, vehicle, new_history(), missing * WEIGHT, TUNING) == known


@pytest.mark.parametrize(("height", "known"), [(0.0, False), (0.6, True), (0.99, False)])
def test_a_slack_cable_pulls_at_nothing_while_the_vehicle_flies_near_the_load(
    height: float, known: bool
) -> None:
    load = laid()
    vehicle = blank_state().vehicle._replace(x_quad=(0.0, 0.0, load.x_load[2] + height * TUNING.cable_length))
    assert is_pull_known(load, vehicle, new_history(), 0.0, TUNING) == known


@pytest.mark.parametrize(
    ("beside", "height", "std", "left"),
    [
        (0.9, 0.3, 0.0, 0.9),  # within reach
        (1.3, 0.3, 0.0, sqrt(DRAGGING_SHARE**2 - 0.3**2)),
        (20.0, 0.3, 0.0, sqrt(DRAGGING_SHARE**2 - 0.3**2)),
        (1.3, 0.3, 0.1, 1.3),  # perhaps the place is not that far away
        (0.2, 1.2, 0.0, 0.2),  # higher than the cable is long, but over its load
        (0.9, 1.2, 0.0, MIN_DRAGGING_SHARE),
    ],
)
def test_a_load_that_no_tracker_sees_follows_the_vehicle_at_the_end_of_its_cable(
    beside: float, height: float, std: float, left: float
) -> None:
    """All in cable lengths."""
    east, north = 0.6, 0.8
    x_load = (3.0, -2.0, TUNING.load_height)
    x_quad = (
        x_load[0] + beside * LENGTH * east,
        x_load[1] + beside * LENGTH * north,
        x_load[2] + height * LENGTH,
    )
    vehicle = blank_state().vehicle._replace(x_quad=x_quad)
    moved = dragged_along(x_load, vehicle, (std * LENGTH) ** 2, LENGTH)
    expected = (x_quad[0] - left * LENGTH * east, x_quad[1] - left * LENGTH * north, x_load[2])
    assert moved == pytest.approx(expected, abs=1e-12)


def test_a_load_is_not_dragged_by_a_cable_that_is_gone() -> None:
    vehicle = blank_state().vehicle._replace(x_quad=(50.0, 0.0, 1.0))
    assert dragged_along((0.0, 0.0, 0.0), vehicle, 0.01, inf) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("axis", range(3))
def test_a_tracked_cable_is_not_taut_while_the_vehicle_s_speed_is_unknown(axis: int) -> None:
    """In whatever direction: tautening would take its velocity for the load's."""
    load = blank_state().load._replace(
        source=TRACKER, x_load=(0.0, 0.0, 0.0), covariance=(1e-6, 0.0, 1e-4), length=TUNING.cable_length
    )
    vehicle = blank_state().vehicle._replace(x_quad=(0.0, 0.0, TUNING.cable_length))
    for speed_var, taut in ((1.0, 0.0), (1e-4, 1.0)):
        history = new_history()
        history.covariance[VELOCITY + axis, VELOCITY + axis] = speed_var
        assert detect_tautness(load, vehicle, history, 0.0, 0.0, TUNING, 0.004).taut == taut
