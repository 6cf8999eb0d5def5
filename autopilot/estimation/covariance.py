"""The covariance of the error state: propagated by its known sparsity, updated by several scalars at once.

An error x of the state obeys x' = F x + noise. `propagate_covariance` applies Phi = I + F dt to the
rows of P, transposes and applies it again, Phi (Phi P)^T = Phi P Phi^T, so that each of the two passes runs
along rows.

A reading measures scalars y_k = h_k x + noise of variance r_k, whose noises are independent. They are
absorbed one after the other, but P is updated only once: row k of H P is reduced by what it shares with the
scalars before it, and P by the sum of the squares of these rows over their variances.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from autopilot.estimation.records import (
    ACCEL_BIAS,
    AIDED_SIZE,
    AIR,
    ATTITUDE,
    BAROMETER,
    DIRECTION,
    GNSS,
    GYRO_BIAS,
    INNOVATION,
    LENGTH,
    POSITION,
    PUSH,
    RATE,
    SIZE,
    TEST_RATIO,
    VARIANCE,
    VELOCITY,
    Array,
    EstimatorTuning,
    History,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, apply_transposed, cross, dot, scale
from autopilot.geometry.wide import columns_at_once, put_wide, transposed, wide_at
from autopilot.geometry.wide_rows import (
    accumulate_and_scale,
    combine,
    subtract_row,
    subtract_rows,
    subtract_squares,
    symmetrise,
    transpose,
)


class PropagationInputs(NamedTuple):
    """What the propagation of the error depends on: specific force (world), attitude, the cable's frame."""

    force: Vec3
    R: Mat3
    q_cable: Vec3
    across: Vec3
    along: Vec3  # second axis: q_cable x across
    q_cable_dot: Vec3
    length: float
    taut: float
    horizontal_slow_std: float
    vertical_slow_std: float
    reversion: float  # return of the receiver's slow error to zero, in units of the rate at which it changes
    accel_var: float  # (m/s^2)^2, of a sample
    gyro_var: float  # (rad/s)^2
    air_walk: float  # m/s^2 per square root of a second, of the load's acceleration by the air
    cable_accel_std: float  # rad/s^2
    separation_std: float  # m/s, speed at which the ends of the cable move apart


class CableRateJacobian(NamedTuple):
    """How the errors change the rate of the cable's direction along one of its axes during a step."""

    attitude: Vec3
    bias: Vec3  # of the accelerometer
    length: float
    direction: tuple[float, float]
    air: tuple[float, float]


@kernel
def _cable_rate_jacobian(inputs: PropagationInputs, dt: float, i: int) -> CableRateJacobian:
    """The entries of Phi in the row of RATE + i."""
    f = inputs.force
    axis = inputs.across if i == 0 else inputs.along
    rates = (dot(inputs.across, inputs.q_cable_dot), dot(inputs.along, inputs.q_cable_dot))
    speed2 = rates[0] * rates[0] + rates[1] * rates[1]
    stiff = dot(inputs.q_cable, f) / inputs.length - speed2
    s = dt / inputs.length
    # two neighbouring paths on the sphere converge: |q'|^2 across the motion
    own, other = dt * (stiff + rates[i] * rates[i]), dt * rates[0] * rates[1]
    return CableRateJacobian(
        scale(-s, cross(f, axis)),
        scale(s, apply_transposed(inputs.R, axis)),
        s / inputs.length * dot(axis, f),
        (own, other) if i == 0 else (other, own),
        (s * axis[0], s * axis[1]),
    )


