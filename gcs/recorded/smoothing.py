"""Position, velocity and acceleration of a point that is measured row by row.

The motion is a triple integrator driven by white noise (a Wiener process of jerk). Its most probable course
is a linear least squares problem with 3 x 3 blocks on three diagonals (Särkkä, *Bayesian Filtering and
Smoothing*, 2013, section 8.2, gives the recursive form); solved here in one pass as a banded system.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Floats = NDArray[np.float64]

_HALF_BAND = 5  # entries beside the diagonal that neighbouring blocks of three reach
_MIN_STEP_S = 1e-4  # least step between rows; the motion is smooth over anything shorter


class SmoothedMotion(NamedTuple):
    """A smoothed motion, one row per instant; shapes (n, d)."""

    position: Floats
    velocity: Floats
    acceleration: Floats


def smooth(time_s: Floats, measured: Floats, variance: Floats | float, jerk_density: float) -> SmoothedMotion:
    """The most probable course of `measured` (n, d) at increasing `time_s` (n,).

    `variance` is that of the measurement, a number or one per row; infinite for a row without information.
    `jerk_density` is the spectral density of the jerk's noise, in units of `measured`^2 / s^5.
    """
    n, d = measured.shape
    step = np.maximum(np.diff(time_s), _MIN_STEP_S)
    unit = float(np.median(step))  # the states are position, unit x velocity, unit^2 x acceleration
    transitions, weights = _transitions(step / unit, jerk_density * unit**5)
    weighted = np.einsum("kji,kjl->kil", transitions, weights)  # F' W
    diagonal = np.zeros((n, 3, 3))
    diagonal[:-1] += np.einsum("kij,kjl->kil", weighted, transitions)
    diagonal[1:] += weights
    information = 1.0 / np.broadcast_to(np.asarray(variance, dtype=np.float64), (n,))
    diagonal[:, 0, 0] += information
    band = np.zeros((_HALF_BAND + 1, 3 * n))  # lower form: band[i - j, j]
    for i in range(3):
        for j in range(3):
            if i >= j:
                band[i - j, j::3] = diagonal[:, i, j]
            band[3 + i - j, j : 3 * (n - 1) : 3] = -weighted[:, j, i]
    right_side = np.zeros((3 * n, d))
    right_side[0::3] = information[:, None] * np.where(np.isfinite(measured), measured, 0.0)
    x = solveh_banded(band, right_side, lower=True, check_finite=False).reshape(n, 3, d)
    return SmoothedMotion(x[:, 0], x[:, 1] / unit, x[:, 2] / unit**2)


def _transitions(step: Floats, density: float) -> tuple[Floats, Floats]:
    """Transition matrices over steps (k,) and the inverses of the noise's covariances, (k, 3, 3)."""
    one, zero = np.ones_like(step), np.zeros_like(step)
    transitions = np.stack([one, step, 0.5 * step**2, zero, one, step, zero, zero, one], axis=1).reshape(
        -1, 3, 3
    )
    # inverse of the covariance [[h^5/20, h^4/8, h^3/6], [h^4/8, h^3/3, h^2/2], [h^3/6, h^2/2, h]]
    h = step
    terms = [
        720 / h**5,
        -360 / h**4,
        60 / h**3,
        -360 / h**4,
        192 / h**3,
        -36 / h**2,
        60 / h**3,
        -36 / h**2,
        9 / h,
    ]
    return transitions, np.stack(terms, axis=1).reshape(-1, 3, 3) / density
