"""Which readings are accepted, and with which deviations: a dropped one leaves no trace in the estimate."""

from __future__ import annotations

import math
from itertools import permutations
from typing import Any

import numpy as np
import pytest

from autopilot.control.records import Cable
from autopilot.estimation import inbox as box
from autopilot.estimation.filter import estimate
from autopilot.estimation.records import (
    DirectionReading,
    EstimatorState,
    GnssReading,
    History,
    ImuReading,
    LoadReading,
    PoseReading,
    blank_state,
    new_history,
)
from autopilot.geometry.linear import ZERO
from autopilot.geometry.packed import packed
from tests.doubles.motion import CABLE_LENGTH, GRAVITY, TICK_S, bebop_tuning
from tests.doubles.readings import put_reading, put_vector

NOW_US = 10_000_000
NAN, INF = math.nan, math.inf
NO_NUMBERS = (NAN, INF, -INF)
HANGING = (0.0, 0.0, 1.3)
OVER = (0.0, 0.0, 1.3 + CABLE_LENGTH)
STILL = ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, GRAVITY))
POSE = PoseReading(0.0, OVER, (1.0, 0.0, 0.0, 0.0), (0.1, 0.2, 0.3), 0.002, 0.003, 0.02)
LOAD = LoadReading(0.0, HANGING, (0.1, 0.2, 0.3), 0.002, 0.02)
FIX = GnssReading(0.0, OVER, (0.1, 0.2, 0.3), 0.02, 0.03, 1.0)
SIGHT = DirectionReading(0.0, (0.0, 0.0, -1.0), 0.01)
FIELD, HEIGHT = (0.2, 0.0, -0.4), (2.0,)


def row_of(kind: int, reading: Any, shows_us: float = NOW_US) -> Any:
    """A row of an inbox."""
    rows = box.new_inbox(1)
    if kind in (box.FIELD, box.HEIGHT):
        put_vector(rows, 0, kind, reading)
    else:
        put_reading(rows, 0, kind, 0, reading)
        rows[0, box.SAMPLE_TIME_US] = shows_us
    return rows[0]


def changed(reading: Any, place: int, value: float) -> Any:
    """The row of a reading with another number at this place of its record."""
    numbers = packed(reading)
    numbers[place] = value
    kind = {
        PoseReading: box.POSE,
        LoadReading: box.LOAD,
        GnssReading: box.FIX,
        DirectionReading: box.DIRECTION,
    }
    row = row_of(kind[type(reading)], reading)
    row[box.READING : box.READING + len(numbers)] = numbers
    return row


# ---- ages


@pytest.mark.parametrize(
    ("elapsed_us", "imu_age", "age"),
    [
        (0, 0.0, 0.0),
        (4000, 0.0, 0.004),
        (300_000, 0.0, 0.3),
        (50_000, 0.02, 0.03),
        (10_000, 0.02, 0.0),  # no reading is newer than the inertial sample
        (320_000, 0.02, 0.3),
        (300_001, 0.0, NAN),
        (-1, 0.0, NAN),
        (-1, 0.02, NAN),
        (10**15, 0.0, NAN),
    ],
)
def test_a_reading_of_the_future_or_older_than_the_memory_has_no_age(
    elapsed_us: int, imu_age: float, age: float
) -> None:
    row = row_of(box.POSE, POSE, NOW_US - elapsed_us)
    assert box.age_of(row, NOW_US, imu_age) == pytest.approx(age, abs=1e-12, nan_ok=True)


@pytest.mark.parametrize("shows_us", NO_NUMBERS)
def test_an_instant_that_is_no_number_gives_no_age(shows_us: float) -> None:
    assert math.isnan(box.age_of(row_of(box.POSE, POSE, shows_us), NOW_US, 0.0))


# ---- one reading

