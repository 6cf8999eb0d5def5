"""What counts as a slack cable."""

from __future__ import annotations

from dataclasses import replace

from autopilot.guidance.legs import CatchLoad, Hold
from autopilot.supervisor.advance import advance
from autopilot.supervisor.state import CableState, Flight, Phase
from tests.doubles.sky import SETTINGS, hanging


def test_noise_alone_starts_no_catch() -> None:
    """No pull for a moment, at an unchanged length: a gust or a jolt of thrust looks like this."""
    flight = Flight(phase=Phase.HOLD, legs=(Hold((0.0, 0.0, 2.0)),), cable=CableState(taut_length_m=0.7))
    for k in range(50):
        seen = hanging(k * 4000)._replace(pull_n=-1.0)
        flight, _ = advance(flight, seen, SETTINGS)
    assert isinstance(flight.legs[0], Hold)
    flight = replace(flight, cable=replace(flight.cable, taut_length_m=0.75))  # now there is a gap as well
    for k in range(50, 60):
        flight, _ = advance(flight, hanging(k * 4000)._replace(pull_n=-1.0), SETTINGS)
    assert isinstance(flight.legs[0], CatchLoad)
