"""Custom code is found, and errors in it are reported with their place."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import pytest

from autopilot.own.estimator import load_estimator
from autopilot.own.law import load_law
from autopilot.own.own_code import OwnCode, parameters_for
from autopilot.own.planner import load_planner
from autopilot.own.source import OwnError
from autopilot.vehicle.file import load_belief, load_vehicle
from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.shipped import VehicleFileError

FINE = """
from plumbline.laws import force

class Fine:
    def load_position(self, memory, now):
        return memory, force((0.0, 0.0, 4.9))
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    return tmp_path


def written(text: str, name: str = "mine.py") -> None:
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


@pytest.mark.parametrize("reference", ["mine.py:Fine", "mine.py", "package.mine:Fine"])
def test_a_law_is_found(reference: str) -> None:
    written(FINE)
    written(FINE, "package/mine.py")
    law = load_law(reference)
    assert (law.name, law.modes, law.parameters) == ("Fine", ("load_position",), ())


def test_a_law_imports_what_lies_beside_it() -> None:
    written("GAIN = 3.0")
    written(f"from mine import GAIN\n{FINE}    gain = GAIN\n", "folder/law.py")
    written("GAIN = 4.0", "folder/mine.py")
    assert load_law("folder/law.py").kind.gain == 4.0  # type: ignore[attr-defined]


def test_a_file_that_was_changed_is_another_law() -> None:
    written(FINE)
    before = load_law("mine.py")
    written(FINE.replace("4.9", "5.1"))
    after = load_law("mine.py")
    assert before.kind is not after.kind
    assert before.digest == load_law("mine.py").digest != ""
    written(FINE.replace("class Fine", "class Better"))
    assert load_law("mine.py").name == "Better"


def test_so_is_one_that_imports_a_file_that_was_changed() -> None:
    law = f"from gain import GAIN\n{FINE}    gain = GAIN\n"
    written(law, "one.py")
    written(law, "other.py")
    written("GAIN = 3.0", "gain.py")
    before = [load_law(name).kind for name in ("one.py", "other.py")]
    assert [load_law(name).kind for name in ("one.py", "other.py")] == before
    written(
        "GAIN = 40.0", "gain.py"
    )  # of another length, by which Python knows that its bytecode is outdated
    after = [load_law(name).kind for name in ("one.py", "other.py")]
    assert [kind.gain for kind in (*before, *after)] == [3.0, 3.0, 40.0, 40.0]  # type: ignore[attr-defined]
    written("GAIN = 4 +", "gain.py")
    with pytest.raises(OwnError, match=re.escape("one.py: SyntaxError: invalid syntax (gain.py:1)")):
        load_law("one.py")
    written("GAIN = 500.0", "gain.py")
    assert load_law("one.py").kind.gain == 500.0  # type: ignore[attr-defined]


def test_its_parameters_are_the_autopilots() -> None:
    brought = '    parameters = {"MY_GAIN": Parameter(2.0, 0.0, 5.0, "1/s", "A gain")}\n'
    written(FINE.replace("import force", "import Parameter, force") + brought)
    table = parameters_for(load_vehicle("bebop"), OwnCode("mine.py"))
    gain = table.describe("MY_GAIN")
    assert (gain.default, gain.low, gain.high, gain.unit, gain.text) == (2.0, 0.0, 5.0, "1/s", "A gain")
    assert table["CTL_LAW"] == table.describe("CTL_LAW").high
    assert "3 Fine" in table.describe("CTL_LAW").text


def test_a_vehicle_is_delivered_with_the_parameters_of_its_law() -> None:
    """They are unknown in a flight without the law, and checked in one with it."""
    brought = '    parameters = {"MY_GAIN": Parameter(2.0, 0.0, 5.0, "1/s", "A gain")}\n'
    written(FINE.replace("import force", "import Parameter, force") + brought)
    law = OwnCode("mine.py")

    def delivered_with(line: str) -> Vehicle:
        bebop = files("autopilot.vehicle").joinpath("vehicles", "bebop.toml").read_text(encoding="utf-8")
        written(f"{bebop}[parameters]\n{line}\n", "tuned.toml")
        return load_belief("tuned.toml")

    belief = delivered_with("MY_GAIN = 3.0")
    table = parameters_for(belief, law)
    assert table["MY_GAIN"] == table.describe("MY_GAIN").default == 3.0
    with pytest.raises(VehicleFileError, match=r"^the vehicle's parameters\.MY_GAIN: no such .* law"):
        parameters_for(belief)
    with pytest.raises(VehicleFileError, match=r"parameters\.MY_GAIN = 9\.0 1/s; must be 0 \.\.\. 5"):
        parameters_for(delivered_with("MY_GAIN = 9.0"), law)
    with pytest.raises(VehicleFileError, match=r"parameters\.MIS_SPED: no such parameter; did you mean MIS"):
        parameters_for(delivered_with("MIS_SPED = 1.0"), law)


