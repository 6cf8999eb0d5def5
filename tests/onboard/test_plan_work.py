"""Paths that take long to prepare are left to another while the vehicle flies."""

from __future__ import annotations

from dataclasses import replace

from autopilot.onboard.onboard import Onboard
from autopilot.onboard.snapshot import Options
from autopilot.supervisor.flight import Phase
from autopilot.trajectory.prepare import PENDING
from autopilot.wire.convert import Home
from missions import model
from missions.model import Delay, Signals, Takeoff, Term
from tests.doubles.craft import Craft

PLUMBLINE = 2.0  # CTL_LAW
EDGE = Signals(3.0, (Term("y", 0.25, 0.0, 0.8, None, 0.0),))


def test_in_the_air_where_the_clock_does_not_wait_paths_are_left_to_another() -> None:
    craft = Craft(Takeoff(2.0), Delay(1.0), EDGE, model.Land(), CTL_LAW=PLUMBLINE)
    onboard: Onboard = craft.onboard
    assert onboard.work is None
    onboard._options = Options(Home(), 0, clock_waits=False)
    flying = replace(onboard._state.flight, phase=Phase.HOLD)
    onboard._state = onboard._state._replace(flight=flying)
    onboard._take_plan(onboard.endpoint.mission)
    work = onboard.work
    assert work is not None
    assert onboard._state.flight.plan.prepared.pending
    onboard.finish(work, work.done())
    assert onboard.work is None
    assert not onboard._state.flight.plan.prepared.pending
    onboard.finish(work, PENDING)
    assert not onboard._state.flight.plan.prepared.pending, "an answer that nobody waits for"
