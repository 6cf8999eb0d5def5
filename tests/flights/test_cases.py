"""Cases of the thesis in the simulated world, judged as their reports judge them."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest

from autopilot.wire.tlog import TlogWriter, read_tlog
from gcs.analysis.metrics import step_numbers, tracking_numbers
from gcs.analysis.samples import samples_of
from gcs.analysis.telemetry import telemetry_of
from gcs.closed_loop import Conditions, fly
from missions.fileformat import load_mission

VEHICLES = Path(__file__).parents[2] / "autopilot" / "vehicle" / "vehicles"


def flown(name: str, conditions: Conditions) -> dict[str, float | int | None]:
    log = io.BytesIO()
    outcome = fly(load_mission(name), conditions, TlogWriter(log))
    assert outcome.name == "completed", outcome.reason
    log.seek(0)
    samples = samples_of(telemetry_of(read_tlog(log)))
    return {**tracking_numbers(samples), **step_numbers(samples)}


def test_case_a_beats_the_thesis_with_true_rotor_limits() -> None:
    """Thesis, without limits: 0.61 s, 15 %, 1.26 s."""
    found = flown("case-a", Conditions())
    rise, settling = found["rise_time_90_s"], found["settling_time_5pct_s"]
    assert rise is not None
    assert settling is not None
    # measured: 0.593 s, 1.4 %, 0.64 s
    assert rise < 0.61
    assert (found["overshoot_pct"] or 0.0) < 4.0
    assert settling < 0.8
    assert (found["shaping_distance_max_m"] or 1.0) < 0.013
    assert (found["tracking_error_max_m"] or 1.0) < 0.01


@pytest.mark.parametrize("vehicle", ["heavy", "hexarotor", "octorotor"])
def test_case_a_is_shaped_to_vehicles_of_any_size(vehicle: str) -> None:
    """Their paths were refused: what a path may exceed its bounds by between two samples was a force."""
    found = flown("case-a", Conditions(vehicle=vehicle))
    assert (found["load_error_max_m"] or 1.0) < 0.016  # measured: 10 to 13 mm
    assert (found["rise_time_90_s"] or 1.0) < 0.61


def test_case_a_leaves_the_rotors_what_noise_needs() -> None:
    """Planned to the limits, which is closer by a tenth of a millimetre, it had errors of 0.25 to 0.38 m."""
    found = flown("case-a", Conditions(vehicle="heavy", sensors="field"))
    assert (found["load_error_max_m"] or 1.0) < 0.1  # measured: 58 to 74 mm


def test_a_vehicle_whose_rotors_hover_near_their_lower_limit_flies_as_others_do(tmp_path: Path) -> None:
    """A thrust of 12 times the weight: 15 % of the range is more than its rotors give in hover."""
    strong = tmp_path / "strong.toml"
    text = (VEHICLES / "bebop.toml").read_text(encoding="utf-8")
    strong.write_text(re.sub("rotor_max_n = .*", "rotor_max_n = 15.0", text), encoding="utf-8")
    for name in ("case-b", "case-c"):
        found = flown(name, Conditions(vehicle=str(strong)))
        assert (found["load_error_max_m"] or 1.0) < 0.02  # measured: 4 and 15 mm


def test_a_gust_into_a_figure_eight_is_flown_off() -> None:
    """For a while, turning the vehicle takes more than its rotors can give."""
    gust = {"SIM_GUST_N": 6.0, "SIM_GUST_AT_S": 32.0}
    assert (flown("case-c", Conditions(settings=gust))["load_error_max_m"] or 1.0) < 0.1  # measured: 73 mm


# measured: 65 and 73 mm
@pytest.mark.parametrize(
    ("name", "late_ms", "error_m"), [("SIM_ACT_DELAY_MS", 250.0, 0.1), ("SIM_SENS_LAT_MS", 400.0, 0.11)]
)
def test_long_delays_are_flown_that_the_autopilot_knows(name: str, late_ms: float, error_m: float) -> None:
    found = flown("case-b", Conditions(settings={name: late_ms}))
    assert (found["load_error_max_m"] or 1.0) < error_m


def test_a_vehicle_settles_on_the_ground_with_a_long_delay() -> None:
    """Its rotors carry nearly all of its weight for half a second after it has touched down."""
    late = {"SIM_ACT_DELAY_MS": 200.0}
    for seed in (1, 3):
        flown("hover", Conditions(vehicle="octorotor", sensors="lab", seed=seed, settings=late))


def test_a_heavy_load_is_lifted_outdoors_by_a_vehicle_that_is_not_as_it_is_believed() -> None:
    """Its battery sags while the cable is still slack: the rotor forces are learned from the rotor speeds."""
    found = flown("case-b", Conditions(vehicle="heavy-real", sensors="field"))
    assert (found["load_error_max_m"] or 1.0) < 0.15  # measured: 103 mm


def test_noise_does_not_overturn_a_vehicle_where_its_path_leaves_little_thrust() -> None:
    """Case C takes rotors of `heavy` down to 1.9 of 12 N; seed 15 was lost as Omega_c followed the noise."""
    found = flown("case-c", Conditions(vehicle="heavy", sensors="field", seed=15))
    assert (found["load_error_max_m"] or 1.0) < 0.15  # measured: 95 mm


def test_a_load_is_followed_more_slowly_where_noise_takes_the_rotors_to_their_limits() -> None:
    """At full pace the noise drove them from limit to limit, and the load strayed by 3.3 m."""
    windy = {"SIM_WIND_E": 4.0, "SIM_GUST_STD": 1.5}
    found = flown("case-c", Conditions(vehicle="bebop-real", sensors="field", settings=windy, seed=8))
    assert (found["load_error_max_m"] or 1.0) < 0.4  # measured: 238 mm


def test_it_flies_a_figure_eight_slower_than_asked_by_the_parameters_it_is_delivered_with() -> None:
    """With the reserve that `heavy` leaves, the load strays by 0.7 m, or is lost."""
    windy = {"SIM_WIND_E": 5.0, "SIM_GUST_STD": 1.0}
    found = flown("case-c", Conditions(vehicle="heavy-real", sensors="field", settings=windy))
    assert (found["load_error_max_m"] or 1.0) < 0.2  # measured: 119 to 132 mm
