"""The path of a mission as one table: the desired position of the load at each tick while it is carried."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.guidance.jet_table import COLUMNS, jets
from autopilot.guidance.legs import LOAD_POSITION
from autopilot.supervisor.mission import with_plan, with_speed
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, MissionPlan
from autopilot.supervisor.step_legs import destination, step_legs
from gcs.errors import GcsError
from missions.model import KINDS, AttitudeRun, Land, Release, Speed, Takeoff, Winch
from sitl.world import Floats

_ENDING_STEPS = (Land, Release, AttitudeRun, Winch)  # the first of these steps ends the path of the load


def path_of(plan: MissionPlan, settings: Settings, speed_m_s: float, tick_s: float, name: str) -> Floats:
    """(ticks, 21) position of the load and its six derivatives, beginning after the take-off, each leg as the
    autopilot flies it. `Error` if the mission has no such leg."""
    flight = with_plan(Flight(), plan)
    flight = replace(flight, mission=replace(flight.mission, speed_m_s=speed_m_s))
    position: Vec3 = ZERO
    tables: list[Floats] = []
    end = ""
    for number, step in enumerate(plan.steps):
        flight = replace(flight, mission=replace(flight.mission, step=number))
        if isinstance(step, Takeoff):
            position = destination(step, position, flight)
        elif isinstance(step, Speed):
            flight = with_speed(flight, step, settings)
        elif isinstance(step, _ENDING_STEPS):
            end = f"; items[{number}] ({KINDS[type(step)]}) ends it"
            break
        else:
            for leg in step_legs(step, position, flight, settings):
                if leg.control_mode != LOAD_POSITION:
                    break
                tables.append(
                    jets(leg, np.asarray(np.arange(round(leg.duration_s / tick_s)) * tick_s, np.float64))
                )
                position = leg.jet(leg.duration_s)[0]
    table = np.concatenate(tables) if tables else np.zeros((0, COLUMNS))
    if not len(table):
        raise GcsError(f"mission {name}: there is no path of the load to follow{end}")
    return np.ascontiguousarray(table)
