"""One Runge-Kutta step in one mode of the cable, and the projection onto the taut cable."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, axpy
from autopilot.geometry.so3 import quat_normalise
from sitl.plant.impact import at_cable_length
from sitl.plant.rates import rates
from sitl.plant.records import Motion, Truth
from sitl.plant.rotors import BEGIN, END, MIDDLE, RotorRows, wrenches

# classical Runge-Kutta, and a fifth evaluation at the end of the step with weight zero
_STAGE_SHIFT = (0.0, 0.5, 0.5, 1.0)
_STAGE_WEIGHT = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0, 0.0)


class StepEnd(NamedTuple):
    """The end of a Runge-Kutta step."""

    motion: Motion
    tension_before: float  # N, at the start of the step, negative if the cable would have to push
    tension: float  # N, at its end
    accel_quad: Vec3
    quad_normal: float
    load_normal: float
    omega_dot: Vec3


@kernel
def _shift(motion: Motion, s: float, rate: Motion) -> Motion:
    """motion + s rate."""
    p, d = motion.quat, rate.quat
    return Motion(
        axpy(s, rate.x_load, motion.x_load),
        axpy(s, rate.v_load, motion.v_load),
        axpy(s, rate.separation, motion.separation),
        axpy(s, rate.separation_dot, motion.separation_dot),
        (p[0] + s * d[0], p[1] + s * d[1], p[2] + s * d[2], p[3] + s * d[3]),
        axpy(s, rate.omega, motion.omega),
        motion.length + s * rate.length,
        motion.length_dot + s * rate.length_dot,
    )


@kernel
def runge_kutta_step(
    motion: Motion, rotors: RotorRows, truth: Truth, wind: Vec3, taut: float, h: float
) -> StepEnd:
    """One Runge-Kutta step of length h in one mode; the lag of the rotors is exact at every stage. The
    row FORCE stays unchanged; the forces at the end of the step are in the row END."""
    wrench, middle, end = wrenches(rotors, truth, h)
    zero_rate = Motion(ZERO, ZERO, ZERO, ZERO, (0.0, 0.0, 0.0, 0.0), ZERO, 0.0, 0.0)
    rate, total = zero_rate, zero_rate
    tension_before = 0.0
    row = BEGIN
    # a loop, so that the equations are compiled once and not five times
    for stage in range(5):
        if stage < 4:
            at = _shift(motion, _STAGE_SHIFT[stage] * h, rate)
        else:
            at = _shift(motion, h, total)
            quat = quat_normalise(at.quat)
            at = Motion(
                at.x_load,
                at.v_load,
                at.separation,
                at.separation_dot,
                quat,
                at.omega,
                at.length,
                at.length_dot,
            )
            if taut > 0.0:
                at = at_cable_length(at, truth)
        # the stages lie at 0, 1/2, 1/2, 1 and 1 of the step
        if stage == 1:
            wrench, row = middle, MIDDLE
        elif stage == 3:
            wrench, row = end, END
        rates_now = rates(at, wrench, rotors, row, truth, wind, taut)
        if stage == 0:
            tension_before = rates_now.tension
        rate = rates_now.motion
        total = _shift(total, _STAGE_WEIGHT[stage], rate)
    return StepEnd(
        at,
        tension_before,
        rates_now.tension,
        rates_now.accel_quad,
        rates_now.quad_normal,
        rates_now.load_normal,
        rates_now.motion.omega,
    )
