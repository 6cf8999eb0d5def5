"""Loops without end, by DO_JUMP: what is flown in them, and behind them if a ground station leaves them."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import pytest

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import Hold
from autopilot.onboard.onboard import mission_plan
from autopilot.services.mission_store import StoredMission
from autopilot.services.requests import Arm, ReplaceMission, SetCurrent, StartMission
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.requests.mission_checks import mission_begin, remaining_timeline
from autopilot.supervisor.state import MissionPlan, Phase
from autopilot.trajectory.prepare import prepare
from autopilot.trajectory.timeline import MissionState, timeline
from autopilot.trajectory.waypoint_path import PathSegment
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import Disc, Fence
from autopilot.wire.items import (
    MissionItemError,
    WireItem,
    encode_steps,
    endless_loops,
    located_steps,
    read_items,
)
from missions.model import (
    Delay,
    Land,
    Release,
    ReturnHome,
    Signals,
    Step,
    Takeoff,
    Term,
    TurnHeading,
    Waypoint,
    Winch,
)
from tests.doubles.sky import ACCEPTED, SETTINGS, Sky

HOME = Home(47.397742, 8.545594, 488.0)
DELAY, JUMP = mavlink.MAV_CMD_NAV_DELAY, mavlink.MAV_CMD_DO_JUMP


def item(command: int, p1: float, p2: float = 0.0) -> WireItem:
    return WireItem(mavlink.MAV_FRAME_MISSION, command, 0, 1, p1, p2, 0.0, 0.0, 0, 0, 0.0)


def delays_and_jumps(rng: random.Random) -> list[WireItem]:
    """A mission of up to nine items, most of them delays of different lengths, the others jumps."""
    count = rng.randint(3, 9)
    jumps = {seq: rng.randrange(count) for seq in range(1, count) if rng.random() < 0.4}
    return [
        item(JUMP, float(jumps[seq]), rng.choice([-1.0, -1.0, 1.0, 2.0]))
        if seq in jumps
        else item(DELAY, seq + 1.0)
        for seq in range(count)
    ]


Counts = tuple[tuple[int, int], ...]  # by the item of a jump: how often it was taken


def after_item(items: list[WireItem], seq: int, counts: Counts) -> tuple[int, Counts]:
    """The item that follows as ArduPilot and PX4 count jumps: never anew, and without end if that is said."""
    one, taken = items[seq], dict(counts)
    if one.command != JUMP or taken.get(seq, 0) == one.param2:
        return seq + 1, counts
    if one.param2 > 0:
        taken[seq] = taken.get(seq, 0) + 1
    return int(one.param1), tuple(sorted(taken.items()))


def flown_from(items: list[WireItem], seq: int, counts: Counts) -> list[int]:
    """The delays that are flown from an item on, up to thirty."""
    flown: list[int] = []
    for _ in range(200):
        if seq >= len(items) or len(flown) == 30:
            break
        flown += [seq] if items[seq].command == DELAY else []
        seq, counts = after_item(items, seq, counts)
    return flown


def test_steps_follow_one_another_as_the_items_with_any_jumps_in_jumps() -> None:
    """Also for each visit to an item, from which the mission continues if it becomes the present one."""
    rng, compared = random.Random(1), 0
    for _ in range(2000):
        items = delays_and_jumps(rng)
        try:
            steps, visits = read_items(items, HOME)
        except MissionItemError:
            continue
        loops = endless_loops(steps)
        flown, sequence = tuple(one.step for one in steps), tuple(one.last for one in steps)
        plan = MissionPlan(flown, sequence, len(items), loops=loops, visits=visits)

        def walk(step: int | None, plan: MissionPlan = plan) -> tuple[int, ...]:
            found: list[int] = []
            while step is not None and step < len(plan.steps) and len(found) < 30:
                found.append(plan.sequence[step])
                step = plan.next_step(step)
            return tuple(found)

        assert list(walk(0)) == flown_from(items, 0, ())
        expected, todo, known = set(), [(0, ())], set()
        while todo:
            seq, counts = todo.pop()
            if seq >= len(items) or (seq, counts) in known:
                continue
            known.add((seq, counts))
            expected.add((seq, tuple(flown_from(items, seq, counts))))
            todo.append(after_item(items, seq, counts))
            if items[seq].command == JUMP and items[seq].param2 < 0:
                todo.append((seq + 1, counts))
        assert {(visit.item, walk(visit.step)) for visit in visits} == expected
        compared += bool(loops)
    assert compared > 100


LIMITS = SETTINGS.limits._replace(shape_paths=True)
LOOP = (Takeoff(2.0), Waypoint(2.0, 0.0, 2.0), Waypoint(2.0, 2.0, 2.0), Waypoint(0.0, 2.0, 2.5))
BEHIND = (Waypoint(-2.0, -1.0, 1.5), Waypoint(-2.0, 1.0, 1.5), Waypoint(0.0, 0.0, 1.5), Land())


def looping(loop: Sequence[Step] = LOOP, behind: Sequence[Step] = BEHIND, back_to: int = 1) -> list[WireItem]:
    """The items of a loop without end, of the jump, and of what stands behind it."""
    jump = item(JUMP, float(back_to), -1.0)
    repeated = encode_steps(loop, Home())
    return [*repeated, jump, *encode_steps((*loop, *behind), Home())[len(repeated) :]]


def plan_of(items: Sequence[WireItem]) -> MissionPlan:
    return mission_plan(StoredMission(tuple(items)), Home(), LIMITS)


def started(items: Sequence[WireItem]) -> Sky:
    sky = Sky()
    sky.flight = with_plan(sky.flight, plan_of(items))
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    return sky


def longest_move(sky: Sky) -> float:
    """The farthest (m) that the setpoint of the load moves from tick to tick."""
    places = [jet[0] for _, mode, jet in sky.setpoints if mode == mavlink.PLUMBLINE_CONTROL_LOAD_POSITION]
    return max(norm(sub(after, before)) for before, after in pairwise(places))


def test_no_path_leads_out_of_a_loop() -> None:
    plan = plan_of(looping())
    assert [isinstance(path, PathSegment) for path in plan.prepared.paths] == [
        *(False, True, True, True),
        *(False, True, True, False),
    ]
    assert plan.prepared.path_starts == {1: (0.0, 0.0, 2.0), 5: pytest.approx((-2.0, -1.0, 1.5), abs=0.01)}


@pytest.mark.parametrize("back_to", [1, 2])
def test_it_leads_back_along_a_straight_line_wherever_its_first_item_lies_on_a_path(back_to: int) -> None:
    sky = started(looping(back_to=back_to, behind=(Delay(1.0), Land())))
    repeated = range(back_to, 4)
    sky.run(lambda s: len(s.reached) == 4 + 2 * len(repeated))
    assert sky.reached == [0, 1, 2, 3, *repeated, *repeated]
    assert longest_move(sky) < 0.05, "at 1.5 m/s, in 20 ms"


def test_what_follows_is_known_at_the_end_of_the_loop() -> None:
    """The law looks ahead to the way back, not to the item behind the loop."""
    sky = started(looping((Takeoff(2.0), Waypoint(2.0, 0.0, 2.0, 1.0), Waypoint(0.0, 2.0, 2.0, 1.0))))
    sky.run(lambda s: s.flight.mission.step == 2)
    end = sky.flight.following[0].jet(sky.flight.following[0].duration_s)[0]
    assert end == pytest.approx((2.0, 0.0, 2.0), abs=0.01)


@pytest.mark.parametrize("step", [1, 3])
@pytest.mark.parametrize("first", [5, 7])
def test_it_is_left_from_wherever_the_load_is_and_the_mission_ends(step: int, first: int) -> None:
    """For item 5 on a path through all waypoints behind the loop, which has to be made first."""
    sky = started(looping())
    sky.run(lambda s: len(s.reached) > 4 and s.flight.mission.step == step)
    known = len(sky.reached)
    assert sky.ask(SetCurrent(first)).result == ACCEPTED
    assert sky.flight.mission.waiting == (first == 5)
    if first == 5:
        sky.wait(2.0)
        plan = sky.flight.mission.plan
        ahead = remaining_timeline(sky.flight, sky.view, SETTINGS)
        begin = mission_begin(sky.flight, ahead, SETTINGS)
        found = prepare(plan.steps, plan.sequence, LIMITS, begin=begin, loop_ends=plan.loops)
        changed = replace(sky.flight.mission, plan=replace(plan, prepared=found))
        sky.flight = replace(sky.flight, mission=changed)
        assert sky.ask(StartMission(None)).result == ACCEPTED
        assert sky.flight.mission.active
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.reached[known:] == list(range(first, 9))
    assert sky.flight.mission.done
    assert longest_move(sky) < 0.05


def test_a_hold_before_signals_behind_a_loop_is_not_shortened_for_them() -> None:
    edge = Signals(3.0, (Term("y", 0.25, 0.0, 0.8, None, 0.0),))
    loop = (Takeoff(2.0), Waypoint(2.0, 0.0, 2.0, 1.0), Delay(4.0))
    sky = started(looping(loop, (edge, Land())))
    sky.run(lambda s: s.flight.mission.step == 2)
    assert sky.flight.legs[0].duration_s == 4.0


def test_a_hold_behind_a_loop_of_signals_is_not_shortened_for_them() -> None:
    out, back = (Signals(3.0, (Term("y", y_m, 0.0, 0.8, None, 0.0),)) for y_m in (0.25, -0.25))
    sky = started(looping((Takeoff(2.0), Delay(3.0), out, back), (Delay(4.0), Land())))
    sky.run(lambda s: s.flight.mission.step == 1)
    assert sky.ask(SetCurrent(sky.flight.mission.plan.item_count - 2)).result == ACCEPTED
    sky.run(lambda s: isinstance(s.flight.legs[0], Hold))
    assert sky.flight.legs[0].duration_s == 4.0


def test_where_the_load_is_behind_a_loop_is_not_known() -> None:
    steps = (Takeoff(2.0), Waypoint(2.0, 0.0, 2.0), Delay(1.0), Waypoint(1.0, 0.0, 2.0))
    entries = list(timeline(steps, MissionState(), loop_ends=(1,)))
    assert [entry.before.position for entry in entries[1:]] == [(0.0, 0.0, 2.0), None, None]
    assert entries[2].before.expected == (2.0, 0.0, 2.0), "where the loop ends, if nothing else is known"
    assert entries[3].after.position == (1.0, 0.0, 2.0)


def test_a_landing_behind_a_loop_is_flown_to_its_place_also_if_that_is_where_the_loop_ends() -> None:
    place = encode_steps((Waypoint(0.0, 2.0, 2.5),), Home())[0]
    land = place._replace(command=mavlink.MAV_CMD_NAV_LAND, param1=0.0, z=0.0)
    steps = located_steps([*looping(behind=()), land], Home())[len(LOOP) :]
    assert [type(one.step) for one in steps] == [Waypoint, Land]
    assert isinstance(steps[0].step, Waypoint)
    assert steps[0].step.altitude_m == 2.5
    here = land._replace(x=0, y=0)
    assert [one.step for one in located_steps([*looping(behind=()), here], Home())[len(LOOP) :]] == [Land()]


@pytest.mark.parametrize(
    ("behind", "text"),
    [
        (
            WireItem(
                mavlink.MAV_FRAME_MISSION, mavlink.MAV_CMD_DO_WINCH, 0, 1, 1.0, 1.0, 0.2, 0.0, 0, 0, 0.0
            ),
            "the load's height is not known after a jump without end; a waypoint first",
        ),
        (
            item(mavlink.MAV_CMD_DO_CHANGE_ALTITUDE, 3.0, 3.0),
            "nothing before it says where the load hangs",
        ),
    ],
)
def test_what_needs_a_known_place_behind_a_loop_is_refused(behind: WireItem, text: str) -> None:
    with pytest.raises(MissionItemError, match=text) as refused:
        located_steps([*looping(behind=()), behind], Home())
    assert refused.value.seq == len(LOOP) + 1
    waypoint = encode_steps((Waypoint(0.0, 0.0, 2.0),), Home())[0]
    located_steps([*looping(behind=()), waypoint, behind], Home())


def test_the_way_home_as_the_last_item_behind_a_loop_lands() -> None:
    sky = started(looping(behind=(ReturnHome(),)))
    sky.run(lambda s: len(s.reached) > 5)
    assert sky.ask(SetCurrent(5)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert "Home reached, landing" in sky.texts


def test_the_fence_is_checked_behind_the_loop_at_the_upload_and_at_the_start() -> None:
    items = looping(behind=(Waypoint(-4.0, 2.0, 2.5), Land()))
    sky = Sky(settings=replace(SETTINGS, fence=replace(SETTINGS.fence, radius_m=3.5)))
    sky.flight = with_plan(sky.flight, plan_of(items))
    for asked in (ReplaceMission(len(items), located_steps(items, Home())), StartMission(None)):
        verdict = sky.ask(asked)
        assert verdict.result == mavlink.MAV_RESULT_DENIED
        assert str(verdict.text).startswith("Mission denied: item 5 leads beyond the fence")


def test_a_loop_is_not_left_over_the_fence() -> None:
    """From where it ends the way is free, from its first corner it is not."""
    sky = started(looping(behind=(Waypoint(-2.0, 0.0, 2.0), Land())))
    fence = Fence((Disc(False, (-0.5, -0.5), 1.0),))
    sky.run(lambda s: len(s.reached) == 4)
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=fence))
    sky.run(lambda s: s.flight.mission.step == 2)
    verdict = sky.ask(SetCurrent(5))
    text = "Mission item 5 denied: item 5 leads into an exclusion zone of the fence"
    assert (verdict.result, verdict.text) == (mavlink.MAV_RESULT_DENIED, text)
    sky.run(lambda s: s.flight.mission.step == 1)
    assert sky.ask(SetCurrent(5)).result == ACCEPTED


def fenced(items: Sequence[WireItem], radius_m: float = 0.0, fence: Fence | None = None) -> Sky:
    """A vehicle on the ground with these items, a fence of this radius, and this fence."""
    sky = Sky(settings=replace(SETTINGS, fence=replace(SETTINGS.fence, radius_m=radius_m)))
    sky.flight = with_plan(sky.flight, plan_of(items))
    if fence is not None:
        sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=fence))
    return sky


REPEATED = ", when a jump without end repeats it"


def test_the_fence_is_checked_on_the_way_back_of_a_loop_at_the_upload_and_at_the_start() -> None:
    """From its last corner straight to the first: through a zone that no other way meets."""
    items = looping((Takeoff(2.0), *LOOP[1:3], Waypoint(-2.0, 2.0, 2.0)), behind=())
    located = located_steps(items, Home())
    for fence, text in (
        (
            Fence((Disc(False, (0.0, 1.0), 0.4),)),
            f"item 1 leads into an exclusion zone of the fence{REPEATED}",
        ),
        (Fence((Disc(False, (-2.0, 0.0), 0.4),)), None),
    ):
        sky = fenced(items, fence=fence)
        for asked in (ReplaceMission(len(items), located), StartMission(None)):
            verdict = sky.ask(asked)
            assert verdict.text == (text and f"Mission denied: {text}")


@pytest.mark.parametrize("y_m", [0.25, 0.0])
def test_signals_that_lead_farther_with_each_pass_leave_the_fence(y_m: float) -> None:
    """With 0.25 m north in each pass, 10 m are passed in the forty-first; those that come back stay."""
    out = Signals(3.0, (Term("x", 0.25, 0.0, 0.8, 0.5 if y_m == 0.0 else None, 0.8),))
    items = looping((Takeoff(2.0), Delay(1.0), out), behind=())
    verdict = fenced(items, radius_m=10.0).ask(StartMission(None))
    if y_m == 0.0:
        assert verdict.result == ACCEPTED
    else:
        assert str(verdict.text).startswith(f"Mission denied: item {len(items) - 2} leads beyond the fence")
        assert str(verdict.text).endswith(REPEATED)


@pytest.mark.parametrize(("shorter_m", "refused"), [(0.3, False), (0.2, True)])
def test_a_winch_that_reels_out_more_than_in_is_refused(shorter_m: float, refused: bool) -> None:
    """A cable of 0.7 m that becomes 0.1 m longer in each pass would be 3.1 m long in the twenty-second."""
    loop = (Takeoff(4.0), Waypoint(1.0, 0.0, 4.0), Winch(0.3), Waypoint(0.0, 0.0, 4.0), Winch(-shorter_m))
    verdict = fenced(looping(loop, behind=())).ask(StartMission(None))
    if not refused:
        assert verdict.result == ACCEPTED
        return
    assert verdict.result == mavlink.MAV_RESULT_DENIED
    assert verdict.text == (
        "Mission denied: item 2: a cable of 3.10 m; must be 0.3 ... 3 m (WNC_LEN_MIN, WNC_LEN_MAX)" + REPEATED
    )


@pytest.mark.parametrize(
    "needing", [(Signals(3.0, (Term("y", 0.25, 0.0, 0.8, 0.5, 0.8),)),), (Winch(0.2), Winch(-0.2))]
)
def test_a_loop_that_releases_the_load_repeats_nothing_that_needs_it(needing: tuple[Step, ...]) -> None:
    loop = (Takeoff(2.0), Waypoint(2.0, 0.0, 2.0), *needing, Waypoint(1.0, 0.0, 2.0), Release())
    items = looping(loop, behind=())
    with pytest.raises(
        MissionItemError, match="needs the load, which is released before the jump"
    ) as refused:
        located_steps(items, Home())
    assert refused.value.seq == 2
    once = items[:-1]
    assert len(located_steps(once, Home())) == len(loop)


def test_a_loop_that_releases_the_load_goes_on_without_it() -> None:
    loop = (Takeoff(2.0), Waypoint(2.0, 0.0, 2.0), Release(), Waypoint(0.0, 0.0, 2.0))
    sky = started(looping(loop, behind=()))
    sky.run(lambda s: len(s.reached) == 10)
    assert sky.reached == [0, 1, 2, 3, 1, 2, 3, 1, 2, 3]
    assert sky.flight.cable.released


def test_the_nose_turns_between_a_return_and_the_jump_behind_it() -> None:
    yaw = item(mavlink.MAV_CMD_CONDITION_YAW, 90.0)
    home, jump = item(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0), item(JUMP, 1.0, -1.0)
    loop = encode_steps((Takeoff(2.0), Waypoint(2.0, 0.0, 2.0)), Home())
    sky = started([*loop, home, yaw, jump])
    sky.run(lambda s: len(s.reached) >= 9)
    assert sky.reached[:9] == [0, 1, 2, 3, 1, 2, 3, 1, 2]
    (aims,) = filter(None, sky.flight.mission.plan.aims)
    assert aims == ((3, TurnHeading(0.0)),)
    assert [type(one.step) for one in located_steps([*loop, home, yaw], Home())][-1] is ReturnHome, "it lands"