@kernel
def _move_rows(
    P: Array,
    inputs: PropagationInputs,
    first: CableRateJacobian,
    second: CableRateJacobian,
    dt: float,
    n: int,
    cable_from: int,
) -> None:
    """Replace P by Phi P, eight columns at a time: half a step of position and direction with their present
    rates, then the rates and the attitude, then the other half step. The cable's rows are computed only from
    column `cable_from` on."""
    half, step = 0.5 * dt, columns_at_once(P)
    f, R = scale(dt, inputs.force), inputs.R
    for j in range(0, n, step):
        a0, a1, a2 = wide_at(P, ATTITUDE, j), wide_at(P, ATTITUDE + 1, j), wide_at(P, ATTITUDE + 2, j)
        b0, b1, b2 = wide_at(P, ACCEL_BIAS, j), wide_at(P, ACCEL_BIAS + 1, j), wide_at(P, ACCEL_BIAS + 2, j)
        g0, g1, g2 = wide_at(P, GYRO_BIAS, j), wide_at(P, GYRO_BIAS + 1, j), wide_at(P, GYRO_BIAS + 2, j)
        if inputs.taut > 0.0 and j + step > cable_from:
            r0, r1, length = wide_at(P, RATE, j), wide_at(P, RATE + 1, j), wide_at(P, LENGTH, j)
            w0, w1 = wide_at(P, AIR, j), wide_at(P, AIR + 1, j)
            d0 = wide_at(P, DIRECTION, j) + half * r0
            d1 = wide_at(P, DIRECTION + 1, j) + half * r1
            c, e, m = first, first.attitude, first.bias
            r0 = r0 + e[0] * a0 + e[1] * a1 + e[2] * a2 + m[0] * b0 + m[1] * b1 + m[2] * b2
            r0 = r0 + c.length * length + c.direction[0] * d0 + c.direction[1] * d1
            r0 = r0 + c.air[0] * w0 + c.air[1] * w1
            c, e, m = second, second.attitude, second.bias
            r1 = r1 + e[0] * a0 + e[1] * a1 + e[2] * a2 + m[0] * b0 + m[1] * b1 + m[2] * b2
            r1 = r1 + c.length * length + c.direction[0] * d0 + c.direction[1] * d1
            r1 = r1 + c.air[0] * w0 + c.air[1] * w1
            put_wide(P, RATE, j, r0)
            put_wide(P, RATE + 1, j, r1)
            put_wide(P, DIRECTION, j, d0 + half * r0)
            put_wide(P, DIRECTION + 1, j, d1 + half * r1)
        v0, v1, v2 = wide_at(P, VELOCITY, j), wide_at(P, VELOCITY + 1, j), wide_at(P, VELOCITY + 2, j)
        x0 = wide_at(P, POSITION, j) + half * v0
        x1 = wide_at(P, POSITION + 1, j) + half * v1
        x2 = wide_at(P, POSITION + 2, j) + half * v2
        # velocity += dt (attitude x f) - dt R bias
        p0, p1, p2 = dt * b0, dt * b1, dt * b2
        v0 = v0 + f[2] * a1 - f[1] * a2 - R[0][0] * p0 - R[0][1] * p1 - R[0][2] * p2
        v1 = v1 + f[0] * a2 - f[2] * a0 - R[1][0] * p0 - R[1][1] * p1 - R[1][2] * p2
        v2 = v2 + f[1] * a0 - f[0] * a1 - R[2][0] * p0 - R[2][1] * p1 - R[2][2] * p2
        put_wide(P, VELOCITY, j, v0)
        put_wide(P, VELOCITY + 1, j, v1)
        put_wide(P, VELOCITY + 2, j, v2)
        put_wide(P, POSITION, j, x0 + half * v0)
        put_wide(P, POSITION + 1, j, x1 + half * v1)
        put_wide(P, POSITION + 2, j, x2 + half * v2)
        p0, p1, p2 = dt * g0, dt * g1, dt * g2
        put_wide(P, ATTITUDE, j, a0 - R[0][0] * p0 - R[0][1] * p1 - R[0][2] * p2)
        put_wide(P, ATTITUDE + 1, j, a1 - R[1][0] * p0 - R[1][1] * p1 - R[1][2] * p2)
        put_wide(P, ATTITUDE + 2, j, a2 - R[2][0] * p0 - R[2][1] * p1 - R[2][2] * p2)


@kernel
def _scale_rows(P: Array, first: int, last: int, factor: float, n: int) -> None:
    """Multiply the rows from `first` to before `last` by `factor`, the share of their errors that is left."""
    step = columns_at_once(P)
    for i in range(first, last):
        for j in range(0, n, step):
            put_wide(P, i, j, factor * wide_at(P, i, j))


@kernel
def _decay_errors(P: Array, gnss_decay: float, tuning: EstimatorTuning, dt: float, n: int) -> None:
    """Let errors return to zero: those of the accelerations by the air, and the receiver's slow error, of
    which the share `gnss_decay` is kept."""
    _scale_rows(P, AIR, AIR + 2, decay_factor(tuning.air_std, tuning.air_walk, dt), n)
    if n >= AIDED_SIZE:
        _scale_rows(P, GNSS, GNSS + 3, gnss_decay, n)
    if n == SIZE:
        _scale_rows(P, PUSH, PUSH + 2, decay_factor(tuning.push_std, tuning.push_walk, dt), n)


