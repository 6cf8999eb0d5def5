"""The earth's field in body axes, with hard-iron offset."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add3, apply_transposed
from autopilot.geometry.so3 import rotation_from_quat
from sitl.plant.records import PlantState
from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, white


class MagnetometerConfig(NamedTuple):
    """The field at home, ENU (gauss); white noise per sample and hard-iron drift (gauss)."""

    field: Vec3
    field_noise: float
    hard_iron: Drift


class MagnetometerState(NamedTuple):
    """Hard-iron offset, body FLU, gauss."""

    offset: Vec3


class MagnetometerReading(NamedTuple):
    """Field in body FLU, gauss."""

    field_body: Vec3


@kernel
def start(config: MagnetometerConfig, noise: Noise) -> MagnetometerState:
    """The offset at switch-on."""
    return MagnetometerState(drift_start(config.hard_iron, noise, 2))


@kernel
def sample(
    truth_state: PlantState, sensor_state: MagnetometerState, config: MagnetometerConfig, noise: Noise
) -> tuple[MagnetometerReading, MagnetometerState]:
    """R^T B with offset and noise."""
    field = apply_transposed(rotation_from_quat(truth_state.quat_wxyz), config.field)
    measured = add3(field, sensor_state.offset, white(config.field_noise, noise, 0))
    return (
        MagnetometerReading(measured),
        MagnetometerState(drift_step(sensor_state.offset, config.hard_iron, noise, 1)),
    )
