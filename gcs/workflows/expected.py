"""How long a batch of unequal parts takes: on an idle machine, and at the pace at which it goes."""

from __future__ import annotations

import heapq
from collections.abc import Sequence

_OVERDUE = 0.25  # of the time that a part has run, that one which should be done is thought to take yet


def expected_s(costs: Sequence[float], cores: int) -> float:
    """Seconds until all parts are done, each of which takes a core so many seconds; in the order in which
    they begin."""
    ends = [0.0] * cores
    for cost in costs:
        heapq.heapreplace(ends, ends[0] + cost)
    return max(ends)


def remaining_s(
    done: Sequence[tuple[float, float]],
    running: Sequence[tuple[float, float]],
    waiting: Sequence[float],
    cores: int,
    busy: float = 0.0,
) -> float:
    """Seconds until all parts are done, at the pace at which it goes so far.

    `done` and `running` give of each part what it takes on an idle machine, and how long it took, or has been
    running; `waiting` what the others take on an idle machine; `busy`: how many other processes want a core.
    """
    cost = sum(idle_s for idle_s, _ in done)
    paces = [sum(took_s for _, took_s in done) / cost] if cost else []
    # a part that runs tells of the pace as soon as it has taken longer than it should
    shared = (busy + len(running)) / cores
    slowness = max(1.0, *(paces or [shared]), *(so_far_s / idle_s for idle_s, so_far_s in running))
    left = [max(idle_s * slowness - so_far_s, _OVERDUE * so_far_s) for idle_s, so_far_s in running]
    return expected_s([*left, *(idle_s * slowness for idle_s in waiting)], cores)


def in_words(seconds: float) -> str:
    """A rough time, as a person says it: in whole minutes only where a minute is a small part of it."""
    if seconds < 90.0:
        return f"about {max(seconds, 1.0):.0f} s"
    return f"about {seconds / 10.0:.0f}0 s" if seconds < 295.0 else f"about {seconds / 60.0:.0f} min"
