"""Numbers and vectors of three numbers as returned by the methods of custom classes."""

from __future__ import annotations

from typing import Any

import numpy as np

from autopilot.geometry.linear import Vec3
from autopilot.own.guard import short_repr


def three_numbers(numbers: Any, what: str) -> Vec3:
    """The three numbers of a tuple, a list or an array. ValueError, which names `what` they are, if it does
    not contain three real ones."""
    try:
        array = np.asarray(numbers)
        shape = array.shape
        if shape == (3,) and array.dtype.kind != "c":
            return (float(numbers[0]), float(numbers[1]), float(numbers[2]))
    except (TypeError, ValueError):
        shape = ()
    if shape == (3,):
        raise ValueError(f"{what} is {short_repr(numbers)}; must be 3 real numbers")
    if shape:
        raise ValueError(f"{what} has {' x '.join(map(str, shape))} numbers; must be 3")
    raise ValueError(f"{what} is {short_repr(numbers)}; must be 3 numbers")


def one_number(number: Any, what: str) -> float:
    """A number as a float. ValueError, which names `what` it is, if it is none."""
    try:
        return float(number)
    except (TypeError, ValueError):
        raise ValueError(f"{what} is {short_repr(number)}; must be a number") from None
