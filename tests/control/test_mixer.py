"""Properties of the mixer, for any demand; linear programmes compute the best that four rotors can do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from autopilot.control.records import Vehicle
from autopilot.vehicle.layout import Layout, Rotor
from tests.doubles.mixing import mix

BEBOP = Vehicle(0.4, 0.1, 0.7, (2.23e-3, 2.99e-3, 4.8e-3), 9.81, 0.126, 0.016, 0.0, 1.96)
WEIGHT = (BEBOP.quad_mass + BEBOP.load_mass) * BEBOP.gravity
# rotors that could give more than the weight beside any moment
STRONG = BEBOP._replace(rotor_max=4.0)
INF = float("inf")
ROUNDING = 1e-12  # N, N m: sums of four numbers of order one
PROGRAMME = 1e-6  # N: feasibility tolerance of the linear programmes

moments = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.2, 0.2))
thrusts = st.floats(-5.0, 20.0)


def rotor_rows(vehicle: Vehicle) -> np.ndarray:
    arm, ratio = vehicle.arm, vehicle.torque_ratio
    return np.array([[1, 1, 1, 1], [0, -arm, 0, arm], [arm, 0, -arm, 0], [-ratio, ratio, -ratio, ratio]])


@given(thrusts, moments)
def test_forces_are_always_within_limits(thrust: float, moment: tuple[float, float, float]) -> None:
    result = mix(thrust, moment, BEBOP, 1.0)
    assert all(BEBOP.rotor_min <= F <= BEBOP.rotor_max for F in result.forces)
    done = rotor_rows(BEBOP) @ np.array(result.forces)
    np.testing.assert_allclose((result.achieved_thrust, *result.achieved_moment), done, atol=ROUNDING)


@given(st.tuples(*[st.floats(0.01, 1.95)] * 4))
def test_demand_within_limits_is_done_exactly(forces: tuple[float, float, float, float]) -> None:
    thrust, *moment = rotor_rows(BEBOP) @ np.array(forces)
    result = mix(float(thrust), tuple(map(float, moment)), BEBOP, 1.0)
    np.testing.assert_allclose(result.forces, forces, atol=ROUNDING)
    assert result.saturated == 0


@pytest.mark.parametrize("vehicle", [BEBOP, STRONG], ids=["bebop", "strong"])
@settings(max_examples=60, deadline=None)
@given(thrusts, moments)
def test_roll_and_pitch_are_kept_whenever_the_demanded_thrust_or_the_weight_makes_room(
    vehicle: Vehicle, thrust: float, moment: tuple[float, float, float]
) -> None:
    """A programme looks for any four forces with that roll and pitch, whose sum is at most the greater of the
    two; of an impossible moment, each part is as near to its demand as is possible beside the other."""
    result = mix(thrust, moment, vehicle, 1.0)
    thrust_row, *rows = rotor_rows(vehicle)[:3]
    bounds = [(vehicle.rotor_min, vehicle.rotor_max)] * 4
    room = {"A_ub": [thrust_row], "b_ub": [max(thrust, WEIGHT)], "bounds": bounds}
    wanted, achieved = np.array(moment[:2]), np.array(result.achieved_moment[:2])
    if linprog(np.zeros(4), A_eq=rows, b_eq=wanted, **room).status == 0:
        np.testing.assert_allclose(achieved, wanted, atol=PROGRAMME)
    for part, other in ((0, 1), (1, 0)):
        sign = np.sign(wanted[part])
        best = linprog(-sign * rows[part], A_eq=[rows[other]], b_eq=[achieved[other]], **room)
        assert best.status == 0
        nearest = min(abs(wanted[part]), max(-best.fun, 0.0))
        assert abs(achieved[part]) == pytest.approx(nearest, abs=PROGRAMME)
        assert achieved[part] * sign >= 0.0


@given(thrusts, moments)
def test_no_moment_lifts_the_vehicle(thrust: float, moment: tuple[float, float, float]) -> None:
    result = mix(thrust, moment, STRONG, 1.0)
    assert result.achieved_thrust <= max(thrust, WEIGHT) + PROGRAMME


@settings(max_examples=60, deadline=None)
@given(thrusts, moments)
def test_thrust_comes_before_yaw(thrust: float, moment: tuple[float, float, float]) -> None:
    """With the roll and pitch that are done, no four forces come nearer to the thrust; with these and the
    thrust that is done, none come nearer to the yaw."""
    result = mix(thrust, moment, BEBOP, 1.0)
    rows, bounds = rotor_rows(BEBOP), [(BEBOP.rotor_min, BEBOP.rotor_max)] * 4
    kept = np.array(result.achieved_moment[:2])

    def reach(row: np.ndarray, A_eq: np.ndarray, b_eq: np.ndarray) -> tuple[float, float]:
        ends = [linprog(sign * row, A_eq=A_eq, b_eq=b_eq, bounds=bounds) for sign in (1.0, -1.0)]
        assert all(end.status == 0 for end in ends)
        return float(ends[0].fun), float(-ends[1].fun)

    low, high = reach(rows[0], rows[1:3], kept)
    assert result.achieved_thrust == pytest.approx(min(high, max(low, thrust)), abs=PROGRAMME)
    # a rounding may make a programme without room infeasible: stay inside by that much
    done = min(high, max(low, result.achieved_thrust))
    low, high = reach(rows[3], rows[:3], np.array([done, *kept]))
    assert result.achieved_moment[2] == pytest.approx(min(high, max(low, moment[2])), abs=PROGRAMME)


@given(thrusts, moments)
def test_unlimited_passes_through(thrust: float, moment: tuple[float, float, float]) -> None:
    free = BEBOP._replace(rotor_min=-INF, rotor_max=INF)
    for vehicle, limited in ((BEBOP, 0.0), (free, 1.0), (free, 0.0)):
        result = mix(thrust, moment, vehicle, limited)
        assert result.saturated == 0
        np.testing.assert_allclose(
            (result.achieved_thrust, *result.achieved_moment), (thrust, *moment), atol=ROUNDING
        )


@pytest.mark.parametrize("high", [1.96, INF])
@pytest.mark.parametrize("limited", [0.0, 1.0])
@given(
    st.floats(allow_nan=True, allow_infinity=True, width=32),
    st.tuples(*[st.floats(allow_nan=True, allow_infinity=True, width=32)] * 3),
)
def test_no_demand_makes_nan(
    high: float, limited: float, thrust: float, moment: tuple[float, float, float]
) -> None:
    result = mix(thrust, moment, BEBOP._replace(rotor_max=high), limited)
    numbers = (*result.forces, result.achieved_thrust, *result.achieved_moment)
    assert not np.isnan(numbers).any()
    if not np.isfinite([thrust, *moment]).all():
        assert result.saturated == 0b1111


# ---- any rotors


@st.composite
def layouts(draw: st.DrawFn) -> Layout:
    """Five to eight rotors around the vehicle, all different, that can hold it. A table of rotors treats a
    coordinate of less than 1e-9 arms as a rounding of zero."""
    count = draw(st.integers(5, 8))
    near = st.floats(0.6, 1.2)
    rotors = []
    for i in range(count):
        angle = 2.0 * np.pi * (i + draw(st.floats(-0.3, 0.3))) / count
        reach, sign = draw(near), 1.0 if i % 2 else -1.0
        x, y = np.round((reach * np.cos(angle), reach * np.sin(angle)), 9).tolist()
        rotors.append(Rotor(x, y, sign * draw(near), draw(near)))
    return tuple(rotors)


def rows_of(layout: Layout, vehicle: Vehicle) -> np.ndarray:
    arm, ratio = vehicle.arm, vehicle.torque_ratio
    return np.array([(1.0, arm * r.y, -arm * r.x, ratio * r.yaw) for r in layout]).T


@settings(deadline=None)
@given(layouts(), st.floats(-5.0, 30.0), moments, st.integers(-1, 7))
def test_any_rotors_stay_within_limits_and_do_what_is_told(
    layout: Layout, thrust: float, moment: tuple[float, float, float], lost: int
) -> None:
    """Also with one rotor lost, which gives no force. Roll and pitch are cut, never reversed."""
    gone = 1 << lost if 0 <= lost < len(layout) else 0
    result = mix(thrust, moment, BEBOP, 1.0, layout, gone)
    for i, (rotor, force) in enumerate(zip(layout, result.forces, strict=True)):
        share = 0.0 if gone >> i & 1 else rotor.strength
        assert share * BEBOP.rotor_min - ROUNDING <= force <= share * BEBOP.rotor_max + ROUNDING
    done = rows_of(layout, BEBOP) @ np.array(result.forces)
    np.testing.assert_allclose((result.achieved_thrust, *result.achieved_moment), done, atol=ROUNDING)
    if result.saturated == 0:
        np.testing.assert_allclose(done[:3], (thrust, *moment[:2]), atol=1e3 * ROUNDING)
    for asked, given_ in zip(moment[:2], result.achieved_moment[:2], strict=True):
        assert abs(given_) <= abs(asked) + 1e3 * ROUNDING
        assert asked * given_ >= -1e3 * ROUNDING


@settings(deadline=None)
@given(layouts(), st.floats(0.2, 0.8), moments)
def test_unlimited_it_is_the_least_squares_inverse(
    layout: Layout, thrust: float, moment: tuple[float, float, float]
) -> None:
    """The inverse is of efforts, so that rotors of different strength are used alike; compared with
    NumPy's."""
    result = mix(thrust, moment, BEBOP, 0.0, layout)
    strengths = np.array([rotor.strength for rotor in layout])
    efforts = np.linalg.pinv(rows_of(layout, BEBOP) * strengths) @ np.array([thrust, *moment])
    np.testing.assert_allclose(result.forces, strengths * efforts, atol=1e5 * ROUNDING)
    assert result.achieved_moment == pytest.approx(moment, abs=1e5 * ROUNDING)
