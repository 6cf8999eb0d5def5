"""docs/cli.md describes every command, and every option of each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from platformdirs.macos import MacOS
from platformdirs.unix import Unix

from autopilot.shell.command import main as autopilot
from gcs.cli import gcs
from sitl.shell.command import main as sitl

PAGE = (Path(__file__).parents[2] / "docs" / "cli.md").read_text(encoding="utf-8")


def commands(command: click.Command, name: str) -> Iterator[tuple[str, click.Command]]:
    """Every command below `command` that is no group, with the words that call it."""
    if not isinstance(command, click.Group):
        yield name, command
        return
    context = click.Context(command)
    for word in command.list_commands(context):
        below = command.get_command(context, word)
        assert below is not None
        yield from commands(below, f"{name} {word}")


def section(heading: str) -> str:
    """The text below a heading, up to the next one."""
    return PAGE.partition(f"\n### {heading}\n")[2].partition("\n#")[0]


def told_options(heading: str) -> list[str]:
    """The options in the first column of the table below a heading."""
    first_cells = re.findall(r"^\| ([^|]*) \|", section(heading), re.MULTILINE)
    return [option for cell in first_cells for option in re.findall(r"--[a-z-]+", cell)]


def options_of(*commands: click.Command) -> list[str]:
    """All names of the options of these commands."""
    return [name for one in commands for p in one.params if isinstance(p, click.Option) for name in p.opts]


COMMANDS = dict(commands(gcs, "gcs"))
HEADINGS = re.findall(r"^### (gcs .*)$", PAGE, re.MULTILINE)


@pytest.mark.parametrize(("name", "command"), [pytest.param(*c, id=c[0]) for c in COMMANDS.items()])
def test_a_command_has_a_heading_and_its_options_are_told(name: str, command: click.Command) -> None:
    assert any(name in heading.split(", ") for heading in HEADINGS)
    options = [p for p in command.params if isinstance(p, click.Option) and not p.hidden]
    missing = [max(p.opts, key=len) for p in options if not any(name in PAGE for name in p.opts)]
    assert not missing


@pytest.mark.parametrize("heading", HEADINGS)
def test_an_option_in_a_table_is_one_of_its_commands(heading: str) -> None:
    assert set(told_options(heading)) <= set(options_of(*(COMMANDS[name] for name in heading.split(", "))))


@pytest.mark.parametrize("program", [sitl, autopilot], ids=["sitl", "autopilot"])
def test_the_table_of_a_program_has_its_options_and_no_others(program: click.Command) -> None:
    assert sorted(told_options(str(program.name))) == sorted(options_of(program))


def test_the_folders_are_those_of_the_programs(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("XDG_STATE_HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for system in (Unix, MacOS):
        folders = system("plumbline")
        for folder in (folders.user_state_dir, folders.user_cache_dir):
            assert f"`{folder.replace(str(Path.home()), '~')}`" in section("Folders")
