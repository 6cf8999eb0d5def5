"""A vehicle and pendulum on a known path, and the estimator fed with readings of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from autopilot.estimation.filter import Readings, estimate, estimator_tuning
from autopilot.estimation.records import (
    TRACKED_SIZE,
    EstimatorState,
    EstimatorTuning,
    ImuReading,
    LoadReading,
    PoseReading,
    blank_state,
    new_history,
)
from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters

Array = NDArray[Any]
TICK_S = 0.004
GRAVITY, CABLE_LENGTH = 9.81, 0.7


def bebop_tuning() -> EstimatorTuning:
    """The estimator as delivered, for the vehicle of Table 4-1."""
    return estimator_tuning(autopilot_parameters(load_vehicle("bebop")))


class Motion:
    """A vehicle on a given path and a pendulum hung from it, as functions of time; no code is shared with
    plant or estimator.

    The pivot moves along sums of sines, the attitude by sines of its Euler angles; the pendulum is the
    integral of  L q'' = -(I - q q^T)(x_Q'' + g e3) - L |q'|^2 q  by SciPy to eleven digits. With `accel`
    the vehicle goes along x at that constant acceleration instead, level, the pendulum at rest in its frame.
    """

    def __init__(self, end_s: float, accel: float | None = None) -> None:
        self.accel = accel
        # amplitude (m), rate (rad/s), phase for each axis
        self._sines = (
            ((0.6, 1.3, 0.2), (0.05, 5.1, 1.0)),
            ((0.5, 0.9, 1.1), (0.04, 6.3, 0.0)),
            ((0.3, 1.7, 0.0), (0.02, 4.4, 2.0)),
        )
        if accel is None:
            start = np.array([0.1, -0.05, 0.0, 0.1, 0.2, 0.0])
            q = np.array([start[0], start[1], -np.sqrt(1.0 - start[0] ** 2 - start[1] ** 2)])
            q_dot = np.array([start[3], start[4], 0.0])
            q_dot -= q * (q @ q_dot)
            self._swing = solve_ivp(
                self._pendulum,
                (-0.5, end_s + 0.1),
                np.concatenate([q, q_dot]),
                method="DOP853",
                rtol=1e-11,
                atol=1e-12,
                dense_output=True,
            ).sol

    def x_quad(self, t: Array | float, order: int = 0) -> Array:
        """Position (order 0) of the vehicle or its derivative, ENU; (..., 3)."""
        t = np.asarray(t, dtype=float)
        if self.accel is not None:
            zero = np.zeros_like(t)
            along = (0.5 * self.accel * t**2, self.accel * t, self.accel + zero)[order]
            return np.stack([along, zero, zero + (2.0 if order == 0 else 0.0)], axis=-1)
        return np.stack(
            [
                sum(a * w**order * np.sin(w * t + p + order * np.pi / 2) for a, w, p in axis)
                + (2.0 if (i, order) == (2, 0) else 0.0)
                for i, axis in enumerate(self._sines)
            ],
            axis=-1,
        )

    def attitude(self, t: Array | float) -> Rotation:
        """Body to world."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        still = 0.0 if self.accel is not None else 1.0
        angles = [0.4 * np.sin(0.7 * t), 0.2 * np.sin(1.9 * t + 0.3), 0.25 * np.sin(2.3 * t)]
        return Rotation.from_euler("ZYX", still * np.stack(angles, axis=-1))

    def omega_body(self, t: Array) -> Array:
        """Body rate, by a central difference of the attitude."""
        h = 1e-5
        turn = self.attitude(t - h).inv() * self.attitude(t + h)
        return np.asarray(turn.as_rotvec() / (2.0 * h))

    def specific_force(self, t: Array) -> Array:
        """What an accelerometer in the centre of mass feels, body."""
        return np.asarray(self.attitude(t).inv().apply(self.x_quad(t, 2) + np.array([0.0, 0.0, GRAVITY])))

    def _pendulum(self, t: float, y: Array) -> Array:
        q, q_dot = y[:3], y[3:]
        push = self.x_quad(t, 2) + np.array([0.0, 0.0, GRAVITY])
        return np.concatenate([q_dot, -(push - q * (q @ push)) / CABLE_LENGTH - q * (q_dot @ q_dot)])

    def cable(self, t: Array | float) -> tuple[Array, Array]:
        """q and q', vehicle to load; (..., 3) each."""
        t = np.asarray(t, dtype=float)
        if self.accel is not None:
            q = np.array([-self.accel, 0.0, -GRAVITY]) / np.hypot(self.accel, GRAVITY)
            return np.broadcast_to(q, (*t.shape, 3)), np.zeros((*t.shape, 3))
        y = self._swing(t)
        return np.moveaxis(y[:3], 0, -1), np.moveaxis(y[3:], 0, -1)

    def x_load(self, t: Array | float) -> Array:
        return np.asarray(self.x_quad(t) + CABLE_LENGTH * self.cable(t)[0])

    def v_load(self, t: Array | float) -> Array:
        return np.asarray(self.x_quad(t, 1) + CABLE_LENGTH * self.cable(t)[1])


