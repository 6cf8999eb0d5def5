"""Demand of a path on rotors, cable and attitude, with its derivatives: the constraints of an optimisation.

For each sample of a path three numbers and one more per rotor: the tension (N), the cosine of the vehicle's
tilt, the square of the rate (rad/s) at which it turns about its level axes, and the demand on each rotor (N),
with a heading of 0. Where the rotors' force is less than the weight, the rate counts as much more.
"""

from __future__ import annotations

from math import cos, inf, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.trajectory.flatness import flat_outputs
from autopilot.trajectory.peaks import Body, KernelBody, rotor_effort, to_kernel_body
from autopilot.trajectory.signals import Jet
from autopilot.vehicle.rotors import MAX_TURN_RATE

Array = NDArray[np.float64]

TENSION, COS_TILT, TURN, FIRST_ROTOR = 0, 1, 2, 3  # outputs
_UNBOUNDED_RANGE_N = 2.0
_LOW_RESERVE = 0.7
_GENTLER = 0.2
_MIN_FORCE_N = 1e-3  # a smaller force has no direction that could turn
# steps of the central differences, m/s ... m/s^6: each changes a rotor force by about as much
_DIFFERENCE_STEPS = (0.0, 1e-3, 1e-3, 4e-3, 1.5e-2, 6e-2, 2e-1)


class Bounds(NamedTuple):
    """What is allowed along a path; infinite where there is no limit.

    `rotor_low` and `rotor_high` (N) bound the command F + tau F' to a rotor that follows with the lag
    `rotor_tau` (s).
    """

    rotor_low: float
    rotor_high: float
    tension_low: float
    cos_tilt: float
    rotor_tau: float
    turn_rate: float = MAX_TURN_RATE  # rad/s, about the level axes, with a force of at least the weight

    @property
    def rotor_range(self) -> float:
        """From the lower to the upper bound of the command to a rotor, N; without bounds, a small one."""
        width = self.rotor_high - self.rotor_low
        return width if isfinite(width) else _UNBOUNDED_RANGE_N


def rotor_bounds(low: float, high: float, margin: float, hover: float) -> tuple[float, float]:
    """The least and the greatest force that a path may ask of a rotor that gives `low` to `high`, and `hover`
    to carry the weight (N): the share `margin` of the range is kept free for control.

    At the lower limit no more than the share `_LOW_RESERVE` of what the rotor gives there in hover: a strong
    rotor hovers within the share `margin` of its range.
    """
    reserve = margin * (high - low)
    return low + min(reserve, max(_LOW_RESERVE * (hover - low), 0.0)), high - reserve


def bounds_along_paths(
    body: Body,
    rotor_range: tuple[float, float] | None,
    rotor_margin: float,
    min_tension_share: float,
    tilt_max_rad: float,
    rotor_tau_s: float,
) -> Bounds:
    """What a vehicle allows along its paths.

    `rotor_range`: forces (N) between which a rotor can give any; None: it has no limits. `rotor_margin`: the
    share of this range kept free for control. `min_tension_share`: the least tension of the cable, as a share
    of the load's weight. `rotor_tau_s`: the lag of the rotors.
    """
    low, high = (
        (-inf, inf)
        if rotor_range is None
        else rotor_bounds(rotor_range[0], rotor_range[1], rotor_margin, body.hover_force)
    )
    tension_low = min_tension_share * body.load_mass * body.gravity
    return Bounds(low, high, tension_low, cos(tilt_max_rad), rotor_tau_s)


def gentler_bounds(body: Body, bounds: Bounds) -> Bounds | None:
    """Bounds that leave the share `_GENTLER` of the rotors' range free, beside what the bounds leave; None if
    hover is not within them, or nothing bounds the rotors."""
    hover = body.hover_force
    low, high = rotor_bounds(bounds.rotor_low, bounds.rotor_high, _GENTLER, hover)
    return bounds._replace(rotor_low=low, rotor_high=high) if low < hover < high < inf else None


