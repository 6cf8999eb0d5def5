"""Custom laws as scripts and the command line name them: the same flight, reported in the same way."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import plumbline
from autopilot.own.misspellings import misspelling_warnings
from autopilot.own.own_code import OwnCode
from gcs.cli import gcs
from gcs.errors import EXIT_DONE, EXIT_USAGE
from missions.model import Delay, Land, Mission, Takeoff
from plumbline.examples.load_pid import LoadPid
from plumbline.laws import Asked, Now

SHORT = Mission("short", "Short", "", (), (Takeoff(0.5), Delay(1.0), Land()))
FAILS = """
from plumbline.examples.load_pid import LoadPid

class Fails(LoadPid):
    def load_position(self, memory, now):
        if now.time_s > 3.0:
            return memory, now.no_such_field
        return super().load_position(memory, now)
"""

PLANNER = "plumbline.examples.minimum_snap:MinimumSnap"
TELLS_WHERE = "print('said', 'by a worker' if parent_process() else 'here')"
SAYS = "from multiprocessing import parent_process" + FAILS.replace(
    "            return memory, now.no", f"            {TELLS_WHERE}\n            return memory, now.no"
)
PRINTS = """
from plumbline.examples.minimum_snap import MinimumSnap

print("loading")

class Prints(MinimumSnap):
    def plan(self, route):
        print("planning")
        return super().plan(route)
"""


class Heavier(LoadPid):
    name = "heavier"

    def load_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        believed = now.believed._replace(load_mass=1.02 * now.believed.load_mass)
        return super().load_position(memory, now._replace(believed=believed))


def run(*words: str) -> Result:
    return CliRunner().invoke(gcs, list(words), prog_name="gcs")


def test_a_class_a_file_and_a_module_fly_the_same() -> None:
    by_class = plumbline.fly(SHORT, law=Heavier, quiet=True)
    by_file = plumbline.fly(SHORT, law=f"{__file__}:Heavier", quiet=True)
    assert by_class.tlog == by_file.tlog
    assert by_class.outcome == "completed"
    assert by_class.summary["law"] == by_file.summary["law"] == "heavier"
    assert by_class.tlog != plumbline.fly(SHORT, law="plumbline.examples.load_pid:LoadPid", quiet=True).tlog


SCRIPT = """
import plumbline
from missions.model import Delay, Land, Mission, Takeoff
from plumbline.examples.load_pid import LoadPid

class Mine(LoadPid):
    pass

