"""The name that a user may have meant by an unknown one."""

from __future__ import annotations

import pytest

from missions.nearest import did_you_mean, nearest

SHIPPED = ("case-a", "case-b", "hover", "square", "WNC_SPEED")


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("case_b", "case-b"),
        ("Case-B", "case-b"),
        ("hovver", "hover"),
        ("wnc_sped", "WNC_SPEED"),
        ("saucer", ""),
        ("", ""),
    ],
)
def test_the_nearest_name_is_found_whatever_its_case(word: str, meant: str) -> None:
    assert nearest(word, SHIPPED) == meant
    assert did_you_mean(word, SHIPPED) == (f"did you mean {meant}? " if meant else "")


def test_how_near_it_must_be_can_be_told() -> None:
    assert nearest("hxxxr", SHIPPED) == ""
    assert nearest("hxxxr", SHIPPED, min_similarity=0.3) == "hover"
