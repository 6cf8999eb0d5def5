"""The fence in flight: what is refused beforehand, and what happens at the fence."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from autopilot.geometry.linear import add, norm, sub
from autopilot.services.requests import (
    Arm,
    EnableFence,
    FollowSetpoint,
    Land,
    Orbit,
    ReplaceMission,
    Reposition,
    ReturnHome,
    RunPrearmChecks,
    SetMode,
    StartMission,
    Takeoff,
)
from autopilot.supervisor.requests.decide import decide
from autopilot.supervisor.state import Phase, View
from autopilot.supervisor.watches.fence import CLEAR_US
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.fence import Disc, Fence, Polygon
from autopilot.wire.items import LocatedStep
from missions import model
from missions.model import Waypoint
from tests.doubles.sky import ACCEPTED, SETTINGS, Sky

SQUARE = Polygon(True, ((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)))
FENCE = Fence((SQUARE, Disc(False, (0.0, 3.0), 1.0)))
DENIED = m.MAV_RESULT_DENIED
NOTHING = (float("nan"),) * 3
LED_OUT = "Fence: would stop outside the fence, holding"
EAST = FollowSetpoint(NOTHING, (2.0, 0.0, 0.0), NOTHING, False)


def fenced(*steps: Any, **changes: Any) -> Sky:
    settings = replace(SETTINGS, fence=replace(SETTINGS.fence, **changes))
    sky = Sky(*steps, settings=settings)
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=FENCE))
    return sky


def eastward(sky: Sky, seconds: float) -> float:
    """Lead the load east by a stream of setpoints; return how far it came."""
    for _ in range(5):
        sky.ask(EAST)
        sky.tick()
    assert sky.ask(SetMode(6, 0)).result == ACCEPTED
    farthest = 0.0
    for _ in range(round(seconds / 0.02)):
        sky.ask(EAST)
        sky.tick()
        farthest = max(farthest, sky.view.x_load[0])
    return farthest


def test_the_load_is_held_within_the_fence() -> None:
    sky = fenced().airborne()
    farthest = eastward(sky, 12.0)
    assert sky.flight.phase == Phase.HOLD
    assert sky.texts[-1] == LED_OUT
    # stopped shortly before the fence: measured 4.89 m
    assert 3.5 < farthest < 5.0
    assert sky.flight.area.breaches == 1


@pytest.mark.parametrize(
    ("action", "phase", "told"),
    [
        (0, Phase.GUIDED, False),
        (1, Phase.GUIDED, True),
        (2, Phase.HOLD, True),
        (3, Phase.RETURN, True),
        (4, Phase.FAILSAFE, True),
        (5, Phase.LOWER, True),
    ],
)
def test_each_action(action: int, phase: Phase, told: bool) -> None:
    sky = fenced(action=action).airborne()
    seen = set()
    for _ in range(5):
        sky.ask(EAST)
        sky.tick()
    sky.ask(SetMode(6, 0))
    for _ in range(300):
        sky.ask(EAST)
        sky.tick()
        seen.add(sky.flight.phase)
    assert phase in seen
    assert seen <= {Phase.GUIDED, phase, Phase.DISARMED}
    assert any("ence" in text for text in sky.texts) == told


@pytest.mark.parametrize(("action", "phase"), [(2, Phase.HOLD), (3, Phase.RETURN), (5, Phase.LOWER)])
def test_each_action_during_the_lift(action: int, phase: Phase) -> None:
    sky = fenced(action=action)
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert sky.ask(Takeoff(6.0)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.LIFT)
    sky.settings = replace(sky.settings, fence=replace(sky.settings.fence, height_m=4.0))
    sky.run(lambda s: s.flight.phase != Phase.LIFT)
    assert sky.flight.phase == phase
    assert sky.texts[-1].startswith("Fence: would stop beyond the fence, GF_MAX_VER_DIST 4 m above home")
    assert sky.view.x_quad[2] < 4.0


@pytest.mark.parametrize("armed", [False, True])
def test_a_takeoff_beyond_it_is_refused(armed: bool) -> None:
    sky = fenced(height_m=4.0)
    if armed:
        assert sky.ask(Arm(True, False)).result == ACCEPTED
    before = sky.flight
    verdict = sky.ask(Takeoff(6.0))
    assert (sky.flight, verdict.result) == (before, DENIED)
    assert verdict.text == (
        "Take-off denied: beyond the fence, GF_MAX_VER_DIST 4 m above home (vehicle at 6.70 m)"
    )
    assert sky.ask(EnableFence(False)).result == ACCEPTED
    assert sky.ask(Takeoff(6.0)).result == ACCEPTED


@pytest.mark.parametrize("force", [False, True])
def test_a_takeoff_that_waits_for_arming_is_refused_if_the_fence_was_lowered_meanwhile(force: bool) -> None:
    sky = fenced()
    assert sky.ask(Takeoff(6.0)).result == ACCEPTED
    sky.settings = replace(sky.settings, fence=replace(sky.settings.fence, height_m=4.0))
    before = sky.flight
    verdict = sky.ask(Arm(True, force))
    assert (sky.flight, verdict.result) == (before, DENIED)
    assert verdict.text == (
        "Take-off denied: beyond the fence, GF_MAX_VER_DIST 4 m above home (vehicle at 6.70 m)"
    )
    assert sky.ask(Takeoff(3.0)).result == ACCEPTED
    assert sky.ask(Arm(True, force)).result == ACCEPTED


def test_a_fence_that_is_switched_off_stops_nobody() -> None:
    sky = fenced().airborne()
    assert sky.ask(EnableFence(False)).result == ACCEPTED
    assert eastward(sky, 12.0) > 6.0
    assert sky.flight.area.breaches == 0
    assert sky.ask(EnableFence(True)).result == ACCEPTED
    sky.wait(0.1)
    assert sky.texts[-1] == "Fence: outside the fence, holding"


def test_distance_and_height() -> None:
    sky = fenced(radius_m=3.0).airborne()
    assert eastward(sky, 10.0) < 3.0
    assert sky.texts[-1] == "Fence: would stop beyond the fence, GF_MAX_HOR_DIST 3 m from home, holding"
    high = fenced(height_m=4.0).airborne()
    assert high.ask(Reposition(None, None, 3.5, True)).result == DENIED  # the vehicle would be at 4.2 m
    assert high.ask(Reposition(None, None, 3.2, True)).result == ACCEPTED


class NoisySky(Sky):
    """A sky in which the estimate of the load's place is `offset_m` farther east."""

    offset_m = 0.0

    def obey(self) -> View:
        there = super().obey()
        return there._replace(x_load=add(there.x_load, (self.offset_m, 0.0, 0.0)))


