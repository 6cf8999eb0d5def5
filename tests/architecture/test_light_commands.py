"""Commands that only talk to a vehicle do not load numba, which takes longer than all else that they do; nor
does `gcs fly` before it has started its programs, or a program before it knows its options."""

from __future__ import annotations

import subprocess
import sys

import pytest

COMMANDS = ("status", "control", "param", "capture", "report", "compare", "new", "warmup", "view", "recorded")
WORKFLOWS = ("status", "parameters", "readiness", "warmup", "vehicle_processes", "before_flight", "fly")
MODULES = [
    "autopilot.shell.command",
    "sitl.shell.command",
    *(f"gcs.commands.{name}" for name in COMMANDS),
    *(f"gcs.workflows.{name}" for name in WORKFLOWS),
]


@pytest.fixture(scope="module")
def loads_numba() -> dict[str, bool]:
    """Whether numba is loaded after each module, when they are imported in this order in one process."""
    loads = "import_module(name); print(name, 'numba' in sys.modules)"
    program = f"import sys; from importlib import import_module\nfor name in {MODULES!r}: {loads}"
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return {name: heavy == "True" for name, heavy in map(str.split, told.stdout.splitlines())}


@pytest.mark.parametrize("module", MODULES)
def test_a_command_that_only_speaks_loads_no_compiler(loads_numba: dict[str, bool], module: str) -> None:
    assert not loads_numba[module]
