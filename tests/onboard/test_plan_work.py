"""Paths take long to prepare: they are left to another process where the clock does not wait."""

from __future__ import annotations

from dataclasses import replace

import pytest

from autopilot.guidance.legs import Hold
from autopilot.onboard.path_work import PathWork
from autopilot.services import identity
from autopilot.supervisor.state import Phase
from autopilot.trajectory.prepare import PENDING, PreparedPaths
from autopilot.trajectory.shaping import ShapedSignals
from autopilot.trajectory.waypoint_path import PathSegment
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import encode_steps
from gcs.clients.missions import MissionUpload
from gcs.clients.operation import Status, Target
from missions.model import Delay, Land, Signals, Speed, Takeoff, Term, Waypoint
from tests.doubles.craft import ACCEPTED, Craft, at_phase

PLUMBLINE = 2.0  # CTL_LAW
PX4_MISSION, PX4_RTL, PX4_LAND = (
    (identity.AUTO, sub) for sub in (identity.AUTO_MISSION, identity.AUTO_RTL, identity.AUTO_LAND)
)
EDGE = Signals(3.0, (Term("y", 0.25, 0.0, 0.8, None, 0.0),))


def upload(craft: Craft, *steps: Takeoff | Speed | Delay | Signals | Waypoint | Land) -> None:
    """Upload a mission, item by item as a ground station does."""
    operation = MissionUpload(Target(1, 1), encode_steps(steps, Home()))
    heard = len(craft.heard)

    def taken(craft: Craft) -> bool:
        nonlocal heard
        for message in craft.heard[heard:]:
            operation.receive(message, craft.onboard.now_us)
        heard = len(craft.heard)
        for message in operation.poll(craft.onboard.now_us):
            craft.send(message)
        return operation.result is not None

    craft.run(taken)
    assert operation.result is not None
    assert operation.result.status is Status.DONE


def test_on_the_ground_too_paths_are_left_to_another_where_the_clock_does_not_wait() -> None:
    craft = Craft(clock_waits=False, CTL_LAW=PLUMBLINE)
    onboard = craft.onboard
    craft.wait(1.0)
    upload(craft, Takeoff(2.0), Delay(1.0), EDGE, Land())
    assert onboard.work is not None
    assert craft.flight.mission.plan.prepared.pending
    onboard.finish(onboard.work, onboard.work.run())
    assert not craft.flight.mission.plan.prepared.pending
    upload(craft)
    assert onboard.work is None, "a mission without steps has no paths"


def test_where_the_clock_waits_paths_are_made_at_once() -> None:
    craft = Craft(CTL_LAW=PLUMBLINE)
    craft.wait(1.0)
    upload(craft, Takeoff(2.0), Delay(1.0), EDGE, Land())
    assert craft.onboard.work is None
    assert not craft.flight.mission.plan.prepared.pending


def test_the_rehearsal_of_another_is_work_that_can_be_done() -> None:
    warmup_work = Craft(CTL_LAW=PLUMBLINE).onboard.warmup_work
    prepared = warmup_work.paths.run()
    assert warmup_work.setup.run() == warmup_work.setup.run()
    assert not prepared.refusal
    assert {type(path) for path in prepared.paths} >= {PathSegment, ShapedSignals}


def test_in_the_air_where_the_clock_does_not_wait_paths_are_left_to_another() -> None:
    craft = Craft(clock_waits=False, CTL_LAW=PLUMBLINE)
    onboard = craft.onboard
    assert onboard.work is None
    craft.wait(1.0)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0) == ACCEPTED
    craft.run(at_phase(Phase.HOLD))
    upload(craft, Takeoff(2.0), Delay(1.0), EDGE, Land())
    work = onboard.work
    assert work is not None
    assert craft.flight.mission.plan.prepared.pending
    onboard.finish(work, work.run())
    assert onboard.work is None
    assert not craft.flight.mission.plan.prepared.pending
    onboard.finish(work, PENDING)
    assert not craft.flight.mission.plan.prepared.pending, "an answer that nobody waits for"


def flown_to_hold(**settings: float) -> Craft:
    craft = Craft(clock_waits=False, CTL_LAW=PLUMBLINE, **settings)
    craft.wait(1.0)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0) == ACCEPTED
    craft.run(at_phase(Phase.HOLD))
    return craft


