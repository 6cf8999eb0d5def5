"""Intervals of identified numbers: few blocks, motion too small to identify anything, no motion."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcs.commands.recorded import with_interval
from gcs.recorded.column_map import ColumnMap, load_map
from gcs.recorded.identification import Identified, half_widths, identify_load
from gcs.recorded.load_model import LoadModel, step_load
from gcs.recorded.motion import Motion, motion_of
from gcs.recorded.recording import Recording

COLUMNS: ColumnMap = load_map("telemetry")
TRUTH: LoadModel = COLUMNS.load_model(1.0)._replace(drag_per_m=0.05)
STEP_S, ROWS, NOISE_M = 0.04, 700, 1e-5


def test_intervals_of_few_blocks_hold_what_they_say() -> None:
    """Four numbers from thirty seconds whose residuals are correlated over a second: three blocks."""
    rng, inside = np.random.default_rng(3), []
    time = np.arange(0.0, 30.0, 0.1)
    for _ in range(200):
        rows = np.stack(
            [np.sin(2.0 * np.pi * time / period + rng.uniform(0, 6)) for period in (3.0, 5.0, 8.0, 11.0)],
            axis=1,
        )
        noise = np.convolve(rng.normal(size=len(time) + 9), np.ones(10) / 10.0, "valid")
        found = np.linalg.solve(rows.T @ rows, rows.T @ noise)  # the true numbers are 0
        gradient = rows * (rows @ found - noise)[:, None]
        widths = half_widths(np.einsum("ki,kj->kij", rows, rows), gradient, time)
        inside.append(np.abs(found) <= widths)
    assert 0.92 < np.mean(inside) <= 1.0


def test_rows_that_tell_nothing_have_no_end_of_an_interval() -> None:
    time = np.arange(0.0, 30.0, 0.1)
    rows = np.stack([np.ones_like(time), np.zeros_like(time)], axis=1)
    widths = half_widths(np.einsum("ki,kj->kij", rows, rows), rows * 0.1, time)
    assert not np.isfinite(widths).any()


def swinging(start: float) -> Motion:
    """A load that swings from `start` (rad) below a vehicle at rest, measured with noise `NOISE_M`."""
    still, state = (0.0,) * 8, (math.sin(start), 0.0, 0.0, 0.0, 0.0, 0.0)
    load = np.zeros((ROWS, 3))
    for k in range(ROWS):
        qx, qy = state[:2]
        load[k] = TRUTH.length_m * np.array([qx, qy, -math.sqrt(1.0 - qx * qx - qy * qy)])
        state = step_load(state, STEP_S, still, still, TRUTH)
    load += np.random.default_rng(1).normal(0.0, NOISE_M, load.shape)
    level = np.tile([0.0, 0.0, 0.0, 1.0], (ROWS, 1))
    return motion_of(Recording("swing", STEP_S * np.arange(ROWS), np.zeros((ROWS, 3)), level, load), COLUMNS)


@pytest.mark.parametrize(("start", "is_determined"), [(0.3, True), (1e-4, False)])
def test_drag_is_told_of_a_load_that_swings_and_not_of_one_that_hangs(
    start: float, is_determined: bool
) -> None:
    told: list[tuple[int, int]] = []
    model = TRUTH._replace(drag_per_m=0.0)
    (drag,) = identify_load(swinging(start), model, ["drag_per_m"], lambda *now: told.append(now))
    assert drag.is_determined == is_determined
    assert drag.value == pytest.approx(TRUTH.drag_per_m, abs=drag.half_width)
    assert [done for done, _ in told] == list(range(1, len(told) + 1))
    assert told[-1][0] <= told[-1][1]


def test_a_number_is_told_if_its_interval_leaves_anything_of_it() -> None:
    assert Identified("push_x_m_s2", 0.0, 1e-3).is_determined  # identified: there is no push
    assert not Identified("drag_per_m", 0.0035, 0.004).is_determined
    assert not Identified("length_m", 0.7, math.nan).is_determined


@pytest.mark.parametrize(
    ("value", "half_width", "printed"),
    [
        (-1e-7, 5e-6, ("0.000000", "+- 5.0e-06")),  # no minus sign before zero
        (3.07045, 0.0014, ("3.0705", "+- 0.0014")),
        (0.0265, 1.2, ("0.0", "+- 1.2")),
        (0.0265, 312.0, ("0", "+- 312")),
        (0.7, 0.0, ("0.700000", "+- 0.000000")),
        (0.7, math.inf, ("0.7000", "+- ?")),
    ],
)
def test_a_number_is_printed_as_far_as_its_interval_tells_it(
    value: float, half_width: float, printed: tuple[str, str]
) -> None:
    assert with_interval(value, half_width) == printed
