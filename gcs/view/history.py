"""What a page that opens later must know of the flight so far: a sample now and then, of each vehicle."""

from __future__ import annotations

from typing import Any

SAMPLE_S = 0.05  # of the vehicle's clock
MOST = 12_000  # samples; beyond, every other one of the older half goes
FIELDS = (
    *("time", "load", "position", "asked", "error", "tension"),
    *("swing", "velocity", "use", "estimator_error", "pace"),
)


class History:
    """Samples in the order of their times."""

    def __init__(self) -> None:
        self.samples: list[list[Any]] = []

    def due(self, time_s: float | None) -> bool:
        """Whether it is time for a sample.

        A clock that runs backward is that of a vehicle that began anew: what was before is forgotten.
        """
        if time_s is None:
            return False
        if self.samples and time_s < self.samples[-1][0] - 1.0:
            self.samples.clear()
        return not self.samples or time_s >= self.samples[-1][0] + SAMPLE_S - 1e-6

    def take(self, state: dict[str, Any]) -> list[Any]:
        """The sample that was taken of a vehicle's state, in the order of FIELDS."""
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
        if len(self.samples) > MOST:
            older = self.samples[: MOST // 2]
            self.samples[: MOST // 2] = older[::2]
        return sample
