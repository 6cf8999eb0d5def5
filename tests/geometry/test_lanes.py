"""Eight flights at once: in each lane the bits that one number gives, and a record of the lanes that
diverged."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lane_numbers import LANES
from autopilot.geometry.lanes import (
    as_lane_array,
    bits_of,
    diverged_lanes,
    float_from_bits,
    if_above,
    int_per_lane,
    row_count,
    table_value,
    to_single,
)
from autopilot.geometry.packed import with_field
from autopilot.geometry.so3 import quat_from_rotation, quat_log, rotation_from_quat
from sitl.plant.records import Motion

Numbers = NDArray[np.float64]


def aligned(values: Any) -> Any:
    """(n, LANES) a copy that begins at a whole cache line."""
    values = np.ascontiguousarray(values)
    block = np.zeros(values.size + 8, values.dtype)
    first = -block.ctypes.data // 8 % 8
    found = block[first : first + values.size].reshape(values.shape)
    found[...] = values
    return found


@kernel
def computed(x: Any, out: Any) -> None:
    a, b, c = x[0], x[1], x[2]
    out[0] = a + b * c - a / c
    out[1] = -a + 2 * b - c / 3
    out[2] = math.sqrt(abs(a))
    out[3] = np.rint(b)
    out[4] = max(a, b, 0.5)
    out[5] = min(a, b, c)
    out[6] = math.sin(a) + math.cos(b) + math.atan2(a, b)
    out[7] = to_single(c)
    out[12] = if_above(a, b, c, 1.0)
    total = 0.0
    for part in (a, b, 1.0):
        total += part
    out[8] = total
    out[9] = float_from_bits(bits_of(a) ^ 1)
    seconds = int_per_lane(x[3])
    out[10] = (seconds // 7) * 1.0 + (seconds % 7)
    out[11] = ((seconds & 0xFF) << 3) + (seconds >> 2)


@kernel
def computed_in_lanes(x: Any, out: Any) -> int:
    diverged_lanes()
    computed(as_lane_array(x), as_lane_array(out))
    return diverged_lanes()


NUMBER = st.floats(allow_subnormal=False) | st.sampled_from([0.0, -0.0, math.inf, -math.inf, math.nan])


@given(
    st.lists(st.tuples(NUMBER, NUMBER, NUMBER, st.integers(-(2**50), 2**50)), min_size=LANES, max_size=LANES)
)
@settings(max_examples=200, deadline=None)
def test_each_lane_has_the_bits_of_one_number(flights: list[tuple[float, float, float, int]]) -> None:
    x = np.array(flights, dtype=np.float64)
    out = np.zeros((LANES, 13))
    for row, found in zip(x, out, strict=True):
        computed(row, found)
    lanes, found = aligned(x.T), aligned(np.zeros((13, LANES)))
    computed_in_lanes(lanes, found)
    # the sign of a NaN has no meaning
    assert np.array_equal(np.isnan(found.T), np.isnan(out))
    known = ~np.isnan(out)
    assert found.T[known].tobytes() == out[known].tobytes()


@kernel
def decided(x: Any) -> int:
    a = as_lane_array(x)
    diverged_lanes()
    steps = 0
    while a[0] > steps:
        steps += 1
    return steps * 1000 + diverged_lanes()


@pytest.mark.parametrize(
    ("numbers", "steps", "others"),
    [
        ([3.0] * 8, 3, 0),
        ([3.0] * 7 + [2.0], 3, 0b10000000),
        ([2.0, 3.0, 2.0, 3.0, 2.0, 2.0, 2.0, 2.0], 2, 0b1010),
        ([3.0, math.nan] + [3.0] * 6, 3, 0b10),
    ],
)
def test_lane_0_decides_and_the_others_that_differ_are_told(
    numbers: list[float], steps: int, others: int
) -> None:
    assert decided(aligned(np.array([numbers]))) == steps * 1000 + others


@kernel
def questions(x: Any, which: int) -> int:
    a = as_lane_array(x)[0]
    diverged_lanes()
    if which == 0:
        return int(a) * 1000 + diverged_lanes()
    if which == 1:
        return math.ceil(a) * 1000 + diverged_lanes()
    if which == 2:
        return (1 if math.isnan(a) else 0) * 1000 + diverged_lanes()
    if which == 3:
        return (1 if math.isfinite(a) else 0) * 1000 + diverged_lanes()
    if which == 4:
        return (1 if math.isinf(a) else 0) * 1000 + diverged_lanes()
    return (1 if a != 1.0 else 0) * 1000 + diverged_lanes()


def test_what_can_have_one_answer_only_is_that_of_lane_0() -> None:
    whole = aligned(np.array([[2.5, 2.25, 2.0, 2.5, 2.5, 2.5, 2.5, 3.0]]))
    assert questions(whole, 0) == 2128
    assert questions(whole, 1) == 3004
    strange = aligned(np.array([[1.0, math.nan, math.inf, -math.inf, 0.0, 1e308, -1e308, 5e-324]]))
    assert questions(strange, 2) == 0b10
    assert questions(strange, 3) == 1000 + 0b1110
    assert questions(strange, 4) == 0b1100
    assert questions(strange, 5) == 0b11111110


@kernel
def turned(quat: Any, out: Any) -> None:
    R = rotation_from_quat((quat[0], quat[1], quat[2], quat[3]))
    # records and tuples in which some numbers are the same for all flights
    motion = Motion(
        (0.0, R[0][1], 1.0),
        R[1],
        (0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        (1.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        1.0,
        0.0,
    )
    if R[0][0] > -2.0:
        motion = with_field(motion, "length", R[0][0])
    logged = quat_log(quat_from_rotation(R))
    for i in range(3):
        out[i] = motion.x_load[i] + motion.v_load[i]
        out[3 + i] = logged[i]
    out[6] = motion.length


@kernel
def turned_in_lanes(quat: Any, out: Any) -> int:
    diverged_lanes()
    turned(as_lane_array(quat), as_lane_array(out))
    return diverged_lanes()


def test_records_and_tuples_mix_one_number_with_eight() -> None:
    quats = np.array([1.0, 0.0, 0.0, 0.0]) + 0.1 * np.random.default_rng(1).normal(size=(LANES, 4))
    quats /= np.linalg.norm(quats, axis=1)[:, None]
    out = np.zeros((LANES, 7))
    for row, found in zip(quats, out, strict=True):
        turned(row, found)
    lanes = aligned(np.zeros((7, LANES)))
    assert turned_in_lanes(aligned(quats.T), lanes) == 0
    assert lanes.T.tobytes() == out.tobytes()


@kernel
def looked_up(tables: Any, at: Any, out: Any) -> int:
    rows, found = as_lane_array(at), as_lane_array(out)
    row = int_per_lane(rows[0])
    found[0] = table_value(tables, row, 1)
    found[1] = row_count(tables) * 1.0
    diverged_lanes()
    return (1 if 0 <= row < row_count(tables) else 0) * 1000 + diverged_lanes()


def test_each_flight_has_its_own_table_and_row() -> None:
    tables = tuple(np.arange(3.0 * (k + 2)).reshape(-1, 3) + 100.0 * k for k in range(LANES))
    at = np.array([[0.0, 1.0, 2.0, 1.0, 0.0, 3.0, 9.0, 2.0]])
    out = aligned(np.zeros((2, LANES)))
    # the row of lane 6 does not exist: the number found for it is not used
    assert looked_up(tables, aligned(at), out) == 1000 + 0b1000000
    for lane, (table, row) in enumerate(zip(tables, at[0].astype(int).tolist(), strict=True)):
        assert out[1, lane] == len(table)
        if lane != 6:
            assert out[0, lane] == table[row, 1]


def test_python_does_the_same_to_one_number() -> None:
    assert to_single(0.1) == float(np.float32(0.1))
    assert float_from_bits(bits_of(-1.5)) == -1.5 and bits_of(1.0) == 0x3FF0000000000000
    assert if_above(2.0, 1.0, 3.0, 4.0) == 3.0 and if_above(math.nan, 1.0, 3.0, 4.0) == 4.0
    assert int_per_lane(3.0) == 3 and table_value(np.arange(6.0).reshape(2, 3), 1, 2) == 5.0
    assert row_count(np.zeros((4, 2))) == 4
