"""For all tests: examples of hypothesis have no deadline, for the first one may compile a kernel; a failed
assertion in the shared doubles is explained like one of a test; linear algebra keeps to one thread, for on a
busy machine several of them wait for each other.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read as numpy is imported

import pytest
from hypothesis import settings

pytest.register_assert_rewrite("tests.doubles")

settings.register_profile("plumbline", deadline=None)
settings.load_profile("plumbline")
