"""The linear limits against the margin tool, which linearises the same law on its own."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

from gcs.sweep.margin import linear_range
from gcs.sweep.plan import SweepPlan

ROOT = Path(__file__).parents[3]


def limits(law: str, name: str, nominal: float, to: tuple[float, float]) -> str:
    return linear_range(SweepPlan("hover", "bebop", "lab", (law,), (1,), (), ()), law, name, nominal, to)


def test_delay_of_the_thesis_cascade_is_that_of_the_margin_tool() -> None:
    spec = importlib.util.spec_from_file_location("sweep_margin_tool", ROOT / "benchmarks/cascade_margin.py")
    assert spec is not None and spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = tool  # its dataclasses look their module up
    spec.loader.exec_module(tool)
    expected_ms = 1e3 * tool.margin(tool.Settings(rotor_tau=0.02, loop="position")).delay
    low, high = limits("thesis", "SIM_ACT_DELAY_MS", 0.0, (0.0, 40.0)).split(" … ")
    assert low == "0"
    # both bisect to 0.1 ms or better
    assert float(high) == pytest.approx(expected_ms, abs=0.15)


def test_what_the_linear_loop_does_not_know_has_no_limit() -> None:
    assert limits("thesis", "SIM_NOISE_SCALE", 1.0, (0.5, 2.0)) == ""


def test_a_gain_of_no_damping_is_no_place_to_be() -> None:
    plan = SweepPlan("hover", "bebop", "lab", ("thesis",), (1,), (), (("NGC_KOMEGA", 0.0),))
    assert linear_range(plan, "thesis", "SIM_ACT_DELAY_MS", 0.0, (0.0, 40.0)) == "nowhere"
