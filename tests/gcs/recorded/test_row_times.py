"""Rows without time: their times, the missing rows, and the breaks where their number is unknown."""

from __future__ import annotations

import numpy as np
import pytest

from gcs.recorded.gaps import find_gaps
from gcs.recorded.row_times import infer_times
from gcs.recorded.smoothing import Floats, smooth

RATE_HZ = 30.0
JITTER_S = 6e-3
NOISE_M = 6e-5


def course(time: Floats) -> Floats:
    """The course of a vehicle that flies to and fro at up to 2 m/s, as in the recordings."""
    return np.column_stack(
        [2.0 * np.sin(0.9 * time), 1.2 * np.sin(0.6 * time + 1.0), 0.1 * np.cos(0.4 * time)]
    )


def recorded(time: Floats, rng: np.random.Generator) -> Floats:
    return course(time) + rng.normal(0.0, NOISE_M, (len(time), 3))


def test_times_of_jittered_rows_are_found_where_the_vehicle_moves() -> None:
    rng = np.random.default_rng(1)
    grid = np.arange(1500) / RATE_HZ
    time = grid + rng.normal(0.0, JITTER_S, len(grid))
    position = recorded(time, rng)
    found = infer_times(position, RATE_HZ, jitter_s=JITTER_S, noise_m=4e-4)
    inner = slice(30, -30)
    error = (found.time_s - time)[inner]
    # an error common to neighbouring rows looks like another course and remains; between rows little remains
    assert np.std(error) < 0.6 * JITTER_S
    moving = np.linalg.norm(found.smoothed.velocity[inner], axis=1)[1:] > 1.0
    assert np.std(np.diff(error)[moving]) < 0.2 * np.std(np.diff(time[inner])[moving])
    assert np.std(found.time_s[inner] - grid[inner]) > 0.8 * JITTER_S
    assert not found.broken.any()
    velocity = np.gradient(course(grid), grid, axis=0)[inner]
    even = smooth(grid, position, (4e-4) ** 2, 400.0)
    wrong = [np.linalg.norm(c.velocity[inner] - velocity, axis=1) for c in (found.smoothed, even)]
    assert np.median(wrong[0]) < 0.4 * np.median(wrong[1])


def test_missing_rows_are_counted() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(600) / RATE_HZ
    kept = np.ones(600, dtype=bool)
    kept[200:204] = False
    kept[425:434] = False
    missing, broken = find_gaps(recorded(time[kept] + rng.normal(0.0, 3e-3, kept.sum()), rng))
    assert {int(k): int(missing[k]) for k in np.flatnonzero(missing)} == {200: 4, 421: 9}
    assert not broken.any()


def test_a_stalled_tracker_misses_no_rows() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(400) / RATE_HZ
    position = recorded(time, rng)
    position[200:203] = position[199]
    missing, broken = find_gaps(position)
    assert not missing.any()
    assert not broken.any()


def test_a_jump_that_no_course_explains_breaks_the_recording() -> None:
    rng = np.random.default_rng(4)
    position = recorded(np.arange(400) / RATE_HZ, rng)
    position[200:, 2] += 0.5
    _, broken = find_gaps(position)
    assert np.flatnonzero(broken).tolist() == [200]


def test_a_course_is_smoothed_as_its_noise_allows() -> None:
    """Smoothing with noise of jerk hardly changes a cubic: value, rate and acceleration are recovered."""
    time = np.linspace(0.0, 10.0, 301)
    cubic = np.column_stack([0.1 * time**3 - time, np.ones_like(time)])
    found = smooth(time, cubic, 1e-8, 100.0)
    assert found.position == pytest.approx(cubic, abs=1e-6)
    assert found.velocity[:, 0] == pytest.approx(0.3 * time**2 - 1.0, abs=1e-3)
    assert found.acceleration[5:-5, 0] == pytest.approx(0.6 * time[5:-5], abs=1e-3)
    assert found.acceleration[:, 1] == pytest.approx(0.0, abs=1e-9)
