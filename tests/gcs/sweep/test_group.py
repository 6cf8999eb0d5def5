"""Flights in lanes equal flights flown alone, figure by figure and bit by bit, however each one ends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import count

import pytest
from numba.core import config

from autopilot.core.flight_core import FlightCore
from autopilot.shell.compiling import Part
from autopilot.supervisor.state import Report
from gcs.closed_loop import Conditions
from gcs.sweep import work
from gcs.sweep.cell import cell_of
from gcs.sweep.flight import FlightResult, SweepFlight, fly, start_times
from gcs.sweep.group import LaneGroup, fits_in_lanes
from gcs.sweep.plan import SweepPlan
from gcs.sweep.plan_values import VariedParameter
from gcs.sweep.work import Work, fly_cases
from missions.fileformat import load_mission

pytestmark = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="lanes are machine code")

PLUMBLINE = 2.0  # the two other laws are flown in lanes by benchmarks/yardstick.py
EIGHT = range(1, 9)


def as_needed(_: Iterable[Part]) -> None:
    """Compile nothing beforehand."""


def both_ways(
    name: str,
    settings: Mapping[str, float],
    seeds: Sequence[int],
    sensors: str = "lab",
    vehicle: str = "bebop",
) -> tuple[list[FlightResult], float]:
    """Fly the seeds alone and together; return the results and the share of ticks flown in lanes."""
    mission = load_mission(name)
    conditions = Conditions(vehicle, sensors, settings=settings)
    start = start_times(mission, conditions)
    alone = [fly(mission, replace(conditions, seed=seed), start) for seed in seeds]
    flights = [SweepFlight(cell_of(mission, conditions), seed, start) for seed in seeds]
    group = LaneGroup(flights)
    group.run()
    # repr: NaN is not equal to itself
    assert [repr(flight.result) for flight in flights] == [repr(flown) for flown in alone]
    return alone, group.lane_ticks / sum(flight.tick for flight in flights)


def test_same_bits_with_eight(short: str) -> None:
    flown, share = both_ways(short, {"CTL_LAW": PLUMBLINE}, EIGHT)
    assert {one.outcome for one in flown} == {"completed"}
    assert share > 0.5


def test_same_bits_of_a_step_response(stepped: str) -> None:
    flown, share = both_ways(stepped, {"CTL_LAW": PLUMBLINE}, EIGHT)
    assert share > 0.5
    for one in flown:
        assert 1.0 < one.rise_time_90_s < one.settling_time_5pct_s < 2.0
    assert len({one.overshoot_pct for one in flown}) == 8


def test_same_bits_with_fewer_than_eight(short: str) -> None:
    _, share = both_ways(short, {"CTL_LAW": PLUMBLINE}, range(1, 6), "ideal")
    assert share > 0.5


def test_same_bits_where_flights_are_lost_one_by_one(short: str) -> None:
    flown, share = both_ways(short, {"CTL_LAW": PLUMBLINE, "SIM_NOISE_SCALE": 30.0}, EIGHT)
    assert {one.outcome for one in flown} == {"diverged"}
    assert len({one.flight_s for one in flown}) > 4
    assert share > 0.05


def test_same_bits_where_courses_part_all_the_time(short: str) -> None:
    flown, share = both_ways(short, {"CTL_LAW": PLUMBLINE, "SIM_NOISE_SCALE": 6.0}, EIGHT)
    assert len({one.load_error_max_m for one in flown}) == 8
    assert 0.0 < share < 1.0


def test_same_bits_in_gusts(short: str) -> None:
    gusts = {"SIM_GUST_STD": 0.5, "SIM_WIND_E": 1.0, "SIM_GUST_E": 2.0, "SIM_GUST_AT_S": 9.0}
    both_ways(short, {"CTL_LAW": PLUMBLINE, **gusts, "SIM_GUST_FOR_S": 1.0}, EIGHT)


def test_same_bits_with_receiver_and_camera(short: str) -> None:
    both_ways(short, {"CTL_LAW": PLUMBLINE}, EIGHT, "rtk")


def test_same_bits_with_vibration_and_errors_that_last(short: str) -> None:
    tracked = {"SIM_TRK_ERR_M": 0.002, "SIM_TRK_CAL_M": 0.002, "SIM_SENS_OFS_MS": 1.0}
    shaken = {"SIM_VIB_ACC": 1.0, "SIM_VIB_GYR": 0.02, "SIM_VIB_BROAD": 0.2, "SIM_IMU_LPF_HZ": 98.0}
    _, share = both_ways(short, {"CTL_LAW": PLUMBLINE, **tracked, **shaken}, EIGHT)
    assert share > 0.3


def test_same_bits_with_multipath_and_motor_currents(short: str) -> None:
    _, share = both_ways(
        short, {"CTL_LAW": PLUMBLINE, "SIM_GPS_MP_M": 0.02, "SIM_MAG_MOT": 0.02}, EIGHT, "rtk"
    )
    assert share > 0.1


def test_same_bits_with_drag_wake_battery_and_a_cable_beside_the_centre(short: str) -> None:
    flown, share = both_ways(short, {"CTL_LAW": PLUMBLINE}, EIGHT, vehicle="bebop-real")
    assert {one.outcome for one in flown} == {"completed"}
    assert share > 0.5


def test_an_attachment_that_is_told_is_flown_better(short: str) -> None:
    beside = {"X": 0.02, "Y": -0.01, "Z": -0.02}
    offset = {f"SIM_ATT_{axis}": place for axis, place in beside.items()}
    known = {f"VEH_ATT_{axis}": place for axis, place in beside.items()}

    def error(settings: Mapping[str, float]) -> float:
        mission, conditions = load_mission(short), Conditions(settings=settings)
        return fly(mission, conditions, start_times(mission, conditions)).load_error_max_m

    assert error({**offset, **known}) < 0.8 * error(offset)


IMU_PLACE = {"IMU_POS_X": 0.03, "IMU_POS_Y": -0.02, "IMU_POS_Z": 0.03}
ANTENNA_PLACE = {"GPS_POS_X": -0.1, "GPS_POS_Y": 0.02, "GPS_POS_Z": 0.15}


def true_and_told(places: Mapping[str, float]) -> tuple[dict[str, float], dict[str, float]]:
    """Settings that place sensors in the world, and the same with an autopilot that is told of it."""
    true = {f"SIM_{name}": place for name, place in places.items()}
    return true, {**true, **{f"VEH_{name}": place for name, place in places.items()}}


def test_same_bits_with_sensors_beside_the_centre_and_axes_with_errors(short: str) -> None:
    errors = {"SIM_ACC_SCALE_Z": 1.0, "SIM_ACC_ALIGN_X": 0.5, "SIM_GYR_SCALE_X": 1.0, "SIM_GYR_ALIGN_Y": 0.5}
    _, told = true_and_told({**IMU_PLACE, **ANTENNA_PLACE})
    _, share = both_ways(short, {"CTL_LAW": PLUMBLINE, **told, **errors}, EIGHT, "rtk")
    assert share > 0.1


def test_same_bits_where_the_height_of_the_inertial_unit_is_learned(short: str) -> None:
    """By each flight for itself."""
    true, _ = true_and_told({**IMU_PLACE, "IMU_POS_Z": -0.03})
    flown, share = both_ways(short, {"CTL_LAW": PLUMBLINE, **true}, EIGHT, "lab")
    assert {one.outcome for one in flown} == {"completed"}
    assert share > 0.1


@pytest.mark.parametrize(
    ("places", "sensors", "cost"), [(IMU_PLACE, "lab", 1.1), (ANTENNA_PLACE, "rtk", 1.5)]
)
def test_places_of_sensors_that_are_told_cost_nothing(
    short: str, places: Mapping[str, float], sensors: str, cost: float
) -> None:
    """The worst of some flights; without being told, they are farther off. The height of the inertial unit is
    learned, and costs less."""
    mission = load_mission(short)

    def error(settings: Mapping[str, float]) -> float:
        flown = (Conditions(sensors=sensors, seed=seed, settings=settings) for seed in (1, 2, 3))
        return max(fly(mission, one, start_times(mission, one)).load_error_max_m for one in flown)

    plain, (true, told) = error({}), true_and_told(places)
    assert error(told) < 1.1 * plain
    assert error(true) > cost * plain


def test_a_load_that_is_released_is_flown_alone(delivery: str) -> None:
    flown, share = both_ways(delivery, {"CTL_LAW": PLUMBLINE}, range(1, 4))
    assert {one.outcome for one in flown} == {"completed"}
    assert 0.0 < share < 0.9


def test_while_the_winch_works_each_flies_alone(winched: str) -> None:
    flown, share = both_ways(winched, {"CTL_LAW": PLUMBLINE}, range(1, 4))
    assert {one.outcome for one in flown} == {"completed"}
    assert 0.0 < share < 0.9


def test_while_the_winch_works_the_supervisor_rests(winched: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mission, conditions = load_mission(winched), Conditions(settings={"CTL_LAW": PLUMBLINE})
    decisions: list[str] = []
    decide = FlightCore.decide

    def counted(core: FlightCore, now_us: int, period_us: int) -> Report:
        decisions.append(type(core.flight.legs[0]).__name__ if core.flight.legs else "")
        return decide(core, now_us, period_us)

    start = start_times(mission, conditions)
    monkeypatch.setattr(FlightCore, "decide", counted)
    one = fly(mission, conditions, start)
    assert one.outcome == "completed"
    assert "Reel" in decisions
    assert len(decisions) < 100


def test_readings_that_get_lost_do_not_suit(short: str) -> None:
    mission = load_mission(short)
    lossy = Conditions(settings={"CTL_LAW": PLUMBLINE, "SIM_DROP_PCT": 5.0})
    start = start_times(mission, Conditions(settings={"CTL_LAW": PLUMBLINE}))
    assert fits_in_lanes(SweepFlight(cell_of(mission, Conditions()), 1, start))
    assert not fits_in_lanes(SweepFlight(cell_of(mission, lossy), 1, start))
    for name, sensors in (
        ("SIM_SENS_JIT_MS", "lab"),
        ("SIM_OCC_LOAD", "lab"),
        ("SIM_GPS_FLT", "rtk"),
        ("SIM_GPS_LOST", "rtk"),
    ):
        late = Conditions(sensors=sensors, settings={"CTL_LAW": PLUMBLINE, name: 3.0})
        assert not fits_in_lanes(SweepFlight(cell_of(mission, late), 1, start)), name


def test_a_sweep_finds_the_same_with_lanes_and_without(short: str) -> None:
    """Five seeds of two settings, of which one loses readings."""
    lost = VariedParameter("SIM_DROP_PCT", (0.0, 5.0), False)
    plan = SweepPlan(short, "bebop", "lab", ("plumbline",), (1, 2, 3, 4, 5), (lost,), ())
    prepared = work.prepare(plan, {}, as_needed)
    cases, clock = list(plan.cases()), partial(next, count(1.0))
    without = fly_cases(replace(prepared, lane_laws=frozenset()), cases, clock)
    lanes: Work = replace(prepared, lane_laws=frozenset({"plumbline"}))
    found = fly_cases(lanes, cases, clock)
    assert [{**row, "wall_s": 0.0} for row in found] == [{**row, "wall_s": 0.0} for row in without]
    assert all(row["wall_s"] > 0.0 for row in found)


def test_lanes_are_compiled_where_many_flights_differ_by_their_seeds(
    short: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = SweepPlan(short, "bebop", "lab", ("plumbline",), tuple(range(1, 21)), (), ())
    compiled: list[str] = []

    def warm(parts: Iterable[Part]) -> None:
        compiled.extend(part.mark for part in parts)

    monkeypatch.setattr(Part, "ready", property(lambda part: part.mark in compiled))
    assert work.prepare(plan, {}, warm).lane_laws == frozenset()
    assert "alone" in compiled and "lanes-plumbline" not in compiled
    monkeypatch.setattr(work, "MIN_FLIGHTS_FOR_LANES", 20)
    assert work.prepare(plan, {}, warm).lane_laws == {"plumbline"}
    assert compiled.count("lanes-plumbline") == 1
    # once they are compiled, fewer flights suffice if there are enough seeds
    monkeypatch.setattr(work, "MIN_FLIGHTS_FOR_LANES", 1000)
    assert work.prepare(plan, {}, warm).lane_laws == {"plumbline"}
    assert work.prepare(replace(plan, seeds=(1, 2)), {}, warm).lane_laws == frozenset()
