"""The autopilots that the simulator serves, and what each requires of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from autopilot.geometry.machine_code import ROOT
from autopilot.shell.options import Address, StopRequest
from sitl.hil import HilSimulator
from sitl.interfaces import PLUMBLINE, ardupilot, betaflight, px4
from sitl.pacing import Pacing
from sitl.shell.ardupilot import run_ardupilot
from sitl.shell.betaflight import run_betaflight
from sitl.shell.link import Link
from sitl.shell.px4 import run_px4

Run = Callable[[Link, HilSimulator, StopRequest, Callable[[str], None], Pacing | None], None]


class AutopilotKind(NamedTuple):
    """The defaults for one autopilot, unless the user sets others."""

    awaited_name: str  # name of what the simulator reports to wait for
    listen: Address
    truth_every: int  # ticks
    settings: Mapping[str, float]  # SIM_* parameters
    run: Run | None = None  # its loop; None: the loops of our own autopilot
    real_time: bool = False  # always in real time: it does not wait for the world


def parameter_file(name: str) -> Path:
    """Path of the file with the parameters that a firmware requires besides its defaults."""
    return ROOT / "sitl" / "interfaces" / f"{name}.parm"


AUTOPILOTS = {
    PLUMBLINE: AutopilotKind("an autopilot", ("127.0.0.1", 4560), 2, {}),
    "ardupilot": AutopilotKind(
        "ArduPilot", ("127.0.0.1", 9002), 8, {"SIM_RATE_HZ": ardupilot.RATE_HZ}, run_ardupilot
    ),
    "px4": AutopilotKind("PX4", ("127.0.0.1", 4560), 5, {"SIM_RATE_HZ": px4.RATE_HZ}, run_px4),
    "betaflight": AutopilotKind(
        "Betaflight", ("127.0.0.1", 9002), 10, {"SIM_RATE_HZ": betaflight.RATE_HZ}, run_betaflight, True
    ),
}
