"""The machine: the only code that enters a phase, upon an event of the transition table.

Everything is a function of the flight, the view and the settings.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

from autopilot.guidance.legs import Creep, Leg
from autopilot.supervisor.motion import damping_leg, stopped_run_of, tracks_attitude, with_control_modes
from autopilot.supervisor.phase_legs import ENTRY_LEGS
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    IN_AIR,
    UNARMED,
    ActionWhenArmed,
    Event,
    Fall,
    Flight,
    Phase,
    View,
)
from autopilot.supervisor.step_legs import following_legs
from autopilot.supervisor.table import TRANSITIONS

STOPPING_HEIGHT_M = 0.12  # of the load: measured, with 0.02 m of margin


def try_transition(flight: Flight, event: Event, view: View, settings: Settings) -> Flight | None:
    """The flight after an event; None if no transition exists."""
    phase = TRANSITIONS.get((flight.phase, event))
    return None if phase is None else _enter_phase(flight, phase, event, view, settings)


def requested_transition(flight: Flight, event: Event, view: View, settings: Settings) -> Flight | None:
    """As `try_transition`, on request: a load that is almost on the ground is set down first, as the vehicle
    would lay it down while it stops."""
    creeping = flight.phase == Phase.LOWER and isinstance(flight.legs[0], Creep)
    touching = creeping and not flight.cable.released and view.x_load[2] < STOPPING_HEIGHT_M
    return None if touching else try_transition(flight, event, view, settings)


def transition(flight: Flight, event: Event, view: View, settings: Settings) -> Flight:
    """The flight after an event for which the present phase has a transition."""
    after = try_transition(flight, event, view, settings)
    assert after is not None, (flight.phase, event)
    return after


def start_phase_legs(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight with the legs of its present phase, which had to wait until a swing was damped."""
    legs = with_control_modes(flight, ENTRY_LEGS[flight.phase](flight, view, settings))
    return replace(flight, legs=legs, leg_start_us=view.now_us)


def _enter_phase(flight: Flight, phase: Phase, event: Event, view: View, settings: Settings) -> Flight:
    """The flight in `phase`, to which the event has led, with the legs with which the phase begins."""
    legs: tuple[Leg, ...]
    if phase in CARRYING and flight.phase in CARRYING and flight.legs and tracks_attitude(flight.legs[0]):
        legs = (damping_leg(flight.legs[0], view, settings, ends_step=False),)
    else:
        legs = ENTRY_LEGS[phase](flight, view, settings) if phase in ENTRY_LEGS else ()
    if flight.phase == Phase.MISSION and phase != Phase.MISSION:
        stopped_run = stopped_run_of(flight, view, settings, legs) or flight.mission.stopped_run
        flight = replace(flight, mission=replace(flight.mission, stopped_run=stopped_run))
    if phase == Phase.TAUTEN:
        flight = replace(flight, cable=replace(flight.cable, ground_place=view.x_load))
    entered = replace(
        flight,
        phase=phase,
        phase_start_us=view.now_us,
        legs=with_control_modes(flight, legs),
        leg_start_us=view.now_us,
        condition_since_us=-1,
        stopped_height=inf,
        stopped_since_us=-1,
        following=(),
        fall=_fall_after(flight, phase, event),
        # another flight begins
        is_failsafe=flight.is_failsafe and phase != Phase.ARMED,
        answered_charge_state=0 if phase == Phase.ARMED else flight.answered_charge_state,
        rotors_lost_before=0 if phase == Phase.ARMED else flight.rotors_lost_before,
        returning=phase == Phase.RETURN
        or (flight.returning and phase in (Phase.LOWER, Phase.SET_DOWN) and event != Event.LAND),
    )
    if phase == Phase.DISARMED:
        return _reset_on_disarm(entered)
    return replace(entered, following=following_legs(entered, settings))


def _fall_after(flight: Flight, phase: Phase, event: Event) -> Fall:
    """Whether the vehicle falls from now on: its rotors have stopped in the air, not because it stands."""
    if phase not in UNARMED:
        return Fall.NONE
    return Fall.FALLING if flight.phase in IN_AIR and event != Event.VEHICLE_DOWN else flight.fall


def _reset_on_disarm(flight: Flight) -> Flight:
    """The flight with its rotors stopped: nothing selected, the mission rewound."""
    mission = flight.mission
    return replace(
        flight,
        action_when_armed=ActionWhenArmed.NOTHING,
        heading=flight.heading.at_rest(),
        rotors_lost=0,  # whether they turn is detected after the next start
        rotors_lost_before=flight.rotors_lost,
        mission=replace(
            mission,
            active=False,
            waiting=False,
            step=0,
            step_anchor=None,
            stopped_run=None,
            final_item=mission.plan.sequence[0] if mission.done else None,
        ),
        cable=replace(flight.cable, reel_target_m=None, failed_lifts=0, slack_step=-1),
    )
