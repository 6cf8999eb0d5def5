"""What an estimator returns, for plain Python and for compiled methods."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from typing import Any

import numpy as np
from numba.extending import overload

from autopilot.control.records import State
from autopilot.estimation.estimator_exchange import NO_ESTIMATE, NOT_GIVEN, Estimate
from autopilot.geometry.compiler import INLINE_OPTIONS
from autopilot.geometry.linear import Mat3
from autopilot.own.vectors import three_numbers

Numbers = Sequence[float] | np.ndarray[Any, Any]


def estimated(
    x_load: Numbers,
    v_load: Numbers,
    q_cable: Numbers,
    q_cable_dot: Numbers,
    x_quad: Numbers,
    v_quad: Numbers,
    R: Sequence[Numbers] | np.ndarray[Any, Any],
    omega_body: Numbers,
    a_quad: Numbers = NOT_GIVEN,
    tension: float = nan,
    horizontal_std: float = nan,
    vertical_std: float = nan,
) -> Estimate:
    """An estimate: what laws are given as `now.state`, in its order, units and frames.

    Optional are `a_quad` (m/s^2; without it the built-in filter's is used), `tension` of the cable (N) and
    the standard deviations of the vehicle's position (m, each axis, 0 or more), which are reported to ground
    stations.
    """
    state = State(
        three_numbers(x_load, "x_load"),
        three_numbers(v_load, "v_load"),
        three_numbers(q_cable, "q_cable"),
        three_numbers(q_cable_dot, "q_cable_dot"),
        three_numbers(x_quad, "x_quad"),
        three_numbers(v_quad, "v_quad"),
        _matrix(R),
        three_numbers(omega_body, "omega_body"),
        three_numbers(a_quad, "a_quad"),
    )
    return Estimate(True, state, float(tension), float(horizontal_std), float(vertical_std))


def no_estimate() -> Estimate:
    """No estimate yet: until the first one, the built-in filter's is used, and arming is refused."""
    return NO_ESTIMATE


def _matrix(rows: Any) -> Mat3:
    if np.shape(rows) != (3, 3):
        shape = " x ".join(map(str, np.shape(rows))) or "1"
        raise ValueError(f"R has {shape} numbers; must be 3 x 3")
    first, second, third = (three_numbers(row, "a row of R") for row in rows)
    return (first, second, third)


@overload(estimated, jit_options=INLINE_OPTIONS)
def _estimated(
    x_load: Any,
    v_load: Any,
    q_cable: Any,
    q_cable_dot: Any,
    x_quad: Any,
    v_quad: Any,
    R: Any,
    omega_body: Any,
    a_quad: Any = NOT_GIVEN,
    tension: Any = nan,
    horizontal_std: Any = nan,
    vertical_std: Any = nan,
) -> Any:
    def implement(
        x_load: Any,
        v_load: Any,
        q_cable: Any,
        q_cable_dot: Any,
        x_quad: Any,
        v_quad: Any,
        R: Any,
        omega_body: Any,
        a_quad: Any = NOT_GIVEN,
        tension: Any = nan,
        horizontal_std: Any = nan,
        vertical_std: Any = nan,
    ) -> Any:
        state = State(x_load, v_load, q_cable, q_cable_dot, x_quad, v_quad, R, omega_body, a_quad)
        return Estimate(True, state, tension, horizontal_std, vertical_std)

    return implement


@overload(no_estimate, jit_options=INLINE_OPTIONS)
def _no_estimate() -> Any:
    def implement() -> Any:
        return NO_ESTIMATE

    return implement
