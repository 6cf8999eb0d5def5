"""Each folder of tests belongs to a room of the product or to another subject that docs/testing.md names."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# subjects that are no room
OTHERS = ("architecture", "clients", "documentation", "doubles", "flights", "processes", "thesis")
TOP = ("sitl", "gcs", "missions", "plumbline")  # rooms beside the autopilot


def homeless(root: Path) -> list[str]:
    """Folders of tests without a room of the same name, and test files at the top of `tests`."""
    found = [str(path.relative_to(root)) for path in (root / "tests").glob("test_*.py")]
    for folder in sorted({path.parent for path in (root / "tests").rglob("*/test_*.py")}):
        place = folder.relative_to(root / "tests")
        room = root / place if place.parts[0] in TOP else root / "autopilot" / place
        if place.parts[0] not in OTHERS and not (room / "__init__.py").is_file():
            found.append(str(folder.relative_to(root)))
    return found


def test_tests_mirror_the_rooms() -> None:
    assert homeless(ROOT) == []


SAMPLE = (
    "autopilot/control/laws/__init__.py",
    "sitl/plant/__init__.py",
    "gcs/__init__.py",
    "autopilot/__init__.py",
)


@pytest.mark.parametrize(
    ("test", "found"),
    [
        ("tests/control/laws/test_a.py", []),
        ("tests/sitl/plant/test_a.py", []),
        ("tests/gcs/test_a.py", []),
        ("tests/flights/test_a.py", []),
        ("tests/clients/new/test_a.py", []),
        ("tests/plant/test_a.py", ["tests/plant"]),
        ("tests/autopilot/test_a.py", ["tests/autopilot"]),
        ("tests/gcs/plots/test_a.py", ["tests/gcs/plots"]),
        ("tests/test_a.py", ["tests/test_a.py"]),
    ],
)
def test_a_folder_without_a_room_is_caught(test: str, found: list[str], tmp_path: Path) -> None:
    for name in (*SAMPLE, test):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert homeless(tmp_path) == found
