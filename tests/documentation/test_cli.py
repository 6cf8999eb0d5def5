"""docs/cli.md describes every command, and every option of each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from gcs.cli import gcs

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


@pytest.mark.parametrize(("name", "command"), [pytest.param(*c, id=c[0]) for c in commands(gcs, "gcs")])
def test_a_command_has_a_heading_and_its_options_are_told(name: str, command: click.Command) -> None:
    headings = re.findall(r"^### (.*)$", PAGE, re.MULTILINE)
    assert any(name in heading.split(", ") for heading in headings)
    options = [p for p in command.params if isinstance(p, click.Option) and not p.hidden]
    missing = [max(p.opts, key=len) for p in options if not any(name in PAGE for name in p.opts)]
    assert not missing
