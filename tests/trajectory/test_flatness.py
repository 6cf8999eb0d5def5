"""The flat map: published point values, and the equations of motion (2-31)-(2-35) themselves."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
import sympy as sp

from autopilot.trajectory.flatness import FlatState, flat_outputs, unit_derivatives_4
from autopilot.trajectory.signals import Jet, evaluate, signal_table
from missions.model import Sine, Term

# The published values are printed with nine decimals.
PRINTED = 5.1e-10
# Residual of an equation of motion, with an eighth-order difference quotient for the derivative.
RESIDUAL = 1e-9

GRAVITY = 9.81
LISSAJOUS = (0.5, 0.087, 1.0, (2.32e-3, 2.32e-3, 4e-3), GRAVITY)
BEBOP = (0.4, 0.1, 0.7, (2.23e-3, 2.99e-3, 4.8e-3), GRAVITY)


def lissajous(t: float) -> Jet:
    """x_L = [2 (1 - cos(2 pi t/4)), 2.5 sin(2 pi t/5), 1.5 cos(2 pi t/7)] and its derivatives."""

    def wave(amplitude: float, period: float, phase: float, order: int) -> float:
        w = 2.0 * pi / period
        return amplitude * w**order * cos(w * t + phase + order * pi / 2.0)

    jet = [(wave(-2.0, 4.0, 0.0, n), wave(2.5, 5.0, -pi / 2.0, n), wave(1.5, 7.0, 0.0, n)) for n in range(7)]
    jet[0] = (jet[0][0] + 2.0, jet[0][1], jet[0][2])
    return tuple(jet)


def figure_eight(t: float) -> Jet:
    """The full amplitude of Case C, with the envelope's slow change left in."""
    return evaluate(_FIGURE_EIGHT, t)


_FIGURE_EIGHT = signal_table(
    [
        Term("x", 20.0, 0.0, 22.5, None, 0.0),
        Term("y", 1.0, 0.0, 22.5, 5.0, 22.5, (Sine(3.0),)),
        Term("z", 0.2, 0.0, 22.5, 5.0, 22.5, (Sine(1.5),)),
    ]
)

POINTS = {
    0.0: {
        "q_cable": (-0.497633687, 0.0, -0.867387292),
        "omega_cable": (0.433932999, 0.0, -0.248954164),
        "x_quad": (0.497633687, 0.0, 2.367387292),
        "thrust": 5.723033004,
        "tension": 0.862738603,
        "omega_body": (0.475955371, 0.0, 0.214491137),
        "moment": (0.0, -0.003040871, 0.0),
    },
    1.3: {
        "q_cable": (0.215892379, 0.379684358, -0.899572270),
        "omega_cable": (-0.063499515, -0.577972977, -0.259185802),
        "x_quad": (2.692088621, 2.115382463, 1.489109817),
        "thrust": 5.906967863,
        "tension": 0.902814355,
        "omega_body": (-0.019510209, -0.565139344, 0.003018459),
        "moment": (-0.001283222, 0.000718008, 0.000386687),
    },
    4.7: {
        "q_cable": (-0.208976431, -0.135561172, -0.968479231),
        "thrust": 6.045934756,
        "tension": 0.932692446,
        "moment": (0.00006241, -0.00045581, -0.000806914),
    },
}


@pytest.mark.parametrize("t", POINTS)
def test_published_point_values(t: float) -> None:
    flat = flat_outputs(lissajous(t), 0.0, *LISSAJOUS)
    found = {**flat._asdict(), "omega_cable": np.cross(flat.q_cable, flat.q_cable_dot)}
    for name, expected in POINTS[t].items():
        assert np.allclose(found[name], expected, rtol=0.0, atol=PRINTED), name


CASES = [
    (lissajous, 0.0, LISSAJOUS),
    (lissajous, 2.2, LISSAJOUS),
    (figure_eight, 0.0, BEBOP),
    (figure_eight, -0.7, BEBOP),
]
INSTANTS = (1.0, 4.7, 13.3, 21.3)


@pytest.mark.parametrize(("path", "heading", "body"), CASES)
def test_the_equations_of_motion_hold(path, heading, body, differentiate) -> None:
    m_Q, m_L, L, inertia, g = body
    J = np.diag(inertia)
    e3 = np.array([0.0, 0.0, 1.0])

    def flat(t: float) -> FlatState:
        return flat_outputs(path(t), heading, *body)

    for t in INSTANTS:
        s = flat(t)
        q, q_dot, q_ddot = (np.array(v) for v in (s.q_cable, s.q_cable_dot, s.q_cable_ddot))
        R, Omega = np.array(s.R), np.array(s.omega_body)
        force = s.thrust * R @ e3
        accel = np.array(path(t)[2])

        def slope(field: str, at: float = t) -> np.ndarray:
            return differentiate(lambda moment: getattr(flat(moment), field), at)

        residuals = {
            "kinematics of the cable": slope("q_cable") - q_dot,
            "its second derivative": slope("q_cable_dot") - q_ddot,
            "speed of the vehicle": slope("x_quad") - s.v_quad,
            "geometry": np.array(s.x_quad) - (np.array(path(t)[0]) - L * q),
            "(2-31)": (m_Q + m_L) * (accel + g * e3) - (q @ force - m_Q * L * q_dot @ q_dot) * q,
            "(2-33)": m_Q * L * np.cross(q, q_ddot) + np.cross(q, force),
            "(2-34)": slope("R") - R @ np.cross(np.eye(3), Omega),
            "rate": slope("omega_body") - s.omega_body_dot,
            "(2-35)": J @ slope("omega_body") + np.cross(Omega, J @ Omega) - s.moment,
            "Newton for the load": m_L * (accel + g * e3) + s.tension * q,
            "tension from the state": s.tension - m_L * (m_Q * L * q_dot @ q_dot - q @ force) / (m_Q + m_L),
            "rotation": R.T @ R - np.eye(3),
            "heading": R[:, 1] @ [cos(heading), sin(heading), 0.0],
        }
        for name, residual in residuals.items():
            assert np.max(np.abs(residual)) < RESIDUAL, (name, t)


def test_hover_needs_the_weight_and_nothing_else() -> None:
    zero = (0.0, 0.0, 0.0)
    flat = flat_outputs(((1.0, 2.0, 3.0), zero, zero, zero, zero, zero, zero), 0.0, *BEBOP)
    assert flat.q_cable == (0.0, 0.0, -1.0)
    assert flat.x_quad == (1.0, 2.0, 3.7)
    assert flat.thrust == pytest.approx(0.5 * GRAVITY, rel=1e-15)
    assert flat.tension == pytest.approx(0.1 * GRAVITY, rel=1e-15)
    assert flat.moment == (0.0, 0.0, 0.0)
    assert np.array_equal(flat.R, np.eye(3))


def test_four_derivatives_of_a_direction_against_symbols() -> None:
    t = sp.Symbol("t")
    v = sp.Matrix([sp.Rational(3, 10) + t - t**3, 2 + t**2 / 3 - t**4, -1 + sp.sin(2 * t)])
    u = v / sp.sqrt(v.dot(v))
    at = {t: sp.Rational(3, 10)}

    def numbers(vector: sp.Matrix, order: int) -> tuple[float, ...]:
        return tuple(float(c.evalf(25)) for c in sp.diff(vector, t, order).subs(at))

    found = unit_derivatives_4(*(numbers(v, order) for order in range(5)))
    for order in range(5):
        # derivatives reach 1e3: the tolerance is some tens of units of their rounding
        assert np.allclose(found[order], numbers(u, order), rtol=1e-12, atol=1e-12)
