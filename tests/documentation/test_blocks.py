"""Every code block of README and docs is run, or says why it is not.

The blocks of a page run one after another in a separate folder that holds what a reader would have by then:
a flight, and files that `gcs new` writes. Commands run in this process. Some are made small, so that all of
it takes less than a minute: `gcs fly` checks its mission, flies a short one with the options of the command,
and gives the report of one flight that is made once; a sweep flies the first two values of each varied
parameter with one seed, also of the short mission. Commands to a running vehicle reach a scripted one.
"""

from __future__ import annotations

import ast
import builtins
import shlex
import shutil
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import pytest
import yaml
from click.testing import CliRunner
from pyarrow import Table, parquet

import plumbline
from autopilot.own.law import law_number
from autopilot.own.own_code import OwnCode
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import encode_mission
from gcs.cli import gcs
from gcs.clients.flight import Outcome
from gcs.closed_loop import Conditions
from gcs.formats.missions import write_foreign
from gcs.mission_files import load
from gcs.recorded.column_map import MAPS, ColumnMap
from gcs.sweep import plan as plans
from gcs.sweep.flight import fly as fly_swept
from gcs.sweep.flight import start_times
from gcs.workflows.before_flight import check_mission, check_options
from gcs.workflows.flight_options import FlightOptions, parse_setting
from gcs.workflows.fly import Flight
from gcs.workflows.new_file import new_file
from missions.fileformat import parse_mission
from plumbline import Land, Mission, Takeoff, Waypoint
from plumbline.frames import as_frame
from sitl.sensors.files import parse_profile
from tests.doubles.pages import PAGES, REASONS, ROOT, Block, split
from tests.doubles.ports import ground_port
from tests.gcs.conftest import LiveVehicle, ScriptedVehicle

LANGUAGES = {"sh", "python", "toml", "yaml", "text"}
# how many blocks are not run, by reason: to add one is a decision
NOT_RUN = {"display": 2, "firmware": 7, "minutes": 19, "network": 17}
SHORT = Mission("short", [Takeoff(0.4), Waypoint(0.0, 0.0, 0.4, hold_s=0.5), Land()])
SHARED = ROOT / "tests" / "clients" / "survey.plan"
RUN = [
    page
    for page in PAGES
    if any(block.language != "text" and block.mark not in ("not run", "run by") for block in split(page)[0])
]
MADE = {
    "mission": ("round", "my-mission", "my/mission", "my/flight"),
    "vehicle": ("mine",),
    "sensors": ("room",),
}


# ---- what the blocks are run with


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of one flight, as `gcs fly` leaves it."""
    folder = tmp_path_factory.mktemp("flown")
    plumbline.fly(SHORT, sensors="ideal", quiet=True).report(folder)
    return folder


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The short mission as a file."""
    path = tmp_path_factory.mktemp("short") / "short.toml"
    SHORT.save(path)
    return str(path)


@cache
def flies_with(own: OwnCode, law: str, sensors: str, vehicle: str, settings: tuple[str, ...]) -> str:
    """The outcome of the short mission with these options, flown as in a sweep: it is the same flight."""
    given = {"CTL_LAW": float(law_number(law)), **dict(map(parse_setting, settings))}
    conditions = Conditions(vehicle, sensors, 1, given, own)
    return fly_swept(SHORT, conditions, start_times(SHORT, conditions)).outcome


