"""Samples of the inertial unit at its full scale: the motion was greater, by an unknown amount.

An impact exceeds the range of an accelerometer, and the velocity that is integrated from it is then wrong by
what was cut off. An impact takes the speed of what hits, more or less: this is the deviation of the velocity
along each axis that was cut in a step. A rate that was cut may have been twice the full scale. A reading that
was made before the impact says nothing about the velocity after it, and is dropped.

A vibration that reaches the full scale is no impact: what is cut of it on one side is cut on the other, too.
It is recognised by its deviation, which for an impact stays a tenth of the full scale.
"""

from __future__ import annotations

from autopilot.estimation.records import (
    RATE,
    VELOCITY,
    Clipping,
    EstimatorTuning,
    History,
    ImuReading,
    Vibration,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import Mat3, Vec3, dot, norm, scale

# of a full scale, by which a sample at it may be off: rounding, and a calibration after the cut. A sample
# further above shows that the range is greater than assumed.
FULL_SCALE_TOLERANCE = 0.001
VIBRATION_SHARE = 0.25  # of the full scale: a vibration of this deviation reaches it
MIN_IMPACT_SPEED_STD = 0.3  # m/s


@kernel
def _at_full_scale(value: float, full_scale: float) -> float:
    size = abs(value)
    not_beyond = if_above(size, (1.0 + FULL_SCALE_TOLERANCE) * full_scale, 0.0, 1.0)
    return if_above(size, (1.0 - FULL_SCALE_TOLERANCE) * full_scale, not_beyond, 0.0)


@kernel
def clipped_axes(v: Vec3, full_scale: float) -> Vec3:
    """1 for each axis whose component of the sample was cut at its full scale, 0 for the others."""
    return (
        _at_full_scale(v[0], full_scale),
        _at_full_scale(v[1], full_scale),
        _at_full_scale(v[2], full_scale),
    )


@kernel
def _clipped_in_step(now: Vec3, last: Vec3, full_scale: float, vibration_var: float) -> Vec3:
    """1 for each axis that an impact cut in the step between two samples."""
    a, b = clipped_axes(now, full_scale), clipped_axes(last, full_scale)
    limit = VIBRATION_SHARE * full_scale
    return scale(
        if_above(vibration_var, limit * limit, 0.0, 1.0),
        (max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2])),
    )


@kernel
def _any(axes: Vec3) -> float:
    return max(axes[0], axes[1], axes[2])


@kernel
def update_clipping(
    clipping: Clipping,
    vibration: Vibration,
    imu: ImuReading,
    last: ImuReading,
    tuning: EstimatorTuning,
    dt: float,
) -> Clipping:
    """What an impact cut in the step between the last two samples, and how many samples were cut so far."""
    accel = _clipped_in_step(imu.accel, last.accel, tuning.accel_range, vibration.accel_var)
    gyro = _any(_clipped_in_step(imu.gyro, last.gyro, tuning.gyro_range, vibration.gyro_var))
    return Clipping(
        accel,
        gyro,
        if_above(max(_any(accel), gyro), 0.0, 0.0, clipping.impact_age_s + dt),
        clipping.samples + _any(clipped_axes(imu.accel, tuning.accel_range)),
    )


@kernel
def add_impact_noise(
    history: History,
    clipping: Clipping,
    R: Mat3,
    v_quad: Vec3,
    across: Vec3,
    along: Vec3,
    length: float,
    taut: float,
) -> None:
    """Make the velocity less certain along the axes that were cut in this step, and with it the rate of a
    taut cable, whose own axes are `across` and `along` and which has this length (m)."""
    P, speed_std = history.covariance, max(MIN_IMPACT_SPEED_STD, norm(v_quad))
    for k in range(3):
        axis = scale(clipping.accel[k] * speed_std, (R[0][k], R[1][k], R[2][k]))
        rates = (-taut / length * dot(across, axis), -taut / length * dot(along, axis))
        for i in range(3):
            for j in range(3):
                P[VELOCITY + i, VELOCITY + j] += axis[i] * axis[j]
            for j in range(2):
                P[VELOCITY + i, RATE + j] += axis[i] * rates[j]
                P[RATE + j, VELOCITY + i] += axis[i] * rates[j]
        for i in range(2):
            for j in range(2):
                P[RATE + i, RATE + j] += rates[i] * rates[j]