def three(a: Array) -> Vec3:
    return (float(a[0]), float(a[1]), float(a[2]))


def four(a: Array) -> Quat:
    return (float(a[0]), float(a[1]), float(a[2]), float(a[3]))


@dataclass(frozen=True)
class Noise:
    """Standard deviations of white noise, constant biases, latency of both trackers; the profile `lab`."""

    gyro: float = 0.005
    accel: float = 0.05
    position: float = 0.001
    angle: float = 0.0007
    gyro_bias: Sequence[float] = (0.002, -0.002, 0.002)
    accel_bias: Sequence[float] = (0.03, -0.03, 0.03)
    latency_s: float = 0.004
    rate_hz: float = 200.0


@dataclass
class Trace:
    """Estimates tick by tick, beside the truth."""

    t: Array
    states: list[EstimatorState] = field(default_factory=list)
    covariances: list[Array] = field(default_factory=list)  # of the error state

    def of(self, what: Callable[[EstimatorState], Any]) -> Array:
        return np.array([what(state) for state in self.states])


def track(
    motion: Motion,
    end_s: float,
    noise: Noise,
    seed: int,
    tuning: EstimatorTuning | None = None,
    tampered: Callable[[float, np.ndarray, str], Array | None] = lambda t, x, who: x,
) -> Trace:
    """The estimator fed with readings of `motion`; `tampered` may change a reading of "vehicle" or "load"."""
    rng = np.random.default_rng(seed)
    tuning = tuning or bebop_tuning()
    ticks = round(end_s / TICK_S)
    t = TICK_S * np.arange(ticks)
    gyro = motion.omega_body(t) + noise.gyro_bias + rng.normal(0.0, 1.0, (ticks, 3)) * noise.gyro
    accel = motion.specific_force(t) + noise.accel_bias + rng.normal(0.0, 1.0, (ticks, 3)) * noise.accel
    at = np.arange(0.0, end_s, 1.0 / noise.rate_hz)
    x_quad = motion.x_quad(at) + rng.normal(0.0, 1.0, (at.size, 3)) * noise.position
    x_load = motion.x_load(at) + rng.normal(0.0, 1.0, (at.size, 3)) * noise.position
    turned = motion.attitude(at) * Rotation.from_rotvec(rng.normal(0.0, 1.0, (at.size, 3)) * noise.angle)
    quat = turned.as_quat(scalar_first=True)

    state, history = blank_state(), new_history()
    trace = Trace(t)
    position_std, angle_std = max(noise.position, 2e-5), max(noise.angle, 2e-5)
    due = 0
    for k in range(ticks):
        poses, loads = [], []
        while due < at.size and at[due] + noise.latency_s <= t[k] + 1e-9:
            age = float(t[k] - at[due])
            seen = tampered(float(at[due]), x_quad[due], "vehicle")
            if seen is not None:
                q = four(quat[due])
                place = three(seen)
                poses.append(PoseReading(age, place, q, (0.0, 0.0, 0.0), position_std, angle_std, -1.0))
            seen = tampered(float(at[due]), x_load[due], "load")
            if seen is not None:
                place = three(seen)
                loads.append(LoadReading(age, place, (0.0, 0.0, 0.0), position_std, -1.0))
            due += 1
        imu = ImuReading(three(gyro[k]), three(accel[k]))
        state = estimate(
            state, history, Readings(imu, tuple(poses), tuple(loads)), tuning, TICK_S if k else 0.0
        )
        trace.states.append(state)
        trace.covariances.append(history.covariance[:TRACKED_SIZE, :TRACKED_SIZE].copy())
    return trace
