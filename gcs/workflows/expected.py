"""How long a batch of unequal parts takes on an idle machine."""

from __future__ import annotations

import heapq
from collections.abc import Sequence


def expected_s(costs: Sequence[float], cores: int) -> float:
    """Seconds until all parts are done, each of which takes a core so many seconds; in the order in which
    they begin."""
    ends = [0.0] * cores
    for cost in costs:
        heapq.heapreplace(ends, ends[0] + cost)
    return max(ends)


def in_words(seconds: float) -> str:
    """A rough time, as a person says it."""
    return f"about {max(seconds, 1.0):.0f} s" if seconds < 90.0 else f"about {seconds / 60.0:.0f} min"
