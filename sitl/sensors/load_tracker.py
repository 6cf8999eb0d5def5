"""Motion capture of the load: position, and velocity where the profile says so."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, add3
from sitl.plant.records import PlantState
from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, white
from sitl.sensors.room import Room, distortion


class LoadConfig(NamedTuple):
    """Deviations per sample, per axis; velocity_noise is nan where velocity is not measured.

    `wander` is a bounded, correlated error of the position.
    """

    position_noise: float
    velocity_noise: float
    position_drift: Drift
    wander: Drift
    room: Room


class LoadTrackerState(NamedTuple):
    """Offset of the tracked point from the centre of the load, and the correlated error, ENU, m."""

    offset: Vec3
    wander: Vec3


class LoadReading(NamedTuple):
    """Position and velocity of the load, ENU (m, m/s); nan = not measured."""

    position: Vec3
    velocity: Vec3


@kernel
def start(config: LoadConfig, noise: Noise) -> LoadTrackerState:
    """The errors at switch-on."""
    return LoadTrackerState(
        drift_start(config.position_drift, noise, 3), drift_start(config.wander, noise, 5)
    )


@kernel
def sample(
    truth_state: PlantState, sensor_state: LoadTrackerState, config: LoadConfig, noise: Noise
) -> tuple[LoadReading, LoadTrackerState]:
    """Position and velocity with white noise."""
    x = truth_state.x_load
    position = add3(x, sensor_state.offset, white(config.position_noise, noise, 0))
    wander = sensor_state.wander
    if config.wander.drive > 0.0:
        position = add(position, wander)
        wander = drift_step(wander, config.wander, noise, 4)
    if config.room.error > 0.0:
        position = add(position, distortion(x, config.room, noise))
    velocity = add(truth_state.v_load, white(config.velocity_noise, noise, 1))
    return (
        LoadReading(position, velocity),
        LoadTrackerState(drift_step(sensor_state.offset, config.position_drift, noise, 2), wander),
    )
