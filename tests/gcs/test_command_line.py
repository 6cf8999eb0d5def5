"""The command that a report states flies its flight again with the same options."""

from __future__ import annotations

import io
import shlex
import sys
from dataclasses import replace

import click
import pytest

from gcs.cli import gcs
from gcs.shell.link import parse_address
from gcs.workflows.flight_options import FlightOptions

ASKED = FlightOptions(
    mission="hover",
    law="thesis",
    sensors="rtk",
    vehicle="heavy",
    seed=7,
    speed=None,
    real_time=False,
    out=None,
    settings=("SIM_WIND_E=2", "MIS_SPEED=1"),
    connect=None,
    quiet=True,
    force=False,
    overwrite=False,
    limit_s=None,
)

IGNORING = replace(ASKED, ignored=("MY_GAIN", "MY_OFFSET"))


def test_the_command_names_the_vehicle_that_was_chosen() -> None:
    options = replace(ASKED, connect=replace(parse_address("14540"), system=2))
    assert options.command_line() == "gcs fly hover --connect 127.0.0.1:14540 --sysid 2"


def test_the_recorded_command_gives_the_options_back() -> None:
    others = (
        {"force": True},
        {"speed": 2.0, "real_time": True},
        {"limit_s": 12.5},
        {"mission": "my hover.toml"},
    )
    for options in (ASKED, IGNORING, *(replace(ASKED, **changes) for changes in others)):
        program, command, *words = shlex.split(options.command_line())
        assert (program, command) == ("gcs", "fly")
        fly = gcs.get_command(click.Context(gcs), command)
        assert fly is not None
        given = fly.make_context(command, words).params
        assert given["mission"] == options.mission
        assert given["limit_s"] == options.limit_s
        assert tuple(given["settings"]) == options.settings
        assert given["ignore"] == options.ignored
        for name in ("law", "sensors", "vehicle", "seed", "speed", "real_time", "force"):
            assert given[name] == getattr(options, name), name


@pytest.mark.parametrize("errors", ["strict", "surrogateescape"])  # of the locale C: the second
def test_letters_that_a_terminal_does_not_have_are_replaced(
    monkeypatch: pytest.MonkeyPatch, errors: str
) -> None:
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, "ascii", errors))
    with pytest.raises(SystemExit):
        gcs.main(["missions"])
    print("2 \N{MULTIPLICATION SIGN}", flush=True)
    assert written.getvalue().endswith(b"2 ?\n")
