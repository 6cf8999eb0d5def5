"""The files on which the result of a flight depends; a change of one of them is noticed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gcs.batch.closure import PACKAGES, ROOT, closure, fingerprint
from gcs.experiments import store
from gcs.sweep import plan_file

SWEEP, EXPERIMENT = plan_file.ENTRIES, store.ENTRIES
BOTH = {"sweep": SWEEP, "experiment": EXPERIMENT}


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project's packages."""
    root: Path = tmp_path_factory.mktemp("tree")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, root / package, ignore=shutil.ignore_patterns("__pycache__"))
    return root


@pytest.mark.parametrize("entries", BOTH.values(), ids=BOTH)
def test_a_copy_of_the_sources_has_the_same_fingerprint(tree: Path, entries: tuple[str, ...]) -> None:
    # numba stores machine code there if it cannot be stored elsewhere
    kept = tree / "sitl" / "__pycache__" / "world.measure.nbi"
    kept.parent.mkdir(exist_ok=True)
    kept.touch()
    assert fingerprint(entries, tree) == fingerprint(entries)
    assert len(fingerprint(entries, tree)) == 16


@pytest.mark.parametrize(
    ("kind", "name", "counts"),
    [
        ("sweep", "autopilot/control/laws/thesis.py", True),
        ("sweep", "autopilot/vehicle/vehicles/bebop.toml", True),
        ("sweep", "sitl/plant/step.py", True),
        ("sweep", "sitl/sensors/lab.toml", True),
        ("sweep", "missions/case-b.toml", True),
        ("sweep", "gcs/closed_loop.py", True),
        ("sweep", "gcs/clients/flight.py", True),
        ("sweep", "gcs/sweep/plan.py", True),
        ("sweep", "gcs/sweep/report.py", False),
        ("sweep", "gcs/report/plots.py", False),
        ("sweep", "gcs/workflows/flight_loops.py", False),
        ("experiment", "autopilot/shell/program.py", True),
        ("experiment", "autopilot/wire/dialect/plumbline.xml", True),
        ("experiment", "sitl/shell/program.py", True),
        ("experiment", "missions/fileformat.py", True),
        ("experiment", "missions/case-a.toml", True),
        ("experiment", "gcs/workflows/flight_loops.py", True),
        ("experiment", "gcs/workflows/started_flight.py", True),
        ("experiment", "gcs/report/plots.py", False),
        ("experiment", "gcs/analysis/metrics.py", False),
        ("experiment", "gcs/sweep/plan.py", False),
    ],
)
def test_a_change_is_noticed_where_it_decides_a_flight(
    tree: Path, kind: str, name: str, counts: bool
) -> None:
    entries, path = BOTH[kind], tree / name
    before, content = fingerprint(entries, tree), path.read_bytes()
    path.write_bytes(content + b"\n# changed\n")
    try:
        assert (fingerprint(entries, tree) != before) is counts
    finally:
        path.write_bytes(content)


def test_a_new_module_counts_as_soon_as_it_is_imported(tree: Path) -> None:
    entry, fresh = tree / "gcs" / "sweep" / "work.py", tree / "gcs" / "sweep" / "fresh.py"
    before, content = fingerprint(SWEEP, tree), entry.read_bytes()
    try:
        fresh.write_text("ANSWER = 42\n", encoding="utf-8")
        assert fingerprint(SWEEP, tree) == before
        entry.write_bytes(content + b"\ndef later():\n    from . import fresh\n")
        used = fingerprint(SWEEP, tree)
        fresh.write_text("ANSWER = 43\n", encoding="utf-8")
        assert before != used != fingerprint(SWEEP, tree)
    finally:
        entry.write_bytes(content)
        fresh.unlink()


@pytest.mark.parametrize("entries", BOTH.values(), ids=BOTH)
def test_nothing_that_python_really_imports_is_missing(entries: tuple[str, ...]) -> None:
    """An independent count: what the interpreter has loaded after importing the entry points."""
    program = (
        "import importlib, sys\n"
        "for name in sys.argv[1:]: importlib.import_module(name)\n"
        "print(*(m.__file__ for m in list(sys.modules.values()) if getattr(m, '__file__', None)), sep='\\n')"
    )
    run = subprocess.run(
        [sys.executable, "-c", program, *entries], check=True, capture_output=True, text=True, cwd=ROOT
    )
    loaded = {Path(line) for line in run.stdout.splitlines()}
    ours = {path for path in loaded if any(path.is_relative_to(ROOT / package) for package in PACKAGES)}
    assert len(ours) > 100
    assert ours <= closure(entries)


NAMED = ("failed", "succeeded", "chosen", "broken_off", "within", "behind")


def test_imports_of_every_form_are_followed(tmp_path: Path) -> None:
    for name, text in {
        "gcs/__init__.py": "",
        "gcs/a.py": "import gcs.b.c as c, gcs.many, os\nfrom .b import (\n    d,\n    name,\n)",
        "gcs/b/__init__.py": "from .e import name",
        "gcs/b/c.py": "from ..f import thing",
        "gcs/b/d.py": "def g():\n    from gcs import h",
        "gcs/b/e.py": "name = 1",
        "gcs/b/table.toml": "",
        "gcs/b/page.html": "",
        "gcs/b/tables/other.toml": "",
        "gcs/b/code/__init__.py": "",
        "gcs/b/code/of_code.toml": "",
        "gcs/f.py": "import numpy, unknown.module, gcs.inside",
        "gcs/inside.py": (
            "f = lambda: 1\n"
            "try:\n    from gcs import tried\nexcept ImportError:\n    from gcs import failed\n"
            "else:\n    from gcs import succeeded\nfinally:\n    from gcs import ended\n"
            "match f():\n    case 1:\n        with f():\n            from gcs import chosen\n"
            '"""\nfrom here import is no statement, and\nimport what you like\n"""'
        ),
        "gcs/ended.py": "from gcs import \\\n    broken_off",
        "gcs/tried.py": "if True: import gcs.within\npass; from gcs import behind",
        **{f"gcs/{name}.py": "" for name in NAMED},
        "gcs/h.py": "from missions import *",
        "gcs/lonely.py": "",
        "gcs/many/__init__.py": "import pkgutil\nNAMES = [m.name for m in pkgutil.iter_modules(__path__)]",
        "gcs/many/one.py": "from gcs import by_one",
        "gcs/by_one.py": "",
        "missions/__init__.py": "",
        "missions/one.toml": "",
    }.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    found = {path.relative_to(tmp_path).as_posix() for path in closure(["gcs.a"], tmp_path)}
    rest = {p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*.*")} - found
    assert rest == {"gcs/lonely.py", "gcs/b/page.html", "gcs/b/code/__init__.py", "gcs/b/code/of_code.toml"}


def test_an_entry_point_that_is_no_module_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"gcs\.nowhere is no module"):
        closure(["gcs.nowhere"])
