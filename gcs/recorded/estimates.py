"""Estimates of the load over a whole recording: filtered, smoothed, and predicted ahead."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs.recorded.load_filter import SIZE, WORK, predict_ahead, run_filter, swing_ahead
from gcs.recorded.load_model import LoadModel
from gcs.recorded.motion import Motion, drive_rows, measurement_rows, slow_rows
from gcs.recorded.smoothing import Floats


class Estimates(NamedTuple):
    """For each row: states (n, 8), covariances (n, 8, 8), normalised squares of innovations (n, 2)."""

    states: Floats
    covariances: Floats
    squares: Floats


class FilterRows(NamedTuple):
    """A motion as the kernels read it."""

    time_s: Floats
    drive: Floats
    slow: Floats
    measurements: Floats


def filter_rows(motion: Motion, model: LoadModel) -> FilterRows:
    """The rows of a motion; of the model they use the length and the delay of the wash."""
    return FilterRows(motion.time_s, drive_rows(motion, model), slow_rows(motion), measurement_rows(motion))


def filtered_estimates(
    rows: FilterRows, model: LoadModel, *, load: bool, tilt: bool, smoothed: bool = False
) -> Estimates:
    """Estimates from the load's position, the vehicle's attitude, or both; `smoothed`: each from all rows."""
    n = len(rows.time_s)
    states, forecasts = np.zeros((2, n, SIZE))
    covariances, forecast_covariances, transitions = np.zeros((3, n, SIZE, SIZE))
    squares = np.zeros((n, 2))
    run_filter(
        *rows,
        model,
        load,
        tilt,
        states,
        covariances,
        forecasts,
        forecast_covariances,
        transitions,
        squares,
        np.zeros((WORK, SIZE)),
    )
    if smoothed:
        _smooth(states, covariances, forecasts, forecast_covariances, transitions)
    return Estimates(states, covariances, squares)


def _smooth(
    states: Floats, covariances: Floats, forecasts: Floats, forecast_covariances: Floats, transitions: Floats
) -> None:
    """Rauch, Tung and Striebel's backward pass, in place."""
    gains = np.linalg.solve(forecast_covariances[1:], transitions[1:] @ covariances[:-1]).transpose(0, 2, 1)
    for k in range(len(states) - 2, -1, -1):
        gain = gains[k]
        states[k] += gain @ (states[k + 1] - forecasts[k + 1])
        covariances[k] += gain @ (covariances[k + 1] - forecast_covariances[k + 1]) @ gain.T


class Prediction(NamedTuple):
    """A prediction: rows at which it begins and ends, cable directions (k, 2) there, covariances (k, 3)."""

    begin: int
    ends: NDArray[np.intp]
    direction: Floats
    covariance: Floats


def predictions(
    rows: FilterRows,
    model: LoadModel,
    estimates: Estimates,
    starts: NDArray[np.intp],
    horizons_s: tuple[float, ...],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Prediction]:
    """Predictions from rows `starts` on, by the vehicle's motion and attitude; stops where the rows end.
    `progress` receives the number of predictions that are done, and of all."""
    windows = []
    work = np.zeros((WORK + SIZE, SIZE))
    for done, (begin, ends) in enumerate(_windows(rows, starts, horizons_s)):
        progress(done, len(starts))
        found = np.zeros((len(ends), 5))
        predict_ahead(
            *rows,
            model,
            begin,
            ends.astype(np.float64),
            estimates.states,
            estimates.covariances,
            found,
            work,
        )
        windows.append(Prediction(begin, ends, found[:, :2], found[:, 2:]))
    return windows


def _windows(
    rows: FilterRows, starts: NDArray[np.intp], horizons_s: tuple[float, ...]
) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Each of the rows `starts` with those that lie `horizons_s` after it, as long as there are such rows."""
    for begin in starts.tolist():
        ends = np.searchsorted(rows.time_s, rows.time_s[begin] + np.array(horizons_s))
        if ends[-1] >= len(rows.time_s):
            return
        yield begin, ends


def swings(
    rows: FilterRows,
    model: LoadModel,
    estimates: Estimates,
    starts: NDArray[np.intp],
    horizons_s: tuple[float, ...],
) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """Predictions by the vehicle's motion alone, as many of those from rows `starts` on as end within the
    rows: where they begin (k,), where they end (k, horizons), cable directions there (k, horizons, 2)."""
    windows = []
    for begin, ends in _windows(rows, starts, horizons_s):
        directions = np.zeros((len(ends), 2))
        swing_ahead(
            *(rows.time_s, rows.drive, model, begin),
            *(ends.astype(np.float64), estimates.states, directions),
        )
        windows.append((ends, directions))
    end_rows = np.array([ends for ends, _ in windows], dtype=np.intp)
    return starts[: len(windows)], end_rows, np.array([directions for _, directions in windows])


def load_position(motion: Motion, model: LoadModel, row: NDArray[np.intp], direction: Floats) -> Floats:
    """Position of the load (k, 3) at rows `row` if the cable has the direction `direction` (k, 2)."""
    below = -np.sqrt(np.maximum(0.0, 1.0 - np.sum(direction**2, axis=1)))
    at: Floats = motion.attachment.position[row] + model.length_m * np.column_stack([direction, below])
    return at
