"""Attitudes flown in one process with the truth at hand: swings in pairs, alone, and cut short."""

from __future__ import annotations

import pytest

from autopilot.guidance.legs import Hold, Swing
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as mavlink
from missions.fileformat import load_mission
from missions.model import AttitudeRun, Land, Takeoff
from tests.doubles.craft import ACCEPTED, Craft, at_phase, least_tension

# m, error after a swing has ended: the tail of the cascade's settling, 78 ms behind its reference
SETTLING = 0.03
# Share of the load's weight that the cable still carries at the worst moment; 0 is slack
IN_PAIRS, CUT_SHORT = 0.85, 0.6


@pytest.mark.parametrize("name", ["quad-attitude", "load-attitude"])
def test_attitude_missions_are_flown_with_margin(name: str) -> None:
    craft = Craft(*load_mission(name).steps, watched=True)
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    assert least_tension(craft, at_phase(Phase.LOWER)) > IN_PAIRS
    assert craft.worst_error < SETTLING
    assert abs(craft.truth.x_load[2] - 3.0) < SETTLING, "the height is kept"
    reached = [m.seq for m in craft.heard if m.get_type() == "MISSION_ITEM_REACHED"]
    assert sorted(set(reached)) == list(range(len(craft.flight.mission.plan.steps) - 1))


@pytest.mark.parametrize("controlled", ["vehicle", "load"])
def test_a_swing_that_nothing_takes_away_is_caught(controlled: str) -> None:
    """One run alone leaves the load swinging and moving at more than 1 m/s."""
    craft = Craft(Takeoff(1.5), AttitudeRun(controlled, 0.17, 0.0, 1.5), Land(), watched=True)  # type: ignore[arg-type]
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    assert least_tension(craft, at_phase(Phase.LOWER)) > CUT_SHORT
    assert craft.worst_error < SETTLING


def test_a_pause_in_the_middle_of_a_swing_is_caught() -> None:
    craft = Craft(Takeoff(1.5), AttitudeRun("vehicle", 0.17, 0.0, 1.5), Land())
    craft.begin()
    craft.run(lambda c: bool(c.flight.legs) and isinstance(c.flight.legs[0], Swing))
    craft.wait(0.75)
    assert craft.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    until = craft.onboard.now_us + 10_000_000
    assert least_tension(craft, lambda c: c.onboard.now_us > until) > CUT_SHORT
    assert isinstance(craft.flight.legs[0], Hold)
