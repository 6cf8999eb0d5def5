"""Satellite navigation receiver: position and velocity with white and slowly varying errors.

Besides the error of orbits, clocks and atmosphere, which varies over minutes, there may be multipath: an
error from signals reflected by a wall or the ground, which varies over tens of seconds and is not stated by
the receiver. A receiver with carrier phase occasionally loses the integer number of wavelengths: its fix
"floats" for a while, with an additional error, and is reported as floating. The receiver may also lose the
fix completely; after it returns, the fix floats for a while. Both begin at random and last for exponentially
distributed times.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add, add3, apply, is_zero, scale, times
from autopilot.geometry.rigid_body import arm_velocity
from autopilot.geometry.so3 import rotation_from_quat
from sitl.plant.records import PlantState
from sitl.sensors.elementary import logarithm
from sitl.sensors.noise import Drift, Noise, drift_start, drift_step, gaussian, uniform

FIXED, FLOATING, LOST = 0.0, 1.0, 2.0  # GnssReading.quality


class GnssConfig(NamedTuple):
    """Deviations (east, north, up): white position (m), correlated position (m), white velocity (m/s).

    `correlation` is a drift of unit deviation. `multipath` is a separate correlated error, of deviations
    `multipath_error`; with a `float_error` of 0 fixes never float.
    """

    position_noise: Vec3
    position_error: Vec3
    velocity_noise: Vec3
    correlation: Drift
    multipath_error: Vec3
    multipath: Drift
    float_error: float  # m, deviation on each axis while it floats
    float_chance: float  # probability that floating begins at a sample
    float_s: float  # its mean duration
    lost_chance: float
    lost_s: float
    period_s: float
    antenna: Vec3 = ZERO  # m, from the centre of mass, body


class GnssState(NamedTuple):
    """The correlated errors in units of their deviations; the remaining times (s) without a fix, and until
    the fix no longer floats."""

    error: Vec3
    multipath: Vec3
    floating: Vec3
    lost_remaining_s: float
    float_remaining_s: float


class GnssReading(NamedTuple):
    """Position and velocity, ENU (m, m/s), and the quality of the fix: FIXED, FLOATING, LOST."""

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
def _remaining(config: GnssConfig, state: GnssState, noise: Noise) -> tuple[float, float]:
    """Remaining times (s) without a fix, and until the fix no longer floats, from this sample on."""
    lost, floating = state.lost_remaining_s - config.period_s, state.float_remaining_s - config.period_s
    lost_draw, float_draw = uniform(noise, 8)
    draws = uniform(noise, 9)
    settling = -logarithm(draws[1]) * config.float_s if config.float_error > 0.0 else 0.0
    if lost <= 0.0 and lost_draw <= config.lost_chance:
        lost = -logarithm(draws[0]) * config.lost_s
        floating = max(floating, lost + settling)
    if floating <= 0.0 and float_draw <= config.float_chance:
        floating = settling
    return max(lost, 0.0), max(floating, 0.0)


@kernel
def sample(
    truth_state: PlantState, sensor_state: GnssState, config: GnssConfig, noise: Noise
) -> tuple[GnssReading, GnssState]:
    """Position and velocity of the antenna."""
    x_antenna, v_antenna = truth_state.x_quad, truth_state.v_quad
    if not is_zero(config.antenna):
        R = rotation_from_quat(truth_state.quat_wxyz)
        x_antenna = add(x_antenna, apply(R, config.antenna))
        v_antenna = add(v_antenna, arm_velocity(R, truth_state.omega_body, config.antenna))
    slow = times(config.position_error, sensor_state.error)
    position = add3(x_antenna, slow, times(config.position_noise, gaussian(noise, 0)))
    velocity = add(v_antenna, times(config.velocity_noise, gaussian(noise, 1)))
    multipath, floating = sensor_state.multipath, sensor_state.floating
    lost_remaining_s, float_remaining_s, quality = (
        sensor_state.lost_remaining_s,
        sensor_state.float_remaining_s,
        FIXED,
    )
    if config.multipath.drive > 0.0:
        position = add(position, times(config.multipath_error, multipath))
        multipath = drift_step(multipath, config.multipath, noise, 4)
    if config.float_chance > 0.0 or config.lost_chance > 0.0:
        lost_remaining_s, float_remaining_s = _remaining(config, sensor_state, noise)
        if lost_remaining_s > 0.0:
            quality = LOST
        elif float_remaining_s > 0.0:
            quality = FLOATING
            position = add(position, scale(config.float_error, floating))
        floating = drift_step(floating, config.correlation, noise, 6)
    return (
        GnssReading(position, velocity, quality),
        GnssState(
            drift_step(sensor_state.error, config.correlation, noise, 2),
            multipath,
            floating,
            lost_remaining_s,
            float_remaining_s,
        ),
    )
