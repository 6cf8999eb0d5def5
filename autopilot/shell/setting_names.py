"""Names of parameters that `--set` of `sitl` and of `autopilot` accept: those of either program, since one
list of settings may be given to both."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from importlib.resources import files

import click

from autopilot.vehicle.parameters import definitions
from autopilot.wire.parameter_names import unknown_parameter_text


def check_names(settings: Iterable[tuple[str, float]], own_names: Iterable[str] = ()) -> None:
    """click.UsageError with the nearest name if neither program has such a parameter and it does not belong
    to user code (`own_names`)."""
    known = {*own_names, *definitions().parameters, *_simulator_names()}
    for name, _ in settings:
        if name not in known:
            raise click.UsageError(f"--set {unknown_parameter_text(name, known)}")


def _simulator_names() -> set[str]:
    """The simulator's names, from its file: the autopilot is installed with it, but imports nothing of it."""
    return set(tomllib.loads((files("sitl") / "sim_parameters.toml").read_text(encoding="utf-8"))) - {
        "groups"
    }
