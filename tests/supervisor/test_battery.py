"""A measured battery that is nearly empty: what follows in flight, once for each level of its charge."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import pytest

from autopilot.guidance.legs import Hold
from autopilot.onboard.snapshot import reported_mode
from autopilot.services import identity
from autopilot.services.requests import Arm, Pause, Reposition, ReturnHome
from autopilot.supervisor.advance import advance
from autopilot.supervisor.quiescence import next_stretch
from autopilot.supervisor.settings import BatterySettings, Settings
from autopilot.supervisor.state import Flight, MissionProgress, Phase, with_battery
from autopilot.wire.convert.battery import CHARGE_LEVELS, BatteryReading
from autopilot.wire.dialect import plumbline as mavlink
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, Sky, hanging

WARN, AS_WARN, LAND, RETURN = 0, 1, 2, 3
HERE = (3.0, 0.0, 2.0)
HOLDING = Flight(phase=Phase.HOLD, legs=(Hold(HERE),), mission=MissionProgress(speed_m_s=1.0))


def acting(action: int) -> Settings:
    return replace(SETTINGS, battery=BatterySettings(CHARGE_LEVELS, action))


def left(flight: Flight, percent: int) -> Flight:
    return with_battery(flight, BatteryReading(remaining=0.01 * percent), CHARGE_LEVELS)


def discharge(sky: Sky, percent: int) -> list[str]:
    """What is told while the battery has this charge for a second."""
    told = len(sky.texts)
    sky.flight = left(sky.flight, percent)
    sky.wait(1.0)
    return sky.texts[told:]


@pytest.mark.parametrize(
    ("action", "percent", "phase", "said"),
    [
        (WARN, 3, Phase.HOLD, None),
        (AS_WARN, 3, Phase.HOLD, None),
        (LAND, 15, Phase.HOLD, None),
        (LAND, 7, Phase.LOWER, "Failsafe: battery nearly empty, 7 % left, landing"),
        (LAND, 4, Phase.LOWER, "Failsafe: battery empty, 4 % left, landing"),
        (RETURN, 8, Phase.HOLD, None),
        (RETURN, 7, Phase.RETURN, "Failsafe: battery nearly empty, 7 % left, returning"),
        (RETURN, 5, Phase.LOWER, "Failsafe: battery empty, 5 % left, landing"),
    ],
)
def test_what_follows_is_chosen_by_a_parameter(
    action: int, percent: int, phase: Phase, said: str | None
) -> None:
    settings = acting(action)
    low = left(HOLDING, percent)
    # the supervisor is called, as it is at each tick at which something is due
    is_due = next_stretch(low, settings, 0, STEP_US, 0.0).stop_us == 0
    flight, report = advance(low, hanging(0, HERE), settings)
    assert flight.phase == phase
    assert [text for _, text in report.texts] == ([said] if said else [])
    assert flight.is_failsafe == is_due == (said is not None)
    _, again = advance(flight, hanging(STEP_US, HERE), settings)
    assert not again.texts
    assert next_stretch(flight, settings, STEP_US, STEP_US, 0.0).stop_us > STEP_US


def test_each_level_is_answered_once_and_commands_are_obeyed() -> None:
    sky = Sky(settings=acting(RETURN)).airborne()
    assert discharge(sky, 7) == ["Failsafe: battery nearly empty, 7 % left, returning"]
    assert sky.ask(Pause()).result == ACCEPTED
    assert discharge(sky, 6) == [] and sky.flight.phase == Phase.HOLD and not sky.flight.is_failsafe
    assert discharge(sky, 5) == ["Failsafe: battery empty, 5 % left, landing"]
    assert sky.ask(Pause()).result == ACCEPTED
    assert discharge(sky, 3) == [] and sky.flight.phase == Phase.HOLD


def test_what_is_under_way_already_is_not_begun_again() -> None:
    sky = Sky(settings=acting(RETURN)).airborne()
    assert sky.ask(ReturnHome()).result == ACCEPTED
    sky.tick()
    legs = sky.flight.legs
    assert discharge(sky, 7) == [] and not sky.flight.is_failsafe
    assert sky.flight.legs == legs[-len(sky.flight.legs) :]
    # a hold ends the return; what is due then is begun again
    assert sky.ask(Pause()).result == ACCEPTED
    assert discharge(sky, 7) == ["Failsafe: battery nearly empty, 7 % left, returning"]
    sky.run(lambda sky: sky.flight.phase == Phase.LOWER)
    assert discharge(sky, 5) == [] and sky.flight.phase == Phase.LOWER


def test_the_landing_of_a_return_that_is_ended_is_reported_as_a_landing() -> None:
    """The landing with which a return ends belongs to it."""
    sky = Sky(settings=acting(RETURN)).airborne()
    assert sky.ask(Reposition(5.0, 0.0, None, True)).result == ACCEPTED
    sky.wait(8.0)
    assert sky.ask(ReturnHome()).result == ACCEPTED
    sky.wait(1.0)
    assert reported_mode(sky.flight) == (identity.AUTO, identity.AUTO_RTL)
    landed = copy(sky)
    landed.run(lambda sky: sky.flight.phase == Phase.LOWER)
    assert reported_mode(landed.flight) == (identity.AUTO, identity.AUTO_RTL)
    assert discharge(sky, 5) == ["Failsafe: battery empty, 5 % left, landing"]
    assert reported_mode(sky.flight) == (identity.AUTO, identity.AUTO_LAND)


def test_the_next_flight_is_another_one() -> None:
    settings = acting(RETURN)
    flight, _ = advance(left(HOLDING, 7), hanging(0, HERE), settings)
    assert flight.answered_charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL
    sky = Sky(settings=settings)
    sky.flight = replace(sky.flight, answered_charge_state=flight.answered_charge_state)
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert sky.flight.answered_charge_state == 0
    # on the ground nothing follows
    assert discharge(sky, 7) == []
