"""The margin tool: its linear model against the independent model, its margins against published ones."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from autopilot.control.linear_model import LOAD_STATES, load_state_space
from benchmarks import cascade_margin

LINEAR = 1e-7  # central differences with step 1e-5 of equations whose third derivatives are of order 100


def test_linear_model_is_that_of_the_equations(model: SimpleNamespace) -> None:
    vehicle, h = cascade_margin.BEBOP, 1e-5
    A, B = load_state_space(vehicle)
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity

    def rates(motion: np.ndarray, u: np.ndarray) -> np.ndarray:
        s = cascade_margin.state_near_hover(motion, vehicle)
        w = np.cross(s.q_cable, s.q_cable_dot)
        d = model.rates(model.pack(s.x_load, s.v_load, s.q_cable, w, s.R, s.omega_body), u[0], u[1:], vehicle)
        q_ddot = np.cross(d[9:12], s.q_cable) + np.cross(w, s.q_cable_dot)
        return np.concatenate([d[0:6], d[6:8], q_ddot[0:2], motion[13:16], d[21:24]])

    u0 = np.array([weight, 0.0, 0.0, 0.0])
    for j in range(LOAD_STATES):
        step = h * np.eye(LOAD_STATES)[j]
        column = (rates(step, u0) - rates(-step, u0)) / (2 * h)
        np.testing.assert_allclose(A[:, j], column, atol=LINEAR * 100)
    zero = np.zeros(LOAD_STATES)
    for j in range(4):
        step = h * np.eye(4)[j]
        np.testing.assert_allclose(
            B[:, j], (rates(zero, u0 + step) - rates(zero, u0 - step)) / (2 * h), rtol=1e-6
        )


@pytest.mark.parametrize(
    ("k_R", "k_Omega", "J", "crossover", "delay"),
    [(1.5, 0.35, 0.02, 18.0, 0.074), (2.4, 0.35, 0.0023, 152.0, 0.0100), (0.25, 0.025, 6.0e-4, 42.7, 0.0314)],
)
def test_published_delay_margins(
    k_R: float, k_Omega: float, J: float, crossover: float, delay: float
) -> None:
    """(k_Omega s + k_R)/(J s^2) with ideal rotors, for three published sets of gains. Holding a command for a
    period costs half a period of delay; the printed figures have two or three digits."""
    period = 0.02 / crossover
    gains = cascade_margin.thesis.THESIS_GAINS._replace(k_R=(k_R,) * 3, k_Omega=(k_Omega,) * 3)
    vehicle = cascade_margin.BEBOP._replace(inertia=(J, J, J))
    result = cascade_margin.margin(cascade_margin.Settings(0.0, period, 0.0, "attitude", gains), vehicle)
    assert result.crossover == pytest.approx(crossover, rel=0.01)
    assert result.delay == pytest.approx(delay - 0.5 * period, rel=0.02)


def test_margin_ends_where_the_loop_is_lost() -> None:
    """With the remaining delay that was reported, the loop is still stable; with a little more it is not."""
    settings = cascade_margin.Settings(rotor_tau=0.02, period=0.004)
    left = cascade_margin.margin(settings).delay
    law = cascade_margin.linearised_law(settings, cascade_margin.BEBOP)
    for delay, holds in ((left, True), (left + 2e-4, False)):
        closed = cascade_margin.closed_loop(
            cascade_margin.plant_of(settings, cascade_margin.BEBOP, delay), law, np.ones(4)
        )
        assert (cascade_margin.radius(closed) < cascade_margin.UNSTABLE_RADIUS) is holds