@pytest.fixture
def small(flown: Path, short: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make `gcs fly`, `gcs sweep` and `plumbline.sweep` small as the head of this file says."""

    def fly(
        options: FlightOptions, told: Callable[..., None], page: Any = None, processes: Any = None
    ) -> Flight:
        mission = load(options.mission)
        if options.connect is None:
            check_options(options)
            check_mission(mission, options)
            vehicle = (
                str(Path(options.vehicle).resolve()) if Path(options.vehicle).is_file() else options.vehicle
            )
            sensors = (
                str(Path(options.sensors).resolve()) if Path(options.sensors).is_file() else options.sensors
            )
            assert flies_with(options.own, options.law, sensors, vehicle, options.settings) == "completed"
        number = len(list(Path("flights").glob("*")))
        out = options.out or Path("flights") / f"{mission.name}-20260101-12000{number}"
        shutil.copytree(flown, out, dirs_exist_ok=True)
        record = plumbline_record(flown)
        told(record, Outcome("completed"))
        return Flight(Outcome("completed"), record, out, False)

    make_plan = plans.make_plan

    def made(mission: str, *rest: Any) -> Any:
        make_plan(mission, *rest)  # raises an error if the sweep itself is wrong
        vehicle, sensors, laws, _, varied, settings, sample, own, limit_s = rest
        few = [replace(one, values=one.values[:2]) for one in varied]
        return make_plan(short, vehicle, sensors, laws, (1,), few, settings, min(sample, 2), own, limit_s)

    monkeypatch.setattr("gcs.shell.processes.Processes.load", lambda processes, name: None)
    monkeypatch.setattr("gcs.workflows.fly.fly", fly)
    monkeypatch.setattr("gcs.workflows.sweep.make_plan", made)
    monkeypatch.setattr("gcs.workflows.sweep.local_processes", in_this_process)
    monkeypatch.setattr("gcs.workflows.sweep.dask_cluster", in_this_process)
    monkeypatch.setattr("gcs.workflows.sweep.write_report", lambda out, plan: out / "report.html")
    monkeypatch.setattr("plumbline.sweep", small_sweep)


def plumbline_record(folder: Path) -> Any:
    """The figures of the flight in a folder."""
    import json

    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


@contextmanager
def in_this_process(_: object) -> Iterator[tuple[Executor, int]]:
    """One thread of this process to fly the flights of a sweep."""
    with ThreadPoolExecutor(1) as executor:
        yield executor, 1


def small_sweep(mission: Any, *, vary: Any = None, kind: str = "pandas", **options: Any) -> Any:
    """plumbline.sweep by the small `gcs sweep` in this process."""
    assert not set(options) - {"seeds", "laws", "sensors", "vehicle", "settings", "out", "quiet"}
    words = ["sweep", str(mission), "--out", "sweeps/python", "--fresh", "--quiet"]
    for name, values in (vary or {}).items():
        words += ["--vary", f"{name}={','.join(map(str, values))}"]
    result = CliRunner().invoke(gcs, words)
    assert result.exit_code == 0, result.output
    return as_frame(parquet.read_table("sweeps/python/flights.parquet"), kind)


class Telling(ScriptedVehicle):
    """A scripted vehicle that also reports the position of its load."""

    def tick(self, now_us: int) -> list[bytes]:
        self.tell_load(0.0, 0.0, 2.0)
        return super().tick(now_us)


@pytest.fixture(scope="module")
def vehicle() -> Iterator[str]:
    """The port of a running vehicle that obeys commands and has the parameters of our autopilot."""
    port = ground_port()
    thread = LiveVehicle(port)
    thread.vehicle = Telling()
    thread.vehicle.HEARTBEAT_US = 50_000
    thread.vehicle.parameters = autopilot_parameters(load_vehicle("bebop")).values()
    thread.start()
    yield str(port)
    thread.stop()


@pytest.fixture
def folder(flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which the blocks of a page are run."""
    shutil.copytree(flown, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    Path("my").mkdir()
    for kind, names in MADE.items():
        for name in names:
            new_file(kind, name)
    shutil.copy(SHARED, "survey.plan")
    swept = Path("sweeps/robustness/delay-noise")
    swept.mkdir(parents=True)
    rows = {"law": ["thesis"], "SIM_ACT_DELAY_MS": [12.0], "load_error_max_m": [0.1]}
    parquet.write_table(Table.from_pydict(rows), swept / "flights.parquet")
    items = encode_mission(SHORT, Home())
    for name in ("theirs.waypoints", "mission.waypoints"):
        write_foreign(Path(name), items, Home())
    return tmp_path


# ---- running them


class Shell:
    """Runs the lines of sh blocks."""

    def __init__(self, flown: Path, port: str) -> None:
        self._flown, self._port = flown, port

    def run(self, block: Block) -> None:
        """Run each command of the block; it must end with exit code 0. Comments are ignored."""
        for line in block.text.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            while words:
                end = words.index("&&") if "&&" in words else len(words)
                command, words = words[:end], words[end + 1 :]
                self._command(command, block)

    def _command(self, words: list[str], block: Block) -> None:
        if words[:1] == ["."]:  # activates the environment
            return
        if words[0] == "python":
            assert Path(words[1]).is_file(), f"{block.place}: no block of the page is {words[1]}"
            return  # it ran as a block
        assert words[0] == "gcs", f"{block.place}: {words[0]} is not run here: mark the block"
        if ">" in words:
            words = words[: words.index(">")]
        arguments = [name for word in words[1:] for name in self._expanded(word)]
        if arguments[0] == "new":
            for ending in (".toml", ".py"):
                Path(arguments[2] + ending).unlink(missing_ok=True)
        if arguments[0] == "sweep":
            arguments.append("--fresh")  # a line must not continue the sweep of an earlier one
        if arguments[0] in ("report", "compare"):
            self._have_flights(arguments[1:])
        if takes_address(arguments):
            arguments += ["--connect", self._port]  # the last --connect counts
        result = CliRunner().invoke(gcs, arguments, prog_name="gcs")
        assert result.exit_code == 0, (
            f"{block.place}: {shlex.join(words)}\n{result.output}{result.exception!r}"
        )

    def _expanded(self, word: str) -> list[str]:
        found = sorted(map(str, Path().glob(word))) if "*" in word and "/" in word else []
        return found or [word]

    def _have_flights(self, arguments: list[str]) -> None:
        for before, name in pairwise(["", *arguments]):
            if name.startswith("-") or before == "--out" or Path(name).exists():
                continue
            if name.endswith(".tlog"):
                Path(name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(self._flown / "flight.tlog", name)
            elif not name.endswith(".html"):
                shutil.copytree(self._flown, name)


def takes_address(arguments: list[str]) -> bool:
    """Whether the command connects to a running vehicle."""
    context, command = click.Context(gcs), gcs.get_command(click.Context(gcs), arguments[0])
    if isinstance(command, click.Group):
        command = command.get_command(context, arguments[1])
    return command is not None and any(option.name == "address" for option in command.params)


def run_toml(block: Block) -> None:
    """Check that the block can be read as the kind of file that it is."""
    table = tomllib.loads(block.text)
    if "items" in table:
        # its other files are found from the folder of its own
        parse_mission(block.text, "block", block.said if block.mark == "file" else block.place)
    elif "quad_mass_kg" in table:
        Vehicle.model_validate({"name": "block", **table})
    elif "model" in table:
        MAPS.record(ColumnMap, table, block.place)
    else:
        parse_profile(block.text, block.place)


def test_a_block_has_a_language_and_a_mark_that_is_known() -> None:
    for page in PAGES:
        blocks, prose = split(page)
        for block in blocks:
            assert block.language in LANGUAGES, block.place
            if block.mark == "not run":
                assert block.said.partition(":")[0] in REASONS, block.place
            if block.mark == "run by":
                told = (ROOT / block.said).read_text(encoding="utf-8")
                assert page.name in told, f"{block.place}: {block.said} does not name this page"
        # four spaces would make a block that is not run
        indented = [
            number
            for (_, before), (number, line) in pairwise(prose)
            if line.startswith("    ") and not before.strip()
        ]
        assert not indented, f"{page.name}:{indented}: write a fence with its language"


def test_as_many_blocks_are_not_run_as_is_known() -> None:
    found = [block for page in PAGES for block in split(page)[0] if block.mark == "not run"]
    assert Counter(block.said.partition(":")[0] for block in found) == NOT_RUN


@pytest.mark.usefixtures("small", "folder")
@pytest.mark.parametrize("page", RUN, ids=lambda page: page.name)
def test_the_blocks_of_a_page_run(
    page: Path, flown: Path, vehicle: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    import matplotlib

    matplotlib.use("Agg")
    shell, names = Shell(flown, vehicle), {"__name__": "__main__"}
    for block in split(page)[0]:
        if block.mark == "file":
            Path(block.said).write_text(block.text, encoding="utf-8")
        if block.mark in ("not run", "run by"):
            continue
        if block.language == "sh":
            shell.run(block)
        elif block.language == "python":
            code = "\n" * (block.line - 1) + block.text
            exec(compile(code, str(page), "exec"), names)
        elif block.language == "toml":
            run_toml(block)
        elif block.language == "yaml":
            yaml.safe_load(block.text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_block_of_python_imports_what_it_uses(page: Path) -> None:
    """Readers copy one block and not the page."""
    for block in split(page)[0]:
        if block.language == "python":
            assert not _undefined(block.text), f"{block.place}: {_undefined(block.text)}"


def _undefined(code: str) -> set[str]:
    """Names that are used but not defined anywhere, regardless of scopes."""
    known, used = set(dir(builtins)), set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            known |= {(one.asname or one.name).split(".")[0] for one in node.names}
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            known.add(node.name)
        elif isinstance(node, ast.arg):
            known.add(node.arg)
        elif isinstance(node, ast.Name):
            (used if isinstance(node.ctx, ast.Load) else known).add(node.id)
    return used - known
