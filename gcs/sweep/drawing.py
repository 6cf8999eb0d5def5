"""Values drawn from a range: any number of it, or only whole numbers where a parameter takes no others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from autopilot.wire.parameter_table import Parameter

Setting = tuple[float, ...]

_EXCHANGES = 200  # tried before another setting is drawn


def draws_whole_numbers(low: float, high: float, parameters: Iterable[Parameter]) -> bool:
    """Whether only whole numbers are drawn from low ... high for these parameters: one of them takes no
    others. False if an end is no whole number, which such a parameter refuses."""
    return low.is_integer() and high.is_integer() and any(one.integer for one in parameters)


def drawn_index(fraction: float, count: int) -> int:
    """The index of one of `count` values for a random number in [0, 1); all are as likely."""
    return min(int(fraction * count), count - 1)


def drawn_number(low: float, high: float, fraction: float, whole: bool) -> float:
    """The number in low ... high for a random number in [0, 1); if `whole`, a whole number, both ends
    included."""
    if whole:
        return low + drawn_index(fraction, int(high - low) + 1)
    return low + fraction * (high - low)


def without_repeats(
    drawn: Sequence[Setting], values: Sequence[Sequence[float]], rng: np.random.Generator
) -> list[Setting]:
    """The drawn settings, which are not more than there are of these values, each of them once.

    A setting that is drawn again exchanges a value with another one, if that makes both of them new: each
    value remains drawn as often as it was. Otherwise any setting is drawn in its place.
    """
    settings, counts = list(drawn), Counter(drawn)
    for i in range(len(settings)):
        if counts[settings[i]] == 1:
            continue
        for _ in range(_EXCHANGES):
            j, k = int(rng.integers(len(settings))), int(rng.integers(len(values)))
            one, other = settings[i], settings[j]
            new = {i: (*one[:k], other[k], *one[k + 1 :]), j: (*other[:k], one[k], *other[k + 1 :])}
            if new[i] != new[j] and not (counts[new[i]] or counts[new[j]]):
                break
        else:
            new = {i: settings[i]}
            while counts[new[i]]:
                new = {i: tuple(one[int(rng.integers(len(one)))] for one in values)}
        for place, setting in new.items():
            counts[settings[place]] -= 1
            counts[setting] += 1
            settings[place] = setting
    return settings
