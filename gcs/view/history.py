"""The flight so far, for pages that open later: a sample now and then of each vehicle."""

from __future__ import annotations

from typing import Any

SAMPLE_S = 0.05  # of the vehicle's clock
MAX_SAMPLES = 12_000  # samples; beyond this, every other one of the older half is deleted
FIELDS = (
    *("time", "load", "position", "asked", "error", "tension"),
    *("swing", "velocity", "use", "estimator_error", "pace"),
)


class History:
    """Samples in the order of their times."""

    def __init__(self) -> None:
        self.samples: list[list[Any]] = []

    def is_due(self, time_s: float | None) -> bool:
        """Whether the next sample is due.

        If the clock jumps back, the vehicle was restarted, and the samples so far are deleted.
        """
        if time_s is None:
            return False
        if self.samples and time_s < self.samples[-1][0] - 1.0:
            self.samples.clear()
        return not self.samples or time_s >= self.samples[-1][0] + SAMPLE_S - 1e-6

    def add(self, state: dict[str, Any]) -> list[Any]:
        """Store a sample of a vehicle's state and return it, in the order of FIELDS."""
        load, rotors = state["load"], state["rotors"]
        sample = [
            round(state["time"], 3),
            None if load is None else load["position"],
            state["position"],
            state["asked"],
            state["error"],
            state["tension"],
            state["swing"],
            state["velocity"],
            max(rotors) if rotors else None,
            state["estimator_error"],
            state["link"]["pace"],
        ]
        self.samples.append(sample)
        if len(self.samples) > MAX_SAMPLES:
            older = self.samples[: MAX_SAMPLES // 2]
            self.samples[: MAX_SAMPLES // 2] = older[::2]
        return sample
