"""Satellite navigation receiver: position and velocity with white and slowly varying errors.

Beside the error of orbits, clocks and air, which wanders over minutes, there may be multipath: the signals
that come by way of a wall or of the ground, an error of tens of seconds that the receiver does not know of.
A receiver with carrier phase now and then loses whole numbers of waves: its fix "floats" for a while, with an
error of its own, and says so. It may also lose the fix altogether, and floats for a while when it has it
again. All three begin by chance; how long they last is exponentially distributed.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, add3, scale, times
from sitl.plant.records import PlantState
from sitl.sensors.elementary import logarithm
from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, gaussian, uniform

FIXED, FLOATING, LOST = 0.0, 1.0, 2.0  # GnssReading.quality


class GnssConfig(NamedTuple):
    """Deviations (east, north, up): white position (m), correlated position (m), white velocity (m/s).

    `correlation` is a drift of unit deviation. `multipath` is a correlated error of its own, of deviations
    `multipath_error`; a `float_error` of 0 is a receiver whose fixes never float.
    """

    position_noise: Vec3
    position_error: Vec3
    velocity_noise: Vec3
    correlation: Drift
    multipath_error: Vec3
    multipath: Drift
    float_error: float  # m, deviation on each axis while it floats
    float_chance: float  # that it begins with a sample
    float_s: float  # for so long on average
    lost_chance: float
    lost_s: float
    period_s: float


class GnssState(NamedTuple):
    """The correlated errors in units of their deviations; for how long (s) it is without a fix, and without
    whole numbers of waves."""

    error: Vec3
    multipath: Vec3
    floating: Vec3
    lost_left: float
    float_left: float


class GnssReading(NamedTuple):
    """Position and velocity, ENU (m, m/s), and whether there is a fix: FIXED, FLOATING, LOST."""

    position: Vec3
    velocity: Vec3
    quality: float


@kernel
def start(config: GnssConfig, noise: Noise) -> GnssState:
    """The correlated errors at switch-on."""
    return GnssState(
        drift_start(config.correlation, noise, 3),
        drift_start(config.multipath, noise, 5),
        drift_start(config.correlation, noise, 7),
        0.0,
        0.0,
    )


@kernel
def _left(config: GnssConfig, state: GnssState, noise: Noise) -> tuple[float, float]:
    """For how long it is without a fix, and without whole numbers of waves, from this sample on."""
    lost, floating = state.lost_left - config.period_s, state.float_left - config.period_s
    loses, floats = uniform(noise, 8)
    how_long = uniform(noise, 9)
    settling = -logarithm(how_long[1]) * config.float_s if config.float_error > 0.0 else 0.0
    if lost <= 0.0 and loses <= config.lost_chance:
        lost = -logarithm(how_long[0]) * config.lost_s
        floating = max(floating, lost + settling)
    if floating <= 0.0 and floats <= config.float_chance:
        floating = settling
    return max(lost, 0.0), max(floating, 0.0)


@kernel
def sample(
    truth_state: PlantState, sensor_state: GnssState, config: GnssConfig, noise: Noise
) -> tuple[GnssReading, GnssState]:
    """Position and velocity of the antenna, at the centre of mass."""
    slow = times(config.position_error, sensor_state.error)
    position = add3(truth_state.x_quad, slow, times(config.position_noise, gaussian(noise, 0)))
    velocity = add(truth_state.v_quad, times(config.velocity_noise, gaussian(noise, 1)))
    multipath, floating = sensor_state.multipath, sensor_state.floating
    lost_left, float_left, quality = sensor_state.lost_left, sensor_state.float_left, FIXED
    if config.multipath.drive > 0.0:
        position = add(position, times(config.multipath_error, multipath))
        multipath = drift_step(multipath, config.multipath, noise, 4)
    if config.float_chance > 0.0 or config.lost_chance > 0.0:
        lost_left, float_left = _left(config, sensor_state, noise)
        if lost_left > 0.0:
            quality = LOST
        elif float_left > 0.0:
            quality = FLOATING
            position = add(position, scale(config.float_error, floating))
        floating = drift_step(floating, config.correlation, noise, 6)
    return (
        GnssReading(position, velocity, quality),
        GnssState(
            drift_step(sensor_state.error, config.correlation, noise, 2),
            multipath,
            floating,
            lost_left,
            float_left,
        ),
    )
