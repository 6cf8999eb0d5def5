"""Wrong files and classes of the user: each gives one line that says what is wrong, where, and what to do,
and its exit code, before anything flies."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from gcs.cli import gcs
from gcs.errors import EXIT_ERROR, EXIT_USAGE
from gcs.workflows.new_file import new_file

LAW = """
from math import nan
from plumbline.laws import Parameter, force, kernel, wrench

class Mine:
    {parameters}
    def load_position(self, memory, now):
        {body}
"""
ESTIMATOR = """
from math import nan
from typing import NamedTuple
from plumbline.estimators import Parameter, estimated, kernel, no_estimate

class Mine:
    {parameters}
    def estimate(self, memory, now):
        s = now.built_in
        {body}
"""
COMPILED = """
from typing import NamedTuple
from plumbline.estimators import estimated, kernel

class Nothing(NamedTuple):
    gain: float

class Mine(Nothing):
    @classmethod
    def build(cls, parameters):
        return cls(1.0)

    @kernel
    def start(self, now):
        return Nothing(0.0)

    @kernel
    def estimate(self, memory, now):
        {body}
"""
PLANNER = """
from math import nan
from plumbline.planners import Parameter, polynomials, samples

class Mine:
    {parameters}
    def plan(self, route):
        ends = [route.points[0], route.points[-1]]
        {body}
"""
TWICE = 'parameters = {"EST_GATE": Parameter(1.0, 0.0, 2.0)}'
WORLD = 'parameters = {"SIM_MINE": Parameter(1.0, 0.0, 2.0)}'
OUT = 'parameters = {"MINE_K": Parameter(3.0, 0.0, 2.0)}'
FINE = "return memory, force((0, 0, 4.9))"
SOUND = "return memory, estimated(*s)"


def law(body: str, parameters: str = "") -> str:
    return LAW.format(body=body, parameters=parameters)


def estimator(body: str, parameters: str = "") -> str:
    return ESTIMATOR.format(body=body, parameters=parameters)


# fails on the routes of `square`, not on those of the trial before a flight
PICKY = """
from plumbline.examples.minimum_snap import MinimumSnap
class Mine(MinimumSnap):
    def plan(self, route):
        if route.points[0][2] != 1.0:
            raise SystemExit(3)
        return super().plan(route)