def modes(craft: Craft) -> list[tuple[int, int]]:
    """(main, sub) of the HEARTBEATs that were heard, without repetitions."""
    packed = [x.custom_mode for x in craft.heard if x.get_type() == "HEARTBEAT" and x.get_srcComponent() == 1]
    found = [(mode >> 16 & 0xFF, mode >> 24) for mode in packed]
    return [mode for i, mode in enumerate(found) if i == 0 or mode != found[i - 1]]


def test_a_mission_asked_for_right_after_its_upload_in_the_air_begins_by_itself() -> None:
    """There is one answer, immediately: MAVSDK calls its user back at the first, and crashes at a second."""
    craft = flown_to_hold()
    upload(craft, Takeoff(2.0), Delay(1.0), EDGE, Land())
    work = craft.onboard.work
    assert work is not None
    command = mavlink.MAV_CMD_DO_SET_MODE
    assert craft.command(command, 1.0, *PX4_MISSION) == ACCEPTED
    craft.wait(3.0)
    assert (craft.flight.phase, craft.flight.mission.waiting) == (Phase.HOLD, True)
    assert modes(craft)[-1] == PX4_MISSION
    craft.onboard.finish(work, work.run())
    assert craft.flight.mission.active
    craft.run(at_phase(Phase.MISSION))
    assert craft.results(command) == [ACCEPTED]


def test_a_vehicle_stays_armed_while_its_mission_waits_for_paths() -> None:
    """On a busy machine, paths take longer than an armed vehicle without a task stays armed."""
    craft = Craft(clock_waits=False, CTL_LAW=PLUMBLINE)
    craft.wait(1.0)
    upload(craft, Takeoff(2.0), Delay(1.0), EDGE, Land())
    work = craft.onboard.work
    assert work is not None
    craft.begin()
    craft.wait(15.0)
    assert (craft.flight.phase, craft.flight.mission.waiting) == (Phase.ARMED, True)
    craft.onboard.finish(work, work.run())
    craft.run(at_phase(Phase.MISSION))
    assert "Disarmed: no take-off for 10 s" not in craft.texts


@pytest.mark.parametrize("refused", [False, True])
def test_a_vehicle_that_nothing_is_asked_of_is_disarmed(refused: bool) -> None:
    craft = Craft(clock_waits=False, CTL_LAW=PLUMBLINE)
    craft.wait(1.0)
    if refused:
        upload(craft, Takeoff(2.0), Delay(1.0), EDGE, Land())
        work = craft.onboard.work
        assert work is not None
        craft.begin()
        craft.wait(15.0)
        craft.onboard.finish(work, PreparedPaths(refusal="no way", notes=()))
    else:
        assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    craft.run(at_phase(Phase.DISARMED), 11.0)
    assert "Disarmed: no take-off for 10 s" in craft.texts


@pytest.mark.parametrize("early", [False, True], ids=["after", "during"])
def test_a_mission_that_begins_elsewhere_is_prepared_from_there(early: bool) -> None:
    """The paths of an upload begin at home; the start waits for those from where the load hangs, whether it
    comes after the paths of the upload or while these are being prepared."""
    craft = flown_to_hold()
    here = craft.onboard.core.flight.legs[0].jet(0.0)[0]
    beside = Hold((here[0] + 1.0, here[1], here[2]))
    craft.onboard.core.replace_flight(replace(craft.flight, legs=(beside,)))
    upload(craft, Takeoff(2.0), Waypoint(3.0, 0.0, 2.0), Waypoint(3.0, 3.0, 2.0), Land())
    first = craft.onboard.work
    assert first is not None
    if not early:
        craft.onboard.finish(first, first.run())
    assert craft.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    if early:
        craft.onboard.finish(first, first.run())
    assert (craft.flight.phase, craft.flight.mission.waiting) == (Phase.HOLD, True)
    work = craft.onboard.work
    assert isinstance(work, PathWork)
    assert work.begin.state is not None
    assert work.begin.state.expected == beside.position
    craft.onboard.finish(work, work.run())
    assert craft.flight.mission.active
    path = craft.flight.mission.plan.prepared.paths[1]
    assert isinstance(path, PathSegment)
    assert path.start == (beside.position[0], beside.position[1], 2.0)


