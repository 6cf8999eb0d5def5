"""The pictures of a sweep."""

from __future__ import annotations

import pytest

from gcs.sweep.plots import law_colours


@pytest.mark.parametrize(
    "laws", [["plumbline", "mine", "other", "third"], ["mine", "lqr", "other", "thesis", "plumbline"]]
)
def test_each_law_has_a_colour_of_its_own(laws: list[str]) -> None:
    assert len(set(law_colours(laws))) == len(laws)


def test_a_built_in_law_has_the_same_colour_beside_any_other() -> None:
    assert law_colours(["mine", "lqr"])[1] == law_colours(["lqr"])[0]
