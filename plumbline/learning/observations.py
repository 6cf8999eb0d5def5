"""What a policy observes: the same numbers in an environment and in flight.

| index | numbers | unit |
|---|---|---|
| 0 | x_L - x_d: position of the load relative to its desired position | m |
| 3 | x_L' - x_d' | m/s |
| 6 | q: unit vector from the vehicle to the load | |
| 9 | q' | 1/s |
| 12 | R, row by row: body to world | |
| 21 | Omega: body rate | rad/s, body |
| 24 | the last action | |

These are followed by the 24 numbers of each earlier step of `history`, and the action before it, newest
first. Then each instant of `preview` adds the displacement of the reference until that instant and its
velocity at that instant (m, m/s), extrapolated from the six derivatives of the reference now. World ENU, body
FLU. Positions are relative, so that a policy can be flown anywhere.
"""

from __future__ import annotations

from typing import Any

from autopilot.control.records import State
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, sub
from autopilot.trajectory.signals import Jet
from autopilot.vehicle.layout import MAX_ROTORS
from plumbline.learning.records import FEATURES, ObservationModel

PREVIEW_SIZE = 6  # numbers of an instant of the preview


def observation_size(model: ObservationModel) -> int:
    """How many numbers an observation has."""
    return (FEATURES + model.actions) * (1 + model.past) + PREVIEW_SIZE * model.ahead


@kernel
def _write_vector(vector: Vec3, out: Any, at: int) -> None:
    for i in range(3):
        out[at + i] = vector[i]


@kernel
def _write_features(state: State, jet: Jet, out: Any) -> None:
    _write_vector(sub(state.x_load, jet[0]), out, 0)
    _write_vector(sub(state.v_load, jet[1]), out, 3)
    _write_vector(state.q_cable, out, 6)
    _write_vector(state.q_cable_dot, out, 9)
    for i in range(3):
        _write_vector(state.R[i], out, 12 + 3 * i)
    _write_vector(state.omega_body, out, 21)


@kernel
def _write_preview(jet: Jet, ahead: int, ahead_s: float, out: Any, at: int) -> None:
    for k in range(ahead):
        t = (k + 1) * ahead_s
        for i in range(3):
            # Horner's scheme of the two Taylor series
            displacement, speed = 0.0, 0.0
            for n in range(6, 0, -1):
                displacement = (jet[n][i] + displacement) * t / n
                speed = jet[n][i] + speed * t / n
            out[at + PREVIEW_SIZE * k + i] = displacement
            out[at + PREVIEW_SIZE * k + 3 + i] = speed


@kernel
def write_observation(
    state: State, jet: Jet, action: Any, past: Any, model: ObservationModel, out: Any
) -> None:
    """Write the observation after a step with `action` into `out`, and insert it into `past` (steps,
    FEATURES + MAX_ROTORS), which has the newest of the earlier steps first."""
    _write_features(state, jet, out)
    for i in range(model.actions):
        out[FEATURES + i] = action[i]
    at = FEATURES + model.actions
    for k in range(model.past):
        for i in range(FEATURES + model.actions):
            out[at + i] = past[k, i]
        at += FEATURES + model.actions
    _write_preview(jet, model.ahead, model.ahead_s, out, at)
    for k in range(model.past - 1, -1, -1):
        for i in range(FEATURES + MAX_ROTORS):
            past[k, i] = past[k - 1, i] if k > 0 else 0.0
    if model.past > 0:
        for i in range(FEATURES + model.actions):
            past[0, i] = out[i]
