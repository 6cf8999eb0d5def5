"""A trajectory of one's own is flown: sent as mission items, shaped at its ends, followed to millimetres."""

from __future__ import annotations

import numpy as np
import pytest

import plumbline
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