@kernel
def decay_factor(std: float, walk: float, dt: float) -> float:
    """The share of an error that is left after dt (s), such that with this walk its deviation stays `std`."""
    return 1.0 - 0.5 * dt * walk * walk / (std * std)


@kernel
def propagate_covariance(
    history: History, inputs: PropagationInputs, tuning: EstimatorTuning, dt: float, n: int
) -> None:
    """Propagate the covariance by dt seconds, in place, with the noise of one sample."""
    before = history.covariance
    decay = dt / tuning.gnss_time
    gnss_decay = 1.0 - decay * inputs.reversion
    first, second = _cable_rate_jacobian(inputs, dt, 0), _cable_rate_jacobian(inputs, dt, 1)
    _move_rows(before, inputs, first, second, dt, n, 0)
    _decay_errors(before, gnss_decay, tuning, dt, n)
    transpose(before, n)
    P = transposed(before)
    # what lies below the diagonal is overwritten in the end
    _move_rows(P, inputs, first, second, dt, n, DIRECTION)
    _decay_errors(P, gnss_decay, tuning, dt, n)

    accel = inputs.accel_var * dt * dt
    gyro = inputs.gyro_var * dt * dt
    air, push = inputs.air_walk * inputs.air_walk * dt, tuning.push_walk * tuning.push_walk * dt
    gyro_walk = tuning.gyro_bias_walk * tuning.gyro_bias_walk * dt
    accel_walk = tuning.accel_bias_walk * tuning.accel_bias_walk * dt
    for i in range(3):
        P[VELOCITY + i, VELOCITY + i] += accel
        P[ATTITUDE + i, ATTITUDE + i] += gyro
        P[GYRO_BIAS + i, GYRO_BIAS + i] += gyro_walk
        P[ACCEL_BIAS + i, ACCEL_BIAS + i] += accel_walk
    if inputs.taut > 0.0:
        # the accelerometer's noise drives vehicle and cable alike
        s = accel / inputs.length
        for i in range(3):
            P[VELOCITY + i, RATE] -= s * inputs.across[i]
            P[VELOCITY + i, RATE + 1] -= s * inputs.along[i]
        model = s / inputs.length + inputs.cable_accel_std * inputs.cable_accel_std * dt * dt
        P[RATE, RATE] += model
        P[RATE + 1, RATE + 1] += model
        P[LENGTH, LENGTH] += inputs.separation_std * inputs.separation_std * dt * dt
    for i in range(2):
        P[AIR + i, AIR + i] += air
        if n == SIZE:
            P[PUSH + i, PUSH + i] += push
    if n >= AIDED_SIZE:
        P[BAROMETER, BAROMETER] += tuning.barometer_walk * tuning.barometer_walk * dt
        horizontal_std, vertical_std = inputs.horizontal_slow_std, inputs.vertical_slow_std
        P[GNSS, GNSS] += 2.0 * decay * horizontal_std * horizontal_std
        P[GNSS + 1, GNSS + 1] += 2.0 * decay * horizontal_std * horizontal_std
        P[GNSS + 2, GNSS + 2] += 2.0 * decay * vertical_std * vertical_std
    symmetrise(P, n)


@kernel
def zero_covariance(P: Array, first: int, count: int) -> None:
    """Zero the rows and columns of a part of the state."""
    for i in range(first, first + count):
        for j in range(SIZE):
            P[i, j] = 0.0
            P[j, i] = 0.0


@kernel
def _clear(array: Array, row: int) -> None:
    """Zero a row by assignment: a NaN would survive a multiplication by zero."""
    for j in range(array.shape[1]):
        array[row, j] = 0.0


@kernel
def start_correction(history: History) -> None:
    """Begin the correction of another reading."""
    _clear(history.error, 0)


@kernel
def start_scalar(history: History, k: int, innovation: float, variance: float) -> None:
    """Begin scalar k of a reading: its innovation against the state before the reading, and its variance."""
    history.columns[k, 0] = 0
    history.scalars[k, INNOVATION], history.scalars[k, VARIANCE] = innovation, variance