@kernel
def _fill_outputs(jet: Jet, body: KernelBody, efforts: Array, out: Array) -> None:
    flat = flat_outputs(
        jet,
        0.0,
        body.quad_mass,
        body.load_mass,
        body.cable_length,
        body.inertia,
        body.gravity,
        body.drag_linear,
        body.drag_quadratic,
    )
    out[TENSION] = flat.tension
    out[COS_TILT] = flat.R[2][2]
    rate = flat.omega_body
    heaviness = max(1.0, (body.quad_mass + body.load_mass) * body.gravity / max(flat.thrust, _MIN_FORCE_N))
    out[TURN] = (rate[0] * rate[0] + rate[1] * rate[1]) * heaviness * heaviness
    for i in range(efforts.shape[0]):
        out[FIRST_ROTOR + i] = rotor_effort(efforts, i, flat.thrust, flat.moment, body)


@kernel
def _jet_of(jets: Array, i: int) -> Jet:
    return (
        (jets[0, i, 0], jets[0, i, 1], jets[0, i, 2]),
        (jets[1, i, 0], jets[1, i, 1], jets[1, i, 2]),
        (jets[2, i, 0], jets[2, i, 1], jets[2, i, 2]),
        (jets[3, i, 0], jets[3, i, 1], jets[3, i, 2]),
        (jets[4, i, 0], jets[4, i, 1], jets[4, i, 2]),
        (jets[5, i, 0], jets[5, i, 1], jets[5, i, 2]),
        (jets[6, i, 0], jets[6, i, 1], jets[6, i, 2]),
    )


@kernel
def fill_demand(jets: Array, body: KernelBody, efforts: Array, out: Array) -> None:
    """Fill `out` (n, 3 + rotors) with the demand of `jets` (7 or more, n, 3)."""
    for i in range(jets.shape[1]):
        _fill_outputs(_jet_of(jets, i), body, efforts, out[i])


@kernel
def fill_demand_derivatives(
    jets: Array, body: KernelBody, efforts: Array, steps: Array, scratch: Array, out: Array
) -> None:
    """Fill `out` (n, 3 + rotors, 7, 3) with the derivative of each output by each entry of the jet except the
    position; `jets` is unchanged at the end. `scratch` is (2, 3 + rotors)."""
    high, low = scratch[0], scratch[1]
    for i in range(jets.shape[1]):
        for order in range(1, 7):
            for axis in range(3):
                original = jets[order, i, axis]
                jets[order, i, axis] = original + steps[order]
                _fill_outputs(_jet_of(jets, i), body, efforts, high)
                jets[order, i, axis] = original - steps[order]
                _fill_outputs(_jet_of(jets, i), body, efforts, low)
                jets[order, i, axis] = original
                r = 0.5 / steps[order]
                for output in range(out.shape[1]):
                    out[i, output, order, axis] = r * (high[output] - low[output])


def demand(jets: Array, body: Body) -> Array:
    """(n, 3 + rotors) demand of the path with `jets` (7, n, 3)."""
    kernel_body, efforts = to_kernel_body(body)
    out = np.empty((jets.shape[1], FIRST_ROTOR + len(efforts)))
    fill_demand(jets, kernel_body, efforts, out)
    return out


def demand_derivatives(jets: Array, body: Body) -> Array:
    """(n, 3 + rotors, 7, 3) derivatives of the demand by the jets (7, n, 3)."""
    kernel_body, efforts = to_kernel_body(body)
    outputs = FIRST_ROTOR + len(efforts)
    out = np.zeros((jets.shape[1], outputs, 7, 3))
    fill_demand_derivatives(
        jets.copy(), kernel_body, efforts, np.array(_DIFFERENCE_STEPS), np.empty((2, outputs)), out
    )
    return out


def rotor_commands(path_demand: Array, spacing: float | Array, tau: float) -> Array:
    """(n, rotors) commands F + tau F' to rotors with the lag `tau`, for samples `spacing` s apart, or at
    these n times (s)."""
    forces = path_demand[:, FIRST_ROTOR:]
    if tau == 0.0 or len(forces) < 3:
        return forces
    return np.asarray(forces + tau * np.gradient(forces, spacing, axis=0))