WRONG = {
    "nofile.py:Fine": ("", r"^nofile\.py: no such file$"),
    "lab": ("", r"^'lab': no control law of that name; lab is one of the shipped sensors; must be thesis, "),
    "mine": (FINE, r"^'mine': no control law of that name; did you mean mine\.py\? must be thesis, "),
    "nobody": ("", r"^'nobody': no control law of that name; must be thesis, lqr, .*my_law\.py:MyLaw$"),
    "mine.py:Other": (FINE, r"^mine\.py: has no class Other; there is Fine$"),
    "mine.py:force": (FINE, r"^mine\.py: has no class force; there is Fine$"),
    "mine.py": ("x = 1", r"^mine\.py: has no control law, as mine\.py:MyLaw$"),
    "./mine.py": (
        "class Near:\n    def load_postion(self, memory, now): ...",
        r"^\./mine\.py: Near has no method that flies; did you mean load_position\? must have one of ",
    ),
    "mine.py:": (
        FINE + FINE.replace("Fine", "Two"),
        r"^mine\.py: has Fine, Two; name one, as mine\.py:Fine$",
    ),
    "no.such.module:Fine": ("", r"^no\.such\.module: ModuleNotFoundError: No module named 'no'$"),
    "my law:Fine": ("", r"^my law: is no Python file \(\.py\), and no name of a module$"),
    "./mine.py:Fine": ("\n\n1 / 0", r"^\./mine\.py: ZeroDivisionError: division by zero \(mine\.py:3\)$"),
    "mine.py:Ends": ("\nraise SystemExit(3)", r"^mine\.py: SystemExit: 3 \(mine\.py:2\)$"),
    "mine.py:Syntax": ("\ndef f(:\n", r"^mine\.py: SyntaxError: .* \(mine\.py:2\)$"),
    "mine.py:Empty": (
        "class Empty: pass",
        r"Empty has no method that flies; must have one of load_position, ",
    ),
    "mine.py:Fine ": (FINE, r"has no class Fine ; there is Fine$"),
}


@pytest.mark.parametrize("reference", WRONG)
def test_what_cannot_be_found_is_told(reference: str) -> None:
    text, told = WRONG[reference]
    if text:
        written(text)
    with pytest.raises(OwnError, match=told):
        load_law(reference)


@pytest.mark.parametrize(
    ("load", "example"),
    [
        (load_planner, "mine.py: has no planner, as mine.py:MyPlanner"),
        (load_estimator, "mine.py:MyEstimator"),
    ],
)
def test_the_example_is_of_the_kind_that_is_missing(load: Callable[[str], object], example: str) -> None:
    written("x = 1")
    with pytest.raises(OwnError, match=f"{re.escape(example)}$"):
        load("mine.py")


def test_a_module_that_would_end_the_program_is_told() -> None:
    written("\nraise SystemExit(3)", "module_that_ends.py")
    with pytest.raises(OwnError, match=r"^module_that_ends: SystemExit: 3 \(module_that_ends\.py:2\)$"):
        load_law("module_that_ends:Ends")


IN_CLASS = {
    '    name = "two words"\n': r"name = 'two words'; must be letters",
    '    name = "thesis"\n': r"name = 'thesis' is that of a shipped law",
    "    parameters = 3\n": r"parameters must be a dictionary of Parameter by name",
    '    parameters = {"MY_GAIN": 2.0}\n': r"parameters\['MY_GAIN'\] must be Parameter\(default, low",
    '    parameters = {"MY_GAIN": Parameter(9.0, 0.0, 5.0)}\n': r"MY_GAIN = 9\.0; the default must be 0\.0",
    '    parameters = {"my gain": Parameter(1.0, 0.0, 5.0)}\n': r"a name is 1 \.\.\. 16 of A-Z",
    '    parameters = {"SIM_GAIN": Parameter(1.0, 0.0, 5.0)}\n': r"must not begin with SIM_",
    '    parameters = {"MIS_SPEED": Parameter(1.0, 0.0, 5.0)}\n': r"parameters defined twice: MIS_SPEED",
}


@pytest.mark.parametrize("line", IN_CLASS)
def test_what_a_law_must_not_say_is_told(line: str) -> None:
    written(FINE.replace("import force", "import Parameter, force") + line)
    with pytest.raises(OwnError, match=rf"^--law mine\.py: Fine\.?.*{IN_CLASS[line]}"):
        parameters_for(load_vehicle("bebop"), OwnCode("mine.py"))


def test_an_entry_point_is_a_law(here: Path) -> None:
    """As an installed package declares it."""
    written(FINE, "brought.py")
    written("[plumbline.laws]\nsteady = brought:Fine\n", "brought-1.0.dist-info/entry_points.txt")
    written("Metadata-Version: 2.1\nName: brought\nVersion: 1.0\n", "brought-1.0.dist-info/METADATA")
    sys.path.insert(0, str(here))
    assert load_law("steady").name == "Fine"
    with pytest.raises(OwnError, match="must be thesis, lqr, plumbline, steady, or a file"):
        load_law("unsteady")
