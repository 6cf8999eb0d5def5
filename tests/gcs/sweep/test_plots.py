"""The pictures of a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcs.report.style import new_figure
from gcs.sweep import plots
from gcs.sweep.plan import SweepPlan
from gcs.sweep.plan_values import VariedParameter
from gcs.sweep.plots import draw_curve, draw_map, label_errors, law_colours
from gcs.sweep.results import MEDIAN_FIGURES, Flights


@pytest.mark.parametrize(
    "laws", [["plumbline", "mine", "other", "third"], ["mine", "lqr", "other", "thesis", "plumbline"]]
)
def test_each_law_has_a_colour_of_its_own(laws: list[str]) -> None:
    assert len(set(law_colours(laws))) == len(laws)


def test_a_built_in_law_has_the_same_colour_beside_any_other() -> None:
    assert law_colours(["mine", "lqr"])[1] == law_colours(["lqr"])[0]


@pytest.mark.parametrize(
    ("errors_mm", "at_least"),
    [((92.0, 153.0), 4), ((3.0, 3.2), 4), ((40.0, 40.0), 3), ((4.0, 700.0), 5), ((95.0, 1020.0), 4)],
)
def test_the_axis_of_the_errors_has_labels_however_near_the_errors_are(
    errors_mm: tuple[float, float], at_least: int
) -> None:
    ax = new_figure(5.0, 3.7).subplots()
    ax.plot([0.0, 1.0], errors_mm)
    ax.set_yscale("log")
    label_errors(ax)
    ax.figure.canvas.draw()
    low, high = ax.get_ylim()
    labelled = [
        label.get_text()
        for at, label in zip(ax.get_yticks(), ax.get_yticklabels(), strict=True)
        if low <= at <= high
    ]
    assert len(labelled) >= at_least and len(set(labelled)) == len(labelled)
    assert low <= min(errors_mm) and max(errors_mm) <= high


WIND, DELAY = "SIM_WIND_E", "SIM_ACT_DELAY_MS"
PLAN = SweepPlan(
    "case-b",
    "bebop",
    "lab",
    ("lqr",),
    (1,),
    (VariedParameter(WIND, (0.0, 6.0), True), VariedParameter(DELAY, (0.0, 40.0), True)),
    (),
)
UNITS = {WIND: "m/s", DELAY: "ms"}


def flights(completed: list[bool]) -> Flights:
    """A flight at each setting of the plan, without wind first."""
    values = {WIND: np.array([0.0, 0.0, 6.0, 6.0]), DELAY: np.array([0.0, 40.0, 0.0, 40.0])}
    outcome = tuple("completed" if one else "diverged" for one in completed)
    figures = {name: np.full(4, np.nan) for name in MEDIAN_FIGURES}
    number = np.arange(4)
    return Flights(
        "lqr",
        values,
        np.array(completed),
        np.full(4, 0.1),
        outcome,
        ("",) * 4,
        number,
        number,
        "lqr",
        (),
        figures,
    )


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The figures, instead of the files."""
    found: list[Any] = []
    monkeypatch.setattr(plots, "save", lambda figure, _: found.append(figure))
    return found


@pytest.mark.parametrize(
    ("completed", "hollow_at"),
    [([True] * 4, []), ([True, False, True, True], [0.0]), ([True, True, False, False], [])],
)
def test_a_curve_of_errors_has_a_hollow_marker_where_flights_were_lost(
    drawn: list[Any], completed: list[bool], hollow_at: list[float]
) -> None:
    draw_curve(Path("curve.png"), [flights(completed)], PLAN, WIND, UNITS)
    errors = drawn[0].axes[1]
    hollow = [line for line in errors.get_lines() if line.get_markerfacecolor() == "white"]
    assert [x for line in hollow for x in line.get_xdata()] == hollow_at
    legend = [text.get_text() for text in errors.get_legend().get_texts()]
    assert legend == ["median", "worst", *(["some lost"] if hollow_at else [])]


def test_pictures_say_that_errors_are_of_completed_flights_and_over_what(drawn: list[Any]) -> None:
    some = flights([True, False, True, True])
    draw_curve(Path("curve.png"), [some], PLAN, WIND, UNITS)
    draw_map(Path("map.png"), some, PLAN, (WIND, DELAY), UNITS)
    seeds = SweepPlan(PLAN.mission, PLAN.vehicle, PLAN.sensors, PLAN.laws, (1, 2), PLAN.varied, ())
    draw_map(Path("map.png"), some, seeds, (WIND, DELAY), UNITS)
    assert drawn[0].axes[1].get_ylabel() == "of completed flights (mm)"
    assert [figure.get_suptitle() for figure in drawn] == [
        "SIM_WIND_E: over all values of SIM_ACT_DELAY_MS",
        "law lqr; errors of completed flights",
        "law lqr: over 2 seeds; errors of completed flights",
    ]