"""


def planner(body: str, parameters: str = "") -> str:
    return PLANNER.format(body=body, parameters=parameters)


# by option: the content of mine.py, and the expected message
BAD = {
    "--law": [
        ("class Mine:", r"mine.py: SyntaxError|mine.py: IndentationError"),
        ("import nowhere", "mine.py: ModuleNotFoundError: No module named 'nowhere' (mine.py:1)"),
        ("x = 1", "mine.py: has no class Mine"),
        ("class Mine: pass", "Mine has no method that flies; must have one of load_position"),
        (
            law("return memory, force((0, 0, 4.9))", TWICE),
            "Mine.parameters: parameters defined twice: EST_GATE",
        ),
        (law(FINE, WORLD), "SIM_MINE would be the simulator's"),
        (law(FINE, OUT), "Mine.parameters: MINE_K"),
        (law("1 / 0"), "Law Mine failed: ZeroDivisionError: division by zero (mine.py:8)"),
        (
            law("return memory, wrench(nan, (0, 0, 0))"),
            "Mine failed: asks for a thrust of nan N; must be numbers up to 1e9 (mine.py:7)",
        ),
        (law("return memory, force((0, 0))"), "the force has 2 numbers; must be 3 (mine.py:8)"),
        (law("return force((0, 0, 4.9))"), "load_position returned Asked(kind="),
    ],
    "--estimator": [
        ("x = 1", "mine.py: has no class Mine"),
        ("class Mine: pass", "mine.py:Mine: Mine has no method estimate(self, memory, now)"),
        (estimator(SOUND, TWICE), "Mine.parameters: parameters defined twice: EST_GATE"),
        (estimator("1 / 0"), "Estimator Mine failed: ZeroDivisionError: division by zero (mine.py:10)"),
        (
            estimator("return memory, estimated(*s._replace(v_load=(nan, 0, 0)))"),
            "Estimator Mine failed: gives v_load = (nan, 0, 0); must be numbers up to 1e9 (mine.py:8)",
        ),
        (
            estimator("return memory, estimated(*s._replace(q_cable_dot=(0, 1e160, 0)))"),
            "Mine failed: gives q_cable_dot = (0, 1e+160, 0); must be numbers up to 1e9 (mine.py:8)",
        ),
        (
            estimator("return memory, estimated(*s._replace(a_quad=(1e160, 0, 0)))"),
            "Estimator Mine failed: gives a_quad = (1e+160, 0, 0); must be numbers up to 1e9 (mine.py:8)",
        ),
        (
            estimator("return memory, estimated(*s, tension=float('inf'))"),
            "Estimator Mine failed: gives tension = inf; must be numbers up to 1e9 (mine.py:8)",
        ),
        (
            estimator("return memory, estimated(*s, horizontal_std=1e160)"),
            "gives horizontal_std = 1e+160; must be 0 ... 1e9, and left out if not known (mine.py:8)",
        ),
        (
            estimator("return memory, estimated(*s._replace(q_cable=(0, 0, -2)))"),
            "gives q_cable = (0, 0, -2), which is no unit vector (mine.py:8)",
        ),
        (
            estimator("return memory, estimated(*s._replace(R=((1, 0, 0), (0, 2, 0), (0, 0, 1))))"),
            "gives R = ((1, 0, 0), (0, 2, 0), (0, 0, 1)), which is no rotation (mine.py:8)",
        ),
        (
            estimator("return memory, estimated(*s, horizontal_std=-1)"),
            "gives horizontal_std = -1; must be 0 ... 1e9, and left out if not known (mine.py:8)",
        ),
        (
            COMPILED.format(
                body="s = now.built_in; return memory, estimated(s.x_load, s.v_load, s.q_cable, "
                "s.q_cable_dot, s.x_quad, s.v_quad, s.R, s.omega_body, s.a_quad, vertical_std=-0.2)"
            ),
            "gives vertical_std = -0.2; must be 0 ... 1e9, and left out if not known (mine.py:",
        ),
        (
            estimator("return memory, estimated(*s, vertical_std=float('inf'))"),
            "gives vertical_std = inf; must be 0 ... 1e9, and left out if not known (mine.py:8)",
        ),
        (
            estimator("return memory, estimated(*s._replace(x_quad=(0, 0)))"),
            "x_quad has 2 numbers; must be 3 (mine.py:10)",
        ),
        (
            estimator("return memory, estimated(*s._replace(R=s.R[0]))"),
            "R has 3 numbers; must be 3 x 3 (mine.py:10)",
        ),
        (estimator("return s"), "estimate returned State(x_load="),
        (estimator("return memory, s"), "which must be made by estimated or no_estimate (mine.py:8)"),
        (
            estimator("return 1, estimated(*s) if memory is None else no_estimate()"),
            "Estimator Mine failed: gives no estimate any more (mine.py:8)",
        ),
        (COMPILED.format(body="return memory, now.no_such"), "Estimator Mine failed: cannot be compiled: "),
    ],
    "--planner": [
        ("x = 1", "mine.py: has no class Mine"),
        ("class Mine: pass", "mine.py:Mine: Mine has no method plan(self, route)"),
        (planner("1 / 0"), "Planner Mine failed: ZeroDivisionError: division by zero (mine.py:9)"),
        (planner("return ends"), "which must be made by polynomials or samples (mine.py:7)"),
        (
            planner("return polynomials([0, 1], [[ends[0], ends[1]]], [0, 1])"),
            "the path begins or ends with a velocity of ",
        ),
        (
            planner("return samples([0, 1], ends[:1], [0, 1])"),
            "are of shape (1, 3); must be (2, 3)",
        ),
        (planner("return samples([0, 3], ends, [0, 1, 2, 3])"), "passes_s are 4 times; must be 2"),
        (
            planner("return polynomials([0, 3], [[(nan, 0, 0)]], [0, 3])"),
            "the path contains a value that is not a number",
        ),
        (
            planner("return samples([0, 2, 4], [ends[0], (1e160, 0, 1), ends[1]], [0, 4])"),
            "the path leads to 1e+160 m; must be numbers up to 1e9 (mine.py:7)",
        ),
        (
            planner("return samples([0, 3], [ends[0], ends[0]], [0, 3])"),
            "the path passes point 1 2.00 m beside it; must be 0.05 m at most (mine.py:7)",
        ),
        (
            planner("return samples([0, 2, 4], [ends[0], (1, 0, -1), ends[1]], [0, 4])"),
            "above home; must be above the ground (mine.py:7)",
        ),
    ],
}
CASES = [(option, text, told) for option, cases in BAD.items() for text, told in cases]


def told_of(*arguments: str) -> tuple[int, str]:
    """Exit code and the one line on stderr."""
    result = CliRunner().invoke(gcs, arguments, prog_name="gcs")
    (line,) = result.stderr.splitlines()
    assert line.startswith("gcs: ") and not result.stdout
    return result.exit_code, line


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(("option", "text", "told"), CASES)
def test_a_class_that_cannot_fly_is_told_in_one_line(option: str, text: str, told: str) -> None:
    Path("mine.py").write_text(text, encoding="utf-8")
    code, line = told_of("fly", "hover", option, "mine.py:Mine")
    assert any(one in line for one in told.split("|")), line
    assert code == EXIT_USAGE


def test_a_mission_is_checked_with_a_planner() -> None:
    words = ["check", "square", "--planner", "plumbline.examples.minimum_snap:MinimumSnap", "--json"]
    found = json.loads(CliRunner().invoke(gcs, words).stdout)
    assert not found["violations"]
    assert [path["item"] for path in found["paths"]] == [0, 2, 3, 4, 5]

    failed = "Planner Mine failed: SystemExit: 3 (mine.py:9)"
    Path("mine.py").write_text(planner("raise SystemExit(3)"), encoding="utf-8")
    code, line = told_of("check", "square", "--planner", "mine.py:Mine")
    assert line == f"gcs: --planner mine.py:Mine: on a trial route (0, 0, 1), (2, 0, 1): {failed}"
    assert code == EXIT_USAGE
    Path("picky.py").write_text(PICKY, encoding="utf-8")
    code, line = told_of("check", "square", "--planner", "picky.py:Mine")
    assert line == f"gcs: square: item 2: {failed.replace('mine.py:9', 'picky.py:6')}"
    assert code == EXIT_ERROR
    assert told_of("check", "square", "--planner", "nofile.py:Mine")[0] == EXIT_USAGE
    assert told_of("check", "square", "--as-asked", "--planner", "mine.py:Mine")[0] == EXIT_USAGE


@pytest.mark.parametrize("option", ["--law", "--estimator", "--planner"])
def test_one_that_is_not_there_is_told(option: str) -> None:
    assert "nofile.py: no such file" in told_of("fly", "hover", option, "nofile.py:Mine")[1]
    code, line = told_of("sweep", "hover", option, "nobody")
    assert (code, "'nobody': no " in line) == (EXIT_USAGE, True)


# kind, option, the line of a shipped template that is changed, what it becomes, and part of the message
FILES = [
    ("vehicle", "--vehicle", "quad_mass_kg = ", "quad_mass_kg = -1.0", "quad_mass_kg = -1"),
    ("vehicle", "--vehicle", "quad_mass_kg = ", "quad_mas_kg = 1.0", "quad_mas_kg"),
    ("vehicle", "--vehicle", "quad_mass_kg = ", "quad_mass_kg = = 1", "mine.toml"),
    ("sensors", "--sensors", "rate_hz = ", "rate_hz = 0.0", "rate_hz = 0"),
    ("sensors", "--sensors", "rate_hz = ", "rat_hz = 100.0", "rat_hz"),
    ("mission", "", "altitude_m = ", 'altitude_m = "high"', "altitude_m"),
    ("mission", "", "altitude_m = ", "altitud_m = 1.0", "altitud_m"),
]


@pytest.mark.parametrize(("kind", "option", "begins", "line", "told"), FILES)
def test_a_file_with_a_mistake_is_told_with_its_place(
    kind: str, option: str, begins: str, line: str, told: str
) -> None:
    path = new_file(kind, "mine").path
    lines = path.read_text(encoding="utf-8").splitlines()
    at = next(i for i, one in enumerate(lines) if one.startswith(begins))
    path.write_text("\n".join([*lines[:at], line, *lines[at + 1 :]]), encoding="utf-8")
    words = ["hover", option, "mine.toml"] if option else ["mine.toml"]
    code, said = told_of("fly", *words)
    assert "mine.toml" in said and told in said
    assert code in (1, EXIT_USAGE)


@pytest.mark.parametrize("command", ["fly hover", "sweep hover", "experiments thesis"])
def test_a_folder_that_cannot_be_made_is_told(command: str) -> None:
    Path("file").touch()
    told = "gcs: --out file/x: Not a directory; name a folder that can be written"
    assert told_of(*command.split(), "--out", "file/x") == (EXIT_USAGE, told)


WRITERS = [
    ("fly hover --junit", "x.xml"),
    ("sweep hover --junit", "x.xml"),
    ("fly hover --out", ""),
    ("sweep hover --out", ""),
    ("report flight --out", ""),
    ("replay flight.csv --out", ""),
    ("experiments thesis --out", ""),
    ("experiments thesis --docs", "x.md"),
    ("compare one other --out", "x.html"),
    ("capture --out", "x.tlog"),
    ("download", "x.plan"),
    ("param save", "x.params"),
]


@pytest.mark.parametrize(("command", "name"), WRITERS)
@pytest.mark.parametrize("folder", ["/proc", "file", "/proc/deep/er"])
def test_where_nothing_can_be_written_it_is_told_at_once(command: str, name: str, folder: str) -> None:
    Path("file").touch()
    path = f"{folder}/{name}" if name else f"{folder}/out"
    code, line = told_of(*command.split(), path)
    kind = "file in a folder" if name else "folder"
    assert code == EXIT_USAGE
    assert f"{path}: " in line and line.endswith(f"; name a {kind} that can be written")
    assert [entry.name for entry in Path().iterdir()] == ["file"]


@pytest.mark.parametrize("command", [command for command, _ in WRITERS])
def test_no_path_is_not_the_folder_in_which_one_is(command: str) -> None:
    code, line = told_of(*command.split(), "")
    assert code == EXIT_USAGE
    assert "'' is no path; . is the folder in which you are" in line


def test_what_is_in_a_file_stays_until_another_is_written() -> None:
    Path("report.xml").write_text("earlier", encoding="utf-8")
    told_of("fly", "nowhere", "--junit", "report.xml", "--out", "")
    assert Path("report.xml").read_text(encoding="utf-8") == "earlier"


REQUIREMENTS = [
    ("load_eror_max_m < 1", "did you mean load_error_max_m or "),
    ("load_error_max_m", "must be KEY SIGN VALUE"),
    ("outcome < completed", "a word is compared with == or !="),
]


@pytest.mark.parametrize(("text", "told"), REQUIREMENTS)
def test_a_requirement_that_cannot_be_judged_is_told(text: str, told: str) -> None:
    code, line = told_of("fly", "hover", "--require", text)
    assert told in line and text in line
    assert code == EXIT_USAGE


FIRMWARES = [
    ("ardupilot", "must be ardupilot=PATH or px4=PATH"),
    ("ardupilt=/bin/true", "did you mean ardupilot?"),
    ("ardupilot=", "must be ardupilot=PATH or px4=PATH"),
    ("ardupilot=nowhere", "no program there; see docs/autopilots.md"),
    ("px4=.", "no program there; see docs/autopilots.md"),
]


@pytest.mark.parametrize(("text", "told"), FIRMWARES)
def test_an_autopilot_that_there_is_not_is_wrong_usage(text: str, told: str) -> None:
    code, line = told_of("fly", "hover", "--autopilot", text)
    assert code == EXIT_USAGE
    assert line.startswith(f"gcs: --autopilot {text}: ") and told in line
