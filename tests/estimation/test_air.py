"""How strong the gusts on the load are, as the estimator learns it from its own estimate of them."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from numpy.typing import NDArray

from autopilot.control.drag import GUST_RANDOM_WALK, GUST_TIME_S
from autopilot.estimation.air import air_walk, predict_air
from autopilot.estimation.covariance import decay_factor
from autopilot.estimation.records import AIR, CAMERA, PADDED_SIZE, TRACKER, blank_state
from autopilot.geometry.linear import ZERO
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import truth_of
from tests.doubles.motion import bebop_tuning

TICK_S = 0.02
WIND = 0.5  # m/s^2, mean acceleration of the load by the wind
TUNING = bebop_tuning()._replace(air_walk=0.003, load_drag=0.0)
TAUT = blank_state().load._replace(
    taut=1.0, source=TRACKER, v_load=ZERO, age_s=0.0, tautness_age_s=float("inf")
)


@pytest.mark.parametrize("acceleration", ["EST_AIR", "EST_PUSH"])
def test_an_acceleration_by_the_air_returns_to_zero_with_all_parameters_that_are_allowed(
    acceleration: str,
) -> None:
    """With a deviation of 1e-6 m/s^2 the state grew 18,000 times from sample to sample."""
    table = autopilot_parameters(load_vehicle("bebop"))
    std, walk = table.describe(f"{acceleration}_STD"), table.describe(f"{acceleration}_WALK")
    slowest_s = 1.0 / sim_parameters(truth_of(load_vehicle("bebop"))).describe("SIM_RATE_HZ").low
    assert 0.0 <= decay_factor(std.low, walk.high, slowest_s) < 1.0
    assert decay_factor(std.high, walk.low, slowest_s) == 1.0


def covariance(air_std: float) -> NDArray[np.float64]:
    """A covariance that states `air_std` (m/s^2) on each axis of the load's acceleration by the air."""
    P = np.zeros((PADDED_SIZE, PADDED_SIZE))
    P[AIR, AIR] = P[AIR + 1, AIR + 1] = air_std**2
    return P


def learned_walk(gust_std: float, air_std: float = 0.0) -> float:
    """The walk after ten minutes of gusts of this standard deviation on each axis, m/s^2 / sqrt(s); the mean
    over the last nine."""
    random, air = np.random.default_rng(5), blank_state().air
    share = TICK_S / GUST_TIME_S
    gust, squares, P = np.zeros(2), [], covariance(air_std)
    for tick in range(round(600.0 / TICK_S)):
        gust += -share * gust + gust_std * sqrt(2.0 * share) * random.normal(size=2)
        blown = air._replace(load_accel=(WIND + gust[0], gust[1]))
        air = predict_air(blown, TAUT, TAUT, P, 1.0, TUNING, TICK_S)
        if tick * TICK_S > 60.0:
            squares.append(air_walk(TAUT, air, ZERO, TUNING) ** 2)
    return sqrt(float(np.mean(squares)))


def test_steady_wind_walks_no_faster_than_configured() -> None:
    assert learned_walk(0.0) == pytest.approx(TUNING.air_walk, rel=1e-3)


@pytest.mark.parametrize("gust_std", [0.02, 0.05])
def test_gusts_walk_as_fast_as_they_do(gust_std: float) -> None:
    walk2 = 2.0 * gust_std**2 / GUST_TIME_S + TUNING.air_walk**2
    assert learned_walk(gust_std) == pytest.approx(sqrt(walk2), rel=0.1)


def test_gusts_that_noise_explains_are_not_learned() -> None:
    # the mean over 4 s leaves 2/3 of a gust's variance, and noise explains 0.06 of the stated variance
    explained_std = sqrt(0.06 / (2.0 / 3.0)) * 0.1
    assert learned_walk(0.3 * explained_std, 0.1) < 1.1 * TUNING.air_walk
    gust_std = 2.0 * explained_std
    walk2 = 2.0 * (gust_std**2 - explained_std**2) / GUST_TIME_S + TUNING.air_walk**2
    assert learned_walk(gust_std, 0.1) == pytest.approx(sqrt(walk2), rel=0.15)


def test_wind_that_a_lifted_load_meets_is_no_gust() -> None:
    air = blank_state().air._replace(load_accel=(WIND, 0.0))
    for tick in range(round(1.0 / TICK_S)):
        lifted = TAUT._replace(tautness_age_s=(tick + 1) * TICK_S)
        air = predict_air(
            air._replace(load_accel=(WIND, 0.0)), lifted, lifted, covariance(0.0), 1.0, TUNING, TICK_S
        )
    assert air.mean_accel[0] == pytest.approx(WIND, rel=0.03)
    assert air_walk(TAUT, air, ZERO, TUNING) < 0.2 * GUST_RANDOM_WALK * WIND


def test_the_wind_limits_what_is_believed_of_gusts() -> None:
    air = blank_state().air._replace(load_accel=(WIND, 0.0), gust_variance=1.0)
    assert air_walk(TAUT, air, ZERO, TUNING) == pytest.approx(GUST_RANDOM_WALK * WIND, rel=1e-3)


def test_gusts_on_a_load_that_no_sensor_observed_are_not_learned() -> None:
    air = blank_state().air._replace(load_accel=(WIND, 0.0), gust_variance=1.0)
    unobserved = TAUT._replace(source=CAMERA, age_s=float("inf"))
    assert air_walk(unobserved, air, ZERO, TUNING) == TUNING.air_walk


def test_the_push_on_the_vehicle_grows_with_the_drag_of_its_rotors() -> None:
    air = blank_state().air._replace(vehicle_accel=(2.0, -1.0))
    grown = predict_air(air, TAUT, TAUT, covariance(0.0), 1.25, TUNING, TICK_S)
    assert grown.vehicle_accel == pytest.approx((2.5, -1.25), rel=1e-3)
