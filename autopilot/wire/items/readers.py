"""Steps of the commands that become more, or less, than one record of their parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator

from autopilot.trajectory.timeline import LOOP, state_after
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.command import ItemContext
from autopilot.wire.items.fields import check
from autopilot.wire.items.limits import (
    FARTHEST_M,
    HOME_ITEM_RADIUS_M,
    LONGEST_S,
    LOWEST_M,
    MIN_REELED_HEIGHT_M,
    SHORTEST_PERIOD_S,
    TURN_ACCEL_M_S2,
)
from autopilot.wire.items.records import ABSOLUTE_FRAMES, GLOBAL_FRAMES
from missions.model import (
    Axis,
    Delay,
    Land,
    PlaceLoad,
    Release,
    Signals,
    Sine,
    Speed,
    Step,
    Term,
    Waypoint,
    Winch,
)


def waypoint(context: ItemContext) -> Iterator[Step]:
    """A waypoint with its hold; home itself as the first item is not flown."""
    if not context.is_home_item():
        yield context.record()


def loiter(context: ItemContext) -> Iterator[Step]:
    """A waypoint with its hold, or a hold."""
    if not context.is_home_item():
        yield _loiter_step(context, context["hold_s"])


def loiter_to_altitude(context: ItemContext) -> Iterator[Step]:
    """A waypoint, or a transfer straight up or down."""
    if not context.is_home_item():
        yield _loiter_step(context, 0.0)


def _loiter_step(context: ItemContext, hold_s: float) -> Step:
    """The way to the place of a loiter and the hold there. An item without a place means where the load hangs
    then, and without a height too, at this height."""
    if context.item.frame not in GLOBAL_FRAMES or context.has_position():
        return Waypoint(context["east_m"], context["north_m"], context["altitude_m"], hold_s)
    if context.item.z == 0.0:
        return Delay(hold_s)
    east, north = _present_place(context)
    return Waypoint(east, north, context["altitude_m"], hold_s)


def _present_place(context: ItemContext) -> tuple[float, float]:
    """Where the load hangs before the item, east and north."""
    if context.state.position is None:
        raise context.refusal("nothing before it says where the load hangs")
    return context.state.position[:2]


def loiter_unlimited(context: ItemContext) -> Iterator[Step]:
    """A waypoint that is held for LONGEST_S."""
    if not context.is_home_item():
        yield _loiter_step(context, LONGEST_S)


def loiter_turns(context: ItemContext) -> Iterator[Step]:
    """A spiral out, turns, a spiral in: an amplitude that rises and falls, times sine and cosine."""
    count, radius = context["turns"], context["radius_m"]
    yield _loiter_step(context, 0.0)
    if radius == 0.0 or count == 0.0:
        return
    context.expect_load()
    speed = min(context.state.speed_m_s, math.sqrt(TURN_ACCEL_M_S2 * abs(radius)))
    period = max(2.0 * math.pi * abs(radius) / speed, SHORTEST_PERIOD_S)
    duration_s = (count + 2.0) * period
    if duration_s > LONGEST_S:
        text = f"its turns would take {duration_s:.0f} s; must take at most {LONGEST_S:.0f} s"
        raise context.refusal(text)
    quarter = 0.5 * math.pi
    # clockwise seen from above for a positive radius: east as the sine, north as the cosine
    phases: tuple[tuple[Axis, float], ...] = (("x", 0.0 if radius > 0.0 else math.pi), ("y", quarter))
    terms = tuple(
        Term(axis, abs(radius), 0.0, period, count * period, period, (Sine(period, phase),))
        for axis, phase in phases
    )
    yield Signals(duration_s, terms)


def gate(context: ItemContext) -> Iterator[Step]:
    """A gate, with which a ground station begins and ends a survey: flown to like a waypoint."""
    load_position = context.state.position
    if context.item.param2 != 0.0:
        height = context["altitude_m"]
    elif load_position is not None:
        height = load_position[2]
    else:
        raise context.refusal("a gate without a height, and nothing before it has one")
    yield Waypoint(context["east_m"], context["north_m"], height)


def change_altitude(context: ItemContext) -> Iterator[Step]:
    """A transfer to another height, straight up or down."""
    sea_level = context.home.altitude_m if context["frame"] in ABSOLUTE_FRAMES else 0.0
    height = context.item.param1 - sea_level
    height = check(context.seq, 1, "height above home", height, "m", LOWEST_M, FARTHEST_M)
    yield Waypoint(*_present_place(context), height)


def change_speed(context: ItemContext) -> Iterator[Step]:
    """The speed of transfers; speeds of climb and descent and "no change" (-1) are ignored."""
    if context["kind"] in ("airspeed", "ground speed") and context.item.param2 != -1.0:
        yield Speed(context["speed_m_s"])


def jump_tag(context: ItemContext) -> Iterator[Step]:
    """A tag, to which jumps lead, is nothing to fly."""
    context["tag"]
    yield from ()


def gripper(context: ItemContext) -> Iterator[Step]:
    """Releasing the load is a step; grabbing a load that is held, as some planners write it, is not."""
    context["gripper"]
    action = context["action"]
    if action == "release":
        yield Release()
    elif action == "grab" and context.state.released:
        text = "the load, released before, can be taken on the ground only and not by a mission"
        raise context.refusal(text, mavlink.MAV_MISSION_INVALID_PARAM2)


def payload_place(context: ItemContext) -> Iterator[Step]:
    """Placing the load on the ground; at a place that is named, the load is carried there first."""
    context.expect_load()
    if context.has_position():
        descent_m, height_m = context["descent_m"], context["altitude_m"]
        if 0.0 < descent_m < height_m:
            text = f"a descent of {descent_m:g} m at most does not reach the ground, {height_m:g} m below"
            raise context.refusal(f"{text}; 0: as far as it is", mavlink.MAV_MISSION_INVALID_PARAM1)
        yield Waypoint(context["east_m"], context["north_m"], height_m)
    yield PlaceLoad()


def winch(context: ItemContext) -> Iterator[Step]:
    """A longer or shorter cable, as far as the load stays above the ground."""
    context["winch"]
    context["action"]
    step = Winch(context["length_m"], context["speed_m_s"])
    end_position = state_after(step, context.state).position
    if end_position is None:
        reason = context.state.unknown_after
        where = f"not known after {reason}" if reason else "not given by any item before it"
        raise context.refusal(f"the load's height is {where}; a waypoint first")
    if end_position[2] < MIN_REELED_HEIGHT_M:
        at = f"it would leave the load at {end_position[2]:.2f} m"
        text = f"{at}; must be at least {MIN_REELED_HEIGHT_M} m: begin higher, or reel out less"
        raise context.refusal(text, mavlink.MAV_MISSION_INVALID_PARAM3)
    yield step


def land(context: ItemContext) -> Iterator[Step]:
    """A landing; to a place other than where the load hangs, the load is carried first. Behind a loop, which
    may be left anywhere, it is carried in any case, at the height at which the loop ends."""
    is_behind_loop = context.state.unknown_after == LOOP
    load_position = context.state.expected if is_behind_loop else context.state.position
    if context.has_position() and context.state.released and load_position is None:
        text = "nothing between it and the release says how high the vehicle flies; put a waypoint there"
        raise context.refusal(text)
    if context.has_position() and load_position is not None:
        east, north = context["east_m"], context["north_m"]
        if is_behind_loop or math.dist((east, north), load_position[:2]) > HOME_ITEM_RADIUS_M:
            yield Waypoint(east, north, load_position[2])
    yield Land()
