"""The commands that a law may give, for plain Python and for compiled methods."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numba.extending import overload

from autopilot.control.law_exchange import ATTITUDE, FORCE, RATES, WRENCH, Asked
from autopilot.geometry.compiler import INLINE_OPTIONS
from autopilot.geometry.linear import IDENTITY, ZERO
from autopilot.own.vectors import one_number, three_numbers


def wrench(thrust: float, moment: Sequence[float]) -> Asked:
    """Thrust (N) along the body's upward axis and moment (N m, body), as they go to the mixer."""
    return Asked(WRENCH, one_number(thrust, "the thrust"), three_numbers(moment, "the moment"), IDENTITY)


def force(F: Sequence[float]) -> Asked:
    """A force of the rotors (N, world): the built-in attitude loop turns the thrust axis to it, and the
    heading to the direction of the reference."""
    return Asked(FORCE, 0.0, three_numbers(F, "the force"), IDENTITY)


def attitude(R_d: Sequence[Sequence[float]], thrust: float) -> Asked:
    """An attitude (rows of the matrix from body to world), which the built-in loop holds, and a thrust
    (N)."""
    if len(R_d) != 3:
        raise ValueError(f"the attitude has {len(R_d)} rows; must be 3 rows of 3 numbers")
    first, second, third = (three_numbers(row, "a row of the attitude") for row in R_d)
    return Asked(ATTITUDE, one_number(thrust, "the thrust"), ZERO, (first, second, third))


def rates(thrust: float, omega_d: Sequence[float]) -> Asked:
    """Thrust (N) and body rate (rad/s, body), which the built-in loop holds."""
    return Asked(RATES, one_number(thrust, "the thrust"), three_numbers(omega_d, "the rate"), IDENTITY)


@overload(wrench, jit_options=INLINE_OPTIONS)
def _wrench(thrust: Any, moment: Any) -> Any:
    def implement(thrust: Any, moment: Any) -> Any:
        return Asked(WRENCH, thrust, moment, IDENTITY)

    return implement


@overload(force, jit_options=INLINE_OPTIONS)
def _force(F: Any) -> Any:
    def implement(F: Any) -> Any:
        return Asked(FORCE, 0.0, F, IDENTITY)

    return implement


@overload(attitude, jit_options=INLINE_OPTIONS)
def _attitude(R_d: Any, thrust: Any) -> Any:
    def implement(R_d: Any, thrust: Any) -> Any:
        return Asked(ATTITUDE, thrust, ZERO, R_d)

    return implement


@overload(rates, jit_options=INLINE_OPTIONS)
def _rates(thrust: Any, omega_d: Any) -> Any:
    def implement(thrust: Any, omega_d: Any) -> Any:
        return Asked(RATES, thrust, omega_d, IDENTITY)

    return implement
