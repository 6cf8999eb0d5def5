"""What a function of the tests returns where the compiler is switched off, in a process of its own."""

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
    """What `function`, of a module of the tests, returns in plain Python; it must be a value of JSON."""
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