def noisy(action: int) -> NoisySky:
    """Load and vehicle that hold 5 mm before the line."""
    settings = replace(SETTINGS, fence=replace(SETTINGS.fence, action=action))
    sky = NoisySky(settings=settings).airborne()
    assert sky.ask(Reposition(4.995, 0.0, 2.0, True)).result == ACCEPTED
    sky.wait(15.0)
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=FENCE))
    return sky


@pytest.mark.parametrize(("action", "text"), [(1, "outside the fence"), (2, "outside the fence, holding")])
def test_a_breach_ends_when_nothing_has_crossed_the_line_for_some_time(action: int, text: str) -> None:
    sky = noisy(action)
    for _ in range(20):  # in and out again, for up to 4 s
        sky.offset_m = 0.01
        sky.wait(0.5)
        assert sky.flight.area.breach
        sky.offset_m = 0.0
        sky.wait(4.0)
        assert sky.flight.area.breach == "outside the fence"
    assert sky.texts.count(f"Fence: {text}") == 1
    assert (sky.flight.area.breaches, sky.flight.phase) == (1, Phase.HOLD)
    sky.wait(CLEAR_US * 1e-6 - 3.9)
    assert not sky.flight.area.breach
    sky.offset_m = 0.01
    sky.tick()
    assert sky.texts.count(f"Fence: {text}") == sky.flight.area.breaches == 2


def breached() -> Sky:
    """Held inside the fence, shortly after a breach."""
    sky = fenced().airborne()
    eastward(sky, 6.0)
    assert sky.flight.phase == Phase.HOLD
    assert sky.flight.area.breach
    return sky


def test_a_breach_ends_with_the_fence() -> None:
    sky = breached()
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=Fence()))
    sky.tick()
    assert sky.flight.area.breach == ""
    sky = breached()
    sky.settings = replace(sky.settings, fence=replace(sky.settings.fence, action=0))
    sky.tick()
    assert sky.flight.area.breach == ""


