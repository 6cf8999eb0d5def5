"""The linear limits against the margin tool, which linearises the same law independently."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks import cascade_margin
from gcs.sweep.margin import linear_range
from gcs.sweep.plan import SweepPlan
from gcs.sweep.plan_values import VariedParameter


def limits(law: str, name: str, nominal: float, to: tuple[float, float]) -> str:
    return linear_range(SweepPlan("hover", "bebop", "lab", (law,), (1,), (), ()), law, name, nominal, to)


def test_delay_of_the_thesis_cascade_is_that_of_the_margin_tool() -> None:
    expected_ms = 1e3 * cascade_margin.margin(cascade_margin.Settings(rotor_tau=0.02, loop="position")).delay
    low, high = limits("thesis", "SIM_ACT_DELAY_MS", 0.0, (0.0, 40.0)).split(" … ")
    assert low == "0"
    # both bisect to 0.1 ms or better
    assert float(high) == pytest.approx(expected_ms, abs=0.15)


def test_what_the_linear_loop_does_not_know_has_no_limit() -> None:
    assert limits("thesis", "SIM_NOISE_SCALE", 1.0, (0.5, 2.0)) == ""


def test_parameters_that_are_varied_together_are_so_in_the_linear_loop() -> None:
    noise = VariedParameter("SIM_NOISE_SCALE", (0.0, 5.0), True)
    delay = replace(noise, followers=("SIM_ACT_DELAY_MS",))
    alone, together = (
        linear_range(
            SweepPlan("hover", "bebop", "lab", ("thesis",), (1,), (one,), ()),
            "thesis",
            "SIM_NOISE_SCALE",
            0.0,
            (0.0, 5.0),
        )
        for one in (noise, delay)
    )
    assert (alone, together) == ("", "0 … > 5")


def test_a_rate_that_takes_some_values_only_has_no_linear_range() -> None:
    assert limits("thesis", "CTL_RATE_HZ", 250.0, (125.0, 250.0)) == ""


def test_a_gain_of_no_damping_is_no_place_to_be() -> None:
    plan = SweepPlan("hover", "bebop", "lab", ("thesis",), (1,), (), (("NGC_KOMEGA", 0.0),))
    assert linear_range(plan, "thesis", "SIM_ACT_DELAY_MS", 0.0, (0.0, 40.0)) == "nowhere"


def test_parameters_of_an_estimator_of_ones_own_are_none_of_the_linear_loop() -> None:
    estimator = "plumbline.examples.luenberger:Luenberger"
    plan = SweepPlan("hover", "bebop", "lab", ("thesis",), (1,), (), (("OBS_W_QUAD", 12.0),), 0, estimator)
    assert linear_range(plan, "thesis", "OBS_W_LOAD", 25.0, (15.0, 40.0)) == ""
    assert linear_range(plan, "thesis", "SIM_ACT_DELAY_MS", 0.0, (0.0, 5.0)) == "0 … > 5"
