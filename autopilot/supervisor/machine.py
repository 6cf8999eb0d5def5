"""The machine: the only code that enters a phase, upon an event of the transition table.

Everything is a function of the flight, the view and the settings.
"""

from __future__ import annotations

from dataclasses import replace

from autopilot.guidance.legs import Leg
from autopilot.supervisor.motion import as_flown, calm, swings
from autopilot.supervisor.phase_legs import ENTRY
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import CARRYING, Event, Flight, Phase, Selected, View
from autopilot.supervisor.step_legs import following_legs
from autopilot.supervisor.table import TRANSITIONS


def happen(flight: Flight, event: Event, view: View, settings: Settings) -> Flight | None:
    """The flight after an event; None if no transition exists."""
    phase = TRANSITIONS.get((flight.phase, event))
    return None if phase is None else _enter(flight, phase, view, settings)


def must_happen(flight: Flight, event: Event, view: View, settings: Settings) -> Flight:
    """The flight after an event for which the present phase has a transition."""
    after = happen(flight, event, view, settings)
    assert after is not None, (flight.phase, event)
    return after


def begin_legs(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight with the legs of its present phase, which had to wait until a swing was damped."""
    legs = as_flown(flight, ENTRY[flight.phase](flight, view, settings))
    return replace(flight, legs=legs, leg_start_us=view.now_us)


def _enter(flight: Flight, phase: Phase, view: View, settings: Settings) -> Flight:
    """The flight in `phase`, with the legs with which the phase begins."""
    legs: tuple[Leg, ...]
    if phase in CARRYING and flight.phase in CARRYING and flight.legs and swings(flight.legs[0]):
        legs = (calm(flight.legs[0], view, settings, ends_step=False),)
    else:
        legs = ENTRY[phase](flight, view, settings) if phase in ENTRY else ()
    entered = replace(
        flight,
        phase=phase,
        phase_start_us=view.now_us,
        legs=as_flown(flight, legs),
        leg_start_us=view.now_us,
        still_since_us=-1,
        following=(),
        returning=phase == Phase.RETURN or (flight.returning and phase in (Phase.LOWER, Phase.SET_DOWN)),
    )
    if phase == Phase.DISARMED:
        return _rewound(entered)
    return replace(entered, following=following_legs(entered, settings))


def _rewound(flight: Flight) -> Flight:
    """The flight with its rotors stopped: nothing selected, the mission rewound."""
    return replace(
        flight,
        selected=Selected.NOTHING,
        heading=flight.heading.at_rest(),
        rotors_lost=0,  # whether they turn is detected after the next start
        mission=replace(flight.mission, active=False, waiting=False, step=0, step_anchor=None),
        cable=replace(flight.cable, reel_to_m=None),
    )
