"""Expected duration of a batch of unequal parts: on an idle machine, and at the present pace."""

from __future__ import annotations

import heapq
from collections.abc import Sequence

_OVERDUE_SHARE = 0.25  # an overdue part is expected to take this share of its running time in addition


def expected_s(costs: Sequence[float], cores: int) -> float:
    """Seconds until all parts are done; `costs` are the seconds that each takes on one core, in the order in
    which they begin."""
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
    """Seconds until all parts are done, at the pace so far.

    `done` and `running` contain for each part its time on an idle machine, and the time that it took or has
    been running; `waiting` contains the times of the others on an idle machine; `busy` is the number of other
    processes that compete for a core.
    """
    cost = sum(idle_s for idle_s, _ in done)
    paces = [sum(took_s for _, took_s in done) / cost] if cost else []
    # a running part contributes to the pace as soon as it has taken longer than expected
    shared = (busy + len(running)) / cores
    slowness = max(1.0, *(paces or [shared]), *(so_far_s / idle_s for idle_s, so_far_s in running))
    left = [max(idle_s * slowness - so_far_s, _OVERDUE_SHARE * so_far_s) for idle_s, so_far_s in running]
    return expected_s([*left, *(idle_s * slowness for idle_s in waiting)], cores)


def duration_text(seconds: float) -> str:
    """A rough time in words: in whole minutes only if a minute is a small part of it."""
    if seconds < 90.0:
        return f"about {max(seconds, 1.0):.0f} s"
    return f"about {seconds / 10.0:.0f}0 s" if seconds < 295.0 else f"about {seconds / 60.0:.0f} min"
