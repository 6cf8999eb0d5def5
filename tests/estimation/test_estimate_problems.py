"""What makes an estimate unfit to fly on: the limits, and the texts for the operator."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan

import pytest

from autopilot.estimation.filter import NO_FIX as FIX_MISSING
from autopilot.estimation.filter import (
    NO_INERTIAL,
    knows_attitude,
    knows_height,
    load_problem,
    vehicle_problem,
)
from autopilot.estimation.records import (
    CAMERA,
    NO_SENSOR,
    RECEIVER,
    TRACKER,
    EstimatorState,
    Uncertainty,
    blank_state,
)
from tests.doubles.estimate_problems import estimate_problems

OLDEST_S = 0.5
PROMISED = 0.1  # m, slow part of a receiver's error
# with a receiver: 0.15 m and 1.5 times the error that it states
FIX_LEVEL = 0.15 + 1.5 * PROMISED
NO_DOUBT = Uncertainty(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
VEHICLE_AGE, LOAD_AGE = "age of the vehicle", "age of the load"

NO_POSE = "no vehicle pose from a tracker"
NO_FIX = "no position from the receiver"
POSITION = "vehicle position not settled"
FIX = "vehicle position not settled, good to {:.1f} m"
ATTITUDE = "vehicle attitude not settled"
HEADING = "vehicle heading not settled"
NO_LOAD = "no load position from a tracker"
NO_LOAD_DIRECTION = "no direction to the load from the camera"
LOAD = "load position not settled"


def settled(source: float, load_source: float, part: str = "", value: float = 0.0) -> EstimatorState:
    """An estimate without doubt, its load hanging on 0.7 m of cable, in which one part has this value: an age
    in s, or a standard deviation in m or rad."""
    state = blank_state()
    doubts = {part: value} if part in Uncertainty._fields else {}
    vehicle_age_s = value if part == VEHICLE_AGE else 0.0
    load_age_s = value if part == LOAD_AGE else 0.0
    assert not part or doubts or part in (VEHICLE_AGE, LOAD_AGE)
    return state._replace(
        vehicle=state.vehicle._replace(source=source, age_s=vehicle_age_s),
        load=state.load._replace(source=load_source, age_s=load_age_s, taut=1.0, length=0.7),
        uncertainty=NO_DOUBT._replace(**doubts),
        sensor_errors=state.sensor_errors._replace(horizontal_slow_std=PROMISED),
    )


# source of the vehicle, of the load, what is in doubt, the last value that may be flown on, the complaint
LIMITS = [
    (TRACKER, TRACKER, VEHICLE_AGE, OLDEST_S, NO_POSE),
    (TRACKER, TRACKER, "horizontal", 0.05, POSITION),
    (TRACKER, TRACKER, "vertical", 0.05, POSITION),
    (TRACKER, TRACKER, "tilt", 0.05, ATTITUDE),
    (TRACKER, TRACKER, "heading", 0.05, ATTITUDE),
    (TRACKER, TRACKER, LOAD_AGE, 2.0, NO_LOAD),  # the pendulum bridges this time, from measured velocities
    (TRACKER, TRACKER, "load", 0.05, LOAD),
    (TRACKER, TRACKER, "relative", inf, ""),
    (RECEIVER, CAMERA, VEHICLE_AGE, 2.0, NO_FIX),  # the inertial unit bridges this time
    (RECEIVER, CAMERA, "horizontal", FIX_LEVEL, FIX),
    (RECEIVER, CAMERA, "relative", FIX_LEVEL, FIX),
    (RECEIVER, CAMERA, "vertical", inf, ""),
    (RECEIVER, CAMERA, "tilt", 0.05, ATTITUDE),
    (RECEIVER, CAMERA, "heading", 0.15, HEADING),
    (RECEIVER, CAMERA, LOAD_AGE, 1.0, NO_LOAD_DIRECTION),  # the pendulum bridges this time
    (RECEIVER, CAMERA, "load", 0.1, LOAD),
]
ABOUT_THE_LOAD = (NO_LOAD, NO_LOAD_DIRECTION, LOAD)


@pytest.mark.parametrize(("source", "load_source", "part", "last", "words"), LIMITS)
def test_each_doubt_has_its_limit_and_its_words(
    source: float, load_source: float, part: str, last: float, words: str
) -> None:
    assert estimate_problems(settled(source, load_source, part, 0.999 * last), OLDEST_S) == ()
    beyond = (1.001 * last, nan) if words == NO_LOAD_DIRECTION else (1.001 * last, inf, nan)
    for value in beyond if words else (inf, nan):
        state = settled(source, load_source, part, value)
        assert estimate_problems(state, OLDEST_S) == (
            (words.format(state.uncertainty.horizontal),) if words else ()
        )
        about_the_load = words in ABOUT_THE_LOAD
        assert bool(load_problem(state, OLDEST_S)) == about_the_load
        assert bool(vehicle_problem(state, OLDEST_S)) == (bool(words) and not about_the_load)
        if about_the_load:
            assert estimate_problems(state, OLDEST_S, carries_load=False) == ()


@pytest.mark.parametrize(
    ("tautness_age_s", "uncertainty", "words"),
    [(9.0, 0.0999, ()), (9.0, 0.1001, (LOAD,)), (9.0, nan, (LOAD,)), (0.9, 1.0, ())],
)
def test_a_load_that_no_sensor_has_ever_seen_is_flown_by_its_pull(
    tautness_age_s: float, uncertainty: float, words: tuple[str, ...]
) -> None:
    state = settled(RECEIVER, CAMERA, "load", uncertainty)
    state = state._replace(load=state.load._replace(age_s=inf, tautness_age_s=tautness_age_s))
    assert estimate_problems(state, OLDEST_S) == words


@pytest.mark.parametrize(
    ("length_m", "last_m"),
    [(0.3, 0.1), (0.7, 0.1), (2.0, 0.28), (20.0, 2.8)],
)
@pytest.mark.parametrize("age_s", [0.1, inf])
def test_on_a_longer_cable_the_load_may_be_less_certain(age_s: float, length_m: float, last_m: float) -> None:
    for std_m, words in ((0.999 * last_m, ()), (1.001 * last_m, (LOAD,))):
        state = settled(RECEIVER, CAMERA, "load", std_m)
        load = state.load._replace(age_s=age_s, length=length_m, tautness_age_s=9.0)
        assert estimate_problems(state._replace(load=load), OLDEST_S) == words


@pytest.mark.parametrize(
    ("load_source", "age_s", "std_m", "words"),
    [
        (CAMERA, 0.0, 1.0, ()),  # in the place where it was laid
        (TRACKER, 0.0, 0.049, ()),
        (TRACKER, 0.0, 0.051, (LOAD,)),  # by a poor tracker
        (TRACKER, 0.0, nan, (LOAD,)),
        (TRACKER, 0.25, 0.051, ()),  # hidden: it might have fallen that far since
        (TRACKER, 1.9, 1.0, ()),
        (TRACKER, 2.1, 1.0, (NO_LOAD,)),
    ],
)
def test_a_load_on_the_ground_may_be_hidden_as_long_as_one_that_hangs(
    load_source: float, age_s: float, std_m: float, words: tuple[str, ...]
) -> None:
    # the doubt is that of the last prediction; a reading since then has settled it
    state = settled(TRACKER, load_source, "load", 1.0)
    load = state.load._replace(taut=0.0, age_s=age_s, covariance=(std_m**2, 0.0, 1.0))
    assert estimate_problems(state._replace(load=load), OLDEST_S) == words


def test_who_bears_older_readings_is_obeyed() -> None:
    old = settled(TRACKER, TRACKER, LOAD_AGE, 9.0)
    assert (estimate_problems(old, 10.0), estimate_problems(old, 8.0)) == ((), (NO_LOAD,))


def test_the_first_complaint_of_each_is_told_vehicle_before_load() -> None:
    blind = blank_state()
    assert (blind.vehicle.source, blind.load.source) == (NO_SENSOR, NO_SENSOR)
    assert estimate_problems(blind, OLDEST_S) == (NO_POSE, NO_LOAD)
    assert estimate_problems(blind, OLDEST_S, carries_load=False) == (NO_POSE,)


def test_a_fix_that_has_not_settled_says_how_good_it_is() -> None:
    assert estimate_problems(settled(RECEIVER, CAMERA, "horizontal", 2.345), OLDEST_S) == (
        "vehicle position not settled, good to 2.3 m",
    )


def test_what_is_not_settled_after_an_impact_names_it() -> None:
    state = settled(TRACKER, TRACKER, "horizontal", 9.0)
    words = {0.0: f"{POSITION} after an impact", 0.9: f"{POSITION} after an impact", 1.1: POSITION}
    for age_s, text in words.items():
        hit = state._replace(clipping=state.clipping._replace(impact_age_s=age_s))
        assert estimate_problems(hit, OLDEST_S) == (text,)
    silent = settled(TRACKER, TRACKER, VEHICLE_AGE, 9.0)
    silent = silent._replace(clipping=silent.clipping._replace(impact_age_s=0.0))
    assert estimate_problems(silent, OLDEST_S) == (NO_POSE,), "an impact does not silence the tracker"


def test_a_longer_limit_of_age_holds_for_the_receiver_too() -> None:
    state = settled(RECEIVER, CAMERA, VEHICLE_AGE, 2.5)
    assert estimate_problems(state, OLDEST_S) == (NO_FIX,)
    assert estimate_problems(state, 3.0) == ()


@pytest.mark.parametrize(
    ("source", "part", "last", "knows"),
    [
        (RECEIVER, "tilt", 0.2, knows_attitude),
        (TRACKER, "tilt", 0.2, knows_attitude),
        (RECEIVER, "tilt", 0.2, knows_height),
        (RECEIVER, "vertical", 10.0, knows_height),
    ],
)
def test_attitude_and_height_remain_while_they_are_good_enough_for_a_landing(
    source: float, part: str, last: float, knows: Callable[[EstimatorState, int], bool]
) -> None:
    for value, known in ((last, True), (last + 1e-6, False), (nan, False)):
        state = settled(source, TRACKER, part, value)
        state = state._replace(sensor_errors=state.sensor_errors._replace(barometer_age=0.0))
        assert knows(state, FIX_MISSING) is known
        assert not knows(state, NO_INERTIAL)
        nothing = state._replace(vehicle=state.vehicle._replace(source=NO_SENSOR))
        assert not knows(nothing, FIX_MISSING)


@pytest.mark.parametrize(
    ("source", "age_s", "known"),
    [(RECEIVER, 2.0, True), (RECEIVER, 2.1, False), (RECEIVER, inf, False), (TRACKER, 0.0, False)],
)
def test_only_a_barometer_that_is_used_and_read_gives_the_height(
    source: float, age_s: float, known: bool
) -> None:
    state = settled(source, TRACKER)
    state = state._replace(sensor_errors=state.sensor_errors._replace(barometer_age=age_s))
    assert knows_height(state, FIX_MISSING) is known
