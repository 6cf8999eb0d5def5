"""Classes that only this process has, in files for others."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from autopilot.own.law import load_law
from autopilot.own.saved_class import is_found_elsewhere, save_class
from autopilot.own.source import OwnError, local_reference
from plumbline.laws import force, kernel
from plumbline.vectors import scale


class Up(NamedTuple):
    up: float


def push(newtons: float) -> type:
    class Push:
        def load_position(self, memory: Any, now: Any) -> Any:
            return memory, force((0.0, 0.0, newtons))

    return Push


def compiled_push(newtons: float) -> type:
    class Push(Up):
        @classmethod
        def build(cls, parameters: Any) -> Any:
            return cls(newtons)

        @kernel
        def load_position(self, memory: Any, now: Any) -> Any:
            return memory, force(scale(self.up, (0.0, 0.0, 1.0)))

    return Push


READER = """
import sys
from autopilot.own.law import load_law

law = load_law(sys.argv[1])
instance = law.kind(*map(float, sys.argv[2:]))
print(law.path, instance.load_position(None, None))
"""


NEIGHBOUR = """
from plumbline.laws import force


class Base:
    def load_position(self, memory, now):
        return memory, force((0.0, 0.0, 4.9))
"""
SCRIPT = """
from pathlib import Path

from autopilot.own.saved_class import save_class
from neighbour_of_a_law import Base


def make():
    class Made(Base):
        pass

    return Made


print(save_class(make(), Path("classes")))
"""


@pytest.mark.parametrize(("made", "arguments"), [(push, []), (compiled_push, ["4.9"])])
def test_another_process_loads_it(
    made: Callable[[float], type], arguments: list[str], tmp_path: Path
) -> None:
    kind = made(4.9)
    assert not is_found_elsewhere(kind)
    path = save_class(kind, tmp_path / "classes")
    command = [sys.executable, "-c", READER, str(path), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2])
    asked = kind(*map(float, arguments)).load_position(None, None)
    assert done.stdout == f"{path} {asked}\n"


def test_what_it_imports_from_a_module_beside_the_script_is_found(tmp_path: Path) -> None:
    (tmp_path / "neighbour_of_a_law.py").write_text(NEIGHBOUR)
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    told = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True, cwd=tmp_path)
    path = told.stdout.strip()
    command = [sys.executable, "-c", READER, path]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2])
    assert done.stdout.startswith(f"{path} (")


def test_a_class_that_no_module_has_is_not_found_elsewhere() -> None:
    made = type("Made", (push(4.9),), {})
    assert made.__module__ == __name__ and not is_found_elsewhere(made)
    assert is_found_elsewhere(Up)


def test_its_file_is_named_by_its_content(tmp_path: Path) -> None:
    """Two classes that are made in the same way are one for those that compare files."""
    paths = [save_class(push(newtons), tmp_path) for newtons in (4.9, 4.9, 5.1)]
    assert paths[0] == paths[1] != paths[2]
    assert len(list(tmp_path.iterdir())) == 2
    kind = push(4.9)
    kind.gain = 3.0  # type: ignore[attr-defined]
    assert save_class(kind, tmp_path) not in paths


def test_within_this_process_the_class_itself_is_found() -> None:
    kind = push(4.9)
    assert load_law(local_reference(kind)).kind is kind


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (None, "no such file"),
        (b"nonsense", "UnpicklingError"),
        (b"I1\n.", "holds no class"),
        (b"", "EOFError"),
    ],
)
def test_a_file_that_holds_none_is_told(content: bytes | None, told: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.pkl"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(OwnError, match=told) as error:
        load_law(str(path))
    assert str(error.value).startswith(f"{path}: ")
