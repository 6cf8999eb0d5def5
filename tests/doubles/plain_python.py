"""The result of a function of the tests with the compiler switched off, in a separate process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
CALL = "import json, sys; from {module} import {name}; print(json.dumps({name}()))"


def in_plain_python(function: Callable[[], Any]) -> Any:
    """The result of `function`, of a module of the tests, in plain Python; it must be a JSON value."""
    done = subprocess.run(
        [sys.executable, "-c", CALL.format(module=function.__module__, name=function.__name__)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    return json.loads(done.stdout)
