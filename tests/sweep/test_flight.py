"""The flight without the wire is the flight with it, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.estimation.filter import complaints
from autopilot.estimation.records import blank_state
from autopilot.guidance import LOAD_POSITION, Brake, Creep, Hold, Run, Transfer
from autopilot.onboard import Onboard
from gcs.closed_loop import Conditions
from gcs.closed_loop import fly as fly_with_wire
from gcs.sweep.flight import TRACE_COLUMNS, boarding, fly
from gcs.sweep.legs import jets
from gcs.sweep.link import settled
from missions.fileformat import load_mission
from missions.model import Sine, Term
from missions.signals import signal_table
from sitl.hil import HilSimulator

MOST_TICKS = 20_000
THESIS, LQR, PLUMBLINE = 0.0, 1.0, 2.0
ROUGH = {"SIM_ACT_DELAY_MS": 9.0, "SIM_DROP_PCT": 10.0, "SIM_GUST_STD": 0.5, "SIM_LOAD_MASS": 0.12}


class NoLog:
    def write(self, unix_us: int, frame: bytes) -> None:
        pass


def flown(name: str, conditions: Conditions) -> None:
    """Fly both ways and compare every true state."""
    mission = load_mission(name)
    real = np.full((MOST_TICKS, TRACE_COLUMNS), np.nan)

    def watch(_: Onboard, simulator: HilSimulator) -> bool:
        core = simulator._core
        p = core.state
        real[core.tick_count] = (*p.x_load, *p.x_quad, *p.quat_wxyz, *p.rotor_force)
        return True

    outcome = fly_with_wire(mission, conditions, NoLog(), watch)
    fused = np.full((MOST_TICKS, TRACE_COLUMNS), np.nan)
    found = fly(mission, conditions, boarding(mission, conditions), fused)
    assert (found.outcome, found.reason) == (outcome.name, outcome.reason)
    # the ground station goes on listening for a moment
    ticks = int(np.isfinite(fused[:, 0]).sum())
    assert 1000 < ticks <= np.isfinite(real[:, 0]).sum()
    assert np.array_equal(fused[:ticks], real[:ticks])


@pytest.mark.parametrize("law", [THESIS, LQR, PLUMBLINE])
def test_same_bits_with_each_law(short: str, law: float) -> None:
    flown(short, Conditions(sensors="lab", seed=1, settings={"CTL_LAW": law}))


def test_same_bits_under_rough_conditions(short: str) -> None:
    flown(short, Conditions(sensors="lab", seed=2, settings={"CTL_LAW": PLUMBLINE, **ROUGH}))


def test_same_bits_with_two_ticks_for_each_command(short: str) -> None:
    settings = {"CTL_LAW": PLUMBLINE, "SIM_RATE_HZ": 500.0}
    flown(short, Conditions(sensors="ideal", seed=1, settings=settings))


def test_same_end_of_a_flight_that_is_lost(short: str) -> None:
    flown(short, Conditions(sensors="lab", seed=1, settings={"CTL_LAW": THESIS, "SIM_ACT_DELAY_MS": 60.0}))


TERM = Term("x", 1.0, 0.0, 1.0, None, 0.0, (Sine(3.0),))
LEGS = (
    Hold((1.0, 2.0, 3.0)),
    Transfer((0.1, 0.2, 0.3), (3.0, 1.0, 2.0), 4.0),
    Brake((0.1, 0.2, 0.3), (1.0, 0.4, 0.1), (0.3, 0.1, 0.7), 2.0),
    Creep((0.1, 0.2, 0.3), (0.0, 0.1, -0.2), LOAD_POSITION),
    Run((0.1, 0.2, 0.3), signal_table((TERM,)), 5.0),
)


@pytest.mark.parametrize("leg", LEGS, ids=lambda leg: type(leg).__name__)
def test_a_leg_laid_out_is_the_leg(leg: object) -> None:
    times = np.arange(-3, 1500) * 0.004
    expected = np.array([np.ravel(leg.jet(t)) for t in times.tolist()])  # type: ignore[attr-defined]
    assert np.array_equal(jets(leg, times), expected)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [0.0, 1e-4, 1.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("part", ["vehicle age", "vehicle position", "vehicle attitude", "load age", "load"])
def test_the_kernel_complains_when_the_estimator_does(part: str, value: float) -> None:
    state = blank_state()
    vehicle = state.vehicle._replace(age_s=0.0, covariance=(0.0,) * 6, attitude_covariance=(0.0, 0.0, 0.0))
    load = state.load._replace(age_s=0.0, covariance=(0.0, 0.0, 0.0))
    if part == "vehicle age":
        vehicle = vehicle._replace(age_s=value)
    elif part == "vehicle position":
        vehicle = vehicle._replace(covariance=(value, 0.0, 0.0, 0.0, 0.0, 0.0))
    elif part == "vehicle attitude":
        vehicle = vehicle._replace(attitude_covariance=(value, 0.0, 0.0))
    elif part == "load age":
        load = load._replace(age_s=value)
    else:
        load = load._replace(covariance=(value, 0.0, 0.0))
    state = state._replace(vehicle=vehicle, load=load)
    assert settled(state, 0.5) == (not complaints(state, 0.5))
