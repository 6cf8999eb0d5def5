"""The rest-to-rest transfer against its own definition, in exact arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from autopilot.geometry.linear import ZERO, norm, scale, sub
from autopilot.trajectory.ramp import PEAK_RAMP_ACCEL
from autopilot.trajectory.reeling import straight_way
from autopilot.trajectory.transfer import (
    PEAK_ACCELERATION,
    PEAK_SPEED,
    Pace,
    lift_pace,
    pace,
    transfer,
    transfer_duration,
)

P0, P1 = (1.0, -2.0, 3.0), (4.0, 2.0, 2.5)
# Horner with alternating coefficients up to 24024 on half the interval leaves some twelve digits, relative
# to the peak of each derivative.
RELATIVE_ROUNDING = 1e-11

u = sp.Symbol("u")


def smoothstep() -> sp.Expr:
    """Slope proportional to u^6 (1 - u)^6, normalised to rise by one."""
    slope = u**6 * (1 - u) ** 6
    return sp.integrate(sp.expand(slope / sp.integrate(slope, (u, 0, 1))), u)


def test_position_and_derivatives_are_those_of_the_polynomial() -> None:
    s, duration = smoothstep(), 3.5
    path = np.subtract(P1, P0)
    for order in range(7):
        derivative = sp.lambdify(u, sp.expand(sp.diff(s, u, order)))
        peak = max(abs(float(derivative(sp.Rational(k, 60)))) for k in range(61))
        for k in range(0, 71, 3):
            exact = float(derivative(sp.Rational(k, 70)))
            expected = path * exact / duration**order + (np.array(P0) if order == 0 else 0.0)
            found = transfer(P0, P1, duration, duration * k / 70)[order]
            assert np.allclose(found, expected, rtol=0.0, atol=RELATIVE_ROUNDING * 5.0 * peak), (order, k)


@pytest.mark.parametrize("t", [-1.0, 0.0, 3.5, 99.0])
def test_outside_it_rests_at_the_ends(t: float) -> None:
    jet = transfer(P0, P1, 3.5, t)
    assert jet[0] == (P0 if t <= 0.0 else P1)
    assert all(component == 0.0 for derivative in jet[1:] for component in derivative)


def test_no_way_to_go_takes_no_time() -> None:
    assert transfer_duration(0.0, 2.0, 1.0) == 0.0
    assert transfer(P0, P0, 0.0, 0.0)[0] == P0


def test_the_peak_factors_are_the_extremes_of_the_polynomial() -> None:
    s = smoothstep()
    assert float(sp.diff(s, u).subs(u, sp.Rational(1, 2))) == PEAK_SPEED
    where = (1 - 1 / sp.sqrt(11)) / 2
    assert sp.simplify(sp.diff(s, u, 3).subs(u, where)) == 0
    assert float(sp.diff(s, u, 2).subs(u, where)) == pytest.approx(PEAK_ACCELERATION, rel=1e-15)


@given(distance=st.floats(0.01, 100.0), speed=st.floats(0.1, 10.0), accel=st.floats(0.1, 10.0))
def test_speed_and_acceleration_stay_within_and_one_is_reached(
    distance: float, speed: float, accel: float
) -> None:
    duration = transfer_duration(distance, speed, accel)
    jets = [
        transfer((0.0, 0.0, 0.0), (distance, 0.0, 0.0), duration, duration * k / 400.0) for k in range(401)
    ]
    fastest = max(abs(jet[1][0]) for jet in jets) / speed
    hardest = max(abs(jet[2][0]) for jet in jets) / accel
    assert max(fastest, hardest) <= 1.0 + 1e-9
    # 400 samples miss a peak by less than this
    assert max(fastest, hardest) >= 0.999


@given(t=st.floats(0.0, 3.5))
def test_it_moves_one_way_only(t: float) -> None:
    jet = transfer(P0, P1, 3.5, t)
    # |p1 - p0| is 5.02 m
    assert -1e-12 <= np.dot(np.subtract(jet[0], P0), np.subtract(P1, P0)) / 25.25 <= 1.0 + 1e-12
    assert np.dot(jet[1], np.subtract(P1, P0)) >= 0.0


@pytest.mark.parametrize("at_pace", [pace, lift_pace])
@given(
    distance=st.floats(0.01, 3000.0),
    speed=st.floats(0.1, 20.0),
    accel=st.floats(0.1, 10.0),
    min_move=st.floats(0.0, 15.0),
)
def test_a_paced_way_keeps_to_its_limits(
    at_pace: Callable[..., Pace], distance: float, speed: float, accel: float, min_move: float
) -> None:
    duration, ramp = at_pace(distance, speed, accel, min_move)
    assert duration >= min_move and (ramp == 0.0 or min_move <= ramp <= 0.5 * duration * (1.0 + 1e-12))
    way = (0.6 * distance, 0.0, -0.8 * distance)
    share = np.linspace(0.0, 1.0, 401)
    times = np.concatenate([ramp * share, duration - ramp * share]) if ramp > 0.0 else duration * share
    jets = [straight_way(ZERO, way, duration, ramp, t) for t in times.tolist()]
    assert max(norm(jet[1]) for jet in jets) <= speed * (1.0 + 1e-9)
    assert max(norm(jet[1]) for jet in jets) == pytest.approx(Pace(duration, ramp).peak_speed(distance))
    assert max(norm(jet[2]) for jet in jets) <= accel * (1.0 + 1e-9)
    assert straight_way(ZERO, way, duration, ramp, duration)[0] == way
    assert (
        norm(sub(straight_way(ZERO, way, duration, ramp, 0.5 * duration)[0], scale(0.5, way)))
        < 1e-9 * distance
    )


def test_a_way_takes_little_longer_than_at_full_speed() -> None:
    for distance in (50.0, 1000.0):
        assert pace(distance, 5.0, 1.5, 2.0) == Pace(
            pytest.approx(distance / 5.0 + PEAK_RAMP_ACCEL * 5.0 / 1.5), PEAK_RAMP_ACCEL * 5.0 / 1.5
        )
    assert lift_pace(1000.0, 5.0, 1.5).duration_s == pytest.approx(1000.0 / 5.0 + PEAK_SPEED * 5.0 / 1.5)


def test_a_short_way_is_flown_along_the_polynomial_where_that_is_quicker() -> None:
    """Each of two ramps, too, takes the time of the least move."""
    alone = Pace(transfer_duration(1.5, 1.5, 1.5))
    assert 2.0 < alone.duration_s < 4.0
    assert pace(1.5, 1.5, 1.5, 2.0) == alone
    assert pace(0.05, 1.5, 1.5, 2.0) == Pace(2.0)
    assert pace(2.2, 1.5, 1.5, 2.0) == Pace(4.0, 2.0)
    assert pace(1.5, 1.5, 1.5).ramp_s > 0.0, "without it two ramps are quicker"


@pytest.mark.parametrize("at_pace", [pace, lift_pace])
@given(speed=st.floats(0.1, 20.0), accel=st.floats(0.1, 10.0), min_move=st.floats(0.0, 15.0))
def test_a_longer_way_takes_longer(
    at_pace: Callable[..., Pace], speed: float, accel: float, min_move: float
) -> None:
    """Also from a way on the polynomial to one with constant speed."""
    distances = np.geomspace(0.01, 3000.0, 400).tolist()
    durations = [at_pace(distance, speed, accel, min_move).duration_s for distance in distances]
    assert all(after >= before * (1.0 - 1e-12) for before, after in pairwise(durations))
    # nowhere by more than in proportion to the way
    assert all(after <= 1.04 * before for before, after in pairwise(durations))


def test_a_lift_that_is_slower_so_that_longer_ones_take_no_less_time() -> None:
    ways = [lift_pace(distance, 2.0, 1.5) for distance in (6.0, 8.0, 11.0, 14.0)]
    assert ways[0].ramp_s == 0.0
    assert ways[1].duration_s == ways[2].duration_s == pytest.approx(10.0)
    assert ways[3].duration_s == pytest.approx(14.0 / 2.0 + PEAK_SPEED * 2.0 / 1.5)


def test_a_stretched_way_keeps_its_shape() -> None:
    usual = pace(300.0, 5.0, 1.5)
    slow = usual.stretched(2.0 * usual.duration_s)
    assert Pace(0.0).stretched(5.0) == Pace(0.0), "no way takes no time"
    assert usual.stretched(1.0) == usual and slow.ramp_s == pytest.approx(2.0 * usual.ramp_s)
    for share in (0.05, 0.3, 0.8):
        at = [straight_way(P0, P1, *one, share * one.duration_s)[0] for one in (usual, slow)]
        assert at[0] == pytest.approx(at[1], abs=1e-12)


def test_plain_python_and_machine_code_agree_to_the_bit() -> None:
    for k in range(36):
        assert transfer.py_func(P0, P1, 3.5, 0.1 * k) == transfer(P0, P1, 3.5, 0.1 * k)
