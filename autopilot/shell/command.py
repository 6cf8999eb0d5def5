"""The command `autopilot`: its options. What it runs is imported when they are known to be right.

`--help` does without: the imports take ten times as long as the rest of it.
"""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import click

from autopilot.shell.options import (
    Address,
    NonEmptyPath,
    ProgramCommand,
    address_option,
    ignore_option,
    last_options,
    origin_option,
    settings_option,
    signing_key_option,
    vehicle_option,
)
from autopilot.vehicle.parameters import LAWS
from autopilot.vehicle.shipped import VEHICLES


def _address_or_none(text: str) -> Address | None:
    """PORT, HOST:PORT or `none`."""
    return None if text == "none" else address_option(text)


@click.command("autopilot", cls=ProgramCommand, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--sim",
    type=address_option,
    metavar="[HOST:]PORT",
    default="127.0.0.1:4560",
    show_default=True,
    help="Address of the simulator.",
)
@click.option(
    "--gcs",
    type=_address_or_none,
    metavar="[HOST:]PORT",
    multiple=True,
    default=("127.0.0.1:14550",),
    show_default=True,
    help="Ground station to send to; repeatable, `none` for none.",
)
@click.option(
    "--api",
    type=_address_or_none,
    metavar="[HOST:]PORT",
    multiple=True,
    default=("127.0.0.1:14540",),
    show_default=True,
    help="API client to send to; repeatable, `none` for none.",
)
@click.option(
    "--tcp",
    type=address_option,
    metavar="[HOST:]PORT",
    help="Listen for TCP connections of ground stations, e.g. at 127.0.0.1:5760.",
)
@click.option(
    "--ground-lockstep",
    type=address_option,
    metavar="[HOST:]PORT",
    help="One ground station in lockstep, instead of --gcs and --api.",
)
@vehicle_option(f"The vehicle that the autopilot assumes: {VEHICLES.choice()}.")
@click.option(
    "--law",
    metavar="NAME|FILE:CLASS",
    help=f"Control law: {', '.join(LAWS)}, or your own (docs/laws.md).  [default: CTL_LAW]",
)
@click.option(
    "--estimator",
    default="",
    metavar="FILE:CLASS",
    help="Your own estimator (docs/estimators.md).",
)
@click.option(
    "--planner",
    default="",
    metavar="FILE:CLASS",
    help="Your own path planner (docs/planners.md).",
)
@settings_option("Set a parameter; repeatable. SIM_ parameters of the simulator are ignored.")
@ignore_option("Fly")
@origin_option
@click.option(
    "--storage",
    type=NonEmptyPath(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Folder that stores mission and parameters.  [default: the user's state directory]",
)
@click.option(
    "--signing-key",
    type=signing_key_option,
    metavar="FILE",
    help="Accept only messages signed with this key (64 hexadecimal digits or a pass phrase), and store it.",
)
@click.option(
    "--allow-setup-signing",
    is_flag=True,
    help="Accept a first signing key from any sender of SETUP_SIGNING.",
)
@last_options("autopilot")
def main(**options: Any) -> None:
    """Fly a quadrotor with a load on a cable: sensors in, rotor commands out, MAVLink to ground stations."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the loop runs, there is nothing to finish
    from autopilot.shell.program import fly

    fly(**options)
