"""The requested path of a trajectory: the spline through its points, with exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from autopilot.trajectory.feasibility import VehicleLimits, check, paths
from autopilot.trajectory.load_path import evaluate_load_path, path_joints, path_tables, slower_step
from autopilot.trajectory.prepare import shaped_path
from autopilot.trajectory.timeline import MissionState, state_after, timeline
from autopilot.vehicle.file import load_vehicle
from missions.model import Land, Mission, Signals, Sine, Takeoff, Term, Trajectory

LIMITS = VehicleLimits(load_vehicle("bebop"))
LOOP = Trajectory(
    [
        (0.0, 0.0, 0.0, 0.0),
        (2.0, 1.0, 0.2, 0.1),
        (3.5, 1.2, 1.0, 0.2),
        (6.0, 0.2, 1.1, 0.1),
        (9.0, 0.5, 0.5, 0.3),
    ]
)


def test_each_point_is_passed_at_its_time_from_rest_to_rest() -> None:
    tables = path_tables(LOOP)
    for point in LOOP.points:
        assert evaluate_load_path(tables, point.t_s)[0] == pytest.approx(point[1:], abs=1e-9)
    for t in (0.0, LOOP.duration_s):
        assert np.abs(evaluate_load_path(tables, t)[1]).max() < 1e-9


def test_derivatives_are_those_of_the_spline() -> None:
    rows = np.array(LOOP.points)
    rest = [(order, np.zeros(3)) for order in (1, 5, 6, 7)]
    spline = make_interp_spline(rows[:, 0], rows[:, 1:], 9, bc_type=(rest, rest))
    tables = path_tables(LOOP)
    for t in np.linspace(0.1, 8.9, 37):
        jet = evaluate_load_path(tables, float(t))
        for order in range(7):
            assert jet[order] == pytest.approx(spline(t, nu=order), rel=1e-6, abs=1e-7)


@pytest.mark.parametrize(
    "step", [LOOP, Signals(9.0, (Term("x", 1.0, 1.0, 3.0, 1.0, 3.0, (Sine(2.0, 0.3, 0.5),)),))]
)
def test_a_slower_path_passes_the_same_places_later(step: Signals | Trajectory) -> None:
    tables, slow = path_tables(step), path_tables(slower_step(step, 1.7))
    for t in np.linspace(0.0, 8.9, 20):
        jet, late = evaluate_load_path(tables, float(t)), evaluate_load_path(slow, 1.7 * float(t))
        for order in range(7):
            assert late[order] == pytest.approx(np.array(jet[order]) / 1.7**order, rel=1e-6, abs=1e-7)


def test_it_ends_at_its_last_point_at_rest() -> None:
    after = state_after(LOOP, MissionState((1.0, 2.0, 3.0)))
    assert after.position == pytest.approx((1.5, 2.5, 3.3))
    (entry,) = timeline((LOOP,), MissionState((1.0, 2.0, 3.0)))
    assert entry.duration_s == LOOP.duration_s
    assert path_joints(LOOP) == ()


def test_a_gentle_one_is_flown_nearly_as_asked_and_a_hasty_one_is_refused() -> None:
    limits = LIMITS.shaping
    gentle = shaped_path(LOOP, limits)
    assert gentle.problem == ""
    assert gentle.path.distance_m < 2e-3  # beside the jumps of acceleration at its ends
    assert gentle.path.duration_s == LOOP.duration_s
    hasty = Trajectory([(0.0,) * 4, (0.25, 0.16, 0.0, 0.0), (0.75, 1.44, 0.0, 0.0), (1.0, 1.6, 0.0, 0.0)])
    assert "it exceeds the bounds of rotors" in shaped_path(hasty, limits).problem


def test_the_check_says_what_is_wrong_with_a_trajectory() -> None:
    def found(step: Trajectory, shaped: bool) -> list[str]:
        mission = Mission("m", "m", "", (), (Takeoff(1.0), step, Land()))
        return [str(violation) for violation in check(mission, LIMITS, shaped)]

    assert found(LOOP, shaped=True) == found(LOOP, shaped=False) == []
    hasty = slower_step(LOOP, 0.2)
    assert isinstance(hasty, Trajectory)
    for shaped in (True, False):
        told = found(hasty, shaped)
        assert any("items[1] (trajectory): at" in line for line in told)
        assert all("give its points later times" in line for line in told)
    deep = Trajectory([(0.0, 0.0, 0.0, 0.0), (5.0, 0.0, 0.0, -0.9), (10.0, 0.0, 0.0, 0.0)])
    (line,) = found(deep, shaped=True)
    assert "the load would be 0.10 m above the ground; it must be at least 0.3 m above" in line
    assert line.endswith("begin higher (altitude_m) or raise its points")


def test_the_report_of_a_path_says_that_it_is_flown_as_asked() -> None:
    mission = Mission("m", "m", "", (), (Takeoff(1.0), LOOP, Land()))
    report = paths(mission, LIMITS, shaped=False)[1]
    assert (report.kind, report.distance_m) == ("trajectory", 0.0)
    assert "9.0 s, as asked; load to" in str(report)
