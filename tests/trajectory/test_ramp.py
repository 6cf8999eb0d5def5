"""The ramp between two speeds: smooth everywhere, its own mirror image, and the smoothest of its kind."""

from __future__ import annotations

from math import inf, nextafter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.trajectory.minimum_snap import ROTATION_TIME_S, ROTOR_TIME_S
from autopilot.trajectory.ramp import PARTS, PEAK_RAMP_ACCEL, WAYS, ramp
from autopilot.trajectory.splines import Basis
from tests.trajectory.conftest import Differentiate

# absolute, and relative to the value: of sums of ten products
ROUNDING, RELATIVE_ROUNDING = 1e-10, 1e-11


def test_it_leads_from_rest_to_the_speed_without_a_jump_of_six_derivatives() -> None:
    assert ramp(1.0, 0.0) == (0.0,) * 7
    assert ramp(1.0, 1.0) == pytest.approx((0.5, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0), abs=ROUNDING)
    for part in range(1, PARTS):
        at = part / PARTS
        assert ramp(1.0, nextafter(at, -inf)) == pytest.approx(
            ramp(1.0, at), rel=RELATIVE_ROUNDING, abs=ROUNDING
        )


@given(at=st.floats(0.01, 0.99))
def test_its_derivatives_are_those_of_its_way(differentiate: Differentiate, at: float) -> None:
    found = differentiate(lambda t: ramp(20.0, t)[:6], 20.0 * at)
    assert found == pytest.approx(ramp(20.0, 20.0 * at)[1:], abs=1e-9)


@given(at=st.floats(0.0, 1.0))
def test_it_is_its_own_mirror_image(at: float) -> None:
    there, back = ramp(1.0, at), ramp(1.0, 1.0 - at)
    mirrored = (at - 0.5 + back[0], 1.0 - back[1], *((-1.0) ** n * back[n] for n in range(2, 7)))
    assert there == pytest.approx(mirrored, rel=RELATIVE_ROUNDING, abs=10.0 * ROUNDING)


@given(duration=st.floats(0.1, 100.0), at=st.floats(0.0, 1.0))
def test_its_speed_rises_and_its_acceleration_peaks_halfway(duration: float, at: float) -> None:
    _, speed, accel, *_ = ramp(duration, at * duration)
    assert -1e-12 <= speed <= 1.0 + 1e-12
    peak = PEAK_RAMP_ACCEL / duration
    assert -1e-9 * peak <= accel <= peak * (1.0 + 1e-12)
    assert ramp(duration, 0.5 * duration)[2] == pytest.approx(peak)


def test_of_all_such_splines_it_has_the_least_integral() -> None:
    """The integral by Gauss's rule, exact for these polynomials, as a quadratic form of the coefficients."""
    duration = 7.0
    basis = Basis(0.0, duration, PARTS)
    ends = np.zeros((2, 7, 3))
    ends[1, :2] = [[0.5 * duration], [1.0]]
    coefficients = basis.end_coefficients(ends[0], ends[1])
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = 0.5 * basis.spacing
    values, first = basis.band((basis.breaks[:-1, None] + half * (1.0 + nodes)).ravel(), 8)
    dense = np.zeros((8, len(first), basis.count))
    for i, begin in enumerate(first):
        dense[:, i, begin : begin + 10] = values[:, i]
    weight = np.tile(half * weights, PARTS)[:, None]
    four, six, seven = (dense[n].T @ (weight * dense[n]) for n in (4, 6, 7))
    H = four + ROTATION_TIME_S**4 * (six + ROTOR_TIME_S**2 * seven)
    free = basis.free
    coefficients[free] = np.linalg.solve(H[free, free], -(H @ coefficients)[free])
    table = basis.pieces(coefficients, np.zeros(3))[:, 2:12]
    part_s = duration / PARTS
    assert pytest.approx(table * part_s ** (np.arange(10) - 1.0), abs=1e-9) == WAYS


def test_plain_python_and_machine_code_agree_to_the_bit() -> None:
    for k in range(36):
        assert ramp.py_func(3.5, 0.1 * k) == ramp(3.5, 0.1 * k)
