"""Shell completion of the names of parameters: quick, as their definitions are read, and not checked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import click
from click.shell_completion import BashComplete, CompletionItem, add_completion_class

# after a name that a value follows, bash would write a space
_VALUE = "COMPREPLY+=($value)"
_VALUE_WITHOUT_SPACE = f"{_VALUE}\n            if [[ $value == *= ]]; then compopt -o nospace; fi"


def _texts() -> Iterator[tuple[str, Any]]:
    """Name and text of each parameter of the autopilot and of the simulator, sorted by the name."""
    from autopilot.vehicle.parameters import document
    from sitl.vehicles.sim_parameter_file import sim_document

    tables = {**document(), **sim_document()}
    del tables["groups"]
    return ((name, tables[name]["text"]) for name in sorted(tables))


def complete_names(
    _: click.Context, __: click.Parameter, incomplete: str, end: str = ""
) -> list[CompletionItem]:
    """The parameters whose names begin with the word, in capitals or not; `end` is appended to each."""
    begin = incomplete.upper()
    return [
        CompletionItem(name + end, help=text) for name, text in _texts() if (name + end).startswith(begin)
    ]


def complete_settings(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """As `complete_names`, each with an equals sign, behind which the user writes the value."""
    return complete_names(ctx, param, incomplete, "=")


def register_bash() -> None:
    """Have completion for bash write no space after an equals sign."""

    class Bash(BashComplete):
        source_template = BashComplete.source_template.replace(_VALUE, _VALUE_WITHOUT_SPACE)

    add_completion_class(Bash)
