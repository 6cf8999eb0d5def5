"""The time of day that goes on evenly: as it was at the start, and what has passed since.

A wall clock that is set forward or back changes nothing.
"""

from __future__ import annotations

import time


class SteadyClock:
    """The time of day."""

    def __init__(self) -> None:
        self._ahead_us = time.time_ns() // 1000 - time.monotonic_ns() // 1000

    def unix_us(self) -> int:
        """us since 1970."""
        return self._ahead_us + time.monotonic_ns() // 1000
