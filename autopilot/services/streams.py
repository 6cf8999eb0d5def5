"""When each message is due on one link: intervals locked to the simulated clock.

A stream of interval I is due at the first tick at or after every multiple of I. Nothing is added up, so
nothing drifts: at a tick of 4 ms, 8 ms is every second tick for ever, 50 ms alternates between 12 and 13.
"""

from __future__ import annotations

from collections.abc import Mapping

OFF = -1  # MAV_CMD_SET_MESSAGE_INTERVAL: never
DEFAULT = 0  # and: the default interval
NEVER_US = 2**63 - 1


class Streams:
    """The intervals of one link, and when each message is due next. Keys are in the order of `defaults`."""

    def __init__(self, defaults: Mapping[int, int], now_us: int) -> None:
        """`defaults`: interval in us by message id, OFF for messages sent on request only."""
        self._defaults = defaults
        self._interval = dict(defaults)
        self._due = {key: _at_or_after(interval, now_us) for key, interval in defaults.items()}
        self.next_us = min(self._due.values(), default=NEVER_US)

    def interval(self, key: int) -> int | None:
        """Interval in us, OFF, or None for a message that is never streamed."""
        return self._interval.get(key)

    def set_interval(self, key: int, interval_us: int, now_us: int) -> None:
        """Change the interval of a known stream: DEFAULT, OFF or us."""
        interval = self._defaults[key] if interval_us == DEFAULT else interval_us
        self._interval[key] = interval
        self._due[key] = _at_or_after(interval, now_us)
        self.next_us = min(self._due.values())

    def take_due(self, now_us: int) -> list[int]:
        """What is due at this tick; each of them is due again at its next multiple."""
        if now_us < self.next_us:
            return []
        taken = [key for key, due_us in self._due.items() if due_us <= now_us]
        for key in taken:
            self._due[key] = _at_or_after(self._interval[key], now_us + 1)
        self.next_us = min(self._due.values())
        return taken


def _at_or_after(interval_us: int, now_us: int) -> int:
    return -(-now_us // interval_us) * interval_us if interval_us > 0 else NEVER_US
