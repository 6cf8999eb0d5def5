"""The command filter (4-2), (4-3): a command passed through a second-order low pass, with two derivatives.

| symbol    | code name | frame | unit    | equation |
|-----------|-----------|-------|---------|----------|
| x_c^o     | u         | any   | u       | (4-2)    |
| x_1 = x_c | x1        | any   | u       | (4-2)    |
| x_2       | x2        | any   | u/s     | (4-2)    |
| omega_n   | omega_n   |       | rad/s   | (4-3)    |
| zeta      | zeta      |       |         | (4-3)    |

    x_1' = x_2,    x_2' = -2 zeta omega_n x_2 - omega_n^2 (x_1 - x_c^o)

The printed (4-2) lacks the `x_2` after `-2 zeta omega_n`; the transfer function (4-3) has it.

Discretised exactly for a command that changes linearly from one sample to the next (first-order hold): the
output at a sample is then the output of the continuous filter. A zero-order hold would add half a period of
lag, which the attitude loop cannot afford. Along a ramp of slope s the steady motion of the filter is
u - 2 zeta s / omega_n; the difference from it decays by the matrix exponential, whose four entries are
computed once, outside the loop.
"""

from __future__ import annotations

from math import cos, cosh, exp, sin, sinh, sqrt
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, axpy, scale, sub


class FilterConstants(NamedTuple):
    """One filter at one period: entries of exp(A dt), the lag on a ramp (s), and the numbers of (4-2)."""

    p11: float
    p12: float
    p21: float
    p22: float
    ramp_lag: float  # 2 zeta / omega_n, s
    rate: float  # 1 / dt, 1/s
    damping: float  # 2 zeta omega_n, 1/s
    stiffness: float  # omega_n^2, 1/s^2


class FilterState(NamedTuple):
    """Memory of one filter of a vector: the last command, x_1 and x_2."""

    u: Vec3
    x1: Vec3
    x2: Vec3


def filter_constants(omega_n: float, zeta: float, dt: float) -> FilterConstants:
    """Constants of the filter with natural frequency omega_n (rad/s) and damping zeta, stepped every dt
    (s)."""
    if not (omega_n > 0.0 and zeta > 0.0 and dt > 0.0):
        raise ValueError(
            f"command filter: omega_n = {omega_n} rad/s, zeta = {zeta}, dt = {dt} s; all three must be > 0"
        )
    decay = zeta * omega_n
    turn = omega_n * sqrt(abs(1.0 - zeta * zeta))
    angle = turn * dt
    # below 1e-6 rad the series' second term is lost in rounding, and zeta = 1 needs no separate case
    if angle < 1e-6:
        c, s = 1.0, dt
    elif zeta < 1.0:
        c, s = cos(angle), sin(angle) / turn
    else:
        c, s = cosh(angle), sinh(angle) / turn
    e = exp(-decay * dt)
    return FilterConstants(
        p11=e * (c + decay * s),
        p12=e * s,
        p21=-e * omega_n * omega_n * s,
        p22=e * (c - decay * s),
        ramp_lag=2.0 * zeta / omega_n,
        rate=1.0 / dt,
        damping=2.0 * zeta * omega_n,
        stiffness=omega_n * omega_n,
    )


@kernel
def filter_start(x: Vec3, x_dot: Vec3) -> FilterState:
    """A filter that is at x and moves with x_dot: the first output continues it without a jump."""
    return FilterState(x, x, x_dot)


@kernel
def filter_step(state: FilterState, u: Vec3, constants: FilterConstants) -> FilterState:
    """The memory one period later, when the command has changed linearly to `u`."""
    slope = scale(constants.rate, sub(u, state.u))
    # h: distance from the steady motion along the ramp
    h1 = sub(state.x1, axpy(-constants.ramp_lag, slope, state.u))
    h2 = sub(state.x2, slope)
    x1 = add(axpy(-constants.ramp_lag, slope, u), axpy(constants.p11, h1, scale(constants.p12, h2)))
    x2 = add(slope, axpy(constants.p21, h1, scale(constants.p22, h2)))
    return FilterState(u, x1, x2)


@kernel
def filter_acceleration(state: FilterState, constants: FilterConstants) -> Vec3:
    """x_2' of (4-2): second derivative of the filtered command."""
    return axpy(-constants.stiffness, sub(state.x1, state.u), scale(-constants.damping, state.x2))