@pytest.mark.parametrize("is_inside", [True, False])
def test_a_breach_of_a_vehicle_that_has_landed_lasts_as_long_as_it_stands_outside(is_inside: bool) -> None:
    sky = breached()
    east = 0.0 if is_inside else 50.0
    fence = Fence((Disc(True, (east, 0.0), 20.0),))
    sky.flight = replace(sky.flight, phase=Phase.DISARMED, legs=())
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=fence))
    sky.tick()
    assert bool(sky.flight.area.breach) != is_inside


def test_who_leads_the_load_out_again_is_stopped_again_before_the_breach_is_over() -> None:
    sky = fenced().airborne()
    west = FollowSetpoint(NOTHING, (-0.5, 0.0, 0.0), NOTHING, False)
    for breaches in (1, 2, 3):
        sky.ask(EAST)
        assert sky.ask(SetMode(6, 0)).result == ACCEPTED
        while sky.flight.phase == Phase.GUIDED:
            sky.ask(EAST)
            sky.tick()
        assert (sky.texts[-1], sky.flight.area.breaches) == (LED_OUT, breaches)
        sky.wait(1.0)
        assert sky.ask(west).result == sky.ask(SetMode(6, 0)).result == ACCEPTED
        for _ in range(40):
            sky.ask(west)
            sky.tick()
        assert sky.flight.area.breach and not sky.flight.area.leads_out
        assert sky.flight.phase == Phase.GUIDED
    assert sky.texts.count(LED_OUT) == 3


def test_noise_does_not_stop_a_load_that_is_led_back_over_the_line() -> None:
    """By setpoints, from outside."""
    sky = NoisySky().airborne()
    assert sky.ask(Reposition(5.3, 0.0, 2.0, True)).result == ACCEPTED
    sky.wait(15.0)
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=FENCE))
    sky.tick()
    west = FollowSetpoint(NOTHING, (-0.3, 0.0, 0.0), NOTHING, False)
    assert sky.ask(west).result == sky.ask(SetMode(6, 0)).result == ACCEPTED
    for k in range(150):
        sky.offset_m = 0.02 * (k % 2)
        sky.ask(west)
        sky.tick()
    assert sky.view.x_load[0] < 4.9
    assert (sky.flight.phase, sky.flight.area.breaches) == (Phase.GUIDED, 1)


@pytest.mark.parametrize(("request_", "phase"), [(ReturnHome(), Phase.RETURN), (Land(), Phase.LOWER)])
def test_a_hold_at_the_fence_ends_no_return_and_no_landing(request_: Any, phase: Phase) -> None:
    sky = fenced(radius_m=30.0).airborne()
    assert sky.ask(Reposition(4.0, 0.0, 2.0, True)).result == ACCEPTED
    sky.wait(15.0)
    assert sky.ask(request_).result == ACCEPTED
    sky.settings = replace(sky.settings, fence=replace(sky.settings.fence, radius_m=3.0))
    sky.tick()
    assert sky.texts[-1] == "Fence: beyond the fence, GF_MAX_HOR_DIST 3 m from home"
    assert sky.flight.phase == phase
    sky.run(lambda sky: sky.flight.phase == Phase.DISARMED)
    assert Phase.HOLD not in sky.phases[sky.phases.index(phase) :]


def test_places_beyond_it_are_refused() -> None:
    sky = fenced().airborne()
    for request in (
        Reposition(6.0, 0.0, 2.0, True),
        Reposition(0.0, 3.0, 2.0, True),
        Orbit(2.5, 1.0, 3.0, 0.0, 2.0),
    ):
        before = sky.flight
        verdict = sky.ask(request)
        assert verdict.result == DENIED and "fence" in (verdict.text or "")
        assert sky.flight == before


def test_a_mission_that_leaves_it_is_refused_with_the_item() -> None:
    steps = (model.Takeoff(2.0), Waypoint(2.0, 0.0, 2.0), Waypoint(6.0, 0.0, 2.0))
    located = tuple(LocatedStep(i, i, step) for i, step in enumerate(steps))
    sky = fenced(*steps)
    verdict = sky.ask(ReplaceMission(3, located))
    assert (verdict.result, verdict.text) == (DENIED, "Mission denied: item 2 leads outside the fence")
    sky.ask(Arm(True, False))
    verdict = sky.ask(StartMission(None))
    assert (verdict.result, verdict.text) == (DENIED, "Mission denied: item 2 leads outside the fence")
    # the way between two good places leads through the exclusion zone
    through = (model.Takeoff(2.0), Waypoint(-3.0, 3.0, 2.0), Waypoint(3.0, 3.0, 2.0))
    verdict = sky.ask(ReplaceMission(3, tuple(LocatedStep(i, i, step) for i, step in enumerate(through))))
    assert verdict.text == "Mission denied: item 2 leads into an exclusion zone of the fence"
    free = fenced(*steps, action=0)
    assert free.ask(ReplaceMission(3, located)).result == ACCEPTED


