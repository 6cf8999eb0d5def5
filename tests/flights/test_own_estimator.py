"""Custom estimators: the law flies by their estimates, and the flight with its load survives an estimator
that fails."""

from __future__ import annotations

from math import nan
from pathlib import Path
from typing import Any

import pytest

from autopilot.own.own_code import OwnCode
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import Delay, Land, Takeoff
from plumbline.estimators import Estimate, Parameter, Sensed, estimated, no_estimate
from tests.doubles.craft import ACCEPTED, Craft, at_phase

HELD = 0.004  # m, error of a load that is held by the example: measured 1.3 mm
SWING = 0.05  # m, greatest motion of the load when the built-in filter takes over
EXAMPLE = "plumbline.examples.luenberger:Luenberger"
UP = {"OWN_UP": Parameter(0.0, -1.0, 1.0, "m", "How much lower than it is the load is believed")}


class Same:
    """The estimate of the built-in filter."""

    def estimate(self, memory: Any, now: Sensed) -> tuple[Any, Estimate]:
        return memory, estimated(*now.built_in)


class Lower(Same):
    """Estimates the load, and with it the vehicle, to be lower than they are."""

    parameters = UP

    def __init__(self, parameters: Any) -> None:
        self.lower = parameters["OWN_UP"]

    def estimate(self, memory: Any, now: Sensed) -> tuple[Any, Estimate]:
        s = now.built_in
        x, z = s.x_load, s.x_quad
        moved = s._replace(x_load=(x[0], x[1], x[2] - self.lower), x_quad=(z[0], z[1], z[2] - self.lower))
        return memory, estimated(*moved, tension=3.0, horizontal_std=0.25, vertical_std=0.5)


class FailsInHold(Same):
    """Fails some seconds after lift-off."""

    def start(self, now: Sensed) -> float:
        return now.time_s

    def estimate(self, began_s: float, now: Sensed) -> tuple[Any, Estimate]:
        if now.time_s - began_s > 14.0:
            raise RuntimeError("no idea")
        return began_s, estimated(*now.built_in)


class NoNumberInHold(FailsInHold):
    """Gives NaN some seconds after lift-off."""

    def estimate(self, began_s: float, now: Sensed) -> tuple[Any, Estimate]:
        v_load = (0.0, nan, 0.0) if now.time_s - began_s > 14.0 else now.built_in.v_load
        return began_s, estimated(*now.built_in._replace(v_load=v_load))


class Undecided:
    """Never has an estimate."""

    def estimate(self, memory: Any, now: Sensed) -> tuple[Any, Estimate]:
        return memory, no_estimate()


def craft(estimator: str | type, *steps: Any) -> Craft:
    named = estimator if isinstance(estimator, str) else f"{__file__}:{estimator.__name__}"
    return Craft(*(steps or (Takeoff(1.0), Delay(1.0), Land())), own=OwnCode(estimator=named), watched=True)


def test_the_example_lifts_holds_and_lands() -> None:
    flown = craft(EXAMPLE)
    flown.begin()
    flown.run(at_phase(Phase.LOWER))
    assert 0.0 < flown.worst_error < HELD
    flown.run(at_phase(Phase.DISARMED))
    assert flown.texts[-1] == "Landed, disarmed"


def test_one_that_says_what_the_built_in_filter_says_flies_the_same_flight() -> None:
    errors = []
    for flown in (craft(Same), Craft(Takeoff(1.0), Delay(1.0), Land(), watched=True)):
        flown.begin()
        flown.run(at_phase(Phase.DISARMED))
        errors.append((flown.worst_error, flown.truth.x_load, flown.onboard.now_us))
    assert errors[0] == errors[1]


def test_the_law_the_supervisor_and_telemetry_believe_it() -> None:
    flown = craft(Lower, Takeoff(1.0), Delay(30.0), Land())
    flown.begin()
    flown.run(at_phase(Phase.MISSION))
    flown.wait(8.0)
    flown.send(mavlink.MAVLink_param_set_message(1, 1, b"OWN_UP", 0.2, mavlink.MAV_PARAM_TYPE_REAL32))
    flown.wait(9.0)
    core = flown.onboard.core
    assert flown.truth.x_load[2] == pytest.approx(1.2, abs=HELD)
    assert core.view(flown.onboard.now_us).x_load[2] == pytest.approx(1.0, abs=HELD)
    assert core.built_in is not None and core.built_in[0][2] == pytest.approx(1.2, abs=HELD)
    moment = flown.onboard.log_sample().snapshot
    assert moment.x_load[2] == pytest.approx(1.0, abs=HELD)
    assert (moment.tension, moment.horizontal_std, moment.vertical_std) == (3.0, 0.25, 0.5)


@pytest.mark.parametrize("kind", [FailsInHold, NoNumberInHold])
def test_one_that_fails_is_replaced_at_once_and_the_vehicle_lands(kind: type) -> None:
    flown = craft(kind, Takeoff(1.0), Delay(30.0), Land())
    flown.begin()
    flown.run(lambda one: any("failed" in text for text in one.texts))
    told = "".join(flown.texts[-3:])
    line = kind.estimate.__code__.co_firstlineno  # type: ignore[attr-defined]
    file = Path(__file__).name
    why = {
        FailsInHold: f"RuntimeError: no idea ({file}:{line + 2})",
        NoNumberInHold: f"gives v_load = (0, nan, 0); must be numbers up to 1e9 ({file}:{line})",
    }[kind]
    assert f"Estimator {kind.__name__} failed: {why}; landing by the built-in filter" in told
    assert flown.flight.phase == Phase.LOWER
    assert flown.worst_error < SWING
    flown.run(at_phase(Phase.DISARMED))
    assert flown.texts[-1] == "Landed, disarmed"
    assert flown.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) != ACCEPTED


def test_one_that_knows_nothing_is_not_armed() -> None:
    flown = craft(Undecided)
    flown.wait(3.0)
    assert flown.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) != ACCEPTED
    assert any("no estimate of Estimator Undecided" in text for text in flown.texts)
