"""What a path asks of rotors, cable and attitude, with its derivatives: the constraints of an optimisation.

For each sample of a path six numbers: the forces F1 ... F4 of the rotors (N), the tension (N) and the cosine
of the vehicle's tilt, with a heading of 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.trajectory.flatness import flat_outputs
from autopilot.trajectory.peaks import Body
from autopilot.trajectory.signals import Jet

Array = NDArray[np.float64]

OUTPUTS = 6
TENSION, COS_TILT = 4, 5
# of the central differences: m/s ... m/s^6, each about as much of a rotor force
_NUDGE = (0.0, 1e-3, 1e-3, 4e-3, 1.5e-2, 6e-2, 2e-1)


class Bounds(NamedTuple):
    """What is allowed along a path; infinite where there is no limit.

    `rotor_low`, `rotor_high` (N) bound what is asked of a rotor that follows with the lag `rotor_tau` (s):
    F + tau F'.
    """

    rotor_low: float
    rotor_high: float
    tension_low: float
    cos_tilt: float
    rotor_tau: float


@kernel
def _asked(jet: Jet, body: Body) -> tuple[float, float, float, float, float, float]:
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
    # (2-13) solved for F1 ... F4
    mean = 0.25 * flat.thrust
    roll = 0.5 * flat.moment[0] / body.arm
    pitch = 0.5 * flat.moment[1] / body.arm
    yaw = 0.25 * flat.moment[2] / body.torque_ratio
    return (
        mean + pitch - yaw,
        mean - roll + yaw,
        mean - pitch - yaw,
        mean + roll + yaw,
        flat.tension,
        flat.R[2][2],
    )


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
def fill_demand(jets: Array, body: Body, out: Array) -> None:
    """`out` (n, 6) from `jets` (7 or more, n, 3)."""
    for i in range(jets.shape[1]):
        row = _asked(_jet_of(jets, i), body)
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5] = row


@kernel
def fill_slopes(jets: Array, body: Body, nudge: Array, out: Array) -> None:
    """`out` (n, 6, 7, 3): the derivative of each output by each entry of the jet; `jets` stays as it was."""
    for i in range(jets.shape[1]):
        for order in range(1, 7):
            for axis in range(3):
                kept = jets[order, i, axis]
                jets[order, i, axis] = kept + nudge[order]
                high = _asked(_jet_of(jets, i), body)
                jets[order, i, axis] = kept - nudge[order]
                low = _asked(_jet_of(jets, i), body)
                jets[order, i, axis] = kept
                r = 0.5 / nudge[order]
                out[i, 0, order, axis] = r * (high[0] - low[0])
                out[i, 1, order, axis] = r * (high[1] - low[1])
                out[i, 2, order, axis] = r * (high[2] - low[2])
                out[i, 3, order, axis] = r * (high[3] - low[3])
                out[i, 4, order, axis] = r * (high[4] - low[4])
                out[i, 5, order, axis] = r * (high[5] - low[5])


def demand(jets: Array, body: Body) -> Array:
    """(n, 6) what the path with `jets` (7, n, 3) asks for."""
    out = np.empty((jets.shape[1], OUTPUTS))
    fill_demand(jets, body, out)
    return out


def slopes(jets: Array, body: Body) -> Array:
    """(n, 6, 7, 3) by how much the demand changes with the jets (7, n, 3)."""
    out = np.zeros((jets.shape[1], OUTPUTS, 7, 3))
    fill_slopes(jets.copy(), body, np.array(_NUDGE), out)
    return out


def commanded(found: Array, spacing: float, tau: float) -> Array:
    """(n, 4) what rotors with the lag `tau` are asked for, F + tau F', of samples `spacing` s apart."""
    forces = found[:, :4]
    if tau == 0.0 or len(forces) < 3:
        return forces
    return np.asarray(forces + tau * np.gradient(forces, spacing, axis=0))
