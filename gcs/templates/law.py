"""A control law of your own, in plain Python; docs/laws.md tells all that it may do.

Fly it: gcs fly hover --law my_name.py:MyName

World: x east, y north, z up. Body: x forward, y left, z up. Metres, seconds, newtons, radians. Vectors are
tuples of three floats, which numpy takes.
"""

import numpy as np

from plumbline.laws import Parameter, force


class MyName:
    """Steers the load as a weight on a string: a position loop above a loop for the cable."""

    # shown by --law and in tables; without it the name of the class
    name = "my_name"

    # become parameters of the autopilot: gcs fly ... --set MINE_KP=5, gcs sweep ... --vary MINE_KP=3:8:6,
    # or from any ground station while it flies. Default, least, greatest, unit, text.
    parameters = {
        "MINE_KP": Parameter(6.0, 0.0, 50.0, "1/s^2", "Gain of the load's position error"),
        "MINE_KI": Parameter(2.0, 0.0, 50.0, "1/s^3", "Gain of the integral of this error"),
        "MINE_KD": Parameter(4.5, 0.0, 50.0, "1/s", "Gain of the load's velocity error"),
        "MINE_KQ": Parameter(90.0, 0.0, 500.0, "1/s^2", "Gain of the cable's direction error"),
        "MINE_KW": Parameter(15.0, 0.0, 100.0, "1/s", "Gain of the cable's rate error"),
    }

    def __init__(self, parameters):
        """Made anew when a parameter changes; `parameters` has all of the autopilot's, by name."""
        self.k_p, self.k_i, self.k_d = (parameters[name] for name in ("MINE_KP", "MINE_KI", "MINE_KD"))
        self.k_q, self.k_w = parameters["MINE_KQ"], parameters["MINE_KW"]

    def start(self, now):
        """What the law remembers when it begins, on take-off and after each change of mode."""
        return np.zeros(3)  # the integral

    def load_position(self, memory, now):
        """At each tick, 250 times a second: what is remembered from now on, and what is asked for."""
        state, believed = now.state, now.believed

        # where the load is to be, with the derivatives of that
        x_d, v_d, a_d, jerk_d = map(np.array, now.reference.jet[:4])
        e_x, e_v = state.x_load - x_d, state.v_load - v_d
        integral = memory if believed.load_lies else memory + now.period_s * e_x
        a = a_d - self.k_p * e_x - self.k_i * integral - self.k_d * e_v

        # the cable pulls the load along its own direction: q_d gives the acceleration that is asked for
        pull = a + np.array([0.0, 0.0, believed.gravity])
        size = np.linalg.norm(pull)
        q_d = -pull / size
        q_d_dot = -(jerk_d - jerk_d.dot(q_d) * q_d) / size
        swing = self.k_q * (state.q_cable - q_d) + self.k_w * (state.q_cable_dot - q_d_dot)

        # the force of the rotors; the built-in attitude loop turns the vehicle to it
        F = (believed.quad_mass + believed.load_mass) * pull + believed.quad_mass * now.cable.length * swing
        return integral, force(F)
