"""For all tests: examples of hypothesis have no deadline, because the first one may compile a kernel; a
failed assertion in the shared doubles is explained like one of a test; linear algebra uses one thread,
because on a busy machine several threads wait for each other; a path that was shaped is not shaped again;
objects that exist after the collection of tests are excluded from garbage collection.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read as numpy is imported

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from tests.doubles.browser import Browser

pytest.register_assert_rewrite("tests.doubles")

settings.register_profile("plumbline", deadline=None)
settings.load_profile("plumbline")


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


@pytest.fixture(scope="session", autouse=True)
def shaped_once() -> Iterator[None]:
    """Each path is shaped once for all tests that fly or check it: shaping takes longer than most tests, and
    the same path gives the same bits."""
    from autopilot.trajectory import prepare

    shape = cache(prepare.shape)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prepare, "shape", shape)
        yield


@pytest.fixture(scope="session")
def started_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Headless Chromium, started once for all tests."""
    from tests.doubles import browser as browsers

    if browsers.missing():
        pytest.skip(browsers.missing())
    with browsers.chromium(tmp_path_factory.mktemp("chromium")) as opened:
        yield opened


@pytest.fixture
def browser(started_browser: Browser) -> Iterator[Browser]:
    """Headless Chromium; `open` a page in it. It is left when the test ends: without a graphics card a scene
    that nobody looks at any more takes a tenth of a core from all tests that follow."""
    yield started_browser
    started_browser.leave()
