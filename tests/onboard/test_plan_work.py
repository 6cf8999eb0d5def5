"""Paths take long to prepare: they are left to another where the clock does not wait."""

from __future__ import annotations

from autopilot.supervisor.state import Phase
from autopilot.trajectory.prepare import PENDING
from autopilot.trajectory.shaping import Shaped
from autopilot.trajectory.waypoint_path import Passage
from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import encode_steps
from gcs.clients.missions import MissionUpload
from gcs.clients.operation import Status, Target
from missions.model import Delay, Land, Signals, Takeoff, Term
from tests.doubles.craft import ACCEPTED, Craft, at_phase

PLUMBLINE = 2.0  # CTL_LAW
EDGE = Signals(3.0, (Term("y", 0.25, 0.0, 0.8, None, 0.0),))


def upload(craft: Craft, *steps: Takeoff | Delay | Signals | Land) -> None:
    """A mission, item by item as a ground station sends it."""
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
    onboard.finish(onboard.work, onboard.work.done())
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
    prepared = Craft(CTL_LAW=PLUMBLINE).onboard.rehearsal.done()
    assert not prepared.refusal
    assert {type(path) for path in prepared.made} >= {Passage, Shaped}


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
    onboard.finish(work, work.done())
    assert onboard.work is None
    assert not craft.flight.mission.plan.prepared.pending
    onboard.finish(work, PENDING)
    assert not craft.flight.mission.plan.prepared.pending, "an answer that nobody waits for"


def test_a_vehicle_that_leaves_the_ground_has_the_paths_of_a_short_mission() -> None:
    craft = Craft(clock_waits=False, CTL_LAW=PLUMBLINE)
    craft.wait(1.0)
    upload(craft, Takeoff(2.0), Delay(1.0), EDGE, Land())
    work = craft.onboard.work
    assert work is not None
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0) == ACCEPTED
    assert craft.onboard.work is work
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    assert craft.onboard.work is None
    assert not craft.flight.mission.plan.prepared.pending
