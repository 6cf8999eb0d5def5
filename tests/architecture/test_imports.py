"""Which room may import which, and which modules may use sockets, clocks, threads and logging.

Missions and geometry import no other room; trajectory imports both, the wire these; the vehicle the wire;
services, laws, estimator and guidance those; the supervisor guidance and services; the core of the flight
everything below it. A law is found in its folder: nothing outside imports one by name. `sitl` imports
geometry and wire of the autopilot, and is layered like it: the plant imports geometry, the sensors the plant,
the world's tick both. `gcs` also imports the paths and the definitions of parameters; only
`gcs/closed_loop.py`, `gcs/sweep` and `plumbline/learning` join the cores. `plumbline`, which scripts import,
imports `gcs`. The definition of a vehicle and the reading of TOML files are leaves that every program shares.
Only the shells use sockets, clocks, threads and logging.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("autopilot", "sitl", "gcs", "missions", "plumbline")

LAW_FILES = (ROOT / "autopilot" / "control" / "laws").glob("[!_]*.py")
LAWS = sorted(path.stem for path in LAW_FILES if path.stem != "interface")

LEAVES = ("autopilot.geometry", "missions", "autopilot.trajectory", "autopilot.wire", "autopilot.vehicle")
SHAPE = ("autopilot.vehicle.layout", "autopilot.vehicle.rotors")  # where rotors are, and what they can do
VEHICLE = (  # the record of a vehicle, its file, and where its rotors are
    "autopilot.vehicle.model",
    "autopilot.vehicle.file",
    "autopilot.vehicle.shipped",
    "autopilot.vehicle.layout",
)
PLANT = ("sitl.plant.records", "sitl.plant.rotors")  # what the sensors may import of it
RECORDS = "autopilot.control.records"  # the records of the laws: vehicle, state, reference, command
OWN = (  # custom laws, estimators and planners, by name
    "autopilot.own.loaded_class",
    "autopilot.own.own_code",
    "autopilot.own.misspellings",
    "autopilot.own.estimator",
    "autopilot.own.law",
    "autopilot.own.planner",
    "autopilot.own.saved_class",
    "autopilot.own.set_attributes",
    "autopilot.own.source",
)
GCS = (
    "autopilot.geometry",
    "autopilot.trajectory",
    "autopilot.wire",
    "autopilot.shell.atomic_file",
    "autopilot.shell.compiling",
    "autopilot.shell.options",
    *OWN,
    *VEHICLE,
    "autopilot.vehicle.parameters",
    "sitl.sensors.shipped",
    "sitl.vehicles.sim_parameter_file",
    "missions",
)
# room: what it may import besides itself. A module belongs to the longest room with which its name begins.
MAY_IMPORT: dict[str, tuple[str, ...]] = {
    "missions": (),
    "autopilot.geometry": (),
    "autopilot.vehicle.layout": (),
    "autopilot.vehicle.rotors": ("autopilot.vehicle.layout",),
    "autopilot.vehicle.battery": ("autopilot.geometry",),
    "autopilot.vehicle.model": SHAPE,
    "autopilot.trajectory": ("autopilot.geometry", "autopilot.vehicle.model", *SHAPE, "missions"),
    "autopilot.wire": ("autopilot.geometry", "autopilot.trajectory", "missions"),
    "autopilot.vehicle": ("autopilot.geometry", "missions", "autopilot.wire"),
    "autopilot.services": LEAVES,
    "autopilot.control": LEAVES,
    "autopilot.estimation": (*LEAVES, RECORDS, "autopilot.control.drag"),
    "autopilot.guidance": (*LEAVES, RECORDS),
    "autopilot.supervisor": (*LEAVES, RECORDS, "autopilot.guidance", "autopilot.services"),
    **{one: (*LEAVES, *(other for other in OWN if other != one)) for one in OWN},
    "autopilot.own.interruption": (),
    "autopilot.own.source": (
        "autopilot.own.interruption",
        "autopilot.own.saved_class",
        "missions.nearest",
        "missions.toml_files",
    ),
    "autopilot.own": (*LEAVES, "autopilot.control", "autopilot.estimation"),
    "autopilot.core": (
        *LEAVES,
        "autopilot.control",
        "autopilot.estimation",
        "autopilot.guidance",
        "autopilot.own",
        "autopilot.services",
        "autopilot.supervisor",
    ),
    "autopilot.onboard": (
        *LEAVES,
        "autopilot.control",
        "autopilot.core",
        "autopilot.estimation",
        "autopilot.guidance",
        "autopilot.own",
        "autopilot.services",
        "autopilot.supervisor",
    ),
    "autopilot.shell.atomic_file": (),
    "autopilot.shell.options": ("autopilot.wire",),
    "autopilot.shell": ("autopilot",),
    "autopilot.__main__": ("autopilot",),
    "sitl.plant": ("autopilot.geometry", "autopilot.vehicle.battery", "autopilot.vehicle.layout"),
    "sitl.sensors": ("autopilot.geometry", "missions.toml_files", *PLANT),
    # its lines stand at the speed that the speed controllers report
    "sitl.sensors.vibration": ("autopilot.geometry", "autopilot.wire.convert", *PLANT, "sitl.sensors"),
    "sitl.vehicles": (*VEHICLE, "autopilot.wire", "sitl.plant.records"),
    "sitl.settings": ("autopilot.geometry", "autopilot.wire", "sitl.sensors.imu", "sitl.sensors.overrides"),
    "sitl.world": (
        "autopilot.geometry",
        "autopilot.vehicle.layout",
        "sitl.plant",
        "sitl.sensors",
        "sitl.settings",
    ),
    "sitl.sim_core": (
        "autopilot.geometry",
        "autopilot.vehicle.layout",
        "sitl.plant",
        "sitl.sensors",
        "sitl.settings",
        "sitl.world",
    ),
    "sitl": (
        "autopilot.geometry",
        "autopilot.wire",
        "autopilot.shell.compiling",
        "autopilot.shell.machine_sockets",
        "autopilot.shell.options",
        "autopilot.shell.setting_names",
        "autopilot.vehicle.battery",
        *VEHICLE,
    ),
    "gcs": GCS,
    "gcs.workflows.flight_inputs": (
        *GCS,
        "gcs",
        "autopilot.estimation.inbox",
        "autopilot.own",
        "autopilot.shell.watched_calls",
        "autopilot.vehicle.rates",
        "sitl.sensors.files",
        "sitl.settings",
        "sitl.vehicles",
    ),
    "gcs.workflows.unused_settings": (
        *GCS,
        "gcs",
        "sitl.sensors.files",
        "sitl.sensors.overrides",
        "sitl.vehicles",
    ),
    "gcs.workflows.slow_rotors": (*GCS, "gcs", "autopilot.control.believed"),
    "gcs.workflows.charge": (
        *GCS,
        "gcs",
        "sitl.plant.drive",
        "sitl.vehicles",
        "autopilot.vehicle.low_battery",
    ),
    "gcs.workflows.wind": (
        *GCS,
        "gcs",
        "autopilot.control.quad_position",
        "autopilot.supervisor.requests.arming",
        "sitl.plant.cable_drag",
        "sitl.plant.records",
        "sitl.vehicles",
    ),
    "gcs.workflows.own_planner": (*GCS, "gcs", "autopilot.own", "autopilot.shell.watched_calls"),
    "gcs.workflows.refusals": (*GCS, "gcs", "autopilot.services.requests", "autopilot.supervisor"),
    "gcs.workflows.in_process_flight": (*GCS, "gcs", "autopilot.shell.watched_calls"),
    "gcs.report.settings": (*GCS, "gcs", "sitl.vehicles"),
    "gcs.closed_loop": ("autopilot", "sitl", "missions", "gcs"),
    "gcs.closed_ticks": ("autopilot", "sitl", "gcs"),
    "gcs.sweep": ("autopilot", "sitl", "missions", "gcs"),
    "gcs.templates": ("plumbline",),  # files of users, which import what scripts import
    "plumbline.estimators": ("autopilot.estimation.estimator_exchange", RECORDS, "autopilot.own"),
    "plumbline.laws": ("autopilot.control.law_exchange", RECORDS, "autopilot.own"),
    "plumbline.planners": ("autopilot.trajectory", "autopilot.own"),
    "plumbline.vectors": ("autopilot.geometry",),
    "plumbline": (
        *OWN,
        *VEHICLE,
        "autopilot.shell.atomic_file",
        "autopilot.shell.options",
        "autopilot.vehicle.parameters",
        "autopilot.wire",
        "missions",
        "gcs",
    ),
    "plumbline.learning": ("autopilot", "sitl", "missions", "gcs", "plumbline"),
    "plumbline.sensors": ("missions", "plumbline", "sitl.sensors"),
}
# module: the only ones that may import it
TOP: dict[str, tuple[str, ...]] = {
    "autopilot.core": (
        "autopilot.onboard",
        "autopilot.shell",
        "autopilot.__main__",
        "gcs.closed_loop",
        "gcs.closed_ticks",
        "gcs.sweep",
        "plumbline.learning",
    ),
    "autopilot.onboard": (
        "autopilot.shell",
        "autopilot.__main__",
        "gcs.closed_loop",
        "gcs.closed_ticks",
        "gcs.sweep",
    ),
    "gcs.closed_loop": ("gcs", "plumbline.learning"),
    **{f"autopilot.control.laws.{law}": ("autopilot.control.laws",) for law in LAWS},
}

WORLD = {"socket", "selectors", "time", "random", "logging", "threading", "asyncio", "subprocess", "signal"}
SHELLS = (
    "autopilot.shell",
    "sitl.shell",
    "gcs.__main__",
    "gcs.commands",
    "gcs.shell",
    "gcs.workflows",
    "plumbline",
    "gcs.batch.pool",
    "gcs.batch.programs",
    "gcs.batch.progress",
    "gcs.batch.runner",
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
    """The longest room with which the name of the module begins; a file at the top of `autopilot` is in
    none."""
    rooms = [room for room in MAY_IMPORT if begins(module, room)]
    if module in ROOMS:
        return module
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
    allowed = (room, *MAY_IMPORT.get(room, ()))
    if any(begins(imported, other) for other in allowed):
        return None
    return f"{room} may import {', '.join(allowed[1:]) or 'nothing of Plumbline'}"


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
    "autopilot/trajectory/prepare.py": "from autopilot.wire.codec import decode",
    "autopilot/wire/codec.py": "from autopilot.vehicle import model",
    "autopilot/vehicle/file.py": "from ..control.laws import thesis",
    "autopilot/vehicle/model.py": "from autopilot.wire.convert import Home",
    "autopilot/trajectory/feasibility.py": "from autopilot.vehicle.file import load_vehicle",
    "autopilot/control/laws/thesis.py": "import autopilot.services.commands",
    "autopilot/control/actuators/mixer.py": "from autopilot.guidance.legs import Hold",
    "autopilot/control/thesis_cascade.py": "from autopilot.estimation.records import EstimatorState",
    "autopilot/control/believed.py": "from autopilot.control.laws import thesis",
    "autopilot/estimation/predict.py": "from autopilot.control.laws import thesis",
    "autopilot/estimation/inbox.py": "from autopilot.core.sensor_inbox import fill",
    "autopilot/estimation/release.py": "from autopilot.control.load_motion import Drag",
    "autopilot/estimation/measurements/pose.py": "from autopilot.supervisor.state import Flight",
    "autopilot/guidance/legs.py": "from autopilot.supervisor.state import Flight",
    "autopilot/guidance/jet_table.py": "from autopilot.services.records import Verdict",
    "autopilot/services/commands.py": "def f():\n    from autopilot.control.laws import thesis",
    "autopilot/services/endpoint.py": "from autopilot.onboard import onboard",
    "autopilot/supervisor/advance.py": "from autopilot.core.flight_core import FlightCore",
    "autopilot/supervisor/quiescence.py": "from autopilot.core.tick import EstimateSummary",
    "autopilot/supervisor/settings.py": "from autopilot.control.laws import chosen_law",
    "autopilot/supervisor/watches/slack.py": "from autopilot.estimation.tautness import tautness",
    "autopilot/supervisor/requests/arming.py": "from autopilot.estimation.filter import estimate",
    "autopilot/core/tick.py": "import time",
    "autopilot/core/flight_core.py": "from autopilot.control.laws.plumbline import LAW",
    "autopilot/core/sensor_inbox.py": "from autopilot.onboard.packet_loss import PacketLoss",
    "autopilot/core/warmup.py": "from autopilot.onboard.onboard import Onboard",
    "autopilot/onboard/onboard.py": "from sitl.sim_core import SimCore",
    "autopilot/onboard/snapshot.py": "from autopilot.shell.storage import Storage",
    "autopilot/control/laws/interface.py": "from gcs.closed_loop import fly",
    "autopilot/lobby.py": "from autopilot.wire.codec import decode",
    "missions/model.py": "from autopilot.geometry.linear import Vec3",
    "missions/schema.py": "import random",
    "sitl/plant/step.py": "from autopilot.control.records import Vehicle",
    "sitl/plant/winch.py": "from sitl.settings import Settings",
    "sitl/plant/records.py": "from autopilot.vehicle.model import Vehicle",
    "sitl/sensors/noise.py": "from sitl.world import WorldRows",
    "sitl/world.py": "from sitl.sim_core import SimCore",
    "sitl/sim_core.py": "from sitl.hil import HilSimulator",
    "sitl/settings.py": "from autopilot.vehicle.file import load_vehicle",
    "sitl/hil.py": "import socket as s",
    "sitl/vehicles/truth.py": "from autopilot.vehicle.parameters import autopilot_parameters",
    "sitl/sensors/files.py": "from missions.model import Step",
    "sitl/sensors/imu.py": "from gcs.analysis import align",
    "sitl/vehicles/loader.py": "from sitl.shell.program import main",
    "gcs/clients/flight.py": "from autopilot.core.tick import fly_tick",
    "gcs/analysis/align.py": "from sitl.plant.records import Truth",
    "gcs/commands/fly.py": "from sitl.sensors.files import load_profile",
    "gcs/workflows/fly.py": "from sitl.vehicles.sim_parameters import sim_parameters",
    "gcs/clients/link.py": "from asyncio import sleep",
    "gcs/report/page.py": "import logging.handlers",
}
GOOD = {
    "autopilot/__main__.py": "from autopilot.shell.command import main",
    "autopilot/shell/program.py": "import socket, time\nfrom autopilot.core.flight_core import FlightCore",
    "autopilot/core/tick.py": (
        "from autopilot.control.laws.interface import kernels_of\nfrom autopilot.supervisor import quiescence"
    ),
    "autopilot/onboard/onboard.py": "from autopilot.control.laws import build_law, chosen_law",
    "autopilot/control/laws/plumbline.py": "from autopilot.control.laws import thesis",
    "autopilot/supervisor/quiescence.py": "from autopilot.control.records import State",
    "autopilot/control/laws/thesis.py": (
        "from autopilot.geometry.linear import Vec3\nfrom ..records import Command"
    ),
    "autopilot/wire/items/table.py": "from missions.model import Step",
    "autopilot/trajectory/timeline.py": "from missions.model import Step",
    "autopilot/trajectory/feasibility.py": "from autopilot.vehicle.model import Vehicle",
    "sitl/vehicles/truth.py": (
        "from autopilot.vehicle.file import load_vehicle\nfrom autopilot.vehicle.model import Vehicle"
    ),
    "sitl/world.py": "from sitl.plant.step import step_plant\nfrom sitl.settings import Settings",
    "sitl/sensors/shipped.py": "from missions.toml_files import TomlFiles",
    "gcs/workflows/flight_inputs.py": "from sitl.vehicles.sim_parameters import sim_parameters",
    "gcs/closed_loop.py": "from sitl.hil import HilSimulator\nfrom autopilot.onboard.onboard import Onboard",
    "gcs/commands/fly.py": (
        "import subprocess, signal\nfrom sitl.sensors.shipped import PROFILES\n"
        "from autopilot.vehicle.file import VEHICLES\nfrom autopilot.vehicle.parameters import LAWS"
    ),
    "sitl/shell/program.py": "import selectors\nfrom sitl.hil import HilSimulator",
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
