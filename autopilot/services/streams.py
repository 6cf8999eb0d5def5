"""When each message is due on one link: intervals locked to the simulated clock.

A stream of interval I is due at the first tick at or after every multiple of I. Intervals are not added up,
so nothing drifts: at a tick of 4 ms, 8 ms is always every second tick, 50 ms every 12 or 13 ticks in turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from heapq import heapify, heapreplace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

OFF = -1  # MAV_CMD_SET_MESSAGE_INTERVAL: never
DEFAULT = 0  # and: the default interval
NEVER_US = 2**63 - 1
_MAX_COMBINATIONS = 64  # remembered sets of groups; a client may choose intervals that seldom coincide again


class Streams:
    """The intervals of one link, and when each message is due next. Keys are in the order of `defaults`."""

    def __init__(self, defaults: Mapping[int, int], now_us: int) -> None:
        """`defaults`: interval in us by message id, OFF for messages sent on request only."""
        self._defaults = defaults
        self._interval = dict(defaults)
        self._order = {key: number for number, key in enumerate(defaults)}
        # streams of one interval are due together: a heap of (next due time, interval, their keys in order)
        self._groups: list[tuple[int, int, tuple[int, ...]]] = []
        self._regroup({key: _at_or_after(interval, now_us) for key, interval in defaults.items()})

    def _regroup(self, due_us: Mapping[int, int]) -> None:
        """Group all streams again by their interval and the time at which each is due."""
        groups: dict[tuple[int, int], list[int]] = {}
        for key in self._order:
            groups.setdefault((due_us[key], self._interval[key]), []).append(key)
        self._groups = [(due, interval, tuple(keys)) for (due, interval), keys in groups.items()]
        heapify(self._groups)
        self._compiled: tuple[NDArray[np.int64], set[int]] | None = None
        self._combinations: dict[
            tuple[tuple[int, ...], ...], tuple[int, ...]
        ] = {}  # groups that were due together
        self.next_us = self._groups[0][0] if self._groups else NEVER_US

    def interval(self, key: int) -> int | None:
        """Interval in us, OFF, or None for a message that is never streamed."""
        return self._interval.get(key)

    def set_interval(self, key: int, interval_us: int, now_us: int) -> None:
        """Change the interval of a known stream: DEFAULT, OFF or us."""
        interval = self._defaults[key] if interval_us == DEFAULT else interval_us
        self._interval[key] = interval
        due_us = self._due_us()
        due_us[key] = _at_or_after(interval, now_us)
        self._regroup(due_us)

    def compiled_groups(self, bits: Mapping[int, int]) -> tuple[NDArray[np.int64], int]:
        """The groups all of whose streams have a bit, (n, 2): interval in us and the sum of their bits; and
        the time at which the first of the other streams is due. No group of the table may be due now: from
        then on, it is due at each tick that reaches or passes a multiple of its interval."""
        if self._compiled is None:
            rows = [
                (interval, sum(map(bits.__getitem__, keys)))
                for interval, keys in self._sent_groups(bits, True)
            ]
            others = {key for _, keys in self._sent_groups(bits, False) for key in keys}
            self._compiled = np.array(rows, np.int64).reshape(-1, 2), others
        table, others = self._compiled
        return table, min((due for due, _, keys in self._groups if keys[0] in others), default=NEVER_US)

    def _sent_groups(self, bits: Mapping[int, int], compiled: bool) -> list[tuple[int, tuple[int, ...]]]:
        """Intervals and streams of the groups that are sent; `compiled`: of those all of whose streams have a
        bit, else of the others."""
        sent = [(interval, keys) for _, interval, keys in self._groups if interval > 0]
        return [(interval, keys) for interval, keys in sent if all(key in bits for key in keys) is compiled]

    def take_due(self, now_us: int) -> tuple[int, ...]:
        """The streams due at this tick; each of them is due again at the next multiple of its interval."""
        groups = self._groups
        taken: tuple[tuple[int, ...], ...] = ()
        last, is_split = 0, False
        while self.next_us <= now_us:
            _, interval, keys = groups[0]
            # a stream was set to this interval between two times at which the others with it were due
            is_split, last = is_split or interval == last, interval
            taken += (keys,)
            heapreplace(groups, (_at_or_after(interval, now_us + 1), interval, keys))
            self.next_us = groups[0][0]
        if is_split:
            self._regroup(self._due_us())
        return self._merged(taken)

    def _merged(self, groups: tuple[tuple[int, ...], ...]) -> tuple[int, ...]:
        """The keys of these groups in their order. The same groups coincide again and again."""
        if len(groups) <= 1:
            return groups[0] if groups else ()
        keys = self._combinations.get(groups)
        if keys is None:
            if len(self._combinations) >= _MAX_COMBINATIONS:
                self._combinations.clear()
            keys = self._combinations[groups] = tuple(sorted(chain(*groups), key=self._order.__getitem__))
        return keys

    def _due_us(self) -> dict[int, int]:
        return {key: due_us for due_us, _, keys in self._groups for key in keys}


def _at_or_after(interval_us: int, now_us: int) -> int:
    return -(-now_us // interval_us) * interval_us if interval_us > 0 else NEVER_US
