"""Flights in one process: machine code flies the ticks without decisions, with the same bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from autopilot.control.law_exchange import Now
from autopilot.own.own_code import OwnCode
from gcs import closed_loop
from gcs.clients.flight import Outcome
from gcs.closed_loop import Conditions
from gcs.closed_ticks import ClosedTicks, FlownTicks
from missions.model import Delay, Land, Mission, Release, Takeoff, Waypoint, Winch
from plumbline.examples.load_pid import LoadPid

ERRAND = Mission(
    "errand",
    "Errand",
    "",
    (),
    (Takeoff(1.2), Winch(0.8, None), Waypoint(1.0, 0.5, 1.2, hold_s=0.5), Release(), Land()),
)
HOVER = Mission("hover", "Hover", "", (), (Takeoff(1.0), Delay(2.0), Land()))
GUSTS = {"SIM_WIND_E": 3.0, "SIM_GUST_STD": 1.0, "SIM_GUST_E": 2.0, "SIM_GUST_AT_S": 9.0}


class Fails(LoadPid):
    """A law that fails in flight."""

    def load_position(self, memory: Any, now: Now) -> Any:
        if now.time_s > 3.0:
            raise ValueError("enough")
        return super().load_position(memory, now)


class Frames:
    """A log that keeps the written frames and their times."""

    def __init__(self) -> None:
        self.written: list[tuple[int, bytes]] = []

    def write(self, unix_us: int, *frames: bytes) -> None:
        self.written += [(unix_us, frame) for frame in frames]


def flown(mission: Mission, conditions: Conditions, **how: Any) -> tuple[Outcome, list[tuple[int, bytes]]]:
    log = Frames()
    return closed_loop.fly(mission, conditions, log, **how), log.written


@pytest.mark.parametrize(
    ("mission", "conditions"),
    [
        (HOVER, Conditions()),
        (ERRAND, Conditions(sensors="rtk", seed=2)),
        (HOVER, Conditions("heavy-real", "field", 3, GUSTS)),
        (HOVER, Conditions(settings={"SIM_CBL_LINKS": 3.0, "SIM_RATE_HZ": 500.0})),
        (HOVER, Conditions(own=OwnCode("plumbline.examples.load_pid:LoadPid"))),
        (HOVER, Conditions(own=OwnCode(f"{__name__}:Fails"))),
    ],
    ids=["hover", "errand", "field", "links", "own law", "own law that fails"],
)
def test_a_flight_is_the_same_without_python_at_each_tick(
    mission: Mission, conditions: Conditions, monkeypatch: pytest.MonkeyPatch
) -> None:
    windows = 0
    run: Callable[..., FlownTicks] = ClosedTicks.run

    def counted(ticks: ClosedTicks, said: bytes, silent_until_us: int) -> FlownTicks:
        nonlocal windows
        found = run(ticks, said, silent_until_us)
        windows += sum(window.ends_us > 0 for window in found.windows)
        return found

    monkeypatch.setattr(ClosedTicks, "run", counted)
    outcome, fast = flown(mission, conditions)
    asked = windows
    assert flown(mission, conditions, watch=lambda *_: True) == (outcome, fast)
    assert windows == asked, "with a watch each tick is shown"
    seconds = (fast[-1][0] - fast[0][0]) * 1e-6
    assert asked > 0.8 * seconds / 0.02, "of the windows of 20 ms most are flown without Python"


def test_the_ground_station_has_its_turn_at_each_window() -> None:
    turns = 0

    def shown() -> None:
        nonlocal turns
        turns += 1

    _, log = flown(HOVER, Conditions(sensors="ideal"), on_turn=shown)
    seconds = (log[-1][0] - log[0][0]) * 1e-6
    assert turns == pytest.approx(seconds / 0.02, rel=0.01)
