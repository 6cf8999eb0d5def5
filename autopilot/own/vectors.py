"""Vectors of three numbers as returned by the methods of custom classes."""

from __future__ import annotations

from typing import Any

import numpy as np

from autopilot.geometry.linear import Vec3
from autopilot.own.guard import short_repr


def three_numbers(numbers: Any, what: str) -> Vec3:
    """The three numbers of a tuple, a list or an array. ValueError, which names `what` they are, if it does
    not contain three."""
    try:
        shape = np.shape(numbers)
        if shape == (3,):
            return (float(numbers[0]), float(numbers[1]), float(numbers[2]))
    except (TypeError, ValueError):
        shape = ()
    if shape:
        raise ValueError(f"{what} has {' x '.join(map(str, shape))} numbers; must be 3")
    raise ValueError(f"{what} is {short_repr(numbers)}; must be 3 numbers")
