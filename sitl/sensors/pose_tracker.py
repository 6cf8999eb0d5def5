"""Motion capture of the vehicle: position and attitude, and their rates where the profile says so."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, add3
from autopilot.geometry.so3 import Quat, quat_exp, quat_multiply, quat_normalise
from sitl.plant.records import PlantState
from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, white
from sitl.sensors.room import Room, distortion


class PoseConfig(NamedTuple):
    """Deviations per sample, per axis; velocity_noise and rate_noise are nan where those are not measured.

    `wander` is a bounded, correlated error of the position.
    """

    position_noise: float
    attitude_noise: float
    velocity_noise: float
    rate_noise: float
    position_drift: Drift
    wander: Drift
    room: Room


class PoseState(NamedTuple):
    """Offset of the tracker's origin and the correlated error, ENU, m."""

    offset: Vec3
    wander: Vec3


class PoseReading(NamedTuple):
    """Position and velocity ENU (m, m/s), attitude FLU -> ENU, body rate FLU (rad/s); nan = not measured."""

    position: Vec3
    quat_wxyz: Quat
    velocity: Vec3
    omega_body: Vec3


@kernel
def start(config: PoseConfig, noise: Noise) -> PoseState:
    """The errors at switch-on."""
    return PoseState(drift_start(config.position_drift, noise, 5), drift_start(config.wander, noise, 7))


@kernel
def sample(
    truth_state: PlantState, sensor_state: PoseState, config: PoseConfig, noise: Noise
) -> tuple[PoseReading, PoseState]:
    """The pose with white noise; the attitude is turned by a small rotation vector in body axes."""
    x = truth_state.x_quad
    position = add3(x, sensor_state.offset, white(config.position_noise, noise, 0))
    wander = sensor_state.wander
    if config.wander.drive > 0.0:
        position = add(position, wander)
        wander = drift_step(wander, config.wander, noise, 6)
    if config.room.error > 0.0:
        position = add(position, distortion(x, config.room, noise))
    turn = quat_exp(white(config.attitude_noise, noise, 1))
    velocity = add(truth_state.v_quad, white(config.velocity_noise, noise, 2))
    omega = add(truth_state.omega_body, white(config.rate_noise, noise, 3))
    attitude = quat_normalise(quat_multiply(truth_state.quat_wxyz, turn))
    return (
        PoseReading(position, attitude, velocity, omega),
        PoseState(drift_step(sensor_state.offset, config.position_drift, noise, 4), wander),
    )
