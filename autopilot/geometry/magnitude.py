"""The greatest number that is taken from custom code.

It is far beyond any vehicle, whatever the quantity (m, m/s, rad/s, N, N m), and so small that the products
of several such numbers are finite: a law that gets or gives larger ones would compute with infinities.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3

MAX_MAGNITUDE = 1e9
MAX_MAGNITUDE_TEXT = "1e9"
BOUNDED_TEXT = f"must be numbers up to {MAX_MAGNITUDE_TEXT}"  # of a message about others


@kernel
def is_bounded(number: float) -> bool:
    """Whether this is a number, and within MAX_MAGNITUDE."""
    return abs(number) <= MAX_MAGNITUDE


@kernel
def is_bounded_vector(v: Vec3) -> bool:
    """Whether all components are numbers, and within MAX_MAGNITUDE."""
    return is_bounded(v[0]) and is_bounded(v[1]) and is_bounded(v[2])
