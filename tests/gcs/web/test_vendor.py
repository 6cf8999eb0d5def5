"""The third-party libraries in pages: of the stated version, licensed, fit to be embedded in a page."""

from __future__ import annotations

import re

import pytest

from gcs.web import LIVE_FILES, LIVE_PAGE, PLOT_SCRIPTS, SCENE_SCRIPTS, asset

TABLE = dict(re.findall(r"^\| `(\S+?)`.*?\| (\d+\.\d+\.\d+) \|", asset("vendor/README.md"), re.MULTILINE))
SCRIPTS = [name for name in (*SCENE_SCRIPTS, *PLOT_SCRIPTS) if name.startswith("vendor/")]


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_library_begins_with_its_version_and_its_licence(script: str) -> None:
    text = asset(script)
    head = text[: text.index("*/")]
    assert TABLE[script.removeprefix("vendor/")] in head.splitlines()[0]
    assert "Permission is hereby granted, free of charge" in head
    assert "Copyright" in head


@pytest.mark.parametrize("script", [*SCENE_SCRIPTS, *PLOT_SCRIPTS])
def test_a_script_may_stand_within_a_page(script: str) -> None:
    assert not re.search(r"</script|<!--", asset(script), re.IGNORECASE)


def test_the_live_page_asks_for_the_files_that_are_served_and_no_others() -> None:
    asked = re.findall(r'(?:src|href)="([^"]+)"', asset(LIVE_PAGE))
    assert sorted(asked) == sorted([*LIVE_FILES, "data:,"])
