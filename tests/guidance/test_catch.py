"""The leg that falls with a load on a slack cable."""

from __future__ import annotations

import pytest

from autopilot.geometry.linear import ZERO
from autopilot.guidance.legs import CATCH_S, CatchLoad


def test_falling_with_the_load_closes_at_the_speed_asked_or_as_the_gap_needs() -> None:
    catch = CatchLoad(ZERO, 0.7, 0.2)
    below = (0.0, 0.0, -0.69)
    _, v, a, *_ = catch.falling_motion(ZERO, (1.0, 0.0, 3.0), below, (0.0, 0.0, -2.0), 9.81)
    assert v == pytest.approx((1.0, 0.0, -2.0 + 0.2))
    assert a == (0.0, 0.0, -9.81)
    near = (0.0, 0.0, -0.4)
    _, v, *_ = catch.falling_motion(ZERO, ZERO, near, (0.0, 0.0, -2.0), 9.81)
    assert v[2] == pytest.approx(-2.0 + 0.3 / CATCH_S)
