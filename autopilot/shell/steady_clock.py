"""A steady time of day: the time at the start plus the time that has passed since.

Setting the wall clock forward or back has no effect on it.
"""

from __future__ import annotations

import time


class SteadyClock:
    """The time of day."""

    def __init__(self) -> None:
        self._offset_us = time.time_ns() // 1000 - time.monotonic_ns() // 1000

    def unix_us(self) -> int:
        """us since 1970."""
        return self._offset_us + time.monotonic_ns() // 1000
