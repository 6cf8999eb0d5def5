"""Jobs on every n-th tick."""

from __future__ import annotations

import pytest

from autopilot.vehicle.rates import RateError, divider


@pytest.mark.parametrize(
    ("tick_hz", "job_hz", "every"),
    [(250.0, 250.0, 1), (250.0, 125.0, 2), (1000.0, 100.0, 10), (1e6 / 1600, 125.0, 5)],
)
def test_a_rate_that_divides(tick_hz: float, job_hz: float, every: int) -> None:
    assert divider(tick_hz, job_hz, "JOB") == every


@pytest.mark.parametrize(
    ("tick_hz", "job_hz"), [(250.0, 400.0), (250.0, 100.0), (100.0, 250.0), (250.0, 249.0)]
)
def test_a_rate_that_does_not_names_both(tick_hz: float, job_hz: float) -> None:
    with pytest.raises(RateError) as caught:
        divider(tick_hz, job_hz, "CTL_RATE_HZ")
    assert f"CTL_RATE_HZ = {job_hz:g} Hz" in str(caught.value)
    assert f"{tick_hz:g} Hz" in str(caught.value)
    assert "SIM_RATE_HZ" in str(caught.value)


def test_it_names_the_rates_that_there_can_be() -> None:
    with pytest.raises(RateError, match="must be one of 250, 125, or change"):
        divider(250.0, 333.0, "CTL_RATE_HZ", 100.0)