READERS = {PoseReading: box.read_pose, LoadReading: box.read_load, GnssReading: box.read_fix}
DEVIATIONS = {PoseReading: (11, 12, 13), LoadReading: (7, 8), GnssReading: (7, 8)}
LEAST = {
    PoseReading: (box.MIN_POSITION_STD_M, box.MIN_ANGLE_STD_RAD, box.MIN_VELOCITY_STD_M_S),
    LoadReading: (box.MIN_POSITION_STD_M, box.MIN_VELOCITY_STD_M_S),
    GnssReading: (box.MIN_FIX_STD_M, box.MIN_FIX_STD_M),
}
PLACED = pytest.mark.parametrize("reading", [POSE, LOAD, FIX], ids=["pose", "load", "fix"])


@PLACED
def test_a_sound_reading_is_believed_as_it_is(reading: Any) -> None:
    believed, read = READERS[type(reading)](changed(reading, 0, 0.0), 0.01)
    assert believed
    assert read == reading._replace(age_s=0.01)


@PLACED
def test_a_reading_without_an_age_is_dropped(reading: Any) -> None:
    assert not READERS[type(reading)](changed(reading, 0, 0.0), NAN)[0]


@PLACED
@pytest.mark.parametrize("value", [*NO_NUMBERS, 3.4e38, -3.4e38, 1e7])
def test_a_place_velocity_or_attitude_that_cannot_be_is_dropped(reading: Any, value: float) -> None:
    for place in range(1, DEVIATIONS[type(reading)][0]):
        assert not READERS[type(reading)](changed(reading, place, value), 0.0)[0], place


@PLACED
def test_a_sensor_that_claims_to_be_perfect_is_believed_to_no_more_than_the_least_deviation(
    reading: Any,
) -> None:
    for place, least in zip(DEVIATIONS[type(reading)], LEAST[type(reading)], strict=True):
        believed, read = READERS[type(reading)](changed(reading, place, 0.0), 0.0)
        assert believed
        assert packed(read)[place] == least
        believed, read = READERS[type(reading)](changed(reading, place, 2.0 * least), 0.0)
        assert believed
        assert packed(read)[place] == 2.0 * least


@PLACED
def test_a_deviation_that_says_that_nothing_is_known_drops_the_reading(reading: Any) -> None:
    for place in DEVIATIONS[type(reading)]:
        for value in (INF, 3.4e38):
            assert not READERS[type(reading)](changed(reading, place, value), 0.0)[0], (place, value)


@pytest.mark.parametrize("reading", [POSE, LOAD], ids=["pose", "load"])
def test_a_tracker_that_states_no_deviation_is_believed_to_the_least(reading: Any) -> None:
    for place, least in zip(DEVIATIONS[type(reading)], LEAST[type(reading)], strict=True):
        believed, read = READERS[type(reading)](changed(reading, place, NAN), 0.0)
        assert believed
        assert packed(read)[place] == least


def test_a_receiver_that_states_no_deviation_is_not_believed() -> None:
    for place in DEVIATIONS[GnssReading]:
        for value in NO_NUMBERS:
            assert not box.read_fix(changed(FIX, place, value), 0.0)[0]


@pytest.mark.parametrize("reading", [POSE, LOAD], ids=["pose", "load"])
def test_a_velocity_that_was_not_measured_is_none_whatever_stands_there(reading: Any) -> None:
    row = changed(reading, DEVIATIONS[type(reading)][-1], -1.0)
    first = DEVIATIONS[type(reading)][0] - 3
    row[box.READING + first : box.READING + first + 3] = NAN, INF, 1e30
    believed, read = READERS[type(reading)](row, 0.0)
    assert believed
    assert packed(read)[first : first + 3].tolist() == [0.0, 0.0, 0.0]
    assert read.velocity_std == box.NOT_MEASURED


@pytest.mark.parametrize(
    "quat", [(0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0), (NAN, 0.0, 0.0, 1.0)]
)
def test_a_quaternion_that_is_no_rotation_is_dropped(quat: tuple[float, float, float, float]) -> None:
    assert not box.read_pose(row_of(box.POSE, POSE._replace(quat_wxyz=quat)), 0.0)[0]


def test_a_quaternion_rounded_by_the_wire_is_a_rotation() -> None:
    quat = tuple(float(np.float32(v)) for v in (0.1825742, 0.3651484, 0.5477226, 0.7302967))
    believed, read = box.read_pose(row_of(box.POSE, POSE._replace(quat_wxyz=quat)), 0.0)
    assert believed
    assert read.quat_wxyz == quat


