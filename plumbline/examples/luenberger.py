"""A Luenberger observer of vehicle and load, compiled: a model corrected by the readings of the trackers.

For rooms where trackers see vehicle and load (`lab`). The inertial unit drives the model. Each reading of a
tracker, which is some milliseconds old, is compared with the state of the model at the time of the reading.

| symbol   | code name | frame | unit  | meaning                                             |
|----------|-----------|-------|-------|-----------------------------------------------------|
| x, v     | x, v      | world | m, m/s | of the vehicle                                     |
| R, omega | R, omega  | , body | , rad/s | attitude, body to world; body rate               |
| b_a, b_g | b_a, b_g  | body  | m/s^2, rad/s | biases of accelerometer and gyro            |
| x_L, v_L | x_L, v_L  | world | m, m/s | of the load                                        |
| q, L     | q, length | world | , m   | direction and distance from vehicle to load         |

While the cable is taut the load is a pendulum below a vehicle of known acceleration a:

    x_L'' = a + L q'',   L q'' = -(I - q q^T) (a + g e_3) - L |q'|^2 q

The gains follow from the bandwidths w: they place all poles of the error dynamics at -w, three for the
position of the vehicle, and two each for attitude and load.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from plumbline.estimators import Estimate, Parameter, Sensed, estimated, kernel, no_estimate
from plumbline.vectors import (
    E3,
    IDENTITY,
    ZERO,
    Mat3,
    Vec3,
    add,
    apply,
    apply_transposed,
    axpy,
    dot,
    norm,
    rotation,
    rotation_vector,
    scale,
    sub,
    turned,
    turned_back,
)

PARAMETERS = {
    "OBS_W_QUAD": Parameter(15.0, 1.0, 60.0, "rad/s", "Bandwidth of the observer of the vehicle's position"),
    "OBS_W_TURN": Parameter(30.0, 1.0, 100.0, "rad/s", "Bandwidth of the observer of the attitude"),
    "OBS_W_LOAD": Parameter(25.0, 1.0, 100.0, "rad/s", "Bandwidth of the observer of the load"),
}


class Memory(NamedTuple):
    """The model's state."""

    started: bool
    x: Vec3
    v: Vec3
    R: Mat3
    b_a: Vec3
    b_g: Vec3
    x_L: Vec3
    v_L: Vec3
    pose_s: float  # time of the latest reading of each tracker
    load_s: float


class Tuning(NamedTuple):
    """Bandwidths, and the assumed gravity and load mass."""

    w_quad: float  # rad/s
    w_turn: float
    w_load: float
    gravity: float  # m/s^2
    load_mass: float  # kg


class Luenberger(Tuning):
    """The observer, which consists of its tuning."""

    parameters = PARAMETERS

    @classmethod
    def build(cls, parameters: Mapping[str, float]) -> Luenberger:
        """The observer with the tuning given by the parameters."""
        w_quad, w_turn, w_load = (parameters[name] for name in PARAMETERS)
        return cls(w_quad, w_turn, w_load, parameters["VEH_GRAVITY"], parameters["VEH_LOAD_MASS"])

    @kernel
    def start(self, now: Sensed) -> Memory:
        """A model whose state is still unknown."""
        return Memory(False, ZERO, ZERO, IDENTITY, ZERO, ZERO, ZERO, ZERO, 0.0, 0.0)

    @kernel
    def estimate(self, m: Memory, now: Sensed) -> tuple[Memory, Estimate]:
        """The model one tick later, corrected by new readings."""
        pose, load, dt = now.pose, now.load, now.period_s
        if not m.started:
            if pose.new and load.new:
                m = Memory(
                    True, pose.x_quad, ZERO, pose.R, ZERO, ZERO, load.x_load, ZERO, pose.time_s, load.time_s
                )
            return m, no_estimate()

        # the model
        omega = sub(now.inertial.gyro, m.b_g)
        R = turned(m.R, rotation(scale(dt, omega)))
        felt = apply(R, sub(now.inertial.accel, m.b_a))
        a = axpy(-self.gravity, E3, felt)
        x, v = axpy(dt, m.v, m.x), axpy(dt, a, m.v)
        apart = sub(m.x_L, m.x)
        length = norm(apart)
        q = scale(1.0 / length, apart)
        a_L = ZERO
        if now.taut:
            rate = scale(1.0 / length, sub(m.v_L, m.v))
            across = axpy(-dot(rate, q), q, rate)
            swing = axpy(dot(felt, q), q, scale(-1.0, felt))
            a_L = add(a, axpy(-length * dot(across, across), q, swing))
        x_L, v_L = axpy(dt, m.v_L, m.x_L), axpy(dt, a_L, m.v_L)
        b_a, b_g, pose_s, load_s = m.b_a, m.b_g, m.pose_s, m.load_s

        # corrections by the readings of the trackers, compared with the model at their time
        if pose.new:
            age, T, w = now.time_s - pose.time_s, pose.time_s - pose_s, self.w_quad
            e = sub(pose.x_quad, axpy(-age, v, x))
            x, v = axpy(min(3.0 * w * T, 1.0), e, x), axpy(3.0 * w * w * T, e, v)
            b_a = axpy(-w * w * w * T, apply_transposed(R, e), b_a)
            then = turned(R, rotation(scale(-age, omega)))
            turn = rotation_vector(turned_back(then, pose.R))
            R = turned(R, rotation(scale(min(2.0 * self.w_turn * T, 1.0), turn)))
            b_g = axpy(-self.w_turn * self.w_turn * T, turn, b_g)
            pose_s = pose.time_s
        if load.new:
            age, T, w = now.time_s - load.time_s, load.time_s - load_s, self.w_load
            e = sub(load.x_load, axpy(-age, v_L, x_L))
            x_L, v_L = axpy(min(2.0 * w * T, 1.0), e, x_L), axpy(w * w * T, e, v_L)
            load_s = load.time_s

        apart = sub(x_L, x)
        length = norm(apart)
        q = scale(1.0 / length, apart)
        rate = scale(1.0 / length, sub(v_L, v))
        q_dot = axpy(-dot(rate, q), q, rate)
        tension = self.load_mass * norm(axpy(self.gravity, E3, a_L)) if now.taut else 0.0
        after = Memory(True, x, v, R, b_a, b_g, x_L, v_L, pose_s, load_s)
        return after, estimated(x_L, v_L, q, q_dot, x, v, R, sub(now.inertial.gyro, b_g), a, tension)
