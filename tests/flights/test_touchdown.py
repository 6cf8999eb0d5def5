"""When a load that is lowered counts as being on the ground."""

from __future__ import annotations

import io
from math import nan

import numpy as np
import pytest

import plumbline
from autopilot.wire.tlog import TlogWriter, read_tlog
from gcs.closed_loop import Conditions, fly
from gcs.sweep.flight import fly as sweep_fly
from gcs.sweep.flight import start_times
from missions.fileformat import load_mission
from missions.model import Land, Mission, Release, Takeoff
from sitl.vehicles.truth import load_truth

SIMULATOR = 27  # component of its truth telemetry in our dialect
UNCONTROLLED = 2e-3  # m, for the ground that gives way under the load, and for the interval of the telemetry


def test_a_load_that_lags_is_not_taken_for_one_on_the_ground() -> None:
    """The linear regulator keeps 75 mm behind a setpoint that sinks at 0.2 m/s, more than the 50 mm by which
    a stopped load is recognised."""
    mission = Mission("down", "Down", "", (), (Takeoff(0.3), Land()))
    log = io.BytesIO()
    outcome = fly(mission, Conditions("thesis", "ideal", settings={"CTL_LAW": 1.0}), TlogWriter(log))
    assert outcome.name == "completed"
    height, noted = nan, []
    for _, received in read_tlog(io.BytesIO(log.getvalue())):
        message = received.message
        if message.get_type() == "LOAD_STATE" and received.component == SIMULATOR:
            height = -message.z
        if message.get_type() == "STATUSTEXT" and "Load on the ground" in message.text:
            noted.append(height)
    assert len(noted) == 1
    assert noted[0] == pytest.approx(load_truth("thesis").load_radius, abs=UNCONTROLLED)


@pytest.mark.parametrize("seed", [2, 7])
def test_a_vehicle_that_trembles_on_the_ground_stands(seed: int) -> None:
    """With 36 ms of delay and rotors without lag the loop never comes to rest between ground and gear."""
    mission = Mission("down", "Down", "", (), (Takeoff(0.3), Land()))
    settings = {"CTL_LAW": 2.0, "SIM_ACT_DELAY_MS": 36.0, "SIM_ROTOR_TAU_MS": 0.0}
    log = io.BytesIO()
    outcome = fly(mission, Conditions(seed=seed, settings=settings), TlogWriter(log))
    assert (outcome.name, outcome.reason) == ("completed", "")


@pytest.mark.parametrize("noise", [0.25, 0.5])
def test_quiet_trackers_that_are_late_see_a_load_that_lies(noise: float) -> None:
    """The vehicle holds still above the load, its cable a centimetre loose: too little to count as slack
    immediately, too much for a pendulum with readings of 0.1 mm."""
    mission = load_mission("case-b")
    settings = {"CTL_LAW": 2.0, "SIM_SENS_LAT_MS": 30.0, "SIM_NOISE_SCALE": noise}
    flown = sweep_fly(
        mission, Conditions(settings=settings), start_times(mission, Conditions(settings=settings))
    )
    assert (flown.outcome, flown.reason) == ("completed", "")


def test_the_wind_does_not_turn_over_a_vehicle_that_lands() -> None:
    """It leans by 26 deg as it touches down with one leg first, and has no load that holds it."""
    mission = Mission("alone", "Alone", "", (), (Takeoff(2.0), Release(), Land()))
    wind = {"SIM_WIND_E": 12.0, "SIM_GUST_STD": 1.0}
    flight = plumbline.fly(mission, vehicle="hexarotor", sensors="field", settings=wind, seed=2)
    assert flight.outcome == "completed"
    told = flight.telemetry()
    told = told[told.phase == "lower"]
    height = told.vehicle_true_z_m
    first_touch = told.time_s[height < height.min() + 0.03].min()
    standing = told[told.time_s >= first_touch]
    tilt = np.arccos(np.cos(standing.vehicle_angle_roll_rad) * np.cos(standing.vehicle_angle_pitch_rad))
    assert np.degrees(tilt.max()) < 40.0
    assert standing.vehicle_true_z_m.max() < height.min() + 0.1, "it jumped"
    assert standing.time_s.max() - first_touch < 5.0, "its rotors ran on the ground"
