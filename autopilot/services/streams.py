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
        self._order = {key: number for number, key in enumerate(defaults)}
        # streams of one interval are due together: (interval, when due next): their keys
        self._groups: dict[tuple[int, int], list[int]] = {}
        for key, interval in defaults.items():
            self._groups.setdefault((interval, _at_or_after(interval, now_us)), []).append(key)
        self._look_ahead()

    def _look_ahead(self) -> None:
        self.next_us = min((due_us for _, due_us in self._groups), default=NEVER_US)

    def interval(self, key: int) -> int | None:
        """Interval in us, OFF, or None for a message that is never streamed."""
        return self._interval.get(key)

    def set_interval(self, key: int, interval_us: int, now_us: int) -> None:
        """Change the interval of a known stream: DEFAULT, OFF or us."""
        interval = self._defaults[key] if interval_us == DEFAULT else interval_us
        self._interval[key] = interval
        groups = {slot: [one for one in keys if one != key] for slot, keys in self._groups.items()}
        groups.setdefault((interval, _at_or_after(interval, now_us)), []).append(key)
        self._groups = {slot: keys for slot, keys in groups.items() if keys}
        self._look_ahead()

    def take_due(self, now_us: int) -> list[int]:
        """What is due at this tick; each of them is due again at its next multiple."""
        if now_us < self.next_us:
            return []
        taken: list[int] = []
        for slot in [slot for slot in self._groups if slot[1] <= now_us]:
            keys = self._groups.pop(slot)
            taken += keys
            interval = slot[0]
            self._groups.setdefault((interval, _at_or_after(interval, now_us + 1)), []).extend(keys)
        taken.sort(key=self._order.__getitem__)
        self._look_ahead()
        return taken


def _at_or_after(interval_us: int, now_us: int) -> int:
    return -(-now_us // interval_us) * interval_us if interval_us > 0 else NEVER_US
