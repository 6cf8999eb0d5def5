"""What counts as a slack cable."""

from __future__ import annotations

from dataclasses import replace

import pytest

from autopilot.guidance.legs import CatchLoad, Hold
from autopilot.supervisor.advance import advance
from autopilot.supervisor.machine import transition
from autopilot.supervisor.state import CableState, Event, Flight, Phase, View
from tests.doubles.sky import SETTINGS, entered, hanging, view


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


def without_pull(phase: Phase, height_m: float) -> tuple[Flight, list[str]]:
    """A flight after the estimator has found the cable slack of a load that no tracker sees, for 40 ms."""
    flight, texts = entered(Flight(), phase, hanging(), SETTINGS), []
    for k in range(11):
        seen = hanging(2_000_000 + k * 4000, (0.0, 0.0, height_m))
        seen = seen._replace(taut=False, pull_n=0.0, load_tracked=False)
        flight, report = advance(flight, seen, SETTINGS)
        texts += [text for _, text in report.texts]
    return flight, texts


@pytest.mark.parametrize("phase", [Phase.HOLD, Phase.LIFT, Phase.LOWER])
def test_no_vehicle_dives_after_a_load_that_no_tracker_sees(phase: Phase) -> None:
    """Nothing shows where it falls: it is lifted again or lowered on, or the vehicle lands."""
    flight, texts = without_pull(phase, 3.0)
    assert not any(isinstance(leg, CatchLoad) for leg in flight.legs)
    assert (flight.phase, texts) == {
        Phase.HOLD: (Phase.SET_DOWN, ["Cable without pull, load lost: landing"]),
        Phase.LIFT: (Phase.TAUTEN, ["Cable slack, the load is not lifted: pulling it taut again"]),
        Phase.LOWER: (Phase.LOWER, []),
    }[phase]


LEFT_ON_THE_GROUND = (Phase.SET_DOWN, ["The load was not lifted: landing"])
CAUGHT = (Phase.LIFT, ["Cable slack: falling with the load to catch it"])


@pytest.mark.parametrize(("tracked", "at_last"), [(True, CAUGHT), (False, LEFT_ON_THE_GROUND)])
def test_a_load_that_was_not_lifted_is_tried_again_three_times(
    tracked: bool, at_last: tuple[Phase, list[str]]
) -> None:
    """A gust and no load pulled at the vehicle."""
    flight = entered(Flight(), Phase.LIFT, hanging(), SETTINGS)
    after: list[tuple[Phase, list[str]]] = []
    for k in range(1, 5):
        assert flight.phase == Phase.LIFT
        for passed_us in (1_100_000, 1_140_000):
            seen = view(k * 2_000_000 + passed_us)._replace(load_tracked=tracked)
            flight, report = advance(flight, seen if tracked else seen._replace(taut=False), SETTINGS)
        after.append((flight.phase, [text for _, text in report.texts]))
        if flight.phase == Phase.TAUTEN:
            flight = transition(flight, Event.TAUT, hanging((k + 1) * 2_000_000), SETTINGS)
    again = (Phase.TAUTEN, ["Cable slack, the load is not lifted: pulling it taut again"])
    assert after == [again] * 3 + [at_last]
    disarmed = transition(flight, Event.DISARM, view(20_000_000), SETTINGS)
    assert disarmed.cable.failed_lifts == 0
