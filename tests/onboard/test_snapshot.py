"""The telemetry of an instant, read from rows that were laid out, compared with the legs that are flown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from math import inf, isnan
from pathlib import Path

import pytest

from autopilot.geometry.linear import ZERO
from autopilot.geometry.packed import unpack
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION, SignalRun, requested_jet
from autopilot.onboard.onboard import Onboard
from autopilot.services.instant import Instant
from autopilot.supervisor.state import Phase, leg_time_s
from gcs import closed_loop
from missions.fileformat import load_mission
from sitl.hil import HilSimulator

WINCH = Path(__file__).parents[2] / "benchmarks" / "yardstick-winch.toml"


class NoLog:
    def write(self, unix_us: int, *frames: bytes) -> None:
        """Keep nothing."""


def watching(seen: Counter[str]) -> Callable[[Onboard, HilSimulator], bool]:
    def watch(onboard: Onboard, simulator: HilSimulator) -> bool:
        said, flight = unpack(Instant, onboard.log_sample().instant, 0), onboard.core.flight
        x_load = onboard.core.state.x_load
        assert said.x_load == x_load
        assert said.distance > 0.0
        if not flight.legs:
            seen["no leg"] += 1
            assert (said.x_load_d, said.v_load_d, said.x_load_requested) == (x_load, ZERO, x_load)
            assert said.elapsed_s == (onboard.now_us - flight.phase_start_us) * 1e-6
            assert isnan(said.duration_s)
            return True
        leg, elapsed_s = flight.legs[0], leg_time_s(flight, onboard.now_us)
        seen[type(leg).__name__] += 1
        assert said.elapsed_s == elapsed_s
        assert said.duration_s == leg.duration_s if leg.duration_s < inf else isnan(said.duration_s)
        jet, asked = leg.jet(elapsed_s), requested_jet(leg, elapsed_s)
        if leg.control_mode == LOAD_POSITION:
            assert (said.x_load_d, said.v_load_d, said.a_load_d) == jet[:3]
            assert (said.x_load_requested, said.v_load_requested) == asked[:2]
            if isinstance(leg, SignalRun):
                seen["asked otherwise"] += asked[0] != jet[0]
        else:
            assert (said.x_load_d, said.v_load_d, said.x_load_requested) == (x_load, ZERO, x_load)
        if leg.control_mode == QUAD_POSITION:
            assert said.x_quad_d == jet[0]
        else:
            assert all(isnan(one) for one in said.x_quad_d)
        return True

    return watch


@pytest.mark.parametrize(
    ("mission", "least"),
    [
        ("case-a", {"SignalRun": 1000, "Hold": 100, "Transfer": 100, "asked otherwise": 100}),
        (str(WINCH), {"Reel": 100}),
    ],
)
def test_the_setpoint_is_that_of_the_leg_at_every_tick(mission: str, least: dict[str, int]) -> None:
    seen: Counter[str] = Counter()
    conditions = closed_loop.Conditions(sensors="ideal")
    outcome = closed_loop.fly(load_mission(mission), conditions, NoLog(), watching(seen))
    assert outcome.name == "completed"
    assert {name: seen[name] for name, count in least.items() if seen[name] < count} == {}


@pytest.mark.parametrize("load_kg", [0.05, 0.1, 0.13])
def test_the_tension_is_that_of_the_load_that_hangs_on_the_cable(load_kg: float) -> None:
    """The vehicle assumes 0.1 kg, and learns the mass while the load hangs free."""
    told_and_true: list[tuple[float, float]] = []

    def watch(onboard: Onboard, simulator: HilSimulator) -> bool:
        if onboard.phase == Phase.MISSION:
            said = unpack(Instant, onboard.log_sample().instant, 0)
            told_and_true.append((said.tension, simulator.core.state.tension))
        return True

    conditions = closed_loop.Conditions(settings={"SIM_LOAD_MASS": load_kg})
    assert closed_loop.fly(load_mission("hover"), conditions, NoLog(), watch).name == "completed"
    assert len(told_and_true) > 1000
    assert max(abs(told / true - 1.0) for told, true in told_and_true) < 0.02
