"""A trajectory of one's own is flown: sent as mission items, shaped at its ends, followed to millimetres."""

from __future__ import annotations

import numpy as np
import pytest

import plumbline
from autopilot.trajectory.feasibility import paths
from autopilot.trajectory.load_path import evaluate_load_path, path_tables
from gcs.workflows.vehicle_limits import load_limits
from plumbline import Land, Mission, Takeoff, Trajectory


def test_a_helix_given_by_rounded_rows_is_followed() -> None:
    times = np.arange(0.0, 15.001, 0.01)
    share = times / times[-1]
    phase = 4.0 * np.pi * share**4 * (35.0 - 84.0 * share + 70.0 * share**2 - 20.0 * share**3)
    rows = np.column_stack([times, 1.0 - np.cos(phase), np.sin(phase), 0.03 * phase]).round(3)
    mission = Mission("helix", [Takeoff(1.0), Trajectory.through(rows), Land()])
    flight = plumbline.fly(mission)
    assert (flight.outcome, flight.mission) == ("completed", mission)
    assert flight.summary["load_speed_max_m_s"] > 1.5
    assert flight.summary["load_error_max_m"] < 0.015  # measured 7 mm
    assert flight.summary["shaping_distance_max_m"] < 0.001
    assert flight.summary["rise_time_90_s"] is None  # no step
    flown = flight.telemetry(kind="pandas")
    flown = flown[flown.in_mission]
    since = flown.item_time_s.to_numpy()
    assert since[0] == pytest.approx(0.0, abs=0.01) and since[-1] == pytest.approx(15.0, abs=0.02)
    assert np.diff(since) == pytest.approx(np.diff(flown.time_s), abs=1e-5)
    at_rows = np.column_stack([np.interp(since, times, rows[:, k]) for k in (1, 2, 3)])
    asked = flown[[f"load_asked_{axis}_m" for axis in "xyz"]].to_numpy() - [0.0, 0.0, 1.0]
    assert asked == pytest.approx(at_rows, abs=2e-3), "the tolerance of the fit, and rows 15 mm apart"


def test_a_path_with_a_shaped_beginning_starts_as_long_after_its_item_as_the_check_says() -> None:
    hasty = Trajectory([(0.0, 0.0, 0.0, 0.0), (4.0, 2.0, 0.0, 0.0), (8.0, 0.0, 0.0, 0.0)])
    mission = Mission("hasty", [Takeoff(1.5), hasty, Land()])
    (report,) = (one for one in paths(mission, load_limits("bebop")) if one.kind == "trajectory")
    assert report.lead_s > 0.1 and f" with {report.lead_s:.2f} s before it begins, at most " in str(report)
    flown = plumbline.fly(mission).telemetry(kind="pandas")
    flown = flown[flown.in_mission]
    tables, since = path_tables(hasty), flown.item_time_s.to_numpy() - report.lead_s
    east_m = [evaluate_load_path(tables, min(max(t, 0.0), 8.0))[0][0] for t in since.tolist()]
    assert flown.load_asked_x_m.to_numpy() == pytest.approx(east_m, abs=1e-4)
