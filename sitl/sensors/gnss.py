"""Satellite navigation receiver: position and velocity with white and slowly varying errors."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, add3, times
from sitl.plant.records import PlantState
from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, gaussian


class GnssConfig(NamedTuple):
    """Deviations (east, north, up): white position (m), correlated position (m), white velocity (m/s).

    `correlation` is a drift of unit deviation.
    """

    position_noise: Vec3
    position_error: Vec3
    velocity_noise: Vec3
    correlation: Drift


class GnssState(NamedTuple):
    """The correlated error in units of its deviation."""

    error: Vec3


class GnssReading(NamedTuple):
    """Position and velocity, ENU (m, m/s)."""

    position: Vec3
    velocity: Vec3


@kernel
def start(config: GnssConfig, noise: Noise) -> GnssState:
    """The correlated error at switch-on."""
    return GnssState(drift_start(config.correlation, noise, 3))


@kernel
def sample(
    truth_state: PlantState, sensor_state: GnssState, config: GnssConfig, noise: Noise
) -> tuple[GnssReading, GnssState]:
    """Position and velocity of the antenna, at the centre of mass."""
    slow = times(config.position_error, sensor_state.error)
    position = add3(truth_state.x_quad, slow, times(config.position_noise, gaussian(noise, 0)))
    velocity = add(truth_state.v_quad, times(config.velocity_noise, gaussian(noise, 1)))
    return (
        GnssReading(position, velocity),
        GnssState(drift_step(sensor_state.error, config.correlation, noise, 2)),
    )
