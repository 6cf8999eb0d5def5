"""The ramp between two speeds along a line, shared by transfers, paths through waypoints and the winch.

In units of the speed that is gained and of the duration, the speed rises from 0 to 1 in a time of 1, and the
way is 1/2. The way is a spline of degree 9 over `PARTS` equal parts; derivatives 2 to 6 are zero at both
ends. Of all such splines it has the least integral of `autopilot.trajectory.minimum_snap` for a duration of
7 s. The second half mirrors the first one.
"""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel

Growth = tuple[float, float, float, float, float, float, float]  # a length and its derivatives 1 ... 6

PARTS = 10
_HALF = PARTS // 2
_DEGREE = 9
# With a part as the unit of time x, the way in the first half is the sum of c x^n, and, where x > k, of
# d (x - k)^9 for k = 1 ... 4.
_FROM_BEGINNING = {7: 0.00029849923922507941785, 8: -0.00015969712497821188411, 9: 2.4994331551239962575e-05}
_FROM_K = (
    -3.5846961128125803938e-05,
    1.6149603891104351898e-05,
    -8.0778063258339493249e-06,
    4.8074839941714273721e-06,
)


def _by_power() -> NDArray[np.float64]:
    """(PARTS, 10) coefficients of the way in each part, by powers of the parts since it began."""
    ways = np.zeros((PARTS, _DEGREE + 1))
    terms = [(0, power, c) for power, c in _FROM_BEGINNING.items()]
    terms += [(k, _DEGREE, d) for k, d in enumerate(_FROM_K, 1)]
    for begin, power, c in terms:
        for part in range(begin, _HALF):
            for n in range(power + 1):
                ways[part, n] += c * comb(power, n) * (part - begin) ** (power - n)
    # way(x) = x - PARTS / 2 + way(PARTS - x), and (1 - y)^m by powers of y
    for part in range(_HALF, PARTS):
        ways[part, :2] = part - _HALF, 1.0
        for m in range(_DEGREE + 1):
            for n in range(m + 1):
                ways[part, n] += ways[PARTS - 1 - part, m] * comb(m, n) * (-1) ** n
    return ways


WAYS = _by_power()
PEAK_RAMP_ACCEL = 2.0 * PARTS * float(WAYS[_HALF, 2])
"""The peak acceleration of a ramp, halfway, times its duration over the speed that is gained."""


@kernel
def ramp(duration: float, t: float) -> Growth:
    """The way and its derivatives 1 ... 6 at time t (s) from 0 to `duration`, as the speed rises from 0 to
    1."""
    x = t / duration * PARTS
    part = min(int(x), PARTS - 1)
    y = x - part
    w0, w1, w2, w3, w4, w5, w6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for n in range(9, -1, -1):
        w6 = w6 * y + w5
        w5 = w5 * y + w4
        w4 = w4 * y + w3
        w3 = w3 * y + w2
        w2 = w2 * y + w1
        w1 = w1 * y + w0
        w0 = w0 * y + WAYS[part, n]
    r = PARTS / duration
    r2 = r * r
    return (
        w0 / r,
        w1,
        2.0 * w2 * r,
        6.0 * w3 * r2,
        24.0 * w4 * r2 * r,
        120.0 * w5 * r2 * r2,
        720.0 * w6 * r2 * r2 * r,
    )
