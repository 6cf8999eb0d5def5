"""What is looked at before a mission is flown: the fence, the load, the winch."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from autopilot.geometry.linear import Vec3, axpy, norm, sub
from autopilot.supervisor.requests.limits import LEAST_ALTITUDE_M
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, forbidden
from autopilot.supervisor.step_legs import LEAST_REEL_M
from missions import model

WAY_M, MOST_PIECES = 0.25, 4000  # at which a way between waypoints is looked at


def leaves_fence(
    flight: Flight, steps: tuple[model.Step, ...], sequence: tuple[int, ...], settings: Settings
) -> str:
    """Which item of a mission leads over the fence, and why; an empty string if none does.

    Places and the straight ways between them are looked at; signals are watched in flight.
    """
    if not settings.fence.action:
        return ""
    here: Vec3 | None = None
    for step, seq in zip(steps, sequence, strict=True):
        match step:
            case model.Takeoff(altitude_m=height):
                places: list[Vec3] = [(0.0, 0.0, height)]
            case model.Waypoint(east_m=east, north_m=north, altitude_m=height):
                there = (east, north, height)
                before = there if here is None else here
                pieces = min(max(1, math.ceil(norm(sub(there, before)) / WAY_M)), MOST_PIECES)
                places = [axpy((k + 1) / pieces, sub(there, before), before) for k in range(pieces)]
            case _:
                continue
        here = places[-1]
        why = next(filter(None, (forbidden(flight.area.fence, place, settings) for place in places)), "")
        if why:
            return f"item {seq} leads {why}"
    return ""


def _ahead(flight: Flight) -> Iterator[tuple[model.Step, int]]:
    """The steps that are still to be flown, each with the mission item it came from."""
    first, plan = flight.mission.step, flight.mission.plan
    return zip(plan.steps[first:], plan.sequence[first:], strict=True)


def needs_load(flight: Flight) -> str:
    """Which item that is still to be flown swings a load that is released by then; an empty string: none."""
    released = flight.cable.released
    for step, seq in _ahead(flight):
        if isinstance(step, model.Release):
            released = True
        elif released and isinstance(step, model.Signals | model.AttitudeRun):
            return f"item {seq} needs the load, which is released"
    return ""


def reels_too_far(flight: Flight, settings: Settings) -> str:
    """Which item that is still to be flown asks too much of the winch; an empty string: none."""
    length = settings.cable_length_m
    for step, seq in _ahead(flight):
        if not isinstance(step, model.Winch):
            continue
        if not settings.winch.usable:
            return f"item {seq}: the law lqr flies one length of the cable"
        if flight.cable.released:
            return f"item {seq} needs the load, which is released"
        if step.speed_m_s is not None and step.speed_m_s > settings.winch.speed_m_s:
            return f"item {seq}: {step.speed_m_s:g} m/s exceeds WNC_SPEED {settings.winch.speed_m_s:g}"
        length += step.length_m
        if flight.cable.reel_to_m is not None:  # taken up again
            length, flight = (
                flight.cable.reel_to_m,
                replace(flight, cable=replace(flight.cable, reel_to_m=None)),
            )
        beyond = reel_trouble(length, math.inf, settings)
        if beyond:
            return f"item {seq}: {beyond}"
    return ""


def reel_trouble(wanted: float, height: float, settings: Settings) -> str:
    """Why the cable may not get so long (m) with the load at that height; an empty string if it may."""
    if not settings.winch.shortest_m - LEAST_REEL_M <= wanted <= settings.winch.longest_m + LEAST_REEL_M:
        limits = (
            f"{settings.winch.shortest_m:g} ... {settings.winch.longest_m:g} m (WNC_LEN_MIN, WNC_LEN_MAX)"
        )
        return f"a cable of {wanted:.2f} m; must be {limits}"
    if height < LEAST_ALTITUDE_M - LEAST_REEL_M:
        return f"load height {height:.2f} m, least {LEAST_ALTITUDE_M} m"
    return ""
