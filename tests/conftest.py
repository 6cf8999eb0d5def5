"""For all tests: examples of hypothesis have no deadline, for the first one may compile a kernel."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("plumbline", deadline=None)
settings.load_profile("plumbline")
