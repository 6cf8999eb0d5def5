"""The command `sitl`: its options. What it runs is imported when they are known to be right.

`--help` does without: the imports take ten times as long as the rest of it.
"""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import click

from autopilot.shell.options import (
    MAX_SEED,
    MAX_SPEED,
    ProgramCommand,
    WholeNumber,
    address_option,
    last_options,
    origin_option,
    settings_option,
    vehicle_option,
)
from autopilot.vehicle.shipped import VEHICLES
from sitl.interfaces import PLUMBLINE, THIRD_PARTY
from sitl.sensors.shipped import PROFILES


@click.command("sitl", cls=ProgramCommand, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--for",
    "interface",
    type=click.Choice((PLUMBLINE, *THIRD_PARTY)),
    default=PLUMBLINE,
    show_default=True,
    help="The autopilot that flies; see docs/autopilots.md.",
)
@click.option(
    "--sensors",
    default="lab",
    show_default=True,
    metavar="NAME|FILE",
    help=f"Sensor profile: {PROFILES.choice()}.",
)
@vehicle_option(f"The simulated vehicle: {VEHICLES.choice()}.")
@click.option(
    "--seed", default=1, show_default=True, type=WholeNumber(0, MAX_SEED), help="Seed of all noise."
)
@click.option(
    "--speed",
    type=click.FloatRange(0.0, MAX_SPEED, min_open=True),
    metavar="NUMBER",
    help="Maximum speed, as a multiple of real time.  [default: 1; with --lockstep: no limit]",
)
@click.option("--lockstep", is_flag=True, help="Run as fast as the autopilot answers.")
@click.option(
    "--real-time",
    is_flag=True,
    help="Keep to the wall clock: a late command of the autopilot is missed, and counted.",
)
@click.option(
    "--listen",
    type=address_option,
    metavar="[HOST:]PORT",
    help="Address for autopilots.  [default: 127.0.0.1:4560; for ardupilot and betaflight :9002]",
)
@click.option(
    "--truth",
    type=address_option,
    metavar="[HOST:]PORT",
    default="127.0.0.1:14560",
    show_default=True,
    help="Address to send the true state to, for logs and reports.",
)
@click.option(
    "--truth-every",
    type=WholeNumber(1, 1000),
    metavar="N",
    help="Send the true state every N ticks.  [default: 2; for ardupilot 8, px4 5, betaflight 10]",
)
@settings_option("Set a SIM_ parameter; repeatable. Parameters of the autopilot are ignored.")
@click.option(
    "--log-sensors",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Log all readings and the true state, for gcs report; see docs/sensors.md.",
)
@origin_option
@click.option("--cpu", type=WholeNumber(0), metavar="N", help="Run on this processor core only.")
@click.option(
    "--parameters",
    is_flag=True,
    help="Print the path of the parameter file for the third-party autopilot, and exit.",
)
@last_options("sitl")
def main(**options: Any) -> None:
    """Simulate a quadrotor with a load on a cable, and its sensors.

    Waits for an autopilot, sends it sensor readings and receives rotor commands, by MAVLink over UDP (with
    third-party autopilots by their own protocols). The world waits for the answer to every tick: on a busy
    machine its clock is slower, and nothing is lost.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the loops run, there is nothing to end in order
    from sitl.shell.program import simulate

    simulate(**options)
