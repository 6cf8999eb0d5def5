"""An error on the command line of `sitl` or `autopilot` ends it with 2, and a line for each error."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from autopilot.shell.command import main as autopilot
from autopilot.shell.options import address_option
from gcs.cli import gcs
from gcs.shell.link import free_port
from sitl.shell.command import main as sitl

TWO_WRONG = """quad_mass_kg = -1.0
load_mass_kg = "heavy"
"""


@pytest.fixture
def invoke(tmp_path: Path):
    """Run a program, which must end before it looks for the other one."""
    places = {"sitl": ["--listen", str(free_port())], "autopilot": ["--storage", str(tmp_path / "storage")]}

    def invoke(program: click.Command, *words: str):
        return CliRunner().invoke(program, ["--quiet", *places[str(program.name)], *words])

    return invoke


@pytest.mark.parametrize(
    ("program", "words", "told"),
    [
        (sitl, ["--sensors", "nothing"], "unknown sensors 'nothing'; shipped: "),
        (sitl, ["--vehicle", "nothing"], "unknown vehicle 'nothing'; shipped: "),
        (sitl, ["--set", "SIM_RATE_HZ=300"], "SIM_RATE_HZ = 300 Hz; a tick must be "),
        (sitl, ["--set", "SIM_DROP_PCT=300"], "SIM_DROP_PCT = 300.0 %; must be "),
        (sitl, ["--real-time", "--lockstep"], "--lockstep and --real-time exclude each other"),
        (sitl, ["--log-sensors", "x", "--for", "px4"], "--log-sensors is for plumbline: px4 receives"),
        (autopilot, ["--vehicle", "nothing"], "unknown vehicle 'nothing'; shipped: "),
        (autopilot, ["--law", "nothing"], "--law 'nothing': no control law of that name; "),
        (
            autopilot,
            ["--ignore", "NGC_KX"],
            "--ignore NGC_KX: not among the vehicle's parameters; there are none",
        ),
        (autopilot, ["--set", "NGC_KX=1e9"], "NGC_KX = 1000000000.0"),
        (autopilot, ["--gcs", "0"], "must be PORT or HOST:PORT, with a port of 1 ... 65535"),
    ],
)
def test_what_is_wrong_on_the_command_line_ends_with_2(invoke, program, words, told) -> None:
    result = invoke(program, *words)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(f"{program.name}: ") and told in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("program", [sitl, autopilot, gcs])
def test_h_is_help(program: click.Command) -> None:
    short, long = (CliRunner().invoke(program, [word]) for word in ("-h", "--help"))
    assert short.exit_code == 0
    assert short.stdout == long.stdout and "Usage: " in short.stdout


@pytest.mark.parametrize("program", [sitl, autopilot])
def test_each_mistake_of_a_file_has_a_line(invoke, program, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(TWO_WRONG, encoding="utf-8")
    result = invoke(program, "--vehicle", str(file))
    lines = result.stderr.splitlines()
    assert result.exit_code == 2
    assert len(lines) > 2
    assert all(line.startswith(f"{program.name}: {file}: ") for line in lines)


@pytest.mark.parametrize(
    ("text", "address"),
    [("5760", ("127.0.0.1", 5760)), ("10.0.0.2:1", ("10.0.0.2", 1)), ("[::1]:4560", ("::1", 4560))],
)
def test_an_address_may_be_a_port_alone(text: str, address: tuple[str, int]) -> None:
    assert address_option(text) == address


@pytest.mark.parametrize("text", ["", ":4560", "host:", "0", "65536", "port", "host"])
def test_what_is_no_address_is_told_with_what_is(text: str) -> None:
    with pytest.raises(click.BadParameter, match="must be PORT or HOST:PORT"):
        address_option(text)
