"""The covariance of the error state: moved in time by its known sparsity, narrowed by one scalar at a time.

An error x of the state obeys x' = F x + noise. `transit` applies Phi = I + F dt to the rows of P, transposes
and applies it again, Phi (Phi P)^T = Phi P Phi^T, so that each of the two passes runs along rows.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.estimation.records import (
    ACCEL_BIAS,
    ATTITUDE,
    BAROMETER,
    DIRECTION,
    GNSS,
    GYRO_BIAS,
    LENGTH,
    POSITION,
    RATE,
    SIZE,
    VELOCITY,
    Array,
    EstimatorTuning,
    History,
    Steps,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, apply_transposed, cross, dot, scale


class Transit(NamedTuple):
    """What the error's motion depends on: specific force (world), attitude, and the cable's frame."""

    force: Vec3
    R: Mat3
    q_cable: Vec3
    across: Vec3
    along: Vec3  # second axis: q_cable x across
    q_cable_dot: Vec3
    length: float
    taut: float
    horizontal_slow: float
    vertical_slow: float
    reversion: float  # of the receiver's slow error, in units of the rate at which it changes
    cable_accel_std: float  # rad/s^2
    parting_std: float  # m/s, at which the ends of the cable part


@kernel
def _step(steps: Steps, k: int, to: int, of: int, factor: float) -> int:
    """Write step k: row `to` += factor times row `of`. The number of the next one."""
    steps.to[k], steps.of[k], steps.factor[k] = to, of, factor
    return k + 1


@kernel
def _step3(steps: Steps, k: int, to: int, of: int, c: Vec3) -> int:
    """Row `to` += c . rows of ... of+2, of which what is zero is left out."""
    for i in range(3):
        if c[i] != 0.0:
            k = _step(steps, k, to, of + i, c[i])
    return k


@kernel
def _half(steps: Steps, k: int, to: Transit, dt: float) -> int:
    """Half a step of position and direction with their present rates."""
    for i in range(3):
        k = _step(steps, k, POSITION + i, VELOCITY + i, 0.5 * dt)
    if to.taut > 0.0:
        for i in range(2):
            k = _step(steps, k, DIRECTION + i, RATE + i, 0.5 * dt)
    return k


@kernel
def _plan(steps: Steps, to: Transit, dt: float) -> int:
    """The rows' steps of Phi, in order; how many they are."""
    f, R = to.force, to.R
    k = _half(steps, 0, to, dt)
    if to.taut > 0.0:
        rates = (dot(to.across, to.q_cable_dot), dot(to.along, to.q_cable_dot))
        speed2 = rates[0] * rates[0] + rates[1] * rates[1]
        stiff = dot(to.q_cable, f) / to.length - speed2
        s = dt / to.length
        for i in range(2):
            # driven by attitude error, accelerometer bias and length
            axis = to.across if i == 0 else to.along
            k = _step3(steps, k, RATE + i, ATTITUDE, scale(-s, cross(f, axis)))
            k = _step3(steps, k, RATE + i, ACCEL_BIAS, scale(s, apply_transposed(R, axis)))
            k = _step(steps, k, RATE + i, LENGTH, s / to.length * dot(axis, f))
            # two neighbouring paths on the sphere draw together: |q'|^2 across the motion
            k = _step(steps, k, RATE + i, DIRECTION + i, dt * (stiff + rates[i] * rates[i]))
            k = _step(steps, k, RATE + i, DIRECTION + 1 - i, dt * rates[0] * rates[1])
    lever = ((0.0, dt * f[2], -dt * f[1]), (-dt * f[2], 0.0, dt * f[0]), (dt * f[1], -dt * f[0], 0.0))
    for i in range(3):
        k = _step3(steps, k, VELOCITY + i, ATTITUDE, lever[i])
        k = _step3(steps, k, VELOCITY + i, ACCEL_BIAS, scale(-dt, R[i]))
        k = _step3(steps, k, ATTITUDE + i, GYRO_BIAS, scale(-dt, R[i]))
    return _half(steps, k, to, dt)