@pytest.mark.parametrize("in_air", [False, True], ids=["on the ground", "in the air"])
def test_a_mission_that_is_deleted_while_it_waits_no_longer_does(in_air: bool) -> None:
    craft = flown_to_hold() if in_air else Craft(clock_waits=False, CTL_LAW=PLUMBLINE)
    craft.wait(1.0)
    upload(craft, Takeoff(2.0), Delay(1.0), EDGE, Land())
    late = craft.onboard.work
    assert late is not None
    if not in_air:
        assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    assert craft.flight.mission.waiting
    craft.send(mavlink.MAVLink_mission_clear_all_message(1, 1, mavlink.MAV_MISSION_TYPE_ALL))
    craft.wait(0.1)
    assert not craft.flight.mission.waiting
    assert not craft.flight.mission.plan.steps
    craft.onboard.finish(late, late.run())
    craft.wait(1.0)
    assert craft.flight.phase == (Phase.HOLD if in_air else Phase.ARMED)


@pytest.mark.parametrize("outside", [True, False])
def test_a_curve_beyond_the_fence_is_told_after_the_upload(outside: bool) -> None:
    craft = Craft(CTL_LAW=PLUMBLINE, GF_MAX_HOR_DIST=8.5 if outside else 12.0)
    craft.wait(1.0)
    corner = (Waypoint(6.0, 0.0, 2.0), Waypoint(6.0, 6.0, 2.0), Waypoint(-6.0, 6.0, 2.0))
    upload(craft, Takeoff(2.0), Speed(3.0), *corner, Land())
    craft.wait(0.1)
    told = [text for text in craft.texts if text.startswith("Mission will not start: the curve to item ")]
    assert len(told) == outside


def test_a_mission_that_turns_out_not_to_be_flyable_is_told() -> None:
    craft = flown_to_hold()
    upload(craft, Takeoff(2.0), Delay(1.0), EDGE, Land())
    work = craft.onboard.work
    assert work is not None
    assert craft.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    craft.onboard.finish(work, PreparedPaths(refusal="no way", notes=()))
    assert not craft.flight.mission.waiting
    craft.wait(0.1)
    assert any("Mission denied: no way" in x.text for x in craft.heard if x.get_type() == "STATUSTEXT")
    assert craft.flight.phase == Phase.HOLD


def test_a_return_is_shown_until_the_vehicle_is_disarmed() -> None:
    craft = flown_to_hold()
    assert craft.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    begun = len(craft.heard)
    craft.run(at_phase(Phase.DISARMED))
    del craft.heard[:begun]
    assert modes(craft) == [PX4_RTL]


def test_a_landing_in_place_of_a_return_is_shown() -> None:
    craft = flown_to_hold()
    craft.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    craft.run(at_phase(Phase.LOWER))
    assert craft.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    craft.wait(1.1)
    assert modes(craft)[-1] == PX4_LAND


def test_gains_are_designed_by_another_where_the_clock_does_not_wait_and_the_answer_is_prompt() -> None:
    craft = Craft(clock_waits=False, CTL_LAW=PLUMBLINE)
    onboard, name = craft.onboard, "PLB_DELAY_TOL"
    craft.wait(1.0)
    before = onboard.core.setup
    asked = []
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    for value in (14.0, 15.0):
        craft.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind))
        craft.tick()
        told = [m.param_value for m in craft.heard if m.get_type() == "PARAM_VALUE" and m.param_id == name]
        assert told[-1] == value, "at the next tick"
        assert onboard.core.setup is before, "nothing is designed in the loop"
        assert onboard.work is not None
        asked.append(onboard.work)
    onboard.finish(asked[0], None)
    assert onboard.work is asked[1], "the first is of no use any more"
    onboard.finish(asked[1], asked[1].run())
    assert onboard.core.setup.law != before.law
    assert onboard.work is None


def test_a_design_that_failed_leaves_the_gains_and_is_told() -> None:
    craft = Craft(clock_waits=False, CTL_LAW=PLUMBLINE)
    craft.wait(1.0)
    before = craft.onboard.core.setup
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    craft.send(mavlink.MAVLink_param_set_message(1, 1, b"PLB_DELAY_TOL", 14.0, kind))
    craft.tick()
    work = craft.onboard.work
    assert work is not None
    craft.onboard.finish(work, work.failure("the process has died"))
    craft.tick()
    assert craft.onboard.core.setup is before
    assert craft.texts[-1] == "Gains not designed: the old ones are in force"
