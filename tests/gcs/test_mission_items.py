"""The vehicle's messages about uploaded items, with the item numbers of the mission file."""

from __future__ import annotations

import pytest

from gcs.clients.flight import Outcome
from gcs.mission_items import in_mission_terms
from missions.fileformat import load_mission

CASE_C = load_mission("case-c")  # signals are its items[2], and items 2 ... 7 of the upload


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (
            "item 7: it exceeds what can be flown",
            "item 7 (items[2] of the mission): it exceeds what can be flown",
        ),
        ("Item 2 flown 1.31 times as long", "Item 2 flown 1.31 times as long"),
        ("Item 8, then item 1", "Item 8 (items[3] of the mission), then item 1"),
        ("disarmed at item 7 of 10", "disarmed at item 7 of 10"),
        ("the last is 17", "the last is 17"),
        ("", ""),
    ],
)
def test_an_item_that_the_mission_counts_otherwise_is_named_as_it_counts(said: str, told: str) -> None:
    assert in_mission_terms(said, CASE_C) == told
    assert Outcome("refused", said).in_mission_terms(CASE_C) == Outcome("refused", told)