@kernel
def transit(history: History, to: Transit, tuning: EstimatorTuning, dt: float, n: int) -> None:
    """The covariance dt seconds on, in place, with the noise of one sample."""
    P, steps = history.covariance, history.steps
    forget = dt / tuning.gnss_time
    keep = 1.0 - forget * to.reversion
    count = _plan(steps, to, dt)
    for turn in range(2):
        for k in range(count):
            i, of, factor = steps.to[k], steps.of[k], steps.factor[k]
            for j in range(n):
                P[i, j] += factor * P[of, j]
        for i in range(GNSS, n):
            for j in range(n):
                P[i, j] *= keep
        if turn == 0:
            for i in range(n):
                for j in range(i):
                    P[i, j], P[j, i] = P[j, i], P[i, j]

    accel = tuning.accel_std * tuning.accel_std * dt * dt
    gyro = tuning.gyro_std * tuning.gyro_std * dt * dt
    gyro_walk = tuning.gyro_bias_walk * tuning.gyro_bias_walk * dt
    accel_walk = tuning.accel_bias_walk * tuning.accel_bias_walk * dt
    for i in range(3):
        P[VELOCITY + i, VELOCITY + i] += accel
        P[ATTITUDE + i, ATTITUDE + i] += gyro
        P[GYRO_BIAS + i, GYRO_BIAS + i] += gyro_walk
        P[ACCEL_BIAS + i, ACCEL_BIAS + i] += accel_walk
    if to.taut > 0.0:
        # the accelerometer's noise drives vehicle and cable alike
        s = accel / to.length
        for i in range(3):
            P[VELOCITY + i, RATE] -= s * to.across[i]
            P[VELOCITY + i, RATE + 1] -= s * to.along[i]
        model = s / to.length + to.cable_accel_std * to.cable_accel_std * dt * dt
        P[RATE, RATE] += model
        P[RATE + 1, RATE + 1] += model
        P[LENGTH, LENGTH] += to.parting_std * to.parting_std * dt * dt
    if n == SIZE:
        P[BAROMETER, BAROMETER] += tuning.barometer_walk * tuning.barometer_walk * dt
        level, climb = to.horizontal_slow, to.vertical_slow
        P[GNSS, GNSS] += 2.0 * forget * level * level
        P[GNSS + 1, GNSS + 1] += 2.0 * forget * level * level
        P[GNSS + 2, GNSS + 2] += 2.0 * forget * climb * climb
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i]


@kernel
def forget(P: Array, first: int, count: int) -> None:
    """Zero the rows and columns of a part of the state."""
    for i in range(first, first + count):
        for j in range(SIZE):
            P[i, j] = 0.0
            P[j, i] = 0.0


@kernel
def clear_row(history: History, n: int) -> None:
    """Begin the Jacobian of another scalar."""
    for i in range(n):
        history.row[i] = 0.0


@kernel
def begin(history: History) -> None:
    """Begin the correction of another reading."""
    for i in range(SIZE):
        history.error[i] = 0.0


@kernel
def spread(history: History, n: int) -> float:
    """Variance of the scalar whose Jacobian is in `row`: row P row^T; `gain` receives P row^T."""
    P, row, gain = history.covariance, history.row, history.gain
    for i in range(n):
        gain[i] = 0.0
    for j in range(n):
        h = row[j]
        if h != 0.0:
            for i in range(n):
                gain[i] += P[j, i] * h
    variance = 0.0
    for j in range(n):
        if row[j] != 0.0:
            variance += row[j] * gain[j]
    return variance


@kernel
def absorb(history: History, innovation: float, variance: float, n: int) -> float:
    """Absorb a scalar with Jacobian `row`: P narrows, `error` gathers what the state is to be moved by.

    `innovation` is against the state before the reading; what `error` already holds is taken off. Returns the
    innovation squared over its variance.
    """
    P, row, gain, error = history.covariance, history.row, history.gain, history.error
    s = 1.0 / (spread(history, n) + variance)
    left = innovation
    for j in range(n):
        if row[j] != 0.0:
            left -= row[j] * error[j]
    for i in range(n):
        error[i] += gain[i] * (left * s)
    for i in range(n):
        g = gain[i]
        for j in range(n):
            P[i, j] -= (g * gain[j]) * s  # in this order: the same bits for (j, i)
    return left * left * s
