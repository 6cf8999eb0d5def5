"""The names with which a custom path planner is written: see `docs/planners.md`.

World ENU from home, SI.
"""

from __future__ import annotations

from autopilot.own.loaded_class import Parameter
from autopilot.trajectory.peaks import Body
from autopilot.trajectory.rotor_demand import Bounds
from autopilot.trajectory.route import Path, PlanError, Route, polynomials, samples, slower, use

__all__ = [
    "Body",
    "Bounds",
    "Parameter",
    "Path",
    "PlanError",
    "Route",
    "polynomials",
    "samples",
    "slower",
    "use",
]
