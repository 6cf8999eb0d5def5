"""Acceleration of the load by the air: a steady wind, and drag that depends on the load's speed.

The error state contains the acceleration d that the pendulum leaves out, as a random walk. Drag is learned
beside it, by the least-squares fit of d to the load's velocity, both less their means over some seconds. With
this fit, d follows the speed immediately. What varies of d beyond its drag, and beyond what noise explains,
is the effect of gusts, whose strength is learned from it.
"""

from __future__ import annotations

from math import sqrt

from autopilot.control.drag import GUST_RANDOM_WALK, GUST_TIME_S
from autopilot.estimation.covariance import decay_factor
from autopilot.estimation.records import AIR, TRACKER, AirEstimate, Array, EstimatorTuning, LoadEstimate
from autopilot.estimation.tautness import is_never_observed
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, dot
from autopilot.geometry.packed import with_field

DRAG_CHANGE_TIME_S = 0.15  # for which a change of drag lasts
# m/s^2, by a wind that a camera cannot distinguish from its own mounting and the slow error of a receiver
HIDDEN_WIND_ACCEL = 0.17
LEARNING_S = 4.0
GUST_LEARNING_S = 2.0
# of the variance that the filter states of d: by so much d varies with the noise of the readings although the
# air is steady; most of it is a constant error, of the camera's mounting or the attitude
NOISE_SHARE = 0.06
# drag is learned from motion faster than MIN_LEARNING_SPEED, m/s, and is at most MAX_DRAG, 1/s
MIN_LEARNING_SPEED, MAX_DRAG = 0.2, 2.0


@kernel
def air_walk(load: LoadEstimate, air: AirEstimate, accel_quad: Vec3, tuning: EstimatorTuning) -> float:
    """How fast the load's acceleration by the air may change, m/s^2 per square root of a second.

    The root of the sum of squares of three parts: the configured walk; gusts; and the change of drag, c u^2,
    with the speed, 2 c u times the acceleration, where u^2 includes the wind that the acceleration c u^2
    indicates.

    Gusts of the variance s^2 that last for T walk by 2 s^2 / T. A mean over the time L leaves s^2 L / (L + T)
    of this variance, so that the learned one means a walk of 2 s'^2 (1 / T + 1 / L). It is at most that of
    strong gusts in the wind that d shows, or that may be hidden where no tracker measures the load.

    Without a sensor of the load, its pull shows only the sum of the wind on load and vehicle: neither gusts
    nor drag can be learned, and with a faster walk d, and with it the direction of the cable, drift away.
    """
    configured_walk, c = tuning.air_walk, tuning.load_drag
    if is_never_observed(load):
        return configured_walk
    wind2 = air.load_accel[0] * air.load_accel[0] + air.load_accel[1] * air.load_accel[1]
    speed2 = c * c * dot(load.v_load, load.v_load) + c * sqrt(wind2)
    strong_gusts = (
        GUST_RANDOM_WALK
        * GUST_RANDOM_WALK
        * (wind2 if load.source == TRACKER else wind2 + HIDDEN_WIND_ACCEL * HIDDEN_WIND_ACCEL)
    )
    gusts = min(strong_gusts, air.gust_variance * (1.0 / GUST_TIME_S + 1.0 / LEARNING_S))
    return sqrt(
        configured_walk * configured_walk
        + gusts
        + 4.0 * speed2 * dot(accel_quad, accel_quad) * DRAG_CHANGE_TIME_S
    )


@kernel
def _moved_towards(mean: tuple[float, float], to: tuple[float, float], share: float) -> tuple[float, float]:
    return mean[0] + share * (to[0] - mean[0]), mean[1] + share * (to[1] - mean[1])


@kernel
def predict_air(
    air: AirEstimate,
    before: LoadEstimate,
    load: LoadEstimate,
    P: Array,
    growth: float,
    tuning: EstimatorTuning,
    dt: float,
) -> AirEstimate:
    """The accelerations by the air dt seconds later; `load` is the load, and `P` the covariance, at that
    time. That of the vehicle grows by the factor `growth` (`cable_pull.rotor_drag_growth`)."""
    load_decay, vehicle_decay = (
        decay_factor(tuning.air_std, tuning.air_walk, dt),
        growth * decay_factor(tuning.push_std, tuning.push_walk, dt),
    )
    vehicle_accel = (vehicle_decay * air.vehicle_accel[0], vehicle_decay * air.vehicle_accel[1])
    d = (load_decay * air.load_accel[0], load_decay * air.load_accel[1])
    if load.taut == 0.0 or before.taut == 0.0:
        return with_field(with_field(air, "load_accel", d), "vehicle_accel", vehicle_accel)
    v, c = load.v_load, air.load_drag
    d = (d[0] - c * (v[0] - before.v_load[0]), d[1] - c * (v[1] - before.v_load[1]))
    share = dt / (min(LEARNING_S, load.tautness_age_s) + dt)
    mean_velocity, mean_accel = (
        _moved_towards(air.mean_velocity, (v[0], v[1]), share),
        _moved_towards(air.mean_accel, d, share),
    )
    s0, s1 = v[0] - mean_velocity[0], v[1] - mean_velocity[1]
    velocity_accel_covariance = air.velocity_accel_covariance + share * (
        s0 * (d[0] - mean_accel[0]) + s1 * (d[1] - mean_accel[1]) - air.velocity_accel_covariance
    )
    velocity_variance = air.velocity_variance + share * (s0 * s0 + s1 * s1 - air.velocity_variance)
    drag = min(
        MAX_DRAG,
        max(0.0, -velocity_accel_covariance / (velocity_variance + MIN_LEARNING_SPEED * MIN_LEARNING_SPEED)),
    )
    g0, g1 = d[0] - mean_accel[0] + drag * s0, d[1] - mean_accel[1] + drag * s1
    gust_share = dt / (GUST_LEARNING_S + dt)
    gust2 = g0 * g0 + g1 * g1 - NOISE_SHARE * (P[AIR, AIR] + P[AIR + 1, AIR + 1])
    gust_variance = max(0.0, air.gust_variance + gust_share * (gust2 - air.gust_variance))
    return AirEstimate(
        load_accel=d,
        vehicle_accel=vehicle_accel,
        load_drag=drag,
        mean_velocity=mean_velocity,
        mean_accel=mean_accel,
        velocity_accel_covariance=velocity_accel_covariance,
        velocity_variance=velocity_variance,
        gust_variance=gust_variance,
    )
