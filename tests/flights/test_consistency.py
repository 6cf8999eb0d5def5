"""The error that the estimator states, compared with the truth of flights with the simulator's sensors.

NEES is error^T P^-1 error of a part of the error state, NIS the same of the innovations; each is, on average,
its number of degrees of freedom if the stated error is right. Averages are over seeds and over instants one
second apart; a slow error (of the receiver, of the levelling) makes the instants of one flight alike, so the
seeds are what counts.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from autopilot.estimation.records import (
    ATTITUDE,
    DIRECTION,
    FIX,
    LINE_OF_SIGHT,
    LOAD,
    MAGNETIC,
    POSE,
    POSITION,
    PRESSURE,
    RATE,
    SENSORS,
    TEST_RATIO,
    VELOCITY,
)
from autopilot.geometry.so3 import quat_conjugate, quat_log, quat_multiply
from autopilot.supervisor.state import Phase
from benchmarks.consistency import fly_nees, per_degree
from gcs.closed_loop import Conditions
from gcs.sweep.flight import FlightResult, fly, start_times
from missions.fileformat import load_mission
from missions.model import Takeoff, Waypoint
from tests.doubles.craft import Craft

PLUMBLINE = 2.0
SEEDS = range(1, 11)
SETTLED_S, END_S, EVERY_S = 16.0, 24.0, 1.0
PARTS = {
    "position": (POSITION, 3),
    "velocity": (VELOCITY, 3),
    "attitude": (ATTITUDE, 3),
    "direction": (DIRECTION, 2),
    "rate": (RATE, 2),
}
# number of scalars in a reading of each kind
SCALARS = {POSE: 6, LOAD: 3, FIX: 6, PRESSURE: 1, MAGNETIC: 1, LINE_OF_SIGHT: 2}


def error_of(craft: Craft) -> NDArray[Any]:
    """The error state without biases, truth minus estimate, after one more tick."""
    truth = craft.truth  # read before the tick, which ends by advancing the world
    craft.tick()
    estimate = craft.estimate
    vehicle, load = estimate.vehicle, estimate.load
    error = np.zeros(RATE + 2)
    error[POSITION : POSITION + 3] = np.subtract(truth.x_quad, vehicle.x_quad)
    error[VELOCITY : VELOCITY + 3] = np.subtract(truth.v_quad, vehicle.v_quad)
    error[ATTITUDE : ATTITUDE + 3] = quat_log(
        quat_multiply(truth.quat_wxyz, quat_conjugate(vehicle.quat_wxyz))
    )
    axes = np.array([load.across, np.cross(load.q_cable, load.across)])
    error[DIRECTION : DIRECTION + 2] = axes @ np.subtract(truth.q_cable, load.q_cable)
    error[RATE : RATE + 2] = axes @ np.subtract(truth.q_cable_dot, load.q_cable_dot)
    return error


@cache
def flown(sensors: str) -> tuple[dict[str, NDArray[Any]], NDArray[Any]]:
    """NEES of each part, (seeds, instants); mean NIS of each sensor per scalar over all seeds."""
    nees: dict[str, list[list[float]]] = {name: [] for name in PARTS}
    consistency = np.zeros((SENSORS, TEST_RATIO))
    for seed in SEEDS:
        steps = Takeoff(1.0), Waypoint(1.0, 1.0, 1.0), Waypoint(0.0, 0.0, 1.0)
        craft = Craft(*steps, sensors=sensors, seed=seed, CTL_LAW=PLUMBLINE)
        craft.begin()
        craft.wait(SETTLED_S - 1.0)
        history = craft.onboard.core.rows.history
        history.consistency[:] = 0.0
        for values in nees.values():
            values.append([])
        while craft.onboard.now_us < END_S * 1e6:
            craft.wait(EVERY_S)
            assert craft.flight.phase in (Phase.LIFT, Phase.MISSION, Phase.HOLD), craft.texts
            error = error_of(craft)
            for name, (first, count) in PARTS.items():
                s = slice(first, first + count)
                nees[name][-1].append(error[s] @ np.linalg.solve(history.covariance[s, s], error[s]))
        consistency += history.consistency[:, :TEST_RATIO]
    return {name: np.array(values) for name, values in nees.items()}, consistency


# Means over 10 seeds and 8 instants. Instants of one flight are alike: the chi-square bounds are those of
# the seeds with three instants that count. Measured per axis, position to rate: lab 0.99, 0.99, 1.04, 0.94,
# 0.85; rtk 0.91, 0.94, 1.28, 1.28, 0.81.
COUNTING = 3 * len(SEEDS)


@pytest.mark.parametrize("sensors", ["lab", "rtk"])
def test_the_error_is_what_the_filter_says(sensors: str) -> None:
    for name, values in flown(sensors)[0].items():
        axes = PARTS[name][1]
        low, high = chi2.ppf([0.001, 0.999], COUNTING * axes) / COUNTING
        assert low < values.mean() < high, (name, values.mean() / axes)


@pytest.mark.parametrize(
    ("sensors", "readings"), [("lab", (POSE, LOAD)), ("rtk", (FIX, PRESSURE, MAGNETIC, LINE_OF_SIGHT))]
)
def test_innovations_are_as_large_as_the_filter_says(sensors: str, readings: tuple[int, ...]) -> None:
    """Measured: 1.00, 1.00; 1.03, 0.99, 0.87, 1.00."""
    consistency = flown(sensors)[1]
    for sensor in readings:
        count, total = consistency[sensor]
        assert count > 30 * len(SEEDS)
        assert 0.8 < total / count / SCALARS[sensor] < 1.2, (sensor, total / count / SCALARS[sensor])


ATTACHED = {"SIM_ATT_X": 0.008, "SIM_ATT_Y": -0.004, "SIM_ATT_Z": -0.02}
KNOWN = {name.replace("SIM", "VEH"): value for name, value in ATTACHED.items()}


def direction_error(seed: int, **settings: float) -> NDArray[Any]:
    """(2,) rad, forward and left: true minus estimated direction of the cable while the load is held."""
    craft = Craft(Takeoff(1.0), sensors="rtk", seed=seed, CTL_LAW=PLUMBLINE, **settings)
    craft.begin()
    craft.wait(SETTLED_S)
    assert craft.flight.phase == Phase.HOLD, craft.texts
    R = Rotation.from_quat(craft.truth.quat_wxyz, scalar_first=True)
    error = np.subtract(craft.truth.q_cable, craft.estimate.load.q_cable)
    forward, left, _ = R.inv().apply(error)
    return np.array([forward, left])


@pytest.mark.parametrize("seed", [1, 2])
def test_the_camera_shows_the_direction_of_a_cable_attached_beside_the_centre_of_mass(seed: int) -> None:
    """Measured: 1.2 and 1.1 mrad; 9 mrad if the readings of the camera are not shifted to the attachment."""
    difference = direction_error(seed, **ATTACHED, **KNOWN) - direction_error(seed)
    assert np.linalg.norm(difference) < 4e-3


@pytest.mark.parametrize("known", [{}, KNOWN])
def test_errors_are_those_of_the_assumed_attachment(known: dict[str, float]) -> None:
    """Measured: 0.6 to 1.0. If the estimate is compared with a cable held where the autopilot does not know
    of, the NEES of its direction is 470; that of the position compared with the centre of mass, 5000."""
    mission, conditions = load_mission("hover"), Conditions("bebop-real", "lab", settings=known)
    in_mission = fly_nees(mission, conditions, start_times(mission, conditions))[0]["mission"]
    for part in PARTS:
        assert 0.4 < per_degree(in_mission[part]) < 1.6, part


GUSTS = {"SIM_WIND_E": 5.0, "SIM_GUST_STD": 1.0}
REAL_LAB = {"sensors": "lab-real", "vehicle": "bebop-real"}
WINDY_FIELD = {"sensors": "field", "vehicle": "heavy-real", "settings": GUSTS}


def flights(name: str, seeds: tuple[int, ...], **told: Any) -> list[FlightResult]:
    """A mission by name under these conditions, once with each seed."""
    mission = load_mission(name)
    start = start_times(mission, Conditions(**told))
    return [fly(mission, Conditions(seed=seed, **told), start) for seed in seeds]


def test_all_that_a_fix_floats_by_counts_as_one_reading() -> None:
    """For 3 s at a time each fix is off by the same 0.15 m. Measured as RMS: 20.9 mm without, 28.2 mm with
    such fixes; 57 mm if each is assumed to have an independent error."""

    def square(floats_per_min: float) -> float:
        floating = flights("hover", (2, 3, 4), sensors="rtk", settings={"SIM_GPS_FLT": floats_per_min})
        return sum(flown.load_error_rms_m**2 for flown in floating)

    assert square(4.0) < 3.0 * square(0.0)


@pytest.mark.parametrize("sensors", ["lab-blind", "rtk-blind"])
def test_a_load_without_a_sensor_is_flown_in_gusts(sensors: str) -> None:
    """Measured: 105 and 116 mm at worst of 40 seeds. If the filter expects as much wind on the load as with a
    sensor, half of the flights are lost."""
    blind = flights("case-b", (1, 2, 3), sensors=sensors, settings=GUSTS)
    assert [flown.outcome for flown in blind] == ["completed"] * 3
    assert max(flown.load_error_max_m for flown in blind) < 0.12


@pytest.mark.parametrize(
    ("vehicle", "seeds", "limit_m"), [("bebop-real", (4, 5, 6), 0.2), ("heavy-real", (6, 7, 8), 0.65)]
)
def test_a_load_without_a_sensor_is_flown_by_rotors_that_the_wind_pushes(
    vehicle: str, seeds: tuple[int, ...], limit_m: float
) -> None:
    """Measured: none of 40 flights lost, at worst 0.24 and 0.61 m. Each of these was lost, or had an error of
    0.78 to 2.5 m, when a load that lay on the ground might move, and when the wind on a load that accelerates
    might change faster."""
    gusts = {"SIM_WIND_E": 8.0, "SIM_GUST_STD": 1.0}
    blown = flights("case-b", seeds, sensors="lab-blind", vehicle=vehicle, settings=gusts)
    assert [flown.outcome for flown in blown] == ["completed"] * 3
    assert max(flown.load_error_max_m for flown in blown) < limit_m


STORM = {"SIM_WIND_E": 5.0, "SIM_GUST_STD": 3.0}
# how each of these flights used to end
LOST = {
    "never taut after a gust that pulled": ("rtk", 4, {"SIM_WIND_E": 4.0, "SIM_GUST_STD": 1.5}),
    "never taut in a gust upward": ("rtk", 173, {"SIM_WIND_E": 4.0, "SIM_GUST_STD": 1.5}),
    "never taut with half the load": ("rtk", 1, {"SIM_LOAD_MASS": 0.05}),
    "never taut, half the load, no sensor": ("rtk-blind", 1, {"SIM_LOAD_MASS": 0.05}),
    "pulled where the cable seemed longer": ("gps", 7, {"SIM_WIND_E": 2.0, "SIM_GUST_STD": 0.7}),
    "never taut, cable of 0.3 m": ("rtk", 6, {"VEH_CABLE_LEN": 0.3, "SIM_CABLE_LEN": 0.3}),
    "never taut while a gust hid the pull": ("rtk", 145, STORM),
    "tumbled, taken for standing in a gust": ("rtk", 150, STORM),
    "never slack after a gust that lifted": ("gps", 83, {"SIM_WIND_E": 4.0, "SIM_GUST_STD": 1.5}),
}


@pytest.mark.parametrize("lost", LOST)
def test_a_load_is_lifted_and_set_down_in_gusts_and_with_another_mass(lost: str) -> None:
    sensors, seed, settings = LOST[lost]
    settings = {"MIS_INFEASIBLE": 1.0, **settings}
    assert [f.outcome for f in flights("case-b", (seed,), sensors=sensors, settings=settings)] == [
        "completed"
    ]


def test_the_load_is_swung_outdoors() -> None:
    """Measured: 73 mm at worst of 16 seeds. With the filters of the thesis half of them were lost."""
    swung = flights("load-attitude", (2, 3), sensors="field", vehicle="bebop-real")
    assert [flown.outcome for flown in swung] == ["completed"] * 2
    assert max(flown.load_error_max_m for flown in swung) < 0.1


def test_noise_that_the_autopilot_does_not_expect_is_filtered() -> None:
    """Measured: 23.7 mm at worst of 20 seeds, and one tick in a thousand saturated."""
    noisy = flights("case-b", (1, 2, 3), settings={"SIM_ACC_NOISE": 1.0, "SIM_GYR_NOISE": 0.05})
    assert max(flown.load_error_max_m for flown in noisy) < 0.025
    assert max(flown.saturated_fraction for flown in noisy) < 0.01


def test_a_gust_in_a_real_lab_moves_the_load_by_less_than_noise_would_allow() -> None:
    """Measured: 233 mm at worst of 20 seeds, of which 60 mm are due to the slower pace at the rotors' limits;
    95 mm more if the push is learned as slowly as noise demands."""
    gust = {"SIM_ACT_DELAY_MS": 12.0, "SIM_GUST_E": 5.0, "SIM_GUST_AT_S": 18.0, "SIM_GUST_FOR_S": 2.0}
    blown = flights("hover", (1, 2, 3), settings=gust, **REAL_LAB)
    assert max(flown.load_error_max_m for flown in blown) < 0.25


def test_ten_times_the_assumed_drag_is_learned() -> None:
    """Measured: 14.8 mm at worst of 20 seeds."""
    dragged = flights("case-b", (1, 2, 3), settings={"SIM_DRAG_SCALE": 10.0})
    assert max(flown.load_error_max_m for flown in dragged) < 0.015


@pytest.mark.parametrize(
    ("mission", "told", "limit_m"),
    [
        ("case-b", REAL_LAB, 0.04),
        ("case-c", REAL_LAB, 0.04),
        ("case-b", WINDY_FIELD, 0.2),
        ("case-c", WINDY_FIELD, 0.2),
    ],
)
def test_real_worlds_are_flown(mission: str, told: dict[str, Any], limit_m: float) -> None:
    """Measured, at worst of 20 seeds: 26, 26, 172 and 165 mm. In the field 5 m/s of wind blow, with gusts of
    1 m/s."""
    flown = flights(mission, (1, 2), **told)
    assert [each.outcome for each in flown] == ["completed"] * 2
    assert max(each.load_error_max_m for each in flown) < limit_m
