"""The noise of the inertial unit, learned from its samples.

What moves a vehicle bends little from sample to sample; noise does. The second difference of white noise of
variance s^2 has the variance 6 s^2, so the mean square of the second differences tells s whatever the motion,
and whatever is believed of the unit: a vibration that nobody told of is found in half a second. An impact
shows in it as well, and makes the samples about it worth little.
"""

from __future__ import annotations

from autopilot.estimation.records import EstimatorTuning, ImuReading, Vibration
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import dot, sub

LEARNING_S = 0.5
_SECOND_DIFFERENCE = 6.0  # its variance over that of the samples


@kernel
def gyro_noise(vibration: Vibration, tuning: EstimatorTuning) -> float:
    """Variance of a sample of the gyroscope, (rad/s)^2: as told, or as it shows."""
    return max(tuning.gyro_std * tuning.gyro_std, vibration.gyro_var)


@kernel
def accel_noise(vibration: Vibration, tuning: EstimatorTuning) -> float:
    """Variance of a sample of the accelerometer, (m/s^2)^2: as told, or as it shows."""
    return max(tuning.accel_std * tuning.accel_std, vibration.accel_var)


@kernel
def shaken(
    vibration: Vibration, imu: ImuReading, last: ImuReading, tuning: EstimatorTuning, dt: float
) -> Vibration:
    """What is known of the noise after another sample."""
    step = ImuReading(sub(imu.gyro, last.gyro), sub(imu.accel, last.accel))
    gyro, accel = sub(step.gyro, vibration.step.gyro), sub(step.accel, vibration.step.accel)
    share = dt / (LEARNING_S + dt)
    each = 1.0 / (3.0 * _SECOND_DIFFERENCE)
    return Vibration(
        vibration.accel_var + share * (each * dot(accel, accel) - vibration.accel_var),
        vibration.gyro_var + share * (each * dot(gyro, gyro) - vibration.gyro_var),
        gyro_noise(vibration, tuning) * dt,
        step,
    )
