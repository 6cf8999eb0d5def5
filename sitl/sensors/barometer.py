"""Static pressure, read as height above the world's origin."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3
from sitl.plant.records import PlantState
from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, white


class BarometerConfig(NamedTuple):
    """White noise per sample and slow drift, in m of height."""

    height_noise: float
    height_drift: Drift


class BarometerState(NamedTuple):
    """The drift; its first component is used (m)."""

    error: Vec3


class BarometerReading(NamedTuple):
    """Height above the origin of the world, m."""

    height: float


@kernel
def start(config: BarometerConfig, noise: Noise) -> BarometerState:
    """The drift at switch-on."""
    return BarometerState(drift_start(config.height_drift, noise, 2))


@kernel
def sample(
    truth_state: PlantState, sensor_state: BarometerState, config: BarometerConfig, noise: Noise
) -> tuple[BarometerReading, BarometerState]:
    """Height of the vehicle with drift and noise."""
    height = truth_state.x_quad[2] + sensor_state.error[0] + white(config.height_noise, noise, 0)[0]
    return (
        BarometerReading(height),
        BarometerState(drift_step(sensor_state.error, config.height_drift, noise, 1)),
    )
