"""What rotors at any places can do together: the columns of a mixer, and the moments that they can give."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from math import inf

import numpy as np
from numpy.typing import NDArray

from autopilot.vehicle.layout import Layout

# columns of a mixer's table, one row per rotor: the effect of each rotor by (2-13), and the columns of the
# inverse; the last row: the effect of the columns for thrust, roll and pitch on yaw
STRENGTH, ROLL, PITCH, YAW, LIFT_BY, ROLL_BY, PITCH_BY, YAW_BY = range(8)
ROTOR_MARGIN = 0.15  # share of a rotor's range that paths leave to control: default of MIS_ROTOR_MARG
_LEAST = 1e-9  # a number of the table below this is a rounding error
_SHARES = tuple(0.1 * i for i in range(1, 10))  # shares of the greatest thrust that are tried
_LEAST_SHARE = 1e-3  # of a rotor's force: less authority counts as none


def allocate(layout: Layout, lost: int = 0) -> NDArray[np.float64]:
    """The table (n + 1, 8) of a mixer for these rotors, without the rotors whose bits are set in `lost`."""
    n = len(layout)
    use = np.array([rotor.strength * (0.0 if lost >> i & 1 else 1.0) for i, rotor in enumerate(layout)])
    yaw = use * np.array([rotor.yaw for rotor in layout])
    rows = use * np.array([[1.0] * n, [rotor.y for rotor in layout], [-rotor.x for rotor in layout]])
    # the inverse gives efforts, so that rotors of different strength are used equally
    columns = rows.T @ np.linalg.pinv(rows @ rows.T, rcond=_LEAST)
    turns = yaw @ columns
    unseen = yaw - turns @ rows
    reach = float(yaw @ unseen)
    table = np.zeros((n + 1, 8))
    table[:n, STRENGTH] = use
    table[:n, ROLL : YAW + 1] = np.array([(rotor.y, -rotor.x, rotor.yaw) for rotor in layout])
    table[:n, LIFT_BY : PITCH_BY + 1] = columns
    if reach > _LEAST:
        table[:n, YAW_BY] = unseen / reach
    table[n, LIFT_BY : PITCH_BY + 1] = turns
    # remove rounding errors of the inverse, so that a row of zeros is exactly zero
    table[np.abs(table) < _LEAST] = 0.0
    return table


def columns(layout: Layout) -> tuple[tuple[float, float, float, float], ...]:
    """How much each rotor's effort grows with thrust, with roll and pitch moment divided by `arm_m`, and with
    yaw moment divided by `torque_ratio_m`: the least-squares inverse of (2-13)."""
    table = allocate(layout)
    each, turns = table[:-1], table[-1]
    whole = each[:, LIFT_BY:] - np.outer(each[:, YAW_BY], np.append(turns[LIFT_BY:YAW_BY], 0.0))
    return tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in whole + 0.0)


def sizes(table: NDArray[np.float64]) -> tuple[float, float]:
    """Thrust, and moment about a level axis divided by `arm_m`, at which the first rotor of a mixer's table
    reaches a given effort, both as multiples of that effort."""
    return float(1.0 / table[:-1, LIFT_BY].max()), float(1.0 / np.abs(table[:-1, [ROLL_BY, PITCH_BY]]).max())


@lru_cache(maxsize=256)
def authority(layout: Layout, lost: int, thrust: float, low: float, high: float, yaw: bool) -> float:
    """The greatest moment that the rotors without those in `lost` can give in every direction while they give
    `thrust` (N), each with an effort of `low` ... `high` (N). The result is in N: level moments are divided
    by `arm_m`, the yaw moment by `torque_ratio_m`. Without `yaw` only level axes count, with any yaw moment.
    Negative: they cannot give this thrust without a moment.

    The thrusts and moments of all possible efforts form a zonotope; the result is the distance of the thrust
    without a moment from its nearest facet. Each facet is spanned by two or three rotors (Du, Quan and
    others: the degree of controllability of multirotors).
    """
    use = [rotor for i, rotor in enumerate(layout) if not lost >> i & 1]
    axes = 4 if yaw else 3
    edges = np.array([[1.0, r.y, -r.x, r.yaw][:axes] for r in use]) * np.array([[r.strength] for r in use])
    spanning = np.array(list(combinations(range(len(use)), axes - 1)))
    if not len(spanning):
        return -inf
    spans = edges[spanning]  # (facets, axes - 1, axes)
    signs = (-1.0) ** np.arange(axes)
    normals = np.stack(
        [sign * np.linalg.det(np.delete(spans, axis, 2)) for axis, sign in enumerate(signs)], axis=1
    )
    turning = np.linalg.norm(normals[:, 1:], axis=1)
    facets, turning = normals[turning > _LEAST], turning[turning > _LEAST]
    if not len(facets):
        return -inf
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    along = facets @ edges.T
    off = facets[:, 0] * thrust - middle * along.sum(axis=1)
    return float(np.min((half * np.abs(along).sum(axis=1) - np.abs(off)) / turning))


def flies(layout: Layout) -> bool:
    """Whether the rotors, each with 0 ... 1 times its strength, can give some thrust together with moments in
    every direction."""
    most = sum(rotor.strength for rotor in layout)
    return any(authority(layout, 0, share * most, 0.0, 1.0, True) > _LEAST_SHARE for share in _SHARES)
