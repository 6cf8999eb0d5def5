"""A PID on the load's position, in plain Python.

It commands an acceleration of the load. From this follows the direction that the cable must have, and a
second loop swings the cable to it. Thrust and attitude are left to the built-in loop.

| symbol   | code name | frame | unit   | meaning                                  |
|----------|-----------|-------|--------|------------------------------------------|
| e_x, e_v | e_x, e_v  | world | m, m/s | position and velocity error of the load   |
| a        | a         | world | m/s^2  | commanded acceleration of the load        |
| q, q_d   | q, q_d    | world |        | direction of the cable, and the desired one |
| F        | F         | world | N      | force of the rotors                       |
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from plumbline.laws import Asked, Now, Parameter, force

Vector = NDArray[np.float64]


PARAMETERS = {
    "PID_KP": Parameter(6.0, 0.0, 50.0, "1/s^2", "Gain of the load's position error"),
    "PID_KI": Parameter(2.0, 0.0, 50.0, "1/s^3", "Gain of the integral of this error"),
    "PID_KD": Parameter(4.5, 0.0, 50.0, "1/s", "Gain of the load's velocity error"),
    "PID_KQ": Parameter(90.0, 0.0, 500.0, "1/s^2", "Gain of the cable's direction error"),
    "PID_KW": Parameter(15.0, 0.0, 100.0, "1/s", "Gain of the cable's rate error"),
}


class LoadPid:
    """PID on the load, PD on the cable."""

    parameters = PARAMETERS

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.k_p, self.k_i, self.k_d = (parameters[name] for name in ("PID_KP", "PID_KI", "PID_KD"))
        self.k_q, self.k_w = parameters["PID_KQ"], parameters["PID_KW"]

    def start(self, now: Now) -> Vector:
        """The integral when the mode begins."""
        return np.zeros(3)

    def load_position(self, integral: Vector, now: Now) -> tuple[Vector, Asked]:
        """The load follows the reference."""
        state, believed = now.state, now.believed
        x_d, v_d, a_d, jerk_d = map(np.array, now.reference.jet[:4])
        e_x, e_v = state.x_load - x_d, state.v_load - v_d
        if not believed.load_lies:
            integral = integral + now.period_s * e_x
        a = a_d - self.k_p * e_x - self.k_i * integral - self.k_d * e_v

        # the cable pulls the load along -q, so q_d is opposite to a + g e3
        pull = a + np.array([0.0, 0.0, believed.gravity])
        size = np.linalg.norm(pull)
        q_d = -pull / size
        q_d_dot = -(jerk_d - jerk_d.dot(q_d) * q_d) / size
        swing = self.k_q * (state.q_cable - q_d) + self.k_w * (state.q_cable_dot - q_d_dot)

        F = (believed.quad_mass + believed.load_mass) * pull
        return integral, force(F + believed.quad_mass * now.cable.length * swing)
