"""The files that the packages need beside their modules are declared, so that a wheel contains them."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("autopilot", "gcs", "missions", "plumbline", "sitl")
NO_DATA = {"__pycache__", ".egg-info"}


def undeclared(root: Path, declared: dict[str, list[str]]) -> list[str]:
    """Files of packages, except modules, that no pattern of package-data matches."""
    patterns = [
        f"{package.replace('.', '/')}/{name}" for package, names in declared.items() for name in names
    ]
    found = []
    for room in ROOMS:
        for path in sorted((root / room).rglob("*")):
            name = str(path.relative_to(root))
            if path.is_dir() or path.suffix == ".py" or NO_DATA & set(path.parts):
                continue
            if not any(fnmatch(name, pattern) for pattern in patterns):
                found.append(name)
    return found


def test_every_file_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert undeclared(ROOT, project["tool"]["setuptools"]["package-data"]) == []


def test_a_file_that_is_forgotten_is_found(tmp_path: Path) -> None:
    for name in ("gcs/report/page.html", "gcs/web/page.js", "gcs/web/page.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert undeclared(tmp_path, {"gcs.web": ["*.js"]}) == ["gcs/report/page.html"]
