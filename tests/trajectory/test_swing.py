"""The direction of an attitude run."""

from __future__ import annotations

from math import cos, pi, radians, sin

import numpy as np
import pytest

from autopilot.trajectory.swing import swing_direction

NORTH, EAST, DURATION = radians(12.0), radians(-5.0), 1.5
RUN = (NORTH, EAST, DURATION)


def test_it_leans_by_the_angle_and_towards_the_side_asked() -> None:
    for t in (0.2, 0.75, 1.4):
        u, _, _ = swing_direction(*RUN, t)
        tilt = np.hypot(NORTH, EAST)
        theta = tilt * sin(pi * t / DURATION) ** 2
        expected = (sin(theta) * EAST / tilt, sin(theta) * NORTH / tilt, cos(theta))
        assert np.allclose(u, expected, rtol=0.0, atol=1e-15)


def test_its_derivatives_are_derivatives(differentiate) -> None:
    for t in (0.3, 0.75, 1.1):
        _, u_dot, u_ddot = swing_direction(*RUN, t)
        # eighth-order difference at 4.2 rad/s
        assert np.allclose(
            differentiate(lambda s: swing_direction(*RUN, s)[0], t), u_dot, rtol=0.0, atol=1e-10
        )
        assert np.allclose(
            differentiate(lambda s: swing_direction(*RUN, s)[1], t), u_ddot, rtol=0.0, atol=1e-9
        )


@pytest.mark.parametrize("t", [-1.0, 0.0, DURATION, 9.0])
def test_outside_it_is_upright_and_at_rest(t: float) -> None:
    assert swing_direction(*RUN, t) == ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_no_tilt_is_no_division_by_zero() -> None:
    assert swing_direction(0.0, 0.0, DURATION, 0.7)[0] == (0.0, 0.0, 1.0)
