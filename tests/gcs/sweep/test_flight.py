"""The flight without the wire is the flight with it, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.estimation.filter import complaints
from autopilot.estimation.records import CAMERA, RECEIVER, TRACKER, Doubt, blank_state
from autopilot.guidance.legs import (
    LOAD_POSITION,
    Brake,
    Creep,
    Hold,
    Leg,
    Pass,
    Run,
    Slow,
    Transfer,
    asked_jet,
)
from autopilot.onboard.onboard import Onboard
from autopilot.supervisor.settings import limits_from
from autopilot.supervisor.state import Flight, jet_ahead
from autopilot.trajectory.prepare import prepare
from autopilot.trajectory.shaping import Shaped, unshaped
from autopilot.trajectory.waypoint_path import Passage
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from gcs.closed_loop import Conditions
from gcs.closed_loop import fly as fly_with_wire
from gcs.sweep.flight import TRACE_COLUMNS, boarding, fly
from gcs.sweep.legs import jets, jets_ahead
from gcs.sweep.link import settled
from missions.fileformat import load_mission
from missions.model import Signals, Sine, Takeoff, Term, Waypoint
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


def test_same_bits_with_late_sensors(short: str) -> None:
    settings = {"CTL_LAW": PLUMBLINE, "SIM_SENS_LAT_MS": 26.0, "SIM_ACT_DELAY_MS": 9.0}
    flown(short, Conditions(sensors="lab", seed=1, settings=settings))


def test_same_bits_with_two_ticks_for_each_command(short: str) -> None:
    settings = {"CTL_LAW": PLUMBLINE, "SIM_RATE_HZ": 500.0}
    flown(short, Conditions(sensors="ideal", seed=1, settings=settings))


def test_same_end_of_a_flight_that_is_lost(short: str) -> None:
    flown(short, Conditions(sensors="lab", seed=1, settings={"CTL_LAW": THESIS, "SIM_ACT_DELAY_MS": 60.0}))


def test_same_bits_with_receiver_and_camera(short: str) -> None:
    gust = {"SIM_GUST_E": 2.0, "SIM_GUST_AT_S": 12.0, "SIM_GUST_FOR_S": 1.0}
    flown(short, Conditions(sensors="rtk", seed=1, settings={"CTL_LAW": PLUMBLINE, **gust}))


@pytest.mark.parametrize("sensors", ["lab", "rtk"])
def test_same_bits_where_the_load_is_released(delivery: str, sensors: str) -> None:
    flown(delivery, Conditions(sensors=sensors, seed=1, settings={"SIM_ACT_DELAY_MS": 5.0}))


# a half-cosine too steep for the vehicle, and a sine that dies away
TERMS = (Term("y", 0.25, 1.0, 0.79, None, 0.0, ()), Term("x", 0.1, 0.0, 1.0, 2.0, 1.0, (Sine(2.0),)))
SIGNALS = Signals(5.0, TERMS)
LEGS = (
    Hold((1.0, 2.0, 3.0)),
    Transfer((0.1, 0.2, 0.3), (3.0, 1.0, 2.0), 4.0),
    Brake((0.1, 0.2, 0.3), (1.0, 0.4, 0.1), (0.3, 0.1, 0.7), 2.0),
    Creep((0.1, 0.2, 0.3), (0.0, 0.1, -0.2), LOAD_POSITION),
    Run((0.1, 0.2, 0.3), unshaped(SIGNALS)),
    Slow(Transfer((0.1, 0.2, 0.3), (3.0, 1.0, 2.0), 4.0), 1.0, 2.0, 0.3),
)


@pytest.mark.parametrize("leg", LEGS, ids=lambda leg: type(leg).__name__)
@pytest.mark.parametrize("asked", [False, True])
def test_a_leg_laid_out_is_the_leg(leg: Leg, asked: bool) -> None:
    times = np.arange(-3, 1500) * 0.004
    expected = [np.ravel(asked_jet(leg, t) if asked else leg.jet(t)) for t in times.tolist()]
    assert np.array_equal(jets(leg, times, asked), np.array(expected))


def test_paths_of_a_plan_laid_out_are_the_paths() -> None:
    limits = limits_from(autopilot_parameters(load_vehicle("bebop")))._replace(shaped=True)
    steps = (
        Takeoff(1.0),
        Waypoint(2.0, 0.0, 2.0, 0.0),
        Waypoint(2.0, 2.0, 2.0, 0.0),
        Waypoint(0.0, 2.0, 1.5, 1.0),
        SIGNALS,
    )
    made = prepare(steps, tuple(range(len(steps))), limits).made
    passage, shaped = made[1], made[4]
    assert isinstance(passage, Passage) and isinstance(shaped, Shaped) and len(shaped.pieces)
    times = np.arange(-3, 2500) * 0.004
    for leg in (Pass(passage, (0.1, -0.2, 0.05), 1.5), Run((0.1, 0.2, 0.3), shaped)):
        expected = [np.ravel(leg.jet(t)) for t in times.tolist()]
        assert np.array_equal(jets(leg, times), np.array(expected))


def test_the_path_ahead_goes_on_into_what_follows() -> None:
    first, second = Transfer((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), 2.0), Hold((1.0, 0.0, 1.0), 0.5)
    third = Run((1.0, 0.0, 1.0), unshaped(SIGNALS))
    flight = Flight(legs=(first, second), following=(third,))
    times = np.arange(1000) * 0.004
    expected = [np.ravel(jet_ahead(flight, t)) for t in times.tolist()]
    assert np.array_equal(jets_ahead(flight, times), np.array(expected))


SETTLED = blank_state()._replace(doubt=Doubt(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("source", [TRACKER, RECEIVER])
@pytest.mark.parametrize("load_source", [TRACKER, CAMERA])
@pytest.mark.parametrize("taut", [0.0, 1.0])
@pytest.mark.parametrize("value", [0.0, 0.07, 0.2, 1.0, 3.0, np.inf, np.nan])
def test_the_kernel_complains_when_the_estimator_does(
    source: float, load_source: float, taut: float, value: float
) -> None:
    told = 0
    for part in ("vehicle", "load", *Doubt._fields):
        age_s = {name: value if part == name else 0.0 for name in ("vehicle", "load")}
        vehicle = SETTLED.vehicle._replace(source=source, age_s=age_s["vehicle"])
        load = SETTLED.load._replace(source=load_source, age_s=age_s["load"], taut=taut)
        doubt = SETTLED.doubt._replace(**{part: value}) if part in Doubt._fields else SETTLED.doubt
        aids = SETTLED.aids._replace(horizontal_slow=0.03)
        state = SETTLED._replace(vehicle=vehicle, load=load, doubt=doubt, aids=aids)
        spoken = bool(complaints(state, 0.5))
        told += spoken
        # it may stop once too often, for a number that is none, but never once too little
        assert not settled(state, 0.5) or not spoken
        assert settled(state, 0.5) or spoken or np.isnan(value)
    assert told > 0 or value in {0.0, 0.07}
