"""What a cable that comes taut tells of the height of a vehicle with a receiver."""

from __future__ import annotations

from math import cos, radians, sin, sqrt

import pytest

from autopilot.estimation.history import store_state
from autopilot.estimation.measurements.tautening import GROUND_LOAD_HEIGHT_STD, correct_tautening
from autopilot.estimation.records import (
    AIDED_SIZE,
    CAMERA,
    POSITION,
    RECEIVER,
    VELOCITY,
    EstimatorState,
    blank_state,
    new_history,
)
from autopilot.estimation.tautness import HELD_SIGMAS, LIFTED_HEIGHT, cable_is_unloaded
from tests.doubles.motion import bebop_tuning

TUNING = bebop_tuning()
WEIGHT = TUNING.load_mass * TUNING.gravity
DT = 0.004
LAY = 0.02
HEIGHT_STD, SPEED_STD = 0.1, 0.03


def pulling(error_m: float, climb: float = 0.0, slant_deg: float = 0.0, pull: float = 0.7) -> EstimatorState:
    """A vehicle whose estimated height is too great by this error over a load on the ground, and which
    climbs; its cable is taut and pulls with this share of the load's weight."""
    slant, length = radians(slant_deg), TUNING.cable_length
    q = (sin(slant), 0.0, -cos(slant))
    x_quad = (0.0, 0.0, LAY + length * cos(slant) + error_m)
    state = blank_state()
    load = state.load._replace(
        x_load=(length * q[0], 0.0, LAY + error_m),
        v_load=(0.0, 0.0, climb),
        q_cable=q,
        across=(cos(slant), 0.0, sin(slant)),
        length=length,
        taut=1.0,
        tension=WEIGHT,
        pull=pull * WEIGHT,
        tautness_age_s=1.0,
        age_s=0.1,
        source=CAMERA,
        laid_height=LAY,
    )
    vehicle = state.vehicle._replace(x_quad=x_quad, v_quad=(0.0, 0.0, climb), source=RECEIVER)
    return state._replace(vehicle=vehicle, load=load, size=AIDED_SIZE)


def corrected(state: EstimatorState, comes_taut: bool, laid_std: float = 0.0) -> tuple[float, float, float]:
    """Changes of height and climb rate, and the deviation of the height after the correction."""
    history = new_history()
    history.covariance[POSITION + 2, POSITION + 2] = HEIGHT_STD**2
    history.covariance[VELOCITY + 2, VELOCITY + 2] = SPEED_STD**2
    state = state._replace(load=state.load._replace(laid_height_var=laid_std**2))
    store_state(state, history)
    before = state.load._replace(x_load=(0.0, 0.0, LAY), taut=0.0 if comes_taut else 1.0)
    vehicle, was = correct_tautening(state, history, before, TUNING, DT).vehicle, state.vehicle
    return (
        vehicle.x_quad[2] - was.x_quad[2],
        vehicle.v_quad[2] - was.v_quad[2],
        sqrt(history.covariance[POSITION + 2, POSITION + 2]),
    )


@pytest.mark.parametrize("error_m", [0.2, -0.2])
def test_the_height_is_measured_as_well_as_the_place_of_the_load_is_known(error_m: float) -> None:
    for laid_std in (0.0, 0.06):
        std = sqrt(laid_std**2 + GROUND_LOAD_HEIGHT_STD**2)
        change, _, left = corrected(pulling(error_m), True, laid_std)
        assert left == pytest.approx(std, rel=1e-6)
        assert change == pytest.approx(-error_m * (1.0 - (std / HEIGHT_STD) ** 2), rel=1e-6)


def test_a_load_whose_place_is_known_no_better_than_the_height_tells_nothing_of_it() -> None:
    """It was set down by a vehicle whose height was as uncertain as now. Each time the cable of such a load
    came taut, the height was called known to 0.02 m."""
    assert corrected(pulling(0.2), True, HEIGHT_STD)[::2] == (0.0, pytest.approx(HEIGHT_STD))


@pytest.mark.parametrize(("slant_deg", "measures"), [(20.0, True), (30.0, False)])
def test_a_slanted_cable_does_not_measure_the_height(slant_deg: float, measures: bool) -> None:
    assert (corrected(pulling(0.1, slant_deg=slant_deg), True)[0] != 0.0) == measures


def test_a_load_that_hangs_when_its_cable_is_noticed_does_not_measure_the_height() -> None:
    assert corrected(pulling(LIFTED_HEIGHT + HELD_SIGMAS * HEIGHT_STD + 0.01), True) == (0.0, 0.0, HEIGHT_STD)


@pytest.mark.parametrize(
    ("height_m", "climb", "rests"),
    [
        (0.0, 0.1, True),
        (0.0, 0.3, False),
        (LIFTED_HEIGHT + HELD_SIGMAS * HEIGHT_STD - 0.01, 0.1, True),
        (LIFTED_HEIGHT + HELD_SIGMAS * HEIGHT_STD + 0.01, 0.1, False),
    ],
)
def test_a_load_that_rises_is_not_taken_for_one_at_rest(height_m: float, climb: float, rests: bool) -> None:
    """In wind the cable may seem to pull with less than the weight of the load that it lifts: its climb was
    called none, and the vehicle flew 3 m too high."""
    change = corrected(pulling(height_m, climb), False)[1]
    assert (change < 0.0) == rests


def test_a_load_above_the_ground_hangs_however_little_its_cable_pulls() -> None:
    history = new_history()
    assert cable_is_unloaded(pulling(LIFTED_HEIGHT - 0.01).load, history, 0.0, 0.0)
    assert not cable_is_unloaded(pulling(LIFTED_HEIGHT + 0.01).load, history, 0.0, 0.0)
    history.covariance[POSITION + 2, POSITION + 2] = 0.01**2
    assert cable_is_unloaded(pulling(LIFTED_HEIGHT + 0.01).load, history, 0.0, 0.0)
