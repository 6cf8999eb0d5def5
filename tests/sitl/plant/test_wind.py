"""Gusts and drag."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sitl.plant.by_value import advance_many
from sitl.plant.wind import gust

CALM = (0.0, 0.0, 0.0)


@pytest.mark.parametrize("h", [4e-3, 40e-3])
def test_gusts_have_the_deviation_and_correlation_asked_for(h):
    rng = np.random.default_rng(5)
    deviation, time = 1.5, 0.5
    series, now = [], CALM
    for normals in rng.standard_normal((int(2000.0 / h), 3)):
        now = gust(now, deviation, time, h, tuple(map(float, normals)))
        series.append(now)
    series = np.array(series)
    # 2000 s hold 2000 independent samples of each axis: 3 axes, three sigma of the estimate is 4 %
    assert series.std() == pytest.approx(deviation, rel=0.04)
    lag = round(time / h)
    correlation = (series[:-lag] * series[lag:]).mean() / series.var()
    assert correlation == pytest.approx(math.exp(-1.0), abs=0.05)


def test_no_deviation_is_no_gust():
    assert gust(CALM, 0.0, 1.0, 4e-3, (1.0, -2.0, 3.0)) == CALM


def test_falling_in_still_air_reaches_terminal_speed(bebop, aloft):
    """Both hang on the cable: the drag of both carries the weight of both."""
    state = advance_many(aloft(bebop, height=2000.0), bebop, (0.0,) * 4, CALM, 4e-3, 5000)
    v = -state.v_load[2]
    drag = bebop.quad_drag * v + (bebop.quad_drag_quadratic + bebop.load_drag_quadratic) * v * v
    assert state.taut == 1.0
    assert drag == pytest.approx((bebop.quad_mass + bebop.load_mass) * bebop.gravity, rel=1e-6)


def test_wind_carries_the_pair_along(bebop, aloft):
    """Hovering level in wind, vehicle and load end with the speed of the wind."""
    hover = 0.25 * (bebop.quad_mass + bebop.load_mass) * bebop.gravity
    start = aloft(bebop, rotor_force=(hover,) * 4)
    state = advance_many(start, bebop, (hover,) * 4, (3.0, -1.0, 0.0), 4e-3, 50_000)
    assert state.v_quad == pytest.approx((3.0, -1.0, 0.0), abs=0.05)
    assert state.v_load == pytest.approx((3.0, -1.0, 0.0), abs=0.05)
