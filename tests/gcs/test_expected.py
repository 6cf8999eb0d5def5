"""How long parts take on an idle machine."""

from __future__ import annotations

import pytest

from gcs.workflows.expected import expected_s, in_words

COSTS = [26.0, 10.0, 8.0, 3.0]


def test_parts_share_the_cores():
    assert expected_s(COSTS, 1) == pytest.approx(47.0)
    assert expected_s(COSTS, 2) == pytest.approx(26.0)
    assert expected_s(COSTS[1:], 2) == pytest.approx(11.0)
    assert expected_s(COSTS[3:], 2) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.0, "about 1 s"), (34.6, "about 35 s"), (130.0, "about 2 min")]
)
def test_in_words(seconds, words):
    assert in_words(seconds) == words
