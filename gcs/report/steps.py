"""A mission in words: a line for each step, from the uploaded items."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from autopilot.wire.command_names import command_name
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import MissionItemError, WireItem, located_steps
from missions.model import (
    AttitudeRun,
    Delay,
    HeadingCommand,
    Land,
    LookAt,
    PlaceLoad,
    Release,
    ReturnHome,
    Signals,
    Speed,
    Step,
    SwitchFence,
    Takeoff,
    Term,
    Trajectory,
    TurnHeading,
    Waypoint,
    Winch,
)

_MAX_TERMS = 3  # of a signal: further terms are only counted


class StepText(NamedTuple):
    """A step in words, and the first and last item from which it was made, both included."""

    first: int
    last: int
    text: str


def step_texts(items: Sequence[WireItem], home: Home) -> list[StepText]:
    """The steps in the order in which they are flown; if they cannot be flown, each item's command name."""
    try:
        found = located_steps(items, home)
    except MissionItemError:
        return [StepText(seq, seq, command_name(item.command)) for seq, item in enumerate(items)]
    texts, released = [], False
    for one in found:
        words = "".join(f"; {_heading(command)}" for _, command in one.aims)
        texts.append(StepText(one.first, one.last, describe(one.step, released) + words))
        released = released or isinstance(one.step, Release)
    return texts


def describe(step: Step, released: bool) -> str:
    """One step as a sentence without a full stop; `released`: the vehicle has released the load."""
    match step:
        case Takeoff():
            return f"Take off{'' if released else ', lift the load'} to {_m(step.altitude_m)}"
        case Waypoint():
            place = f"{_m(step.east_m)} east, {_m(step.north_m)} north, {_m(step.altitude_m)} up"
            held = f", hold for {step.hold_s:g} s" if step.hold_s > 0.0 else ""
            return f"{'Fly' if released else 'Carry the load'} to {place}{held}"
        case Speed():
            limit = "the usual speed" if step.speed_m_s is None else f"{step.speed_m_s:g} m/s"
            return f"From here on at most {limit}"
        case SwitchFence():
            return f"Switch the fence {'on' if step.on else 'off'}"
        case Delay():
            return f"Hold for {step.duration_s:g} s"
        case ReturnHome():
            return "Return to home"
        case Land():
            return "Land" if released else "Set the load down and land"
        case PlaceLoad() if not released:
            return "Lower the load to the ground and release it"
        case Release():
            return "Release the load"
        case Winch():
            speed = "" if step.speed_m_s is None else f" at {step.speed_m_s:g} m/s"
            return f"Make the cable {_m(abs(step.length_m))} {_longer(step.length_m)}{speed}"
        case Signals():
            return f"Fly signals for {step.duration_s:g} s: {_terms(step.terms)}"
        case Trajectory():
            return f"Fly a trajectory of {len(step.points)} points for {step.duration_s:g} s: {_extent(step)}"
        case AttitudeRun():
            return _attitude_run(step)


def _heading(command: HeadingCommand) -> str:
    """What the nose does as a step begins; headings clockwise from north."""
    match command:
        case TurnHeading(relative=True):
            turn = round(math.degrees(command.angle_rad))
            return f"nose turned by {abs(turn)}° to the {'left' if turn > 0 else 'right'}"
        case TurnHeading():
            return f"nose to {round(90.0 - math.degrees(command.angle_rad)) % 360}°"
        case LookAt(east_m, north_m) if east_m is not None and north_m is not None:
            return f"nose towards {_m(east_m)} east, {_m(north_m)} north"
        case _:
            return "nose no longer towards a place"


def _terms(terms: Sequence[Term]) -> str:
    named = [_term(term) for term in terms[:_MAX_TERMS]]
    more = len(terms) - len(named)
    return "; ".join([*named, *([f"and {more} more"] if more else [])])


def _term(term: Term) -> str:
    sines = "".join(f" × sine of {factor.period_s:g} s" for factor in term.factors)
    return f"{_m(term.amplitude_m)} along {term.axis}{sines}"


def _extent(step: Trajectory) -> str:
    """Where its points are, relative to its beginning."""
    axes = zip(("east", "north", "up"), *(point[1:] for point in step.points), strict=True)
    return ", ".join(f"{min(places):.2f} to {max(places):.2f} m {name}" for name, *places in axes)


def _attitude_run(step: AttitudeRun) -> str:
    what = "cable" if step.controlled == "load" else "vehicle"
    tilt = math.degrees(math.hypot(step.tilt_north_rad, step.tilt_east_rad))
    return f"Lean the {what} by {tilt:.3g}° and back within {step.duration_s:g} s"


def _longer(length_m: float) -> str:
    return "longer" if length_m > 0.0 else "shorter"


def _m(value: float) -> str:
    return f"{round(value, 2) + 0.0:g} m"
