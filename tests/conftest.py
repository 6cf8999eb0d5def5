"""For all tests: examples of hypothesis have no deadline, and real processes do not fly side by side."""

from __future__ import annotations

import pytest
from hypothesis import settings

# the first example may compile a kernel
settings.register_profile("plumbline", deadline=None)
settings.load_profile("plumbline")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Tests in which processes keep to the wall clock run one after the other, in one worker."""
    if config.pluginmanager.hasplugin("xdist"):
        for item in items:
            if item.get_closest_marker("processes"):
                item.add_marker(pytest.mark.xdist_group("processes"))
