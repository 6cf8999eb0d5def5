"""The step response taken tick by tick is that of all samples."""

from __future__ import annotations

import numpy as np
import pytest

from gcs.analysis.step import Step, step_response
from gcs.sweep.step import figures_of, followed, response_to

TICK_US = 4000
ROUNDING = 1e-9  # of seconds since the start of a flight, and of shares of a height of about a metre
STEP = Step(2.0, 0.75, np.array((1.0, -2.0, 3.0)), np.array((0.6, 0.0, 0.8)))


def response(omega: float, damping: float, end: float = 1.0) -> np.ndarray:
    """(n, 3) the load of a second-order lag that comes to rest at this share of the step, for 3 s."""
    t = np.arange(0.0, 3.0, TICK_US * 1e-6)
    roots = np.sqrt(damping**2 - 1.0 + 0j)
    fast, slow = -omega * (damping + roots), -omega * (damping - roots)
    along = np.real(1.0 + (slow * np.exp(fast * t) - fast * np.exp(slow * t)) / (fast - slow))
    aside = np.stack((0.8 * np.sin(t), np.cos(t), -0.6 * np.sin(t)), axis=1)  # across the step
    return STEP.origin_m + end * STEP.height_m * along[:, None] * STEP.direction + aside


@pytest.mark.parametrize(
    ("load", "there"),
    [
        pytest.param(response(6.0, 0.3), True, id="overshoots"),
        pytest.param(response(4.0, 1.5), True, id="creeps"),
        pytest.param(response(6.0, 0.6, 1.2), False, id="ends outside"),
        pytest.param(response(1.0, 0.7, 0.5), False, id="never gets there"),
        pytest.param(response(1e4, 0.9), True, id="is there at once"),
    ],
)
def test_the_figures_are_those_of_the_whole_response(load: np.ndarray, there: bool) -> None:
    times_us = 2_000_000 + TICK_US * np.arange(len(load))
    expected = step_response(STEP, times_us * 1e-6, load)
    found = response_to(STEP)
    for now_us, x_load in zip(times_us.tolist(), load.tolist(), strict=True):
        found = followed(found, tuple(x_load), now_us)
    known = [np.nan if value is None else value for value in expected[1:]]
    assert figures_of(found) == pytest.approx(known, abs=ROUNDING, nan_ok=True)
    assert np.isfinite(known[2]) == there