print("runs")
print(plumbline.fly(Mission("short", "Short", "", (), (Takeoff(0.5), Delay(1.0), Land())), law=Mine).outcome)
"""


def test_a_script_that_passes_its_own_class_runs_once(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["runs", "completed"]


def test_a_script_that_a_sweep_loads_for_its_class_is_told_to_guard_its_calls(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    told = "script.py calls plumbline.fly while its class is loaded; put its calls below: if __name__ =="
    with pytest.raises(plumbline.Error, match=re.escape(told)):
        plumbline.sweep("hover", laws=[f"{script}:Mine"])


def test_its_parameters_are_set() -> None:
    stiff = plumbline.fly(SHORT, law=Heavier, settings={"PID_KP": 8.0}, quiet=True)
    assert stiff.outcome == "completed"
    assert stiff.tlog != plumbline.fly(SHORT, law=Heavier, quiet=True).tlog
    with pytest.raises(plumbline.Error, match=r"PID_KP = 80\.0 1/s\^2; must be 0 \.\.\. 50"):
        plumbline.fly(SHORT, law=Heavier, settings={"PID_KP": 80.0}, quiet=True)


def test_one_that_fails_in_flight_leaves_a_report(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(FAILS)
    flight = plumbline.fly(SHORT, law=f"{path}:Fails", quiet=True)
    assert flight.outcome == "diverged"
    assert flight.reason == (
        "Law Fails failed: AttributeError: 'Now' object has no attribute 'no_such_field' (mine.py:7);"
        " landing by law plumbline"
    )
    page = flight.report(tmp_path / "out").read_text(encoding="utf-8")
    assert "has no attribute" in page


def test_one_that_fails_beforehand_does_not_fly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(FAILS.replace("now.time_s > 3.0", "True"))
    told = "Law Fails failed: AttributeError: 'Now' object has no attribute 'no_such_field' (mine.py:7)"
    with pytest.raises(plumbline.Error) as error:
        plumbline.fly(SHORT, law="mine.py", quiet=True)
    assert str(error.value) == f"law mine.py: {told}"
    for command in ("fly", "sweep"):
        result = run(command, "hover", "--law", "mine.py:Fails", "--quiet", "--out", "out")
        assert result.exit_code == EXIT_USAGE
        assert f"--law mine.py:Fails: {told}" in result.stderr
        assert not Path("out").exists()


@pytest.mark.parametrize("command", ["fly", "sweep", "warmup"])
def test_one_that_there_is_not_is_told(command: str) -> None:
    words = [command, *(["hover"] if command != "warmup" else []), "--law", "nofile.py:Mine"]
    result = run(*words)
    assert result.exit_code == EXIT_USAGE
    assert result.stderr == "gcs: --law nofile.py: no such file\n"


def test_what_it_prints_is_no_part_of_the_json(tmp_path: Path) -> None:
    """Nor does anything else disturb a program that reads stdout."""
    path = tmp_path / "mine.py"
    path.write_text(PRINTS)
    result = run("check", "square", "--planner", str(path), "--json")
    assert result.exit_code == EXIT_DONE, result.stderr
    assert json.loads(result.stdout)["mission"] == "square"
    assert result.stderr.startswith("loading\nplanning\n")
    assert "planning" in run("check", "square", "--planner", str(path)).stdout  # without --json: to stdout


class Misspelt(LoadPid):
    def quad_postion(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        raise AssertionError

    def position(self) -> None:
        raise AssertionError


def test_a_method_whose_name_is_near_to_one_that_is_called_is_told() -> None:
    law = f"{__file__}:Misspelt"
    assert misspelling_warnings(OwnCode(law)) == [
        f"--law {law}: Misspelt.quad_postion is never called; did you mean quad_position?"
    ]
    shipped = OwnCode("plumbline.examples.load_pid:LoadPid", "plumbline.examples.luenberger:Luenberger")
    assert misspelling_warnings(shipped._replace(planner=PLANNER)) == []


def test_a_planner_that_is_never_asked_is_told() -> None:
    with pytest.warns(UserWarning, match=f"^planner {PLANNER}: is not used: mission short has no way"):
        plumbline.fly(SHORT, planner=PLANNER, quiet=True)
    told = "the planner is not used: mission hover has no waypoints\n"
    assert run("check", "hover", "--planner", PLANNER).stdout.endswith(told)
    assert "planner is not used" not in run("check", "square", "--planner", PLANNER).stdout


def heavier_by(factor: float) -> type:
    class Made(LoadPid):
        name = "heavier"

        def load_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
            believed = now.believed._replace(load_mass=factor * now.believed.load_mass)
            return super().load_position(memory, now._replace(believed=believed))

    return Made


def test_a_sweep_tells_laws_apart(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """And it flies each as `fly` does, also one that only this process has."""
    short = plumbline.Mission("short", [Takeoff(0.5), Delay(1.0), Land()])
    path = tmp_path / "mine.py"
    path.write_text(SAYS)
    laws = (heavier_by(1.02), f"{path}:Fails")
    out = tmp_path / "out"
    rows = plumbline.sweep(short, laws=laws, jobs=1, out=out, quiet=True, kind="arrow").to_pylist()
    assert capfd.readouterr() == ("", "said by a worker\n")
    assert [(row["law"], row["outcome"]) for row in rows] == [("heavier", "completed"), ("Fails", "diverged")]
    error_m = plumbline.fly(short, law=Heavier, quiet=True).summary["load_error_max_m"]
    assert rows[0]["load_error_max_m"] == pytest.approx(error_m, rel=1e-3)
    plan = json.loads((out / "plan.json").read_text())
    (saved,) = (out / "classes").iterdir()
    assert plan["origin"]["settings"]["plan"]["laws"] == [str(saved), laws[1]]
    flown_again = plumbline.fly(short, law=str(saved), quiet=True)
    assert flown_again.tlog == plumbline.fly(short, law=laws[0], quiet=True).tlog
    path.write_text(FAILS.replace("3.0", "2.0"))
    with pytest.raises(plumbline.Error, match="holds another sweep"):
        plumbline.sweep(short, laws=laws, jobs=1, out=out, quiet=True)


def test_a_class_whose_attributes_were_set_is_not_swept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Heavier, "name", "heavier-still")
    with pytest.raises(plumbline.Error, match=re.escape("law Heavier: Heavier.name was set after the class")):
        plumbline.sweep("hover", laws=[Heavier])


def test_one_that_holds_what_cannot_be_saved_is_not_swept() -> None:
    kind = heavier_by(1.02)
    kind.lock = threading.Lock()  # type: ignore[attr-defined]
    told = "law Made cannot be given to other processes (cannot pickle '_thread.lock' object)"
    with pytest.raises(plumbline.Error, match=re.escape(told)):
        plumbline.sweep("hover", laws=[kind])


def test_two_laws_of_one_name_are_not_swept(tmp_path: Path) -> None:
    for name in ("one.py", "two.py"):
        (tmp_path / name).write_text(FAILS)
    laws = [str(tmp_path / name) for name in ("one.py", "two.py")]
    with pytest.raises(plumbline.Error, match="another law has the name Fails, too"):
        plumbline.sweep("hover", laws=laws, quiet=True)
