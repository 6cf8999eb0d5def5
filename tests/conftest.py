"""For all tests: examples of hypothesis have no deadline, for the first one may compile a kernel; a failed
assertion in the shared doubles is explained like one of a test."""

from __future__ import annotations

import pytest
from hypothesis import settings

pytest.register_assert_rewrite("tests.doubles")

settings.register_profile("plumbline", deadline=None)
settings.load_profile("plumbline")
