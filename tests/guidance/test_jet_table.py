"""Setpoints laid out tick by tick, compared with those of their legs evaluated one by one."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.guidance.jet_table import flies_requested_path, jets, jets_ahead
from autopilot.guidance.legs import (
    LOAD_POSITION,
    QUAD_POSITION,
    Brake,
    Creep,
    Hold,
    Leg,
    PathStop,
    PathStretch,
    Reel,
    SignalRun,
    Transfer,
    requested_jet,
)
from autopilot.supervisor.settings import path_limits
from autopilot.supervisor.state import Flight, jet_ahead
from autopilot.trajectory.prepare import prepare
from autopilot.trajectory.shaping import ShapedSignals, unshaped_signals
from autopilot.trajectory.transfer import Pace
from autopilot.trajectory.waypoint_path import PathSegment
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from missions.model import Signals, Sine, Takeoff, Term, Trajectory, Waypoint

# a half-cosine too steep for the vehicle, and a sine that dies away
TERMS = (Term("y", 0.25, 1.0, 0.79, None, 0.0, ()), Term("x", 0.1, 0.0, 1.0, 2.0, 1.0, (Sine(2.0),)))
SIGNALS = Signals(5.0, TERMS)
CURVE = Trajectory([(0.0,) * 4, (1.5, 0.5, 0.2, 0.1), (3.0, 0.2, 0.6, 0.0), (5.0, 0.3, 0.1, 0.2)])
LEGS = (
    Hold((1.0, 2.0, 3.0)),
    Transfer((0.1, 0.2, 0.3), (3.0, 1.0, 2.0), Pace(4.0)),
    Brake((0.1, 0.2, 0.3), (1.0, 0.4, 0.1), (0.3, 0.1, 0.7), 2.0),
    Creep((0.1, 0.2, 0.3), (0.0, 0.1, -0.2), LOAD_POSITION),
    SignalRun((0.1, 0.2, 0.3), unshaped_signals(SIGNALS)),
    SignalRun((0.1, 0.2, 0.3), unshaped_signals(CURVE)),
    Transfer((0.1, 0.2, 0.3), (0.9, 0.3, -0.4), Pace(3.5, 0.7), QUAD_POSITION),
    Reel((0.1, 0.2, 1.3), 2.0, 0.3, 0.7, 2.1),
    Reel((0.1, 0.2, 1.3), 2.0, -0.3, 0.5, 0.0),
    PathStop(Transfer((0.1, 0.2, 0.3), (3.0, 1.0, 2.0), Pace(4.0)), 1.0, 2.0, 0.3),
)


@pytest.mark.parametrize("leg", LEGS, ids=lambda leg: type(leg).__name__)
@pytest.mark.parametrize("asked", [False, True])
def test_a_leg_laid_out_is_the_leg(leg: Leg, asked: bool) -> None:
    times = np.arange(-3, 1500) * 0.004
    expected = [np.ravel(requested_jet(leg, t) if asked else leg.jet(t)) for t in times.tolist()]
    assert np.array_equal(jets(leg, times, asked), np.array(expected))
    assert flies_requested_path(leg)


def test_paths_of_a_plan_laid_out_are_the_paths() -> None:
    limits = path_limits(autopilot_parameters(load_vehicle("bebop")), True)._replace(shape_paths=True)
    steps = (
        Takeoff(1.0),
        Waypoint(2.0, 0.0, 2.0, 0.0),
        Waypoint(2.0, 2.0, 2.0, 0.0),
        Waypoint(0.0, 2.0, 1.5, 1.0),
        SIGNALS,
    )
    made = prepare(steps, tuple(range(len(steps))), limits).paths
    passage, shaped = made[1], made[4]
    assert isinstance(passage, PathSegment) and isinstance(shaped, ShapedSignals) and len(shaped.pieces)
    times = np.arange(-3, 2500) * 0.004
    for leg in (PathStretch(passage, (0.1, -0.2, 0.05), 1.5), SignalRun((0.1, 0.2, 0.3), shaped)):
        expected = [np.ravel(leg.jet(t)) for t in times.tolist()]
        assert np.array_equal(jets(leg, times), np.array(expected))
        as_requested = np.array_equal(jets(leg, times, requested=True), np.array(expected))
        assert flies_requested_path(leg) == as_requested == isinstance(leg, PathStretch)


def test_the_path_ahead_goes_on_into_what_follows() -> None:
    first, second = Transfer((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), Pace(2.0)), Hold((1.0, 0.0, 1.0), 0.5)
    third = SignalRun((1.0, 0.0, 1.0), unshaped_signals(SIGNALS))
    flight = Flight(legs=(first, second), following=(third,))
    times = np.arange(1000) * 0.004
    expected = [np.ravel(jet_ahead(flight, t)) for t in times.tolist()]
    assert np.array_equal(jets_ahead((first, second, third), times), np.array(expected))
