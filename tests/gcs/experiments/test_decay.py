"""The fitted bound alpha e^(-beta t), on errors whose decay is known."""

from __future__ import annotations

import numpy as np
import pytest

from gcs.experiments.decay import decay_of, fit_bound
from tests.gcs.experiments import tolerances

T = np.arange(0.0, 6.0, 0.008)
REST_S = 10.0


@pytest.mark.parametrize("beta", [0.3, 1.0, 2.5, 8.0])
def test_of_an_exponential_it_finds_rate_and_scale(beta):
    rate, scale = fit_bound(T, 0.2 * np.exp(-beta * T), 1e-9)
    assert rate == pytest.approx(beta, rel=tolerances.FIT_EXACT)
    assert scale == pytest.approx(0.2, rel=tolerances.FIT_EXACT)


@pytest.mark.parametrize(("beta", "omega"), [(0.5, 9.0), (1.5, 6.0), (3.0, 12.0)])
def test_a_swing_is_judged_by_its_crests(beta, omega):
    values = np.abs(0.3 * np.cos(omega * T)) * np.exp(-beta * T)
    rate, scale = fit_bound(T, values, 1e-9)
    assert rate == pytest.approx(beta, rel=tolerances.FIT_SWING)
    fitted = np.log(1e3) / beta - 1.0 / beta > T
    assert (values[fitted] <= scale * np.exp(-rate * T[fitted]) * (1.0 + tolerances.TOUCH)).all()


def test_what_grows_before_it_decays_is_fitted_from_its_peak():
    values = T * np.exp(-2.0 * T)
    rate, _ = fit_bound(T, values, 1e-9)
    assert 1.0 < rate < 2.0  # slower than the exponential at first, never faster


def test_the_tail_of_rounding_does_not_decide():
    noise = 1e-6 * np.random.default_rng(1).random(len(T))
    rate, _ = fit_bound(T, np.exp(-4.0 * T) + noise, 2e-6)
    assert rate == pytest.approx(4.0, rel=0.02)  # the noise is 1e-3 of the smallest fitted value


def test_nothing_above_the_resolution_has_no_rate():
    assert fit_bound(T, np.full(len(T), 1e-6), 1e-6) == (None, None)
    decay = decay_of(T + REST_S, np.full(len(T), 1e-6), REST_S, 1e-6)
    assert decay.rate_1_s is None
    assert decay.decays is True


def test_an_error_that_stays_does_not_decay():
    decay = decay_of(T + REST_S, 0.1 + 0.2 * np.exp(-3.0 * T), REST_S, 1e-6)
    assert decay.decays is False
    assert decay.final == pytest.approx(0.1, rel=1e-3)
    assert decay.greatest == pytest.approx(0.3)


def test_greatest_is_that_of_the_whole_mission_and_the_fit_that_of_the_rest():
    time_s = np.arange(0.0, 16.0, 0.008)
    values = np.where(time_s < REST_S, 5.0, np.exp(-(time_s - REST_S)))
    decay = decay_of(time_s, values, REST_S, 1e-9)
    assert decay.greatest == 5.0
    assert decay.rate_1_s == pytest.approx(1.0, rel=1e-6)
    assert decay.decays is True


def test_a_flight_lost_before_the_rest_decays_not_and_one_without_samples_is_unknown():
    lost = decay_of(T, np.exp(T), REST_S, 1e-9)
    assert (lost.decays, lost.rate_1_s) == (False, None)
    assert decay_of(np.zeros(0), np.zeros(0), 0.0, 1e-9) == (None,) * 5
