"""gcs new: the files it writes fly unchanged and name every key."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path
from typing import IO, Any

import pytest
from click.testing import CliRunner, Result

import plumbline
from autopilot.vehicle.model import Vehicle
from gcs.cli import gcs
from gcs.errors import EXIT_DONE, EXIT_ERROR, EXIT_USAGE
from gcs.workflows.new_file import kinds
from missions.model import Land, Mission, Takeoff, Waypoint
from missions.schema import ITEMS
from sitl.sensors.profile import Profile

SHORT = Mission("short", "Short", "", (), (Takeoff(0.5), Waypoint(0.2, 0.0, 0.5), Land()))


def run(*words: str) -> Result:
    return CliRunner().invoke(gcs, list(words), prog_name="gcs")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def written(kind: str, name: str = "my-own") -> Path:
    """The file that `gcs new` has written."""
    result = run("new", kind, name)
    assert result.exit_code == EXIT_DONE, result.stderr
    (path,) = Path().rglob("*.*")
    return path


@pytest.mark.parametrize("kind", kinds())
def test_what_is_written_flies_as_it_is(kind: str) -> None:
    """The options are those of the command in the file; a file that is no mission flies a short one."""
    path = written(kind)
    mission, *options = shlex.split(written_command(path))[2:]
    given = dict(zip((word.removeprefix("--") for word in options[::2]), options[1::2], strict=True))
    assert str(path) in " ".join([mission, *given.values()])
    flight = plumbline.fly(mission if kind == "mission" else SHORT, **given, quiet=True)
    assert (flight.outcome, flight.reason) == ("completed", "")
    assert flight.summary["load_error_max_m"] < 0.05


@pytest.mark.parametrize("seed", [0, 1])
def test_templates_of_law_estimator_and_sensors_fly_together(seed: int) -> None:
    for kind in ("law", "estimator", "sensors"):
        assert run("new", kind, f"my-{kind}").exit_code == EXIT_DONE
    law, estimator = "my_law.py:MyLaw", "my_estimator.py:MyEstimator"
    flown = plumbline.fly(
        SHORT, law=law, estimator=estimator, sensors="my-sensors.toml", seed=seed, quiet=True
    )
    assert (flown.outcome, flown.reason) == ("completed", "")


def written_command(path: Path) -> str:
    """The command that is stated in the file."""
    (line,) = re.findall(r"Fly it:\s+(gcs fly .*)", path.read_text(encoding="utf-8"))
    return line


@pytest.mark.parametrize("kind", kinds())
def test_the_next_command_is_said(kind: str) -> None:
    said = run("new", kind, "mine").stdout
    (path,) = Path().iterdir()
    assert said == f"{path} is written; it flies as it is:\n\n    {written_command(path)}\n\n"
    assert "my_name" not in path.read_text(encoding="utf-8") and "MyName" not in path.read_text()


@pytest.mark.parametrize("kind", kinds())
def test_the_command_can_be_pasted_if_a_folder_has_a_space(kind: str) -> None:
    path = written(kind, "my files/mine")
    words = shlex.split(written_command(path))
    assert str(path) in [word.removesuffix(":Mine") for word in words]


@pytest.mark.parametrize("name", ["numpy", "signal", "sitl", "pytest"])
def test_a_module_that_there_is_already_is_not_hidden(name: str) -> None:
    result = run("new", "law", name)
    assert result.exit_code == EXIT_USAGE
    assert "is a module of Python or of a library; choose another name" in result.stderr
    assert run("new", "mission", name).exit_code == EXIT_DONE


def test_folders_are_made() -> None:
    assert run("new", "mission", "a/b/c").exit_code == EXIT_DONE
    assert Path("a/b/c.toml").is_file()


@pytest.mark.parametrize("kind", kinds())
def test_a_file_that_exists_is_left_as_it_is(kind: str) -> None:
    path = written(kind)
    path.write_text("precious", encoding="utf-8")
    result = run("new", kind, "my-own")
    assert (result.exit_code, result.stdout) == (EXIT_USAGE, "")
    assert result.stderr == f"gcs: {path} exists already and is left as it is; choose another name\n"
    assert path.read_text(encoding="utf-8") == "precious"


def test_a_name_may_lead_into_a_folder_and_have_its_ending() -> None:
    Path("sub").mkdir()
    assert "gcs fly sub/mine.toml\n" in run("new", "mission", "sub/mine.toml").stdout
    assert tomllib.loads(Path("sub/mine.toml").read_text(encoding="utf-8"))["title"] == "mine"


@pytest.mark.parametrize(
    ("words", "code", "part"),
    [
        (("mission", ""), EXIT_USAGE, "'' cannot be the name of the new mission"),
        (("estimator", "1"), EXIT_USAGE, "'1' cannot be the name of the new estimator"),
        (("mission", "Übung"), EXIT_USAGE, "A-Z, a-z, 0-9, - and _"),
        (("mission", 'a"b'), EXIT_USAGE, "A-Z, a-z, 0-9, - and _"),
        (("mission", "a" * 65), EXIT_USAGE, "at most 64"),
        (("mission", "1st"), EXIT_USAGE, "beginning with a letter"),
        (
            ("mission", "/dev/null/such"),
            EXIT_USAGE,
            "/dev/null/such.toml: File exists; name another file",
        ),
        (("aeroplane", "mine"), EXIT_USAGE, "'aeroplane' is not one of"),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[str, ...], code: int, part: str) -> None:
    result = run("new", *words)
    assert (result.exit_code, result.stdout) == (code, "")
    assert part in result.stderr and result.stderr.count("\n") == 1
    assert list(Path().iterdir()) == []


def test_a_full_disk_leaves_no_file_in_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    open_file = Path.open

    def full(path: Path, mode: str = "r", **options: Any) -> IO[str]:
        if mode == "x":
            path.touch()
            path, mode = Path("/dev/full"), "w"
        return open_file(path, mode, **options)

    monkeypatch.setattr(Path, "open", full)
    result = run("new", "mission", "mine")
    assert result.exit_code == EXIT_ERROR
    assert "No space left on device" in result.stderr
    assert list(Path().iterdir()) == []


def uncommented(kind: str) -> dict[str, object]:
    """The content of the file if the keys in its comments are made active."""
    text = written(kind).read_text(encoding="utf-8")
    return tomllib.loads(re.sub(r"^# (?=\[|\w+ = )", "", text, flags=re.MULTILINE))


def test_every_key_of_a_vehicle_is_named() -> None:
    table = uncommented("vehicle")
    assert Vehicle.model_validate(table)
    # keys of vehicles other than quadrotors
    assert set(Vehicle.model_fields) - set(table) <= {"rotors", "frame", "spin", "rotor"}


def test_every_sensor_is_named() -> None:
    profile = Profile.model_validate(uncommented("sensors"))
    assert [name for name in Profile.model_fields if getattr(profile, name) is None] == []


def test_the_mission_template_names_every_type_of_item(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    assert CliRunner().invoke(gcs, ["new", "mission", str(path)]).exit_code == 0
    text = path.read_text()
    assert [kind for kind in ITEMS if not re.search(rf"\b{kind}\b", text)] == []
