"""Which room may import which, and who may touch the world.

The arrows are those of the design: geometry stands alone; missions on geometry; the wire on both; the
vehicle's beliefs on the wire; laws, estimator and services on those; the core of the flight on everything
below. `sitl` knows of the autopilot its geometry and its wire, `gcs` also the missions; only
`gcs/closed_loop.py` and `gcs/sweep` join the cores. Sockets, clocks, threads and logging belong to the shells
alone.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("autopilot", "sitl", "gcs", "missions")

LEAVES = ("autopilot.geometry", "missions", "autopilot.wire", "autopilot.vehicle")
RECORDS = "autopilot.control.records"  # what the laws speak of: vehicle, state, reference, command
PHASES = (*LEAVES, RECORDS, "autopilot.flight", "autopilot.following", "autopilot.guidance")
# room: what it may import besides itself. A module belongs to the longest room that begins its name.
MAY_IMPORT: dict[str, tuple[str, ...]] = {
    "autopilot.geometry": (),
    "missions": ("autopilot.geometry",),
    "autopilot.wire": ("autopilot.geometry", "missions"),
    "autopilot.vehicle": ("autopilot.geometry", "missions", "autopilot.wire"),
    "autopilot.control": LEAVES,
    "autopilot.estimation": (*LEAVES, RECORDS),
    "autopilot.mixer": (*LEAVES, RECORDS),
    "autopilot.services": LEAVES,
    "autopilot.phase_legs": PHASES,
    "autopilot.supervisor": (*PHASES, "autopilot.phase_legs"),
    "autopilot": ("autopilot", "missions"),  # what joins the rooms; TOP says who may not be joined
    "sitl": ("autopilot.geometry", "autopilot.wire"),
    "gcs": ("autopilot.geometry", "autopilot.wire", "missions"),
    "gcs.closed_loop": ("autopilot", "sitl", "missions", "gcs"),
    "gcs.sweep": ("autopilot", "sitl", "missions", "gcs"),
}
# module: the only ones that may import it
TOP: dict[str, tuple[str, ...]] = {
    "autopilot.flight_core": (
        "autopilot.onboard",
        "autopilot.rehearsal",
        "autopilot.telemetry_view",
        "autopilot.__main__",
        "gcs.closed_loop",
        "gcs.sweep",
    ),
    "autopilot.onboard": (
        "autopilot.__main__",
        "autopilot.aside",
        "autopilot.tcp_server",
        "gcs.closed_loop",
        "gcs.sweep",
    ),
    "gcs.closed_loop": ("gcs",),
}

WORLD = {"socket", "selectors", "time", "random", "logging", "threading", "asyncio", "subprocess", "signal"}
SHELLS = (
    "autopilot.__main__",
    "sitl.__main__",
    "autopilot.aside",
    "autopilot.tcp_server",
    "autopilot.wire.shell",  # what these two have in common
    "gcs.__main__",
    "gcs.commands",
    "gcs.display",
    "gcs.flight_loops",
    "gcs.flying",
    "gcs.link",
    "gcs.processes",
    "gcs.stopping",
    "gcs.sweep.pool",
    "gcs.sweep.progress",
    "autopilot.wire.dialect.plumbline",  # generated
    "autopilot.wire.dialect.generate",
)


def module_name(path: Path, root: Path) -> str:
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def begins(name: str, room: str) -> bool:
    return name == room or name.startswith(room + ".")


def imports(tree: ast.AST, module: str, is_package: bool) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of every import, also inside functions; `from a import b` gives a.b and a."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module.split(".")
                kept = parts[: len(parts) - node.level + (1 if is_package else 0)]
                base = ".".join([*kept, base] if base else kept)
            for alias in node.names:
                yield node.lineno, f"{base}.{alias.name}"


def room_of(module: str) -> str | None:
    rooms = [room for room in MAY_IMPORT if begins(module, room)]
    return max(rooms, key=len) if rooms else None


def offences(root: Path) -> list[str]:
    """Every forbidden import below `root`, as `file:line: module -> imported: why`."""
    found = []
    for name in ROOMS:
        for path in sorted((root / name).rglob("*.py")):
            module = module_name(path, root)
            tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
            for line, imported in imports(tree, module, path.name == "__init__.py"):
                why = offence(module, imported)
                if why:
                    found.append(f"{path.relative_to(root)}:{line}: {module} -> {imported}: {why}")
    return found


def offence(module: str, imported: str) -> str | None:
    """Why `module` may not import `imported`, or None."""
    top = imported.partition(".")[0]
    if top in WORLD and not any(begins(module, shell) for shell in SHELLS):
        return f"{top} belongs to the shells"
    if top == "tests":
        return "tests are not part of the product"
    if top not in ROOMS:
        return None
    for name, importers in TOP.items():
        if begins(imported, name) and not any(begins(module, other) for other in (name, *importers)):
            return f"only {', '.join(importers)} may import {name}"
    if imported.endswith(".__main__") or ".__main__." in imported:
        return "a shell is started, not imported"
    room = room_of(module)
    if room is None:
        return "the module belongs to no room of the design"
    allowed = (room, *MAY_IMPORT[room])
    if any(begins(imported, other) for other in allowed):
        return None
    return f"{room} may import {', '.join(MAY_IMPORT[room]) or 'nothing of Plumbline'}"


def test_every_arrow_points_down() -> None:
    wrong = offences(ROOT)
    assert not wrong, "wrong imports:\n" + "\n".join(wrong)


def test_every_module_has_a_room() -> None:
    homeless = [
        module
        for name in ROOMS
        for path in (ROOT / name).rglob("*.py")
        if room_of(module := module_name(path, ROOT)) is None
    ]
    assert homeless == []


BAD = {
    "autopilot/geometry/so3.py": "from missions.model import Step",
    "autopilot/wire/codec.py": "from autopilot.vehicle import belief",
    "autopilot/vehicle/belief.py": "from ..control import thesis",
    "autopilot/control/thesis.py": "import autopilot.services.commands",
    "autopilot/estimation/predict.py": "from autopilot.control import thesis",
    "autopilot/services/commands.py": "def f():\n    from autopilot.control import thesis",
    "autopilot/flight_core.py": "import time",
    "autopilot/onboard.py": "from sitl.sim_core import SimCore",
    "missions/model.py": "from autopilot.wire import codec",
    "missions/signals.py": "import random",
    "sitl/plant/step.py": "from autopilot.control.records import Vehicle",
    "sitl/hil.py": "import socket as s",
    "sitl/sensors/imu.py": "from gcs.analysis import align",
    "gcs/clients/flight.py": "from autopilot.flight_core import step",
    "gcs/analysis/align.py": "from sitl.plant.records import Truth",
    "gcs/clients/link.py": "from asyncio import sleep",
    "gcs/report/page.py": "import logging.handlers",
    "sitl/truth/loader.py": "from sitl.__main__ import main",
    "autopilot/services/endpoint.py": "from autopilot import onboard",
    "autopilot/guidance.py": "from autopilot.flight_core import step",
    "autopilot/laws.py": "from gcs.closed_loop import fly",
}
GOOD = {
    "autopilot/__main__.py": "import socket, time\nfrom autopilot.flight_core import step",
    "autopilot/flight_core.py": "from autopilot.control import thesis\nfrom missions.model import Step",
    "autopilot/control/thesis.py": "from autopilot.geometry.linear import Vec3\nfrom .records import Command",
    "autopilot/wire/mission_items.py": "from missions.model import Step",
    "gcs/closed_loop.py": "from sitl.hil import HilSimulator\nfrom autopilot.onboard import Onboard",
    "gcs/commands/fly.py": "import subprocess, signal",
    "sitl/__main__.py": "import selectors\nfrom sitl.hil import HilSimulator",
    "missions/fileformat.py": "import pydantic, datetime, timeit",
}


def _tree(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return root


@pytest.mark.parametrize("name", BAD)
def test_a_wrong_import_is_caught(name: str, tmp_path: Path) -> None:
    (one,) = offences(_tree(tmp_path, {name: BAD[name]}))
    assert one.startswith(f"{name}:")


def test_right_imports_are_let_pass(tmp_path: Path) -> None:
    assert offences(_tree(tmp_path, GOOD)) == []
