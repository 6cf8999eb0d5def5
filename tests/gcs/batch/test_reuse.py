"""The rule by which a stored flight is reused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcs.batch.reuse import Origin, file_digests, origin_of

HERE = Origin({"seed": 1, "laws": ("thesis",)}, "1.0", "0123")


def test_what_was_stored_is_reused() -> None:
    assert HERE.differences(json.loads(json.dumps(HERE.to_json()))) == ()


@pytest.mark.parametrize("name", ["settings", "version", "code"])
def test_each_of_the_three_decides(name: str) -> None:
    stored: dict[str, Any] = {**HERE.to_json(), name: "other"}
    assert HERE.differences(stored) == (name,)
    del stored[name]
    assert HERE.differences(stored) == (name,)


@pytest.mark.parametrize("stored", [None, [], "text", 1.0, {}])
def test_what_is_no_origin_differs_in_everything(stored: object) -> None:
    assert HERE.differences(stored) == ("settings", "version", "code")


def test_the_code_is_that_of_the_entry_points() -> None:
    one, other = origin_of({}, ["missions.model"]), origin_of({}, ["sitl.hil"])
    assert one == origin_of({}, ["missions.model"])
    assert one.code != other.code and one.version == other.version


def test_content_of_named_files_counts(tmp_path: Path) -> None:
    file = tmp_path / "vehicle.toml"
    file.write_text("a = 1", encoding="utf-8")
    first = file_digests(["bebop", str(file)])
    assert list(first) == [str(file)]
    file.write_text("a = 2", encoding="utf-8")
    assert file_digests(["bebop", str(file)]) != first
