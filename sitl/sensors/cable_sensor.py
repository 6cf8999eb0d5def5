"""Direction from the vehicle to the load in body axes: a camera that looks down, or encoders on the cable.

Encoders read the direction of a taut cable only; a camera sees the load within a cone about its axis.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, apply, apply_transposed, norm, scale, sub
from autopilot.geometry.so3 import exp, rotation_from_quat
from sitl.plant.records import PlantState
from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, white

_DOWN: Vec3 = (0.0, 0.0, -1.0)


class CableConfig(NamedTuple):
    """Noise in rad per axis; the cosine of the cone's half angle; 1.0 if it reads a taut cable only."""

    direction_noise: float
    mounting_drift: Drift
    cone_cosine: float
    taut_only: float


class CableState(NamedTuple):
    """Misalignment of the mounting, a rotation vector in body FLU, rad."""

    mounting: Vec3


class CableReading(NamedTuple):
    """Unit vector from vehicle to load, body FLU; `detected` is 0.0 if there is no reading."""

    direction_body: Vec3
    detected: float


@kernel
def start(config: CableConfig, noise: Noise) -> CableState:
    """The mounting error at switch-on."""
    return CableState(drift_start(config.mounting_drift, noise, 2))


@kernel
def sample(
    truth_state: PlantState, sensor_state: CableState, config: CableConfig, noise: Noise
) -> tuple[CableReading, CableState]:
    """R^T (x_L - x_Q) / |x_L - x_Q|, turned by mounting error and noise."""
    R = rotation_from_quat(truth_state.quat_wxyz)
    line = apply_transposed(R, sub(truth_state.x_load, truth_state.x_quad))
    distance = norm(line)
    direction = _DOWN
    detected = 0.0
    if distance > 0.0:
        direction = scale(1.0 / distance, line)
        if -direction[2] >= config.cone_cosine and (truth_state.taut > 0.5 or config.taut_only < 0.5):
            detected = 1.0
    turn = add(sensor_state.mounting, white(config.direction_noise, noise, 0))
    measured = apply(exp(turn), direction)
    return (
        CableReading(measured, detected),
        CableState(drift_step(sensor_state.mounting, config.mounting_drift, noise, 1)),
    )
