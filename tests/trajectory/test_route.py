"""Paths of a custom planner: what they are made of, and how their faults are reported."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from autopilot.trajectory.feasibility import VehicleLimits
from autopilot.trajectory.route import (
    Path,
    PlanError,
    Route,
    bound_violation,
    check_path,
    path_segments,
    polynomials,
    samples,
    slower,
    use,
)
from autopilot.trajectory.splines import evaluate_path
from autopilot.trajectory.waypoint_path import sample_path
from autopilot.vehicle.file import load_vehicle

LIMITS = VehicleLimits(load_vehicle("bebop")).shaping
POINTS = ((0.0, 0.0, 1.0), (2.0, 0.0, 1.0))
ROUTE = Route(POINTS, 1.5, 1.5, False, LIMITS.body, LIMITS.bounds)
# s^5 (126 - 420 s + 540 s^2 - 315 s^3 + 70 s^4): from 0 to 1 with four derivatives 0 at both ends
REST_TO_REST = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 126.0, -420.0, 540.0, -315.0, 70.0])
EXACT = 1e-9  # of numbers of the size of 1, through polynomials of degree 9
SAMPLED = 1e-5  # m, of 41 samples of such a path: the spline between them


def straight(duration: float) -> Path:
    coefficients = np.zeros((1, 10, 3))
    coefficients[0, :, 0] = 2.0 * REST_TO_REST / duration ** np.arange(10)
    coefficients[0, 0, 2] = 1.0
    return polynomials([0.0, duration], coefficients, [0.0, duration])


def test_a_polynomial_is_the_path_and_its_derivatives() -> None:
    path = straight(4.0)
    check_path(path, ROUTE)
    jets = sample_path(path.table, np.array([0.0, 2.0, 4.0]))
    assert jets[0, :, 0] == pytest.approx([0.0, 1.0, 2.0], abs=EXACT)
    assert jets[1, 1, 0] == pytest.approx(2.0 / 4.0 * 630.0 / 256.0, abs=EXACT)  # 630 s^4 (1 - s)^4 at 1/2
    assert np.abs(jets[1:5, [0, 2], :]).max() < EXACT
    (one,) = path_segments(path, ROUTE)
    assert (one.begin_s, one.end_s, one.start) == (0.0, 4.0, POINTS[0])


def test_samples_are_passed_from_rest_to_rest() -> None:
    exact = straight(4.0)
    times = np.linspace(0.0, 4.0, 41)
    path = samples(times, sample_path(exact.table, times)[0], [0.0, 4.0])
    check_path(path, ROUTE)
    between = np.linspace(0.0, 4.0, 333)
    off = sample_path(path.table, between)[0] - sample_path(exact.table, between)[0]
    assert np.abs(off).max() < SAMPLED


def test_samples_of_a_curve_that_is_not_at_rest_at_its_ends_ring() -> None:
    """Its fourth derivative is not 0 there: docs/planners.md says how far off the spline is."""

    def sampled(count: int, powers: tuple[float, ...]) -> float:
        s = np.linspace(0.0, 1.0, count)
        share = np.polynomial.Polynomial(powers)(s)[:, None]
        start, end = np.array(POINTS)
        return use(samples(3.0 * s, start + share * (end - start), [0.0, 3.0]), ROUTE)

    at_rest_to_the_third = (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0)
    assert sampled(11, at_rest_to_the_third) == pytest.approx(3.3, abs=0.1)
    assert sampled(61, at_rest_to_the_third) == pytest.approx(42.0, abs=5.0)
    exact = use(straight(3.0), ROUTE)
    assert sampled(11, tuple(REST_TO_REST)) == pytest.approx(exact, rel=1e-3)
    assert sampled(61, tuple(REST_TO_REST)) == pytest.approx(exact, rel=1e-3)


def test_use_is_right_near_1_and_too_great_for_a_path_that_is_much_too_fast() -> None:
    """docs/planners.md gives these figures, and why a planner slows down in steps."""

    def needed(path: Path) -> float:
        factors = np.linspace(1.0, 4.0, 301)
        return next(float(factor) for factor in factors if use(slower(path, factor), ROUTE) <= 1.0)

    assert use(straight(3.0), ROUTE) == pytest.approx(needed(straight(3.0)), abs=0.02)
    assert use(straight(2.0), ROUTE) == pytest.approx(1.85, abs=0.01)
    assert needed(straight(2.0)) == pytest.approx(1.77, abs=0.01)
    assert use(straight(1.5), ROUTE) > 1000.0
    assert needed(straight(1.5)) == pytest.approx(2.36, abs=0.01)


def test_a_slower_path_is_the_same_path() -> None:
    quick, slow = straight(4.0), slower(straight(4.0), 1.5)
    assert slow.passes_s == (0.0, 6.0)
    a, b = evaluate_path(quick.table, 1.0), evaluate_path(slow.table, 1.5)
    for order in range(7):
        assert np.array(b[order]) * 1.5**order == pytest.approx(np.array(a[order]), abs=1e-6)


def test_use_tells_how_much_longer_a_path_must_take() -> None:
    peak = 2.0 / 4.0 * 630.0 / 256.0  # m/s
    fast = ROUTE._replace(accel_m_s2=100.0)
    assert use(straight(4.0), fast) == pytest.approx(peak / 1.5, rel=1e-3)
    assert bound_violation(straight(4.0), ROUTE) == ""
    assert use(straight(0.8), ROUTE) > 1.0
    assert bound_violation(straight(0.8), ROUTE).startswith("a rotor would have to give ")
    sedate = ROUTE._replace(bounds=ROUTE.bounds._replace(turn_rate=0.05))
    assert bound_violation(straight(4.0), sedate).startswith("the vehicle would turn at ")
    assert bound_violation(straight(4.0), sedate).endswith("; allowed are 0.1 rad/s")


def changed(change: Callable[[Path], Path]) -> Path:
    return change(straight(4.0))


def with_table(at: tuple[int, int], value: float) -> Callable[[Path], Path]:
    def change(path: Path) -> Path:
        table = path.table.copy()
        table[at] = value
        return path._replace(table=table)

    return change


def jumping(path: Path) -> Path:
    """The path in two halves, the second displaced by 1 cm."""
    table = np.vstack([path.table, path.table])
    table[1] = 0.0
    jets = sample_path(path.table, np.array([2.0]))
    table[0, 1] = table[1, 0] = 2.0
    table[1, 1] = 4.0
    factorials = np.cumprod([1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    table[1, 2:9] = jets[:, 0, 0] / factorials
    table[1, 22] = 1.01
    return path._replace(table=table)


WRONG = {
    "times": (lambda p: p._replace(passes_s=(0.0, 2.0, 4.0)), r"passes_s are 3 times; must be 2"),
    "number": (with_table((0, 5), np.nan), "is not a number"),
    "begin": (with_table((0, 0), 0.5), r"breaks_s of the path begin at 0\.5 s; must begin at 0"),
    "late": (lambda p: p._replace(passes_s=(0.5, 4.0)), r"passes_s of the path begin at 0\.5 s"),
    "end": (lambda p: p._replace(passes_s=(0.0, 3.0)), "ends at 4 s and passes its last point at 3 s"),
    "order": (with_table((0, 1), -1.0), r"breaks_s of the path must increase; -1 s comes after 0 s"),
    "reversed": (lambda p: p._replace(passes_s=(4.0, 0.0)), r"passes_s .* increase; 0 s comes after 4 s"),
    "rest": (with_table((0, 3), 0.1), r"begins or ends with a velocity of 0\.1 m/s; must be at rest"),
    "jump": (jumping, r"position of the path jumps by 0\.01 m at 2\.00 s"),
    "beside": (with_table((0, 2), 0.1), r"passes point 0 0\.10 m beside it"),
    "ground": (lambda p: polynomials([0.0, 1.0], [[(0.0, 0.0, -1.0)]], [0.0, 1.0]), "beside it"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_with_a_path_is_told(wrong: str) -> None:
    change, told = WRONG[wrong]
    with pytest.raises(PlanError, match=told):
        check_path(changed(change), ROUTE)


def test_shapes_that_do_not_fit_are_told() -> None:
    with pytest.raises(ValueError, match=r"coefficients are of shape \(1, 11, 3\); must be"):
        polynomials([0.0, 1.0], np.zeros((1, 11, 3)), [0.0, 1.0])
    with pytest.raises(ValueError, match=r"breaks_s are of shape \(2,\); must be \(3,\)"):
        polynomials([0.0, 1.0], np.zeros((2, 4, 3)), [0.0, 1.0])
    with pytest.raises(ValueError, match=r"positions are of shape \(2, 2\); must be \(2, 3\)"):
        samples([0.0, 1.0], np.zeros((2, 2)), [0.0, 1.0])
    with pytest.raises(ValueError, match="times_s must increase"):
        samples([1.0, 1.0], np.zeros((2, 3)), [0.0, 1.0])
