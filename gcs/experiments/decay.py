"""Whether error functions go to zero, and how fast: fits the bound alpha e^(-beta t) of (3-26), (3-39)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gcs.analysis.axes import Floats

DEPTH = 1e-3  # of the peak: the fit ends there, so that a long tail of rounding errors does not dominate it
_TAIL_S = 0.25  # at the end: the greatest value in this time is the final value
_ZERO_SHARE = 0.02  # of the greatest value of the mission: a smaller final value counts as zero
_MIN_SAMPLES = 10  # samples of a fit
_MIN_PEAK_RATIO = 5.0  # ratio of peak to resolution: below this no rate can be determined


class Decay(NamedTuple):
    """The decay of one error function after the last motion of the reference."""

    greatest: float | None  # in the whole mission
    final: float | None  # greatest of the last quarter of a second
    decays: bool | None  # final is negligible compared with greatest, or below the resolution of telemetry
    rate_1_s: float | None  # beta
    scale: float | None  # alpha, at the last motion; the bound holds wherever it is fitted


def decay_of(time_s: Floats, values: Floats, rest_s: float, resolution: float, depth: float = DEPTH) -> Decay:
    """The decay of a norm or error function (n,) >= 0 over the mission; the reference rests from `rest_s` on.

    The rate is None if the peak after that is only a few times the `resolution`: there is nothing to fit.
    """
    known = np.isfinite(values)
    t, v = time_s[known], values[known]
    if len(t) == 0:
        return Decay(None, None, None, None, None)
    greatest = float(v.max())
    after = t >= rest_s
    if not after.any():  # the flight was lost before
        return Decay(greatest, float(v[-1]), False, None, None)
    final = float(v[t >= t[-1] - _TAIL_S].max())
    decays = bool(final <= max(_ZERO_SHARE * greatest, resolution))
    rate, scale = fit_bound(t[after] - rest_s, v[after], resolution, depth)
    return Decay(greatest, final, decays, rate, scale)


def fit_bound(
    t: Floats, v: Floats, resolution: float, depth: float = DEPTH
) -> tuple[float | None, float | None]:
    """(beta, alpha): a least-squares line through the logarithm of the envelope, raised until it bounds `v`.

    The envelope is the greatest of the present and all later values, so that an oscillating error is judged
    by its crests. The range of the fit and of the bound is from the peak down to `depth` of the peak, or to
    the resolution, or to the last crest.
    """
    peak = int(np.argmax(v))
    if v[peak] < _MIN_PEAK_RATIO * resolution:
        return None, None
    envelope = np.maximum.accumulate(v[::-1])[::-1]
    below = np.flatnonzero(envelope[peak:] < max(depth * v[peak], resolution))
    end = peak + int(below[0]) if len(below) else len(v)
    crests = peak + 1 + np.flatnonzero((v[peak + 1 : -1] > v[peak:-2]) & (v[peak + 1 : -1] >= v[peak + 2 :]))
    crests = crests[crests < end]
    if len(crests) > 1 and not len(below):  # the last wave is incomplete, and its envelope falls to zero
        end = int(crests[-1]) + 1
    if end - peak < _MIN_SAMPLES:
        return None, None
    slope, _ = np.polyfit(t[peak:end], np.log(envelope[peak:end]), 1)
    beta = float(-slope)
    alpha = float(np.exp((np.log(envelope[peak:end]) + beta * t[peak:end]).max()))
    return beta, alpha
