"""One clock for everything: the sensors' ticks, and jobs that run on every n-th tick."""

from __future__ import annotations

from autopilot.wire.parameter_table import ParameterTable


class RateError(ValueError):
    """A rate that does not divide the tick rate."""


def divider(tick_hz: float, job_hz: float, job: str, min_hz: float = 1.0) -> int:
    """The number n such that a job runs on every n-th tick.

    RateError if n is no whole number: it names both rates, and the possible whole rates from `min_hz` on.
    """
    ratio = tick_hz / job_hz
    n = round(ratio)
    if n < 1 or abs(ratio - n) > 1e-6 * ratio:
        rates = (tick_hz / n for n in range(1, int(tick_hz / min_hz) + 1))
        allowed = ", ".join(f"{rate:g}" for rate in rates if rate.is_integer())
        raise RateError(
            f"{job} = {job_hz:g} Hz does not divide the sensor rate of {tick_hz:g} Hz; "
            f"must be one of {allowed}, or change SIM_RATE_HZ"
        )
    return n


def control_divider(tick_hz: float, table: ParameterTable) -> int:
    """The number n such that the control law runs on every n-th tick, by CTL_RATE_HZ; RateError as above."""
    name = "CTL_RATE_HZ"
    return divider(tick_hz, table[name], name, table.describe(name).low)
