"""How well a recorded load is predicted, and how well it is estimated from the vehicle's pose alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs.recorded.estimates import Estimates, FilterRows, load_position, predictions
from gcs.recorded.load_model import LoadModel
from gcs.recorded.motion import Motion
from gcs.recorded.smoothing import Floats

HORIZONS_S = (2.0, 5.0)
ROWS_BETWEEN_PREDICTIONS = 15  # between the beginnings of predictions, and
INTERVAL_S = 0.5  # at least: predictions that begin closer to each other tell the same
SETTLED_ROWS = 90  # with a measured load that the filter uses before the first prediction
BOUND_95 = 5.991  # chi-square of two degrees of freedom


class Score(NamedTuple):
    """Errors (k,) in metres, and their normalised squares (k,) by the stated covariance of the direction."""

    rows: NDArray[np.intp]  # of the errors
    error_m: Floats
    square: Floats

    @property
    def median_m(self) -> float:
        """Median error; nan if there is none."""
        known = self.error_m[np.isfinite(self.error_m)]
        return float(np.median(known)) if known.size else float("nan")

    @property
    def inside(self) -> float:
        """Share within the 95 % bounds; nan if there is none."""
        known = self.square[np.isfinite(self.square)]
        return float(np.mean(known < BOUND_95)) if known.size else float("nan")


def score_ahead(
    motion: Motion,
    rows: FilterRows,
    model: LoadModel,
    estimates: Estimates,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[Score, ...]:
    """Predictions that begin every `ROWS_BETWEEN_PREDICTIONS` rows, or every `INTERVAL_S` if that is more
    rows, for each horizon, compared with the measured load.

    Each begins with the estimate from load and vehicle up to this row (`estimates`), and continues with the
    vehicle's motion and attitude alone. Predictions across a break, whose duration is unknown, are left out.
    `progress` receives the number of predictions that are done, and of all.
    """
    step_s = float(np.median(np.diff(rows.time_s)))
    interval = max(ROWS_BETWEEN_PREDICTIONS, round(INTERVAL_S / step_s))
    starts = np.arange(SETTLED_ROWS, len(rows.time_s), interval)
    windows = predictions(rows, model, estimates, starts, HORIZONS_S, progress)
    breaks = np.cumsum(motion.times.broken)
    windows = [one for one in windows if breaks[one.begin] == breaks[one.ends[-1]]]
    scores = []
    for i in range(len(HORIZONS_S)):
        end_rows = np.array([one.ends[i] for one in windows], dtype=np.intp)
        direction = np.array([one.direction[i] for one in windows]).reshape(-1, 2)
        covariance = np.array([one.covariance[i] for one in windows]).reshape(-1, 3)
        scores.append(_score(motion, model, end_rows, direction, covariance))
    return tuple(scores)


def score_pose_alone(motion: Motion, model: LoadModel, estimates: Estimates) -> Score:
    """Smoothed `estimates` of the whole flight from the pose alone, compared with the measured load."""
    at = np.arange(len(motion.time_s))
    covariance = estimates.covariances[:, [0, 0, 1], [0, 1, 1]]
    return _score(motion, model, at, estimates.states[:, :2], covariance)


def _score(
    motion: Motion, model: LoadModel, at: NDArray[np.intp], direction: Floats, covariance: Floats
) -> Score:
    error = load_position(motion, model, at, direction) - motion.load[at]
    x, y = (error[:, :2] / model.length_m).T
    xx, xy, yy = covariance.T
    square = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
    return Score(at, np.linalg.norm(error, axis=1), square)
