"""A custom state estimator in plain Python; docs/estimators.md describes everything that it can do.

Fly it: gcs fly hover --estimator my_name.py:MyName

For rooms in which trackers measure vehicle and load (--sensors lab). World axes: x east, y north, z up. Body
axes: x forward, y left, z up. Units: metres, seconds, newtons, radians. Vectors in `now` are tuples of three
floats, which numpy functions accept as they are.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from plumbline.estimators import Parameter, estimated, no_estimate

UP = np.array([0.0, 0.0, 1.0])


class Memory(NamedTuple):
    """What is kept from tick to tick: vehicle (x, v, R), biases of the inertial unit, load (x_L, v_L)."""

    x: np.ndarray
    v: np.ndarray
    R: Rotation  # body to world
    accel_bias: np.ndarray
    gyro_bias: np.ndarray
    x_L: np.ndarray
    v_L: np.ndarray
    pose_s: float  # time of the vehicle tracker's last reading
    load_s: float  # time of the load tracker's last reading


class MyName:
    """Predicts vehicle and load from the inertial unit, and corrects the prediction by the trackers."""

    # the name in the report; if omitted, the name of the class
    name = "my_name"

    # These become parameters of the autopilot. Set them with gcs fly ... --set MINE_W=8, vary them with
    # gcs sweep ... --vary MINE_W=3:15:5, or change them in flight from any ground station.
    # The faster the estimate follows a tracker, the more of its noise reaches the law, which multiplies it by
    # its gains: at three times these values, the template of a law and trackers of 2 mm drive the rotors to
    # their limits all the time, and the load is lost.
    # Parameter(default, minimum, maximum, unit, description)
    parameters = {
        "MINE_W": Parameter(6.0, 1.0, 60.0, "rad/s", "How fast the vehicle's place follows the tracker"),
        "MINE_W_TURN": Parameter(10.0, 1.0, 100.0, "rad/s", "How fast its attitude does"),
        "MINE_W_LOAD": Parameter(8.0, 1.0, 100.0, "rad/s", "How fast the load does"),
    }

    def __init__(self, parameters):
        """Called again when a parameter changes. `parameters` contains all of the autopilot's, by name."""
        self.w, self.w_turn, self.w_load = (parameters[n] for n in ("MINE_W", "MINE_W_TURN", "MINE_W_LOAD"))
        self.gravity = parameters["VEH_GRAVITY"]

    def start(self, now):
        """Return the memory with which the first tick begins: None, because nothing is known yet."""
        return

    def estimate(self, memory, now):
        """Called at each tick, 250 times a second: return the new memory and the estimate."""
        pose, load, dt, zero = now.pose, now.load, now.period_s, np.zeros(3)
        if memory is None:
            if pose.new and load.new:
                R = Rotation.from_matrix(pose.R)
                at = (np.array(pose.x_quad), zero, R, zero, zero, np.array(load.x_load), zero)
                memory = Memory(*at, pose.time_s, load.time_s)
            return memory, no_estimate()
        x, v, R, accel_bias, gyro_bias, x_L, v_L, pose_s, load_s = memory

        # Predict: the inertial unit measures the vehicle's body rate and specific force (`felt`, turned into
        # world axes); the load swings below the vehicle while the cable is taut, else it keeps its velocity.
        omega = now.inertial.gyro - gyro_bias
        R = R * Rotation.from_rotvec(omega * dt)
        felt = R.apply(now.inertial.accel - accel_bias)
        a = felt - self.gravity * UP
        length = np.linalg.norm(x_L - x)
        q = (x_L - x) / length
        q_dot = (v_L - v) / length
        q_dot = q_dot - q.dot(q_dot) * q
        a_L = zero
        if now.taut:
            a_L = a - (felt - q.dot(felt) * q) - length * q_dot.dot(q_dot) * q
        x, v, x_L, v_L = x + v * dt, v + a * dt, x_L + v_L * dt, v_L + a_L * dt

        # Correct: a tracker's reading is some milliseconds old when it arrives. It is therefore compared
        # with the prediction for the time of the reading.
        if pose.new:
            age, T, w = now.time_s - pose.time_s, pose.time_s - pose_s, self.w
            e = pose.x_quad - (x - v * age)
            x, v = x + 3.0 * w * T * e, v + 3.0 * w**2 * T * e
            accel_bias = accel_bias - w**3 * T * R.inv().apply(e)
            then = R * Rotation.from_rotvec(-omega * age)
            turn = (then.inv() * Rotation.from_matrix(pose.R)).as_rotvec()
            R = R * Rotation.from_rotvec(2.0 * self.w_turn * T * turn)
            gyro_bias = gyro_bias - self.w_turn**2 * T * turn
            pose_s = pose.time_s
        if load.new:
            age, T, w = now.time_s - load.time_s, load.time_s - load_s, self.w_load
            e = load.x_load - (x_L - v_L * age)
            x_L, v_L = x_L + 2.0 * w * T * e, v_L + w**2 * T * e
            load_s = load.time_s

        q = (x_L - x) / np.linalg.norm(x_L - x)
        q_dot = (v_L - v) / np.linalg.norm(x_L - x)
        q_dot = q_dot - q.dot(q_dot) * q
        memory = Memory(x, v, R, accel_bias, gyro_bias, x_L, v_L, pose_s, load_s)
        omega = now.inertial.gyro - gyro_bias
        return memory, estimated(x_L, v_L, q, q_dot, x, v, R.as_matrix(), omega, a)