@pytest.mark.parametrize("length", [0.51, 1.0, 1.99])
def test_a_direction_is_made_a_unit_vector(length: float) -> None:
    along = (0.6 * length, 0.0, -0.8 * length)
    believed, read = box.read_direction(row_of(box.DIRECTION, SIGHT._replace(direction_body=along)), 0.01)
    assert believed
    assert read.direction_body == pytest.approx((0.6, 0.0, -0.8), abs=1e-15)
    assert (read.age_s, read.direction_std) == (0.01, 0.01)


@pytest.mark.parametrize(
    "along", [(0.0, 0.0, 0.0), (0.0, 0.0, -0.49), (0.0, 0.0, -2.01), *((v, 0.0, -1.0) for v in NO_NUMBERS)]
)
def test_what_is_no_direction_is_dropped(along: tuple[float, float, float]) -> None:
    assert not box.read_direction(row_of(box.DIRECTION, SIGHT._replace(direction_body=along)), 0.0)[0]


def test_a_direction_of_no_age_or_no_precision_is_dropped_and_a_perfect_one_is_not() -> None:
    assert not box.read_direction(row_of(box.DIRECTION, SIGHT), NAN)[0]
    assert not box.read_direction(row_of(box.DIRECTION, SIGHT._replace(direction_std=INF)), 0.0)[0]
    for stated in (0.0, NAN):
        believed, read = box.read_direction(row_of(box.DIRECTION, SIGHT._replace(direction_std=stated)), 0.0)
        assert believed
        assert read.direction_std == box.MIN_DIRECTION_STD_RAD


@pytest.mark.parametrize(
    ("gyro", "accel", "sane"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), True),
        ((0.0, 499.0, 0.0), (0.0, 0.0, 1999.0), True),
        ((0.0, 0.0, 501.0), (0.0, 0.0, 9.81), False),
        ((0.0, 0.0, 0.0), (0.0, -2001.0, 9.81), False),
        *(((v, 0.0, 0.0), (0.0, 0.0, 9.81), False) for v in NO_NUMBERS),
        *(((0.0, 0.0, 0.0), (0.0, v, 9.81), False) for v in NO_NUMBERS),
    ],
)
def test_an_inertial_sample_is_a_number_within_any_sensors_range(gyro: Any, accel: Any, sane: bool) -> None:
    assert box.is_valid_imu(ImuReading(gyro, accel)) == sane


# ---- the estimate from an inbox

TUNING = bebop_tuning()


def begun(rows: list[Any], ticks: int = 20) -> tuple[EstimatorState, History]:
    """An estimate that has received these rows for some ticks."""
    state, history = blank_state(), new_history()
    for _ in range(ticks):
        state = after_readings(state, history, rows)
    return state, history


def after_readings(state: EstimatorState, history: History, rows: list[Any]) -> EstimatorState:
    inbox = np.array(rows)
    return estimate(
        state, history, inbox, len(rows), NOW_US, TUNING, Cable(CABLE_LENGTH), 0.0, TICK_S, 14.0, ZERO
    )


def bits(state: EstimatorState, history: History) -> bytes:
    steps = b"".join(part.tobytes() for part in (history.ring, history.covariance, history.consistency))
    return packed(state).tobytes() + steps


