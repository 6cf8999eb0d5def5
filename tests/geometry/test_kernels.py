"""A kernel gives the same bits compiled and interpreted."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.geometry import frames, linear, machine_code, s2, so3

SAMPLES = 50


def kernels(module: ModuleType) -> Iterator[tuple[str, Any]]:
    for name, function in vars(module).items():
        if hasattr(function, "py_func") and function.__module__ == module.__name__:
            yield f"{module.__name__.rpartition('.')[2]}.{name}", function


ALL = dict(pair for module in (frames, linear, s2, so3) for pair in kernels(module))


def argument(annotation: str, name: str, rng: np.random.Generator) -> Any:
    def vector() -> tuple[float, ...]:
        return tuple(float(x) for x in rng.normal(size=3))

    rotation = Rotation.random(rng=rng)
    match annotation:
        case "float":
            return float(rng.normal())
        case "int":
            return int(rng.integers(3))
        case "Vec3":
            return vector()
        case "Quat":
            return tuple(float(x) for x in rotation.as_quat(scalar_first=True))
        case "Mat3":
            turned = name.startswith("R")
            rows = rotation.as_matrix() if turned else rng.normal(size=(3, 3))
            return tuple(tuple(float(x) for x in row) for row in rows)
    raise TypeError(annotation)


def flat(value: Any) -> list[float]:
    return [x for one in value for x in flat(one)] if isinstance(value, tuple) else [value]


@pytest.mark.skipif(not ALL, reason="numba is switched off: there is nothing compiled to compare with")
@pytest.mark.parametrize("name", ALL)
def test_compiled_and_interpreted_agree_to_the_bit(name: str) -> None:
    compiled = ALL[name]
    parameters = inspect.signature(compiled.py_func).parameters
    rng = np.random.default_rng(sum(name.encode()))
    for _ in range(SAMPLES):
        arguments = [argument(str(p.annotation), p.name, rng) for p in parameters.values()]
        machine, python = flat(compiled(*arguments)), flat(compiled.py_func(*arguments))
        assert np.array(machine).tobytes() == np.array(python).tobytes()


def test_kernels_are_found() -> None:
    assert not ALL or {"linear.cross", "so3.quat_exp", "s2.unit_derivatives", "frames.ned_from_enu"} <= set(
        ALL
    )


@pytest.mark.parametrize(
    ("changed", "stale"),
    [
        ("autopilot/law.py", True),
        ("autopilot/leaf.py", True),
        ("missions/path.py", True),
        ("sitl/other.py", False),
    ],
)
def test_machine_code_is_stale_after_a_change_in_whatever_it_can_reach(
    changed: str, stale: bool, tmp_path: Path
) -> None:
    files = {
        "autopilot/law.py": "from autopilot.middle import (\n    f,\n)\n",
        "autopilot/middle.py": "from autopilot import leaf\nfrom missions.path import LENGTH\n",
        "autopilot/leaf.py": "from autopilot.law import back  # a circle\n",
        "autopilot/__init__.py": "",
        "missions/path.py": "LENGTH = 1.0\n",
        "sitl/other.py": "from autopilot.law import g\n",
    }

    def hashed(root: Path) -> str:
        for name, text in files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text)
        return machine_code.sources_hash(root / "autopilot/law.py", root)

    before = hashed(tmp_path / "before")
    assert hashed(tmp_path / "copy") == before
    files[changed] += "# changed\n"
    assert (hashed(tmp_path / "after") != before) is stale
