"""A custom control law in plain Python; docs/laws.md describes everything that it can do.

Fly it: gcs fly hover --law my_name.py:MyName

World axes: x east, y north, z up. Body axes: x forward, y left, z up. Units: metres, seconds, newtons,
radians. Vectors in `now` are tuples of three floats, which numpy functions accept as they are.
"""

import numpy as np

from plumbline.laws import Parameter, force


class MyName:
    """A position loop for the load commands the cable's direction; an inner loop tracks that direction."""

    # the name in reports and tables; if omitted, the name of the class
    name = "my_name"

    # These become parameters of the autopilot. Set them with gcs fly ... --set MINE_KP=5, vary them with
    # gcs sweep ... --vary MINE_KP=3:8:6, or change them in flight from any ground station.
    # Parameter(default, minimum, maximum, unit, description)
    parameters = {
        "MINE_KP": Parameter(6.0, 0.0, 50.0, "1/s^2", "Gain of the load's position error"),
        "MINE_KI": Parameter(2.0, 0.0, 50.0, "1/s^3", "Gain of the integral of this error"),
        "MINE_KD": Parameter(4.5, 0.0, 50.0, "1/s", "Gain of the load's velocity error"),
        "MINE_KQ": Parameter(90.0, 0.0, 500.0, "1/s^2", "Gain of the cable's direction error"),
        "MINE_KW": Parameter(15.0, 0.0, 100.0, "1/s", "Gain of the cable's rate error"),
    }

    def __init__(self, parameters):
        """Called again when a parameter changes. `parameters` contains all of the autopilot's, by name."""
        self.k_p, self.k_i, self.k_d = (parameters[name] for name in ("MINE_KP", "MINE_KI", "MINE_KD"))
        self.k_q, self.k_w = parameters["MINE_KQ"], parameters["MINE_KW"]

    def start(self, now):
        """Return the memory with which the law begins, at take-off and after each change of mode."""
        return np.zeros(3)  # the integral

    def load_position(self, memory, now):
        """Called at each tick, 250 times a second: return the new memory and the command."""
        state, believed = now.state, now.believed

        # desired position of the load with its first three derivatives, and the errors; `believed` is what
        # the autopilot assumes of the vehicle; while the load lies on the ground, the integral is held
        x_d, v_d, a_d, jerk_d = map(np.array, now.reference.jet[:4])
        e_x, e_v = state.x_load - x_d, state.v_load - v_d
        integral = memory if believed.load_lies else memory + now.period_s * e_x
        a = a_d - self.k_p * e_x - self.k_i * integral - self.k_d * e_v

        # The cable can pull the load only along its own direction. q_d, the unit vector from vehicle to load,
        # is the direction in which its pull gives the load the acceleration a.
        pull = a + np.array([0.0, 0.0, believed.gravity])
        size = np.linalg.norm(pull)
        q_d = -pull / size
        q_d_dot = -(jerk_d - jerk_d.dot(q_d) * q_d) / size
        swing = self.k_q * (state.q_cable - q_d) + self.k_w * (state.q_cable_dot - q_d_dot)

        # the force of all rotors together, N, world; the built-in attitude loop turns the vehicle to it
        F = (believed.quad_mass + believed.load_mass) * pull + believed.quad_mass * now.cable.length * swing
        return integral, force(F)
