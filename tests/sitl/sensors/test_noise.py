"""The noise is the published generator, normal, and independent from stream to stream and step to step."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, gaussian, philox, uniform

# Known answers of Philox4x32-10, from the test vectors of the Random123 library (kat_vectors).
KNOWN_ANSWERS = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((2**32 - 1,) * 4, (2**32 - 1,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]

DRAWS = 20_000
# A statistic of N draws may lie this many of its own standard errors from its expectation. The draws are
# fixed by their keys, so a test that passes once passes for ever: this only says what is suspicious.
SIGMAS = 4.0
LEAST_P = 1e-3  # of the Kolmogorov-Smirnov test


def draws(seed: int, stream: int, block: int = 0, count: int = DRAWS, scale: float = 1.0) -> np.ndarray:
    return np.array([gaussian(Noise(seed, stream, step, scale), block) for step in range(count)])


@pytest.mark.parametrize(("counter", "key", "expected"), KNOWN_ANSWERS)
def test_generator_gives_the_published_numbers(counter, key, expected) -> None:
    assert philox(counter, *key) == expected
    assert philox.py_func(counter, *key) == expected


@pytest.mark.parametrize("component", [0, 1, 2])
def test_gaussian_is_normal(component: int) -> None:
    x = draws(seed=3, stream=1)[:, component]
    assert abs(x.mean()) < SIGMAS / DRAWS**0.5
    assert abs(x.std() - 1.0) < SIGMAS / (2 * DRAWS) ** 0.5
    assert abs(stats.skew(x)) < SIGMAS * (6 / DRAWS) ** 0.5
    assert abs(stats.kurtosis(x)) < SIGMAS * (24 / DRAWS) ** 0.5
    assert stats.kstest(x, "norm").pvalue > LEAST_P


def test_uniform_is_uniform_and_never_zero() -> None:
    u = np.array([uniform(Noise(9, 2, step, 1.0), 15) for step in range(DRAWS)])
    assert u.min() > 0.0
    assert u.max() <= 1.0
    assert stats.kstest(u[:, 0], "uniform").pvalue > LEAST_P
    assert stats.kstest(u[:, 1], "uniform").pvalue > LEAST_P


@pytest.mark.parametrize(
    "other",
    [
        draws(seed=4, stream=1)[:, 0],
        draws(seed=3 + 2**32, stream=1)[:, 0],
        draws(seed=3, stream=2)[:, 0],
        draws(seed=3, stream=1, block=1)[:, 0],
        draws(seed=3, stream=1)[:, 1],
        draws(seed=3, stream=1)[:, 2],
        np.roll(draws(seed=3, stream=1)[:, 0], 1),
    ],
    ids=["seed", "high half of the seed", "stream", "block", "y", "z", "step"],
)
def test_draws_of_different_keys_are_uncorrelated(other: np.ndarray) -> None:
    x = draws(seed=3, stream=1)[:, 0]
    bound = SIGMAS / DRAWS**0.5
    assert abs(np.corrcoef(x, other)[0, 1]) < bound
    assert abs(np.corrcoef(x**2, other**2)[0, 1]) < bound


def test_scale_multiplies_and_zero_silences() -> None:
    assert np.array_equal(draws(1, 1, count=5, scale=2.0), 2.0 * draws(1, 1, count=5))
    assert not draws(1, 1, count=5, scale=0.0).any()


def test_largest_seed_is_a_seed() -> None:
    assert gaussian(Noise(2**63 - 1, 1, 0, 1.0), 0) != gaussian(Noise(2**31 - 1, 1, 0, 1.0), 0)


def drift_paths(drift: Drift, steps: int, paths: int) -> np.ndarray:
    """Error after each step, paths x steps x 3."""
    out = np.empty((paths, steps, 3))
    for path in range(paths):
        error = drift_start(drift, Noise(path, 1, 0, 1.0), 1)
        for step in range(steps):
            out[path, step] = error
            error = drift_step(error, drift, Noise(path, 1, step, 1.0), 0)
    return out


def test_constant_bias_stays() -> None:
    paths = drift_paths(Drift(initial=0.3, decay=1.0, drive=0.0), steps=5, paths=400)
    assert np.array_equal(paths[:, 0], paths[:, 4])
    assert abs(paths[:, 0].std() - 0.3) < SIGMAS * 0.3 / (2 * 1200) ** 0.5


def test_random_walk_grows_with_the_root_of_time() -> None:
    paths = drift_paths(Drift(initial=0.0, decay=1.0, drive=0.1), steps=101, paths=400)
    assert abs(paths[:, 100].std() - 1.0) < SIGMAS / (2 * 1200) ** 0.5
    assert abs(paths[:, 25].std() - 0.5) < SIGMAS * 0.5 / (2 * 1200) ** 0.5


def test_correlated_error_keeps_its_size_and_forgets() -> None:
    decay = 0.9
    paths = drift_paths(Drift(1.0, decay, (1.0 - decay**2) ** 0.5), steps=40, paths=400)
    for step in (0, 20, 39):
        assert abs(paths[:, step].std() - 1.0) < SIGMAS / (2 * 1200) ** 0.5
    lag = np.corrcoef(paths[:, 10].ravel(), paths[:, 15].ravel())[0, 1]
    assert abs(lag - decay**5) < SIGMAS / 1200**0.5
