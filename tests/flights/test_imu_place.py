"""An inertial unit above or below the centre of mass, of which the autopilot is not told: it learns that."""

from __future__ import annotations

import pytest

from autopilot.estimation.imu_height import LEAST_HEIGHT
from autopilot.supervisor.state import Phase
from gcs.closed_loop import Conditions
from gcs.sweep.flight import fly, start_times
from missions.fileformat import load_mission
from missions.model import Delay, Land, Mission, Release, Takeoff, Waypoint
from tests.doubles.craft import Craft, at_phase


@pytest.mark.parametrize(
    ("vehicle", "sensors", "height"),
    [
        ("bebop", "lab", -0.03),
        ("bebop", "lab", -0.1),
        ("heavy", "rtk", -0.05),
        ("bebop", "lab", 0.1),
        ("bebop", "lab", -LEAST_HEIGHT),
    ],
)
def test_a_flight_is_nearly_as_good_as_with_the_unit_at_the_centre(
    vehicle: str, sensors: str, height: float
) -> None:
    """At 3 cm below, `bebop` was always lost as soon as it flew."""
    hover = load_mission("hover")
    errors = []
    for place in (0.0, height):
        conditions = Conditions(vehicle, sensors, settings={"SIM_IMU_POS_Z": place})
        flown = fly(hover, conditions, start_times(hover, conditions))
        assert flown.outcome == "completed", flown.texts
        errors.append(flown.load_error_max_m)
    assert errors[1] < 2.5 * errors[0]


def test_what_is_learned_is_known_after_the_load_has_been_released() -> None:
    """For as long as the vehicle flies."""
    items = (Takeoff(2.0), Delay(8.0), Release(), Delay(200.0), Waypoint(4.0, 0.0, 3.0, 0.0), Land())
    mission = Mission("leave", "", "load", (), items)
    conditions = Conditions("bebop", "lab", settings={"SIM_IMU_POS_Z": -0.05})
    flown = fly(mission, conditions, start_times(mission, conditions))
    assert flown.outcome == "completed", flown.texts


def learned_height(**settings: float) -> float:
    """What the autopilot of `bebop` has learned when it has held its load for 8 s."""
    craft = Craft(Takeoff(2.0), Delay(8.0), Land(), vehicle="bebop", sensors="lab", **settings)
    craft.begin()
    craft.run(at_phase(Phase.SET_DOWN))
    return craft.estimate.imu_height.height


def test_what_is_learned_is_the_rest_of_what_is_assumed() -> None:
    """In both directions."""
    assert -0.04 < learned_height(SIM_IMU_POS_Z=-0.04) < -0.025
    assert learned_height(SIM_IMU_POS_Z=-0.04, VEH_IMU_POS_Z=-0.04) == 0.0
    assert -0.04 < learned_height(SIM_IMU_POS_Z=-0.01, VEH_IMU_POS_Z=0.03) < -0.025


@pytest.mark.parametrize(
    "settings",
    [
        {"SIM_WIND_E": 5.0, "SIM_GUST_STD": 2.0},
        {"SIM_VIB_ACC": 2.0, "SIM_VIB_GYR": 0.05},
        {"SIM_ROTOR_TAU_MS": 40.0},
        {"SIM_ROTOR_DRAG": 0.25, "SIM_ROTOR_FLAP": 0.01, "SIM_WIND_E": 4.0},
        {"SIM_ATT_Z": -0.05},
    ],
)
def test_of_a_unit_at_the_centre_nothing_is_learned(settings: dict[str, float]) -> None:
    """Whatever else is different from what is assumed."""
    assert learned_height(**settings) == 0.0
