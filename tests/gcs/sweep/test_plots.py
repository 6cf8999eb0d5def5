"""The pictures of a sweep."""

from __future__ import annotations

import pytest

from gcs.report.style import new_figure
from gcs.sweep.plots import label_errors, law_colours


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
