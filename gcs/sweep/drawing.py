"""Values drawn from a range: any number of it, or only whole numbers where a parameter takes no others."""

from __future__ import annotations

from collections.abc import Iterable

from autopilot.wire.parameter_table import Parameter


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
