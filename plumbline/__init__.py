"""Fly a load on a cable from Python.

    import plumbline

    flight = plumbline.fly("case-b", seed=3, settings={"SIM_ACT_DELAY_MS": 12})
    flight.outcome, flight.summary["load_error_max_m"]
    flight.telemetry()  # a table, a row for each sample of the true load
    flight.report("out")  # the files of gcs fly, without logs

    plumbline.sweep("case-b", vary={"SIM_ACT_DELAY_MS": [0, 12]}, seeds=20)  # a table, a row for each flight

A flight here is the same as with `gcs fly` in lockstep, but without processes and sockets: its telemetry is
equal byte for byte. An invalid argument raises an `Error` with a message of one line.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

try:
    from gcs.errors import NotInTimeError, NoVehicleError
    from missions.errors import Error
    from missions.model import (
        AttitudeRun,
        Delay,
        Land,
        PlaceLoad,
        Release,
        ReturnHome,
        Signals,
        Sine,
        Speed,
        SwitchFence,
        Takeoff,
        Term,
        Trajectory,
        Waypoint,
        Winch,
    )
    from plumbline.flights import Flight, fly
    from plumbline.missions import Mission
    from plumbline.sweeps import sweep
    from plumbline.vehicles import Vehicle
except ImportError as error:
    # by its path, because the package gcs may be the one that is hidden
    from runpy import run_path

    if problem := run_path(str(Path(__file__).parents[1] / "gcs" / "shadowing.py"))["shadowing_problem"]():
        raise ImportError(problem) from error
    raise

if TYPE_CHECKING:
    from plumbline.running import RunningVehicle, connect
    from plumbline.sensors import Sensors
    from plumbline.state import State

__all__ = [
    "AttitudeRun",
    "Delay",
    "Error",
    "Flight",
    "Land",
    "Mission",
    "NoVehicleError",
    "NotInTimeError",
    "PlaceLoad",
    "Release",
    "ReturnHome",
    "RunningVehicle",
    "Sensors",
    "Signals",
    "Sine",
    "Speed",
    "State",
    "SwitchFence",
    "Takeoff",
    "Term",
    "Trajectory",
    "Vehicle",
    "Waypoint",
    "Winch",
    "__version__",
    "connect",
    "fly",
    "sweep",
]

__version__ = version("plumbline")

_LOADED_ON_FIRST_USE = {
    "RunningVehicle": "plumbline.running",
    "Sensors": "plumbline.sensors",
    "State": "plumbline.state",
    "connect": "plumbline.running",
}


def __getattr__(name: str) -> Any:
    """Load on first use what only some scripts need: the simulator's sensors, the link to a vehicle."""
    if name not in _LOADED_ON_FIRST_USE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_LOADED_ON_FIRST_USE[name]), name)