def test_items_that_switch_the_fence_count_for_the_ways_behind_them() -> None:
    inside, outside = Waypoint(0.0, 0.0, 2.0), Waypoint(8.0, 0.0, 2.0)
    on, off = model.SwitchFence(True), model.SwitchFence(False)
    up, down = model.Takeoff(2.0), model.Land()
    for steps, enabled, why in (
        ((up, off, outside, inside, on, down), True, ""),
        ((up, off, outside, inside, on, outside, down), True, "item 5"),
        ((up, outside, inside, down), False, ""),
        ((up, on, outside, inside, down), False, "item 2"),
        ((up, outside, off, inside, down), True, "item 1"),
    ):
        sky = fenced(*steps)
        sky.ask(EnableFence(enabled))
        located = tuple(LocatedStep(i, i, step) for i, step in enumerate(steps))
        asked = (sky.ask(ReplaceMission(len(steps), located)), sky.ask(StartMission(None)))
        for verdict in asked:
            assert (verdict.result == DENIED) == bool(why), steps
            assert f"Mission denied: {why}" in (verdict.text or "Mission denied: "), steps


@pytest.mark.parametrize("is_off", [True, False])
def test_a_mission_flies_out_while_its_fence_is_off(is_off: bool) -> None:
    out, back = Waypoint(8.0, 0.0, 2.0), Waypoint(0.0, 0.0, 2.0)
    switched = (model.SwitchFence(False), out, back, model.SwitchFence(True))
    sky = fenced(model.Takeoff(2.0), *(switched if is_off else (back,)), model.Land())
    begin = sky.flight.area.fence_enabled
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    seen = set()

    def is_down(sky: Sky) -> bool:
        seen.add(sky.flight.area.fence_enabled)
        return sky.flight.phase == Phase.DISARMED

    sky.run(is_down)
    assert begin and sky.flight.area.fence_enabled
    assert (False in seen) == is_off
    assert sky.flight.area.breaches == 0


def test_no_arming_outside() -> None:
    sky = fenced()
    sky.flight = replace(
        sky.flight, area=replace(sky.flight.area, fence=Fence((Disc(True, (50.0, 0.0), 10.0),)))
    )
    assert sky.ask(Arm(True, False)).text == "Arming denied: outside the fence"
    _, verdict = decide(sky.flight, RunPrearmChecks(), sky.view, sky.settings)
    assert verdict.text == "Not ready to arm: outside the fence"


def test_a_return_does_not_lead_to_a_rally_point_that_the_fence_forbids() -> None:
    rally = ((6.0, 0.0, 0.0), (0.0, 3.0, 0.0), (2.0, 2.0, 0.0))  # outside, in the exclusion zone, allowed
    for action, nearest in ((1, (2.0, 2.0)), (0, (6.0, 0.0))):
        sky = fenced(action=action).airborne()
        sky.ask(Reposition(4.5, 0.0, 2.0, True))
        sky.wait(8.0)
        sky.flight = replace(sky.flight, area=replace(sky.flight.area, rally=rally))
        assert sky.ask(ReturnHome()).result == ACCEPTED
        sky.run(lambda sky: sky.flight.phase == Phase.LOWER)
        assert norm(sub(sky.view.x_load, (*nearest, 2.0))) < 0.01


def test_a_return_leads_to_the_nearest_rally_point() -> None:
    sky = Sky().airborne()
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, rally=((4.0, 0.0, 0.0), (20.0, 0.0, 0.0))))
    sky.ask(Reposition(3.0, 0.0, 2.0, True))
    sky.wait(8.0)
    assert sky.ask(ReturnHome()).result == ACCEPTED
    sky.run(lambda sky: sky.flight.phase == Phase.LOWER)
    assert norm(sub(sky.view.x_load, (4.0, 0.0, 2.0))) < 0.01
