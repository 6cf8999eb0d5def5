"""Load signals against exact symbolic derivatives, and their behaviour at the joints."""

from __future__ import annotations

from functools import cache
from math import inf, nextafter, pi, sin

import numpy as np
import pytest
import sympy as sp

from autopilot.trajectory.signals import REST, evaluate, joints, signal_table
from missions.fileformat import load_mission
from missions.model import Signals, Sine, Term

# Both sides are sums of a few rounded cosines: relative to amplitude * (greatest frequency)^n this leaves
# some hundred units of rounding, mostly from the phases of up to 300 rad.
RELATIVE_ROUNDING = 1e-13

THREE_SINES = Term("y", -1.3, 1.5, 4.0, 2.5, 3.0, (Sine(3.0, 0.4, 0.7), Sine(1.1, -1.0), Sine(7.0, 2.0, 3.0)))
TWO_EQUAL_SINES = Term("z", 0.7, 0.5, 2.0, 1.0, 2.0, (Sine(2.0), Sine(2.0, 0.3)))
TERMS = [
    THREE_SINES,
    TWO_EQUAL_SINES,
    Term("x", 20.0, 0.0, 22.5, None, 0.0),
    Term("y", 1.0, 0.0, 22.5, 5.0, 22.5, (Sine(3.0),)),
    Term("x", 2.0, 1.0, 3.0, None, 0.0, (Sine(2.0, 0.1),)),
]
TIMES = (0.0, 0.3, 1.7, 2.2, 5.6, 7.9, 9.8, 23.4, 31.0, 49.9, 70.0)
t = sp.Symbol("t")


def symbolic(term: Term, at: float) -> sp.Expr:
    """The term's formula in the stretch that contains `at`, written as in the definition: a product."""
    top = term.start_s + term.rise_s
    edge = inf if term.hold_s is None else top + term.hold_s
    if at < term.start_s or at >= edge + term.fall_s:
        return sp.Integer(0)
    if at < top:
        envelope = (1 - sp.cos(sp.pi * (t - term.start_s) / term.rise_s)) / 2
    elif at < edge:
        envelope = sp.Integer(1)
    else:
        envelope = (1 + sp.cos(sp.pi * (t - edge) / term.fall_s)) / 2
    product = term.amplitude_m * envelope
    for sine in term.factors:
        product *= sp.sin(2 * sp.pi * (t - sine.start_s) / sine.period_s + sine.phase_rad)
    return product


@cache
def derivatives(formula: sp.Expr) -> list[sp.Expr]:
    """The formula and six derivatives: each that of the one before, since most cost as much as all before."""
    found = [formula]
    for _ in range(6):
        found.append(sp.diff(found[-1], t))
    return found


def quickest(term: Term) -> float:
    """No component of the term turns faster than this (rad/s)."""
    edges = [edge for edge in (term.rise_s, term.fall_s) if edge > 0.0]
    return sum(2.0 * pi / sine.period_s for sine in term.factors) + pi / min(edges)


@pytest.mark.parametrize("term", TERMS, ids=lambda term: f"{term.axis}{len(term.factors)}")
def test_position_and_six_derivatives_are_those_of_the_formula(term: Term) -> None:
    table = signal_table([term])
    axis = "xyz".index(term.axis)
    scale = abs(term.amplitude_m)
    for at in TIMES:
        formula = symbolic(term, at)
        jet = evaluate(table, at)
        for order in range(7):
            expected = float(derivatives(formula)[order].subs(t, sp.Float(at, 30)).evalf(30))
            tolerance = RELATIVE_ROUNDING * scale * quickest(term) ** order
            assert jet[order][axis] == pytest.approx(expected, rel=0.0, abs=tolerance), (at, order)
            assert all(jet[order][other] == 0.0 for other in range(3) if other != axis)


def test_each_derivative_is_the_slope_of_the_one_before(differentiate) -> None:
    table = signal_table(TERMS[:2])
    for order in range(6):
        slope = differentiate(lambda s, n=order: evaluate(table, s)[n], 3.3)
        # the fastest component turns with 10.3 rad/s; what is left is rounding divided by the step
        assert np.allclose(slope, evaluate(table, 3.3)[order + 1], rtol=1e-7, atol=1e-7 * 10.3 ** (order + 1))


def test_terms_add_up() -> None:
    together = np.array(evaluate(signal_table(TERMS), 8.3))
    apart = sum(np.array(evaluate(signal_table([term]), 8.3)) for term in TERMS)
    # sixth derivatives reach 1e6
    assert np.allclose(together, apart, rtol=1e-12, atol=1e-9)


def test_before_and_after_there_is_rest() -> None:
    table = signal_table([THREE_SINES])
    assert evaluate(table, nextafter(1.5, -inf)) == REST
    assert evaluate(table, 1.5 + 4.0 + 2.5 + 3.0) == REST


def test_a_term_without_hold_stays_for_ever() -> None:
    table = signal_table([Term("x", 20.0, 0.0, 22.5, None, 0.0)])
    assert evaluate(table, 1e6) == ((20.0, 0.0, 0.0), *REST[1:])


def test_at_a_joint_the_derivatives_of_the_stretch_that_begins_hold() -> None:
    step = Term("y", 0.25, 0.0, 0.78, None, 0.0)
    table = signal_table([step])
    peak = 0.125 * (pi / 0.78) ** 2
    assert evaluate(table, 0.0)[2][1] == pytest.approx(peak, rel=1e-12)
    assert evaluate(table, nextafter(0.78, -inf))[2][1] == pytest.approx(-peak, rel=1e-12)
    assert evaluate(table, 0.78)[2][1] == 0.0
    assert joints([step]) == (0.0, 0.78)


@pytest.mark.parametrize("name", ["case-a", "case-b", "case-b-extended", "case-c"])
def test_position_and_velocity_of_the_cases_are_continuous(name: str) -> None:
    for step in load_mission(name).steps:
        if isinstance(step, Signals):
            table = signal_table(step.terms)
            for joint in joints(step.terms):
                before, after = evaluate(table, nextafter(joint, -inf)), evaluate(table, joint)
                assert np.allclose(before[:2], after[:2], rtol=0.0, atol=1e-12)


def test_case_b_is_the_published_signal() -> None:
    (signals,) = [step for step in load_mission("case-b").steps if isinstance(step, Signals)]
    table = signal_table(signals.terms)
    for at in (4.0, 13.37, 22.4):
        envelope = 0.5 * (1.0 + sin(2.0 * pi / 45.0 * at - pi / 2.0))
        assert evaluate(table, at)[0][1] == pytest.approx(envelope * sin(2.0 * pi / 3.0 * at), abs=1e-14)
    assert evaluate(table, 24.75)[0][1] == pytest.approx(sin(2.0 * pi / 3.0 * 24.75), abs=1e-14)


def test_plain_python_and_machine_code_agree_to_the_bit() -> None:
    table = signal_table(TERMS)
    for at in TIMES:
        assert evaluate.py_func(table, at) == evaluate(table, at)