IMU_ROW = row_of(box.IMU, STILL)
TRACKED = [IMU_ROW, row_of(box.POSE, POSE), row_of(box.LOAD, LOAD)]
AIDED = [
    *(IMU_ROW, row_of(box.FIELD, FIELD), row_of(box.FIX, FIX)),
    *(row_of(box.HEIGHT, HEIGHT), row_of(box.DIRECTION, SIGHT)),
]
DROPPED = {
    "a pose of the future": row_of(box.POSE, POSE, NOW_US + 1),
    "an old pose": row_of(box.POSE, POSE, NOW_US - 300_001),
    "a pose that is no number": row_of(box.POSE, POSE._replace(x_quad=(NAN, 0.0, 0.0))),
    "a pose that is no rotation": row_of(box.POSE, POSE._replace(quat_wxyz=(0.0, 0.0, 0.0, 0.0))),
    "a load of the future": row_of(box.LOAD, LOAD, NOW_US + 1),
    "a load that is no number": row_of(box.LOAD, LOAD._replace(v_load=(0.0, INF, 0.0))),
    "a fix of the future": row_of(box.FIX, FIX, NOW_US + 1),
    "a fix that is no number": row_of(box.FIX, FIX._replace(vertical_std=NAN)),
    "an old sight": row_of(box.DIRECTION, SIGHT, NOW_US - 300_001),
    "a sight of nothing": row_of(box.DIRECTION, SIGHT._replace(direction_body=(0.0, 0.0, 0.0))),
    "a height that is no number": row_of(box.HEIGHT, (NAN,)),
    "a field that is no number": row_of(box.FIELD, (NAN, 0.0, 0.4)),
    "no field": row_of(box.FIELD, (0.0, 0.0, 0.0)),
    "a sample that is no number": row_of(box.IMU, STILL._replace(accel=(0.0, 0.0, NAN))),
    "a kind that there is not": row_of(99, POSE),
    "a kind that is no number": np.full(box.COLUMNS, NAN),
}


@pytest.mark.parametrize("rows", [TRACKED, AIDED], ids=["trackers", "receiver"])
@pytest.mark.parametrize("dropped", DROPPED.values(), ids=DROPPED)
def test_what_is_dropped_leaves_no_trace(rows: list[Any], dropped: Any) -> None:
    alone, beside = begun(rows), begun(rows)
    for between in range(len(rows) + 1):
        alone = (after_readings(*alone, rows), alone[1])
        beside = (after_readings(*beside, [*rows[:between], dropped, *rows[between:]]), beside[1])
        assert bits(*alone) == bits(*beside)


def test_without_a_sound_sample_the_last_one_goes_on() -> None:
    state, history = begun(TRACKED)
    state = after_readings(state, history, TRACKED[1:])
    assert state.last_imu == STILL


@pytest.mark.parametrize("rows", [TRACKED, AIDED], ids=["trackers", "receiver"])
def test_readings_of_different_kinds_may_come_in_any_order(rows: list[Any]) -> None:
    first = bits(*begun(rows))
    for order in permutations(rows):
        assert bits(*begun(list(order))) == first


def test_rows_behind_the_count_are_not_read() -> None:
    inbox = np.array([*TRACKED, row_of(box.POSE, POSE._replace(x_quad=(5.0, 5.0, 5.0)))])
    alone, beside = begun(TRACKED), begun(TRACKED)
    first = after_readings(*alone, TRACKED)
    second = estimate(
        *beside, inbox, len(TRACKED), NOW_US, TUNING, Cable(CABLE_LENGTH), 0.0, TICK_S, 14.0, ZERO
    )
    assert bits(first, alone[1]) == bits(second, beside[1])


@pytest.mark.parametrize(
    ("field", "accel"),
    [
        ((0.0, 0.0, -0.4), (0.0, 0.0, GRAVITY)),
        (FIELD, (0.0, 0.0, 0.0)),
        ((0.002, 0.0, -0.4), (0.0, 0.0, 9.0)),
    ],
    ids=["a vertical field", "free fall", "nearly a vertical field"],
)
def test_a_fix_waits_for_an_attitude_to_start_with(field: Any, accel: Any) -> None:
    """With a receiver, the vehicle takes its level from the accelerometer and its heading from the
    magnetometer."""
    fallen = row_of(box.IMU, ImuReading((0.0, 0.0, 0.0), accel))
    state, history = begun([fallen, row_of(box.FIELD, field), *AIDED[2:]])
    assert state.vehicle.source == 0.0
    assert state.resets == 0.0
    for _ in range(20):
        state = after_readings(state, history, AIDED)
    assert state.vehicle.source == 2.0
    assert state.vehicle.x_quad[:2] == pytest.approx(OVER[:2], abs=0.02)
    assert np.isfinite(history.covariance).all()
