"""What counts as a slack cable."""

from __future__ import annotations

from dataclasses import replace

from autopilot.guidance.legs import CatchLoad, Hold
from autopilot.supervisor.advance import advance
from autopilot.supervisor.state import CableState, Flight, Phase, View
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


def slackened(is_tracked: bool) -> Flight:
    """A flight that holds, after a cable without pull has looked 5 cm short for 50 ms."""
    flight = Flight(phase=Phase.HOLD, legs=(Hold((0.0, 0.0, 2.0)),), cable=CableState(taut_length_m=0.75))
    for k in range(13):
        seen = hanging(k * 4000)._replace(pull_n=-1.0, load_tracked=is_tracked)
        flight, _ = advance(flight, seen, SETTINGS)
    return flight


def test_of_a_load_that_is_not_tracked_no_gap_is_known() -> None:
    """Its distance is the length that the estimator has learned, which is not that of the take-off."""
    assert isinstance(slackened(is_tracked=True).legs[0], CatchLoad)
    assert isinstance(slackened(is_tracked=False).legs[0], Hold)


def test_a_catch_that_ends_on_the_ground_ends_the_flight() -> None:
    """The load seems to be in the air, as no sensor sees it, but the vehicle has come to rest."""
    flight = slackened(is_tracked=True)

    def at(now_s: float, climb: float) -> View:
        return hanging(round(now_s * 1e6), v=(0.0, 0.0, climb))._replace(taut=False, pull_n=0.0)

    flight, _ = advance(flight, at(0.9, 0.0), SETTINGS)
    assert isinstance(flight.legs[0], CatchLoad)
    flight, _ = advance(flight, at(1.2, -2.0), SETTINGS)
    assert isinstance(flight.legs[0], CatchLoad)
    flight, report = advance(flight, at(1.2, 0.0), SETTINGS)
    assert flight.phase != Phase.HOLD
    assert [text for _, text in report.texts] == ["The load fell to the ground: landing"]
