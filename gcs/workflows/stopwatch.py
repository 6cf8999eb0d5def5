"""How long a flight took on the wall clock."""

from __future__ import annotations

import time


class Stopwatch:
    """The wall time from the vehicle's first message to the end of the flight."""

    def __init__(self) -> None:
        self._start_s: float | None = None
        self._wall_s: float | None = None

    def start(self) -> None:
        self._start_s = time.monotonic()

    def stop(self) -> float:
        """Stop if it runs; return the measured time."""
        if self._wall_s is None:
            self._wall_s = 0.0 if self._start_s is None else time.monotonic() - self._start_s
        return self._wall_s