@kernel
def add_jacobian_entry(history: History, k: int, column: int, share: float) -> None:
    """Add an entry to the Jacobian of scalar k: `share` times the error in `column`."""
    if share != 0.0:
        at = history.columns[k, 0] + 1
        history.columns[k, 0] = at
        history.columns[k, at], history.jacobian[k, at] = column, share


@kernel
def compute_gain_rows(history: History, first: int, last: int, n: int) -> None:
    """Compute the rows of H P of the scalars from `first` to before `last`."""
    for k in range(first, last):
        combine(history.gain, k, history.covariance, history.columns, history.jacobian, n)


@kernel
def scalar_covariance(history: History, k: int, other: int) -> float:
    """Covariance of two scalars by the state: the Jacobian of scalar k times the gathered row of `other`."""
    total = 0.0
    for entry in range(1, history.columns[k, 0] + 1):
        total += history.jacobian[k, entry] * history.gain[other, history.columns[k, entry]]
    return total


@kernel
def normalised_innovation_squared(history: History, count: int) -> float:
    """The sum of the squared innovations over their variances of the first `count` scalars, whose rows are
    gathered; each scalar is taken by itself."""
    total = 0.0
    for k in range(count):
        innovation = history.scalars[k, INNOVATION]
        total += innovation * innovation / (scalar_covariance(history, k, k) + history.scalars[k, VARIANCE])
    return total


@kernel
def within_gate(history: History, sensor: int, count: int, gate_sigma: float) -> bool:
    """Whether the first `count` scalars, whose rows are gathered, are together within `gate_sigma` standard
    deviations; NaN is not. Keeps the ratio for this row of `consistency`."""
    nis, limit = normalised_innovation_squared(history, count), count * gate_sigma * gate_sigma
    history.consistency[sensor, TEST_RATIO] = nis / limit
    return nis <= limit


@kernel
def fuse_scalars(history: History, count: int, n: int) -> float:
    """Absorb the first `count` scalars, whose rows are gathered: reduce P, collect the correction in `error`.

    Returns the sum of their squared innovations over their variances, each given the scalars before it.
    """
    gain, scalars = history.gain, history.scalars
    lanes = columns_at_once(gain) == 1
    nis = _decorrelate_in_lanes(history, count, n) if lanes else _decorrelate(history, count, n)
    accumulate_and_scale(history.error, gain, scalars, count, n)
    whole = count + -count % 3
    for k in range(count, whole):
        _clear(gain, k)
    subtract_squares(history.covariance, gain, whole, n)
    return nis


@kernel
def _decorrelate(history: History, count: int, n: int) -> float:
    """Reduce each scalar to what it adds to the scalars before it. In place of innovation and variance, leave
    the two factors of its row: that for the correction of the state, and that for the square root of what P
    loses. Returns the sum of the squared innovations over their variances."""
    gain, scalars = history.gain, history.scalars
    nis = 0.0
    for k in range(count):
        s = 1.0 / (scalar_covariance(history, k, k) + scalars[k, VARIANCE])
        innovation = scalars[k, INNOVATION]
        for m in range(k + 1, count):
            share = scalar_covariance(history, m, k) * s
            scalars[m, INNOVATION] -= share * innovation
            subtract_row(gain, m, share, k, n)
        nis += innovation * innovation * s
        scalars[k, INNOVATION], scalars[k, VARIANCE] = innovation * s, sqrt(s)
    return nis


@kernel
def _decorrelate_in_lanes(history: History, count: int, n: int) -> float:
    """The same, row by row: what a row loses to the rows before it is subtracted in one pass."""
    gain, jacobian, scalars = history.gain, history.jacobian, history.scalars
    nis = 0.0
    for m in range(count):
        for k in range(m):
            share = scalar_covariance(history, m, k) * scalars[k, VARIANCE]
            scalars[m, INNOVATION] -= share * scalars[k, INNOVATION]
            jacobian[k, 0] = share
        subtract_rows(gain, m, jacobian, n)
        s = 1.0 / (scalar_covariance(history, m, m) + scalars[m, VARIANCE])
        nis += scalars[m, INNOVATION] * scalars[m, INNOVATION] * s
        scalars[m, VARIANCE] = s
    for k in range(count):
        s = scalars[k, VARIANCE]
        scalars[k, INNOVATION], scalars[k, VARIANCE] = scalars[k, INNOVATION] * s, sqrt(s)
    return nis
