"""Parameters of the paths that are set while a mission is flown apply to what follows its present path."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from autopilot.guidance.legs import PathStretch
from autopilot.onboard.onboard import SetupWork
from autopilot.onboard.path_work import PathWork
from autopilot.supervisor.state import Phase
from autopilot.trajectory.prepare import PreparedPaths
from autopilot.trajectory.waypoint_path import PathSegment
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import Disc, Fence
from missions.model import Land, ReturnHome, Speed, Step, Takeoff, Waypoint
from tests.doubles.craft import ACCEPTED, Craft, at_phase

ITEMS = (
    Takeoff(2.0),
    Waypoint(8.0, 0.0, 2.0),
    Waypoint(16.0, 2.0, 2.0, hold_s=0.5),
    Waypoint(24.0, 0.0, 2.0),
    Waypoint(32.0, 2.0, 2.0, hold_s=0.5),
    ReturnHome(),
    Land(),
)


def set_parameter(craft: Craft, name: bytes, value: float) -> None:
    craft.send(mavlink.MAVLink_param_set_message(1, 1, name, value, mavlink.MAV_PARAM_TYPE_REAL32))


def begun(*steps: Step, **settings: float) -> Craft:
    """A mission that has flown for a second to its first waypoint."""
    craft = Craft(*steps, **settings)
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    craft.wait(1.0)
    return craft


def top_speeds(craft: Craft) -> dict[int, float]:
    """The greatest speed (m/s) at which the load should move in each step, until the landing."""
    found: dict[int, float] = {}
    while craft.flight.phase == Phase.MISSION:
        leg, step = craft.flight.legs[0], craft.flight.mission.step
        v = leg.jet((craft.onboard.now_us - craft.flight.leg_start_us) * 1e-6)[1]
        found[step] = max(found.get(step, 0.0), math.dist(v, (0.0, 0.0, 0.0)))
        craft.tick()
    return found


@pytest.mark.parametrize(
    ("name", "value", "later_m_s"), [(b"MIS_SPEED", 2.0, 2.0), (b"MIS_ACCEL", 0.1, 0.679)]
)
def test_they_apply_from_the_next_path_on(name: bytes, value: float, later_m_s: float) -> None:
    craft = begun(*ITEMS)
    path = craft.flight.mission.plan.prepared.paths[1]
    assert isinstance(path, PathSegment)
    set_parameter(craft, name, value)
    speeds = top_speeds(craft)
    assert speeds[1] == pytest.approx(1.5, abs=0.01), "the path that is flown is flown to its end"
    assert speeds[2] == pytest.approx(1.5, abs=0.01)
    assert speeds[4] == pytest.approx(later_m_s, abs=0.01)
    assert "Changed parameters apply from mission item 3 on" in craft.texts
    kept, later = (craft.flight.mission.plan.prepared.paths[i] for i in (2, 3))
    assert isinstance(kept, PathSegment)
    assert isinstance(later, PathSegment)
    assert kept.table is path.table
    craft.run(at_phase(Phase.DISARMED))
    assert "Landed, disarmed" in craft.texts


def test_a_speed_item_keeps_its_speed() -> None:
    craft = begun(Takeoff(2.0), Waypoint(6.0, 0.0, 2.0, hold_s=0.5), Speed(1.0), *ITEMS[3:])
    set_parameter(craft, b"MIS_SPEED", 2.5)
    speeds = top_speeds(craft)
    assert speeds[3] == pytest.approx(1.0, abs=0.01)
    assert speeds[5] == pytest.approx(1.0, abs=0.01)


def test_a_transfer_after_a_reset_of_the_speed_uses_them() -> None:
    craft = begun(Takeoff(2.0), Waypoint(9.0, 0.0, 2.0, hold_s=0.5), Speed(None), ReturnHome(), Land())
    set_parameter(craft, b"MIS_SPEED", 1.0)
    assert top_speeds(craft)[3] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("name", "value", "later_m_s"), [(b"MIS_SPEED", 1.3, 1.3), (b"FS_LOAD_ERR", 4.0, 0.7)]
)
def test_a_transfer_after_a_path_that_waited_uses_a_new_speed(
    name: bytes, value: float, later_m_s: float
) -> None:
    craft = begun(Takeoff(2.0), Waypoint(9.0, 0.0, 2.0, hold_s=0.5), ReturnHome(), Land(), MIS_SPEED=1.0)
    waited = replace(craft.flight.mission, speed_m_s=0.7, speed_before_waits_m_s=1.0)
    craft.onboard.core.replace_flight(replace(craft.flight, mission=waited))
    set_parameter(craft, name, value)
    assert top_speeds(craft)[2] == pytest.approx(later_m_s, abs=0.01)


def test_on_the_last_path_they_apply_to_the_next_mission() -> None:
    craft = begun(Takeoff(2.0), Waypoint(6.0, 0.0, 2.0))
    set_parameter(craft, b"MIS_SPEED", 2.5)
    craft.wait(0.1)
    assert "Changed parameters apply to the next mission" in craft.texts


def awaiting_paths() -> tuple[Craft, PathWork]:
    """A mission that is flown while another process prepares its paths for another MIS_SPEED."""
    craft = Craft(*ITEMS, clock_waits=False)
    onboard = craft.onboard
    first = onboard.work
    assert isinstance(first, PathWork)
    onboard.finish(first, first.run())
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    set_parameter(craft, b"MIS_SPEED", 2.0)
    craft.wait(0.1)
    setup = onboard.work
    assert isinstance(setup, SetupWork)
    onboard.finish(setup, setup.run())
    work = onboard.work
    assert isinstance(work, PathWork)
    craft.wait(1.0)
    assert isinstance(craft.flight.legs[0], PathStretch)
    assert not craft.flight.mission.plan.prepared.pending
    return craft, work


def test_where_the_clock_does_not_wait_the_mission_goes_on_meanwhile() -> None:
    craft, work = awaiting_paths()
    craft.onboard.finish(work, work.run())
    craft.wait(0.1)
    assert "Changed parameters apply from mission item 3 on" in craft.texts
    assert top_speeds(craft)[4] == pytest.approx(2.0, abs=0.01)


def test_paths_that_are_refused_are_not_flown() -> None:
    craft, work = awaiting_paths()
    before = craft.flight.mission.plan.prepared
    craft.onboard.finish(work, PreparedPaths(refusal="item 4: too fast"))
    craft.wait(0.1)
    assert craft.flight.mission.plan.prepared == before
    assert "Mission keeps its paths: item 4: too fast" in craft.texts


def test_curves_that_the_fence_forbids_are_not_flown() -> None:
    craft, work = awaiting_paths()
    before = craft.flight.mission.plan.prepared
    fence = Fence((Disc(True, (0.0, 0.0), 30.0),))
    flight = craft.flight
    craft.onboard.core.replace_flight(replace(flight, area=replace(flight.area, fence=fence)))
    craft.onboard.finish(work, work.run())
    craft.wait(0.1)
    assert craft.flight.mission.plan.prepared == before
    assert "Mission keeps its paths: the curve to item 4 leads outside the fence" in "".join(craft.texts)


def test_a_take_off_climbs_to_the_height_that_was_set_just_before() -> None:
    """As MAVSDK asks for it: the height as a parameter, which is in force only when another process has
    derived the setup, and then a take-off without a height."""
    craft = Craft(clock_waits=False)
    craft.wait(1.0)
    set_parameter(craft, b"MIS_TAKEOFF_ALT", 4.0)
    assert craft.command(mavlink.MAV_CMD_NAV_TAKEOFF, *(math.nan,) * 7) == ACCEPTED
    assert craft.onboard.work is not None
    assert craft.flight.mission.takeoff_altitude_m == 4.0
