"""One clock for everything: the sensors' ticks, and jobs that run on every n-th of them."""

from __future__ import annotations


class RateError(ValueError):
    """A rate that the tick rate is no multiple of."""


def divider(tick_hz: float, job_hz: float, job: str) -> int:
    """On every how many-th tick a job runs; RateError, naming both rates, if that is no whole number."""
    ratio = tick_hz / job_hz
    n = round(ratio)
    if n < 1 or abs(ratio - n) > 1e-6 * ratio:
        raise RateError(
            f"{job} = {job_hz:g} Hz does not divide the sensor rate of {tick_hz:g} Hz; "
            f"choose a rate that does, or change SIM_RATE_HZ"
        )
    return n


def is_due(tick: int, every: int) -> bool:
    """Whether a job that runs on every `every`-th tick runs on this one."""
    return tick % every == 0
