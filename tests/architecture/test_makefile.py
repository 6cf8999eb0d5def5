"""The Makefile: a Python that is asked for is the one that is used."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

MAKEFILE = Path(__file__).parents[2] / "Makefile"
pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


def make(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """What `make` would do where `.venv` is of Python 3.9."""
    python = folder / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text("#!/bin/sh\necho 3.9\n", encoding="utf-8")
    python.chmod(0o755)
    (folder / "pyproject.toml").touch()
    command = ["make", "--dry-run", f"--file={MAKEFILE}", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_an_environment_of_another_python_is_not_used_in_its_place(tmp_path: Path) -> None:
    made = make(tmp_path, "fly", f"PYTHON={sys.executable}")
    assert made.returncode != 0
    assert f".venv is of Python 3.9, which {sys.executable} is not; make clean first" in made.stderr


@pytest.mark.parametrize("words", [("fly",), ("clean", f"PYTHON={sys.executable}")])
def test_nothing_else_is_refused(words: tuple[str, ...], tmp_path: Path) -> None:
    made = make(tmp_path, *words)
    assert made.returncode == 0, made.stderr
