"""Every kernel of a flight called once on the ground, so that none has to be compiled in the air."""

from __future__ import annotations

import numpy as np

from autopilot.core.flight_core import FlightCore, Setup
from autopilot.core.tick import compiled_law
from autopilot.geometry.frames import enu_from_ned
from autopilot.geometry.linear import E3, ZERO
from autopilot.geometry.s2 import tangent
from autopilot.guidance.jet_table import jets_ahead
from autopilot.guidance.legs import (
    QUAD_POSITION,
    Creep,
    Hold,
    Leg,
    PathStretch,
    SignalRun,
    slack_leg,
)
from autopilot.guidance.setpoint_follower import start_following
from autopilot.trajectory.prepare import prepare
from autopilot.trajectory.rotor_demand import demand
from autopilot.trajectory.shaping import shape
from autopilot.trajectory.slack_cable import LONG_WAY
from autopilot.trajectory.splines import COLUMNS
from autopilot.trajectory.timeline import AT_ORIGIN, state_after
from autopilot.trajectory.waypoint_path import PathSegment
from missions.model import Signals, Sine, Term, Waypoint


def warm_up_tick(setup: Setup) -> None:
    """Compile what is the same with all laws."""
    FlightCore(setup).compile()


def warm_up_law(setup: Setup) -> None:
    """Compile the law's half of a tick."""
    core = FlightCore(setup)
    compiled_law(core.rows, core.law_rows)


def warm_up_paths(setup: Setup) -> None:
    """Lay out each kind of leg for an instant, and prepare a short mission."""
    load = (0.0, 0.0, 1.0)
    above_load = (0.0, 0.0, 1.0 + setup.vehicle.cable_length)
    wave = Signals(
        1.0, (Term("x", 0.01, 0.0, 1.0, None, 0.0, (Sine(1.0),)), Term("x", 0.1, 0.0, 1.0, None, 0.0))
    )
    legs: tuple[Leg, ...] = (
        Hold(load),
        slack_leg(load, load),
        slack_leg(load, (0.0, 0.0, 2.0 * LONG_WAY)),
        Creep(above_load, ZERO, QUAD_POSITION),
        SignalRun(load, shape(wave, setup.settings.limits.body, setup.settings.limits.bounds)),
        PathStretch(PathSegment(np.zeros((1, COLUMNS)), 0.0, 1.0, load), ZERO, 1.0),
        start_following((load, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), 1.0),
    )
    tangent(E3, ZERO)  # for the supervisor, when a swing is calmed
    enu_from_ned(ZERO)  # for setpoints of a companion computer
    state_after(wave, AT_ORIGIN)  # for missions that are decoded
    for leg in legs:
        leg.jet(0.5)
        jets_ahead((leg,), np.array([0.5]))
    limits = setup.settings.limits
    prepare((Waypoint(1.0, 0.0, 2.0, 1.0),), (0,), limits)
    demand(np.zeros((7, 1, 3)), limits.body)  # of paths through waypoints


PARTS = {"tick": warm_up_tick, "law": warm_up_law, "paths": warm_up_paths}


def warm_up(setup: Setup) -> None:
    """Run all parts."""
    for part in PARTS.values():
        part(setup)
