"""Machine code is compiled once, by the first process that needs it; a mark records that all of it exists."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from autopilot.geometry import machine_code, s2
from missions import model
from sitl import hil

ROOT = Path(__file__).parents[2]
# prints what it compiles, begins on a line of input, and compiles in the order of its arguments
PROGRAM = """
import sys
from numba.core import event
from numba.core.errors import TypingError
from autopilot.geometry.compiler import Kernel


class Names(event.Listener):
    def on_start(self, event):
        dispatcher = event.data["dispatcher"]
        if isinstance(dispatcher, Kernel):  # not what is inside of one
            print(dispatcher.py_func.__name__, event.data["args"], flush=True)

    def on_end(self, event):
        pass


event.register("numba:compile", Names())
from autopilot.geometry import s2, so3
e1, e2, e3 = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
work = {
    "s2": lambda: s2.unit_derivatives(e3, e1, e2),
    "so3": lambda: so3.quat_exp(e1),
    "wrong": lambda: so3.quat_exp(1.0),
}
print("ready", flush=True)
input()
for name in sys.argv[1:]:
    try:
        work[name]()
    except TypingError:
        print("refused")
"""
NUMBA_IS_OFF = pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")


@pytest.fixture
def empty(tmp_path: Path) -> dict[str, str]:
    """An environment in which nothing has been compiled yet."""
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return {**kept, "XDG_CACHE_HOME": str(tmp_path)}


def compiled(environment: dict[str, str], *orders: tuple[str, ...]) -> Counter[str]:
    """How often each kernel was compiled by processes that begin together, one for each order."""
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *order],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env=environment,
        )
        for order in orders
    ]
    lines: list[str] = []
    for process in processes:
        assert process.stdout is not None
        lines += iter(process.stdout.readline, "ready\n")
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in processes:
        lines += process.communicate(timeout=120.0)[0].splitlines(keepends=True)
        assert process.returncode == 0
    return Counter(line.strip() for line in lines)


@NUMBA_IS_OFF
def test_no_kernel_is_compiled_by_two_processes(empty: dict[str, str]) -> None:
    together = compiled(empty, ("s2", "so3"), ("so3", "s2"), ("s2", "so3"))
    # kernels that these call become a part of each of them
    called = {name: count for name, count in together.items() if name.startswith(("unit_der", "quat_exp "))}
    assert len(called) == 2
    assert set(called.values()) == {1}, together
    assert not compiled(empty, ("s2", "so3"))


@NUMBA_IS_OFF
def test_a_kernel_that_cannot_be_compiled_for_some_types_holds_up_nobody(empty: dict[str, str]) -> None:
    together = compiled(empty, ("wrong", "so3"), ("wrong", "so3"))
    assert together["refused"] == 2
    assert compiled(empty, ("so3",)) == Counter()


@NUMBA_IS_OFF
def test_where_nothing_can_be_written_nothing_is_kept_beside_the_sources(
    tmp_path: Path, empty: dict[str, str]
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    nowhere = {**empty, "XDG_CACHE_HOME": str(tmp_path / "file")}
    before = set(Path(s2.__file__).parent.rglob("*.nb[ci]"))
    assert compiled(nowhere, ("so3",)) == compiled(nowhere, ("so3",)) != Counter(), "each compiles anew"
    assert set(Path(s2.__file__).parent.rglob("*.nb[ci]")) == before


@NUMBA_IS_OFF
def test_the_folder_that_the_user_names_for_numba_is_kept_by_content_too(
    tmp_path: Path, empty: dict[str, str]
) -> None:
    chosen = {**empty, "NUMBA_CACHE_DIR": str(tmp_path / "chosen")}
    assert compiled(chosen, ("so3",))
    assert compiled(chosen, ("so3",)) == Counter()
    kept = machine_code.sources_hash(Path(s2.__file__).with_name("so3.py"))
    assert (tmp_path / "chosen" / "plumbline" / "kernels" / kept).is_dir()


def test_what_is_ready_is_known_by_its_sources_and_its_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    source = Path(s2.__file__)
    assert not machine_code.is_ready(source, ("tick",))
    machine_code.mark_ready(source, ("tick", "law"))
    assert machine_code.is_ready(source, ("tick", "law"))
    assert not machine_code.is_ready(source, ("tick", "paths"))
    assert not machine_code.is_ready(Path(model.__file__), ("tick",))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    assert not machine_code.is_ready(source, ("tick",))


def test_what_is_not_used_for_long_is_deleted_and_its_mark_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    source = Path(__file__)
    folder = machine_code.kernel_folder(source)
    other = folder.with_name("0123")
    for one in (folder, other):
        (one / "code").mkdir(parents=True)
        os.utime(one, (0.0, 0.0))
    machine_code.mark_ready(source, ("used", "unused"))
    marks = sorted((folder.parent / "ready").iterdir())
    for one in marks:
        os.utime(one, (0.0, 0.0))
    assert machine_code.is_marked(source, "used")
    machine_code.record_use(folder)

    machine_code.drop_unused(machine_code.RETENTION_S + 43200.0)  # half a day beyond the limit
    assert machine_code.is_marked(source, "used") and not machine_code.is_marked(source, "unused")
    assert (folder / "code").is_dir() and (other / "code").is_dir()
    machine_code.drop_unused(time.time())
    assert (folder / "code").is_dir() and not other.exists()


def test_nothing_is_to_be_compiled_where_numba_is_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert machine_code.is_ready(Path(hil.__file__), ("no such part",))


def test_a_directory_that_cannot_be_written_is_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    source = Path(s2.__file__)
    machine_code.mark_ready(source, ("tick",))
    assert not machine_code.is_ready(source, ("tick",))


def test_a_temporary_folder_of_machine_code_is_deleted_at_the_end_of_its_process() -> None:
    program = f"""
import os
from autopilot.geometry.machine_code import mark_ready, storage_problem, use_temporary_folder
use_temporary_folder()
mark_ready({__file__!r}, ["tick"])
assert not storage_problem() and any(os.scandir(os.environ["NUMBA_CACHE_DIR"]))
print(os.environ["NUMBA_CACHE_DIR"])
"""
    ended = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, check=True, capture_output=True, text=True
    )
    assert not Path(ended.stdout.strip()).exists()
