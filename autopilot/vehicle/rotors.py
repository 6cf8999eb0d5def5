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
STRENGTH, ROLL, PITCH, YAW, FROM_THRUST, FROM_ROLL, FROM_PITCH, FROM_YAW = range(8)
# rad/s about a level axis, at which the law `plumbline` and paths turn the vehicle at most; with a force of
# the whole weight, less with a smaller one: noise turns the direction of a small force faster than rotors can
MAX_TURN_RATE = 9.0
ROTOR_MARGIN = 0.15  # share of a rotor's range that paths leave to control: default of MIS_ROTOR_MARG
_TOLERANCE = 1e-9  # a number of the table below this is a rounding error
_THRUST_SHARES = tuple(0.1 * i for i in range(1, 10))  # shares of the greatest thrust that are tried
_MIN_SHARE = 1e-3  # of a rotor's force: less authority counts as none


def mixer_table(layout: Layout, lost: int = 0) -> NDArray[np.float64]:
    """The table (n + 1, 8) of a mixer for these rotors, without the rotors whose bits are set in `lost`."""
    n = len(layout)
    strengths = np.array([rotor.strength * (0.0 if lost >> i & 1 else 1.0) for i, rotor in enumerate(layout)])
    yaw = strengths * np.array([rotor.yaw for rotor in layout])
    rows = strengths * np.array([[1.0] * n, [rotor.y for rotor in layout], [-rotor.x for rotor in layout]])
    # the inverse gives efforts, so that rotors of different strength are used equally
    columns = rows.T @ np.linalg.pinv(rows @ rows.T, rcond=_TOLERANCE)
    yaw_coupling = yaw @ columns
    yaw_residual = yaw - yaw_coupling @ rows
    residual_norm2 = float(yaw @ yaw_residual)
    table = np.zeros((n + 1, 8))
    table[:n, STRENGTH] = strengths
    table[:n, ROLL : YAW + 1] = np.array([(rotor.y, -rotor.x, rotor.yaw) for rotor in layout])
    table[:n, FROM_THRUST : FROM_PITCH + 1] = columns
    if residual_norm2 > _TOLERANCE:
        table[:n, FROM_YAW] = yaw_residual / residual_norm2
    table[n, FROM_THRUST : FROM_PITCH + 1] = yaw_coupling
    # remove rounding errors of the inverse, so that a row of zeros is exactly zero
    table[np.abs(table) < _TOLERANCE] = 0.0
    return table


def allocation_columns(layout: Layout) -> tuple[tuple[float, float, float, float], ...]:
    """How much each rotor's effort grows with thrust, with roll and pitch moment divided by `arm_m`, and with
    yaw moment divided by `torque_ratio_m`: the least-squares inverse of (2-13)."""
    table = mixer_table(layout)
    rotor_rows, yaw_coupling = table[:-1], table[-1]
    combined = rotor_rows[:, FROM_THRUST:] - np.outer(
        rotor_rows[:, FROM_YAW], np.append(yaw_coupling[FROM_THRUST:FROM_YAW], 0.0)
    )
    return tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in combined + 0.0)


def thrust_and_moment_per_force(table: NDArray[np.float64]) -> tuple[float, float]:
    """Thrust, and moment about a level axis divided by `arm_m`, at which the first rotor of a mixer's table
    reaches a given effort, both as multiples of that effort."""
    return float(1.0 / table[:-1, FROM_THRUST].max()), float(
        1.0 / np.abs(table[:-1, [FROM_ROLL, FROM_PITCH]]).max()
    )


@lru_cache(maxsize=256)
def control_authority(layout: Layout, lost: int, thrust: float, low: float, high: float, yaw: bool) -> float:
    """The greatest moment that the rotors without those in `lost` can give in every direction while they give
    `thrust` (N), each with an effort of `low` ... `high` (N). The result is in N: level moments are divided
    by `arm_m`, the yaw moment by `torque_ratio_m`. Without `yaw` only level axes count, with any yaw moment.
    Negative: they cannot give this thrust without a moment.

    The thrusts and moments of all possible efforts form a zonotope; the result is the distance of the thrust
    without a moment from its nearest facet. Each facet is spanned by two or three rotors (Du, Quan and
    others: the degree of controllability of multirotors).
    """
    working = [rotor for i, rotor in enumerate(layout) if not lost >> i & 1]
    axes = 4 if yaw else 3
    edges = np.array([[1.0, r.y, -r.x, r.yaw][:axes] for r in working]) * np.array(
        [[r.strength] for r in working]
    )
    spanning = np.array(list(combinations(range(len(working)), axes - 1)))
    if not len(spanning):
        return -inf
    spans = edges[spanning]  # (facets, axes - 1, axes)
    signs = (-1.0) ** np.arange(axes)
    normals = np.stack(
        [sign * np.linalg.det(np.delete(spans, axis, 2)) for axis, sign in enumerate(signs)], axis=1
    )
    moment_norms = np.linalg.norm(normals[:, 1:], axis=1)
    facets, moment_norms = normals[moment_norms > _TOLERANCE], moment_norms[moment_norms > _TOLERANCE]
    if not len(facets):
        return -inf
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    projections = facets @ edges.T
    offsets = facets[:, 0] * thrust - middle * projections.sum(axis=1)
    return float(np.min((half * np.abs(projections).sum(axis=1) - np.abs(offsets)) / moment_norms))


def is_controllable(layout: Layout) -> bool:
    """Whether the rotors, each with 0 ... 1 times its strength, can give some thrust together with moments in
    every direction."""
    total_strength = sum(rotor.strength for rotor in layout)
    return any(
        control_authority(layout, 0, share * total_strength, 0.0, 1.0, True) > _MIN_SHARE
        for share in _THRUST_SHARES
    )
