"""Counter-based noise: a number depends on (seed, stream, step, block) alone, not on what ran before.

The generator is Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011): key =
seed, counter = (step, stream, block). Every sensor has its own stream and counts its own samples, hence a
reading keeps its noise whatever other sensors are fitted, lost or late.
"""

from __future__ import annotations

from math import isnan, sqrt
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, scale
from sitl.sensors.elementary import cosine_sine, logarithm

_MASK = 0xFFFFFFFF
_MULTIPLIER_0 = 0xD2511F53
_MULTIPLIER_1 = 0xCD9E8D57
_WEYL_0 = 0x9E3779B9
_WEYL_1 = 0xBB67AE85
_UNIT = 1.0 / 4294967296.0

Words = tuple[int, int, int, int]


class Noise(NamedTuple):
    """Identifies one sample of one stream; `scale` multiplies every deviation drawn from it."""

    seed: int
    stream: int
    step: int
    scale: float


@kernel
def philox(counter: Words, key_0: int, key_1: int) -> Words:
    """Four uniform 32-bit words. The low 32 bits and bits 32..63 of a product survive the wrap of int64."""
    c0, c1, c2, c3 = counter
    for _ in range(10):
        p0 = _MULTIPLIER_0 * c0
        p1 = _MULTIPLIER_1 * c2
        c0, c1, c2, c3 = (
            ((p1 >> 32) & _MASK) ^ c1 ^ key_0,
            p1 & _MASK,
            ((p0 >> 32) & _MASK) ^ c3 ^ key_1,
            p0 & _MASK,
        )
        key_0 = (key_0 + _WEYL_0) & _MASK
        key_1 = (key_1 + _WEYL_1) & _MASK
    return (c0, c1, c2, c3)


@kernel
def words(noise: Noise, block: int) -> Words:
    """The words of one block of a sample."""
    counter = (noise.step & _MASK, (noise.step >> 32) & _MASK, noise.stream & _MASK, block)
    return philox(counter, noise.seed & _MASK, (noise.seed >> 32) & _MASK)


@kernel
def uniform(noise: Noise, block: int) -> tuple[float, float]:
    """Two independent numbers, uniform in (0, 1]."""
    w = words(noise, block)
    return ((w[0] + 1.0) * _UNIT, (w[1] + 1.0) * _UNIT)


@kernel
def gaussian(noise: Noise, block: int) -> Vec3:
    """Three independent normal numbers of deviation `noise.scale`, by Box and Muller; |x| < 6.7 scale."""
    w = words(noise, block)
    r0 = noise.scale * sqrt(-2.0 * logarithm((w[0] + 1.0) * _UNIT))
    r1 = noise.scale * sqrt(-2.0 * logarithm((w[2] + 1.0) * _UNIT))
    cosine_0, sine_0 = cosine_sine(w[1])
    cosine_1, _ = cosine_sine(w[3])
    return (r0 * cosine_0, r0 * sine_0, r1 * cosine_1)


@kernel
def white(std: float, noise: Noise, block: int) -> Vec3:
    """Three independent normal numbers of deviation `std` times the sample's scale; nan if `std` is nan."""
    if isnan(std):
        return (std, std, std)
    if std == 0.0 or noise.scale == 0.0:
        return ZERO
    return scale(std, gaussian(noise, block))


class Drift(NamedTuple):
    """A slow error per sample: x' = decay x + drive n, started at initial n, with n normal.

    decay = 1 is a constant bias plus random walk; decay < 1 a bounded, correlated error (Gauss-Markov).
    """

    initial: float
    decay: float
    drive: float


@kernel
def drift_start(drift: Drift, noise: Noise, block: int) -> Vec3:
    """The error before the first sample."""
    n = gaussian(noise, block)
    return (drift.initial * n[0], drift.initial * n[1], drift.initial * n[2])


@kernel
def drift_step(error: Vec3, drift: Drift, noise: Noise, block: int) -> Vec3:
    """The error one sample later."""
    if drift.drive == 0.0 or noise.scale == 0.0:
        return (drift.decay * error[0], drift.decay * error[1], drift.decay * error[2])
    n = gaussian(noise, block)
    return (
        drift.decay * error[0] + drift.drive * n[0],
        drift.decay * error[1] + drift.drive * n[1],
        drift.decay * error[2] + drift.drive * n[2],
    )
