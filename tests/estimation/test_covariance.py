"""The test by which a reading is accepted or refused."""

from __future__ import annotations

from math import nan

import pytest

from autopilot.estimation.covariance import add_jacobian_entry, compute_gain_rows, start_scalar, within_gate
from autopilot.estimation.records import FIX, POSITION, SIZE, TEST_RATIO, new_history


@pytest.mark.parametrize(
    ("innovation_m", "accepted"), [(0.0, True), (9.9, True), (-10.1, False), (nan, False)]
)
def test_a_reading_beyond_the_gate_is_refused_and_its_ratio_is_kept(
    innovation_m: float, accepted: bool
) -> None:
    history = new_history()
    history.covariance[POSITION, POSITION] = 3.0
    for k in range(2):
        start_scalar(history, k, innovation_m, 1.0)  # variances: 1 of the reading, 3 of the estimate
        add_jacobian_entry(history, k, POSITION, 1.0)
    compute_gain_rows(history, 0, 2, SIZE)
    assert within_gate(history, FIX, 2, 5.0) is accepted
    ratio = innovation_m**2 / 4.0 / 25.0
    assert history.consistency[FIX, TEST_RATIO] == pytest.approx(ratio, nan_ok=True)
    assert not history.consistency[:, :TEST_RATIO].any()
