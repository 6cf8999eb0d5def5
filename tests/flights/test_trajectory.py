"""A trajectory of one's own is flown: sent as mission items, shaped at its ends, followed to millimetres."""

from __future__ import annotations

import numpy as np

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
