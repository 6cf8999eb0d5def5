"""Fly a load on a cable from Python.

    import plumbline

    flight = plumbline.fly("case-b", seed=3, settings={"SIM_ACT_DELAY_MS": 12})
    flight.outcome, flight.summary["load_error_max_m"]
    flight.telemetry()  # a table, a row for each sample of the true load
    flight.report("out")  # what gcs fly leaves

    plumbline.sweep("case-b", vary={"SIM_ACT_DELAY_MS": [0, 12]}, seeds=20)  # a table, a row for each flight

A flight here is the flight of `gcs fly` in lockstep, without processes and sockets: the same bytes of
telemetry. What is wrong with an argument is told by an `Error` of one line.
"""

from __future__ import annotations

from importlib.metadata import version

from gcs.errors import GcsError as Error
from plumbline.flights import Flight, fly
from plumbline.sweeps import sweep

__all__ = ["Error", "Flight", "__version__", "fly", "sweep"]

__version__ = version("plumbline")
