"""A package of the user that hides one of Plumbline's is named, with what to do."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gcs.shadowing import shadowing_problem

ROOT = Path(__file__).parents[2]
IMPORT = ("-c", "import plumbline")
GCS = ("-m", "gcs", "fly", "hover", "--out", "out")


@pytest.mark.parametrize(
    ("name", "run"),
    [
        ("missions/__init__.py", IMPORT),
        ("missions.py", IMPORT),
        ("gcs/__init__.py", IMPORT),
        ("autopilot/__init__.py", IMPORT),
        ("missions/__init__.py", GCS),
        ("autopilot/__init__.py", GCS),
    ],
)
def test_what_hides_a_package_is_named(tmp_path: Path, name: str, run: tuple[str, ...]) -> None:
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.touch()
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONSAFEPATH": ""}
    ended = subprocess.run(
        [sys.executable, *run], cwd=tmp_path, env=environment, check=False, capture_output=True, text=True
    )
    assert ended.returncode == 1
    found, package = tmp_path / Path(name).parts[0], Path(name).parts[0].removesuffix(".py")
    says = "ImportError" if run == IMPORT else "gcs"
    told = (
        f"{says}: {found} hides the package {package} of Plumbline, which is in {ROOT}; rename it, or start "
    )
    assert ended.stderr.splitlines()[-1].startswith(told)
    assert run == IMPORT or len(ended.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_imported_for_another_reason_is_not_explained_away(tmp_path: Path) -> None:
    assert shadowing_problem() == ""
    broken = "import sys; sys.modules['click'] = None; from gcs.__main__ import main; main()"
    ended = subprocess.run(
        [sys.executable, "-c", broken], cwd=ROOT, check=False, capture_output=True, text=True
    )
    assert ended.stderr.splitlines()[-1].startswith("ModuleNotFoundError: import of click halted")
