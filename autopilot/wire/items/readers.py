"""Steps of the commands that become more, or less, than one record of their parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator

from autopilot.trajectory.timeline import state_after
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.command import Asked
from autopilot.wire.items.fields import check
from autopilot.wire.items.limits import (
    FARTHEST_M,
    HOME_ROW_M,
    LEAST_REELED_M,
    LONGEST_S,
    LOWEST_M,
    SHORTEST_PERIOD_S,
    TURN_ACCEL_M_S2,
)
from autopilot.wire.items.records import ABSOLUTE_FRAMES
from missions.model import Axis, Land, Release, Signals, Sine, Speed, Step, Term, Waypoint, Winch


def waypoint(asked: Asked) -> Iterator[Step]:
    """A waypoint with its hold; home itself as the first item is not flown."""
    if not asked.is_home_row():
        yield asked.record()


def waypoint_for_a_day(asked: Asked) -> Iterator[Step]:
    """A waypoint that is held for LONGEST_S."""
    if not asked.is_home_row():
        yield Waypoint(asked["east_m"], asked["north_m"], asked["altitude_m"], LONGEST_S)


def turns(asked: Asked) -> Iterator[Step]:
    """A spiral out, turns, a spiral in: an amplitude that rises and falls, times sine and cosine."""
    count, radius = asked["turns"], asked["radius_m"]
    yield Waypoint(asked["east_m"], asked["north_m"], asked["altitude_m"])
    if radius == 0.0 or count == 0.0:
        return
    asked.expect_load()
    speed = min(asked.state.speed_m_s, math.sqrt(TURN_ACCEL_M_S2 * abs(radius)))
    period = max(2.0 * math.pi * abs(radius) / speed, SHORTEST_PERIOD_S)
    quarter = 0.5 * math.pi
    # clockwise seen from above for a positive radius: east as the sine, north as the cosine
    phases: tuple[tuple[Axis, float], ...] = (("x", 0.0 if radius > 0.0 else math.pi), ("y", quarter))
    terms = tuple(
        Term(axis, abs(radius), 0.0, period, count * period, period, (Sine(period, phase),))
        for axis, phase in phases
    )
    yield Signals((count + 2.0) * period, terms)


def gate(asked: Asked) -> Iterator[Step]:
    """A gate, with which a ground station begins and ends a survey: flown to like a waypoint."""
    left_at = asked.state.position
    if asked.item.param2 != 0.0:
        height = asked["altitude_m"]
    elif left_at is not None:
        height = left_at[2]
    else:
        raise asked.refused("a gate without a height, and nothing before it has one")
    yield Waypoint(asked["east_m"], asked["north_m"], height)


def change_altitude(asked: Asked) -> Iterator[Step]:
    """A transfer to another height, straight up or down."""
    sea_level = asked.home.altitude_m if asked["frame"] in ABSOLUTE_FRAMES else 0.0
    height = asked.item.param1 - sea_level
    height = check(asked.seq, 1, "height above home", height, "m", LOWEST_M, FARTHEST_M)
    if asked.state.position is None:
        raise asked.refused("nothing before it says where the load hangs")
    yield Waypoint(asked.state.position[0], asked.state.position[1], height)


def change_speed(asked: Asked) -> Iterator[Step]:
    """The speed of transfers; speeds of climb and descent and "no change" (-1) are ignored."""
    if asked["kind"] in ("airspeed", "ground speed") and asked.item.param2 != -1.0:
        yield Speed(asked["speed_m_s"])


def gripper(asked: Asked) -> Iterator[Step]:
    """Releasing the load is a step; grabbing a load that is held, as some planners write it, is not."""
    asked["gripper"]
    action = asked["action"]
    if action == "release":
        yield Release()
    elif action == "grab" and asked.state.released:
        text = "the load, released before, can be taken on the ground only and not by a mission"
        raise asked.refused(text, mavlink.MAV_MISSION_INVALID_PARAM2)


def winch(asked: Asked) -> Iterator[Step]:
    """A longer or shorter cable, as far as the load stays above the ground."""
    asked["winch"]
    asked["action"]
    step = Winch(asked["length_m"], asked["speed_m_s"])
    left_at = state_after(step, asked.state).position
    if left_at is None:
        raise asked.refused(
            "the load's height is not known there, as after an attitude run; a waypoint first"
        )
    if left_at[2] < LEAST_REELED_M:
        at = f"it would leave the load at {left_at[2]:.2f} m"
        text = f"{at}; must be at least {LEAST_REELED_M} m: begin higher, or reel out less"
        raise asked.refused(text, mavlink.MAV_MISSION_INVALID_PARAM3)
    yield step


def land(asked: Asked) -> Iterator[Step]:
    """A landing; to a place other than where the load hangs, the load is carried first."""
    left_at = asked.state.position
    if asked.is_placed() and asked.state.released and left_at is None:
        text = "nothing between it and the release says how high the vehicle flies; put a waypoint there"
        raise asked.refused(text)
    if asked.is_placed() and left_at is not None:
        east, north = asked["east_m"], asked["north_m"]
        if math.dist((east, north), left_at[:2]) > HOME_ROW_M:
            yield Waypoint(east, north, left_at[2])
    yield Land()
