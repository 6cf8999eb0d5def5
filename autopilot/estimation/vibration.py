"""The noise of the inertial unit, learned from its samples.

The motion of a vehicle is smooth from sample to sample; noise is not. The second difference of white noise of
variance s^2 has the variance 6 s^2, so the mean square of the second differences gives s whatever the motion,
and whatever noise is assumed: a vibration that is not configured is found in half a second. An impact shows
in it as well, and the samples about it then get little weight.

The shaking of rotors is a line at their speed, and far less than white noise of the same size once it is
integrated to a velocity. So the accelerometer's noise is measured a second time below the rotors' speeds and
above the vehicle's motion, in the band

    H(s) = (s tau)^2 / (1 + s tau)^4,    1 / tau = 2 pi 20 Hz,

which is computed by four low-passes in a row as y_2 - 2 y_3 + y_4. Of white noise of variance s^2 it lets
through `_band_variance` s^2. The smaller of the two results is the noise that counts.
"""

from __future__ import annotations

from autopilot.estimation.records import EstimatorTuning, ImuReading, Vibration
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, dot, sub

LEARNING_S = 0.5
_SECOND_DIFFERENCE = 6.0  # its variance over that of the samples
_BAND_S = 0.008  # tau


@kernel
def gyro_noise(vibration: Vibration, tuning: EstimatorTuning) -> float:
    """Variance of a sample of the gyroscope, (rad/s)^2: the configured or the measured one if greater."""
    return max(tuning.gyro_std * tuning.gyro_std, vibration.gyro_var)


@kernel
def accel_noise(vibration: Vibration, tuning: EstimatorTuning) -> float:
    """Variance of a sample of the accelerometer, (m/s^2)^2: the configured or the measured one if greater."""
    return max(tuning.accel_std * tuning.accel_std, measured_accel_noise(vibration))


@kernel
def measured_accel_noise(vibration: Vibration) -> float:
    """Measured variance of a sample of the accelerometer, (m/s^2)^2, without the lines of the rotors."""
    return min(vibration.accel_var, vibration.accel_band_var)


@kernel
def _band_variance(sample_weight: float) -> float:
    """Variance that white noise of variance 1 leaves in the band, divided by `sample_weight`, the
    weight of a sample in the low-passes.

    It is the sum of the squares of the band's response to an impulse.
    """
    p = 1.0 - sample_weight
    return 2.0 * p * p * p * p * (3.0 * p * p - 4.0 * p + 3.0) / (1.0 + p) ** 7


@kernel
def _low_passed(to: Vec3, last: Vec3, share: float) -> Vec3:
    return axpy(share, sub(to, last), last)


@kernel
def update_vibration(
    vibration: Vibration, imu: ImuReading, last: ImuReading, tuning: EstimatorTuning, dt: float
) -> Vibration:
    """The measured noise after another sample."""
    difference = ImuReading(sub(imu.gyro, last.gyro), sub(imu.accel, last.accel))
    gyro, accel = (
        sub(difference.gyro, vibration.last_difference.gyro),
        sub(difference.accel, vibration.last_difference.accel),
    )
    share = dt / (LEARNING_S + dt)
    smooth = dt / (_BAND_S + dt)
    y1 = _low_passed(imu.accel, vibration.low_passed[0], smooth)
    y2 = _low_passed(y1, vibration.low_passed[1], smooth)
    y3 = _low_passed(y2, vibration.low_passed[2], smooth)
    y4 = _low_passed(y3, vibration.low_passed[3], smooth)
    band = sub(sub(y2, y3), sub(y3, y4))
    # share / smooth written as one quotient, since both are zero at the first sample
    band_gain = 3.0 * _band_variance(smooth) * (LEARNING_S + dt) / (_BAND_S + dt)
    each = 1.0 / (3.0 * _SECOND_DIFFERENCE)
    return Vibration(
        vibration.accel_var + share * (each * dot(accel, accel) - vibration.accel_var),
        vibration.accel_band_var * (1.0 - share) + dot(band, band) / band_gain,
        vibration.gyro_var + share * (each * dot(gyro, gyro) - vibration.gyro_var),
        gyro_noise(vibration, tuning) * dt,
        difference,
        (y1, y2, y3, y4),
    )
