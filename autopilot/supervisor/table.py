"""The transition table: the phase to which each event leads.

An event that has no entry for a phase cannot happen in it, and a request for it is refused. Entering a phase,
even the present one again, creates its legs anew (`machine`).
"""

from __future__ import annotations

from autopilot.supervisor.state import IN_AIR, Event, Phase

P, E = Phase, Event
TRANSITIONS: dict[tuple[Phase, Event], Phase] = {
    (P.DISARMED, E.ARM): P.ARMED,
    (P.DISARMED, E.FOUND_IN_FLIGHT): P.HOLD,
    (P.ARMED, E.DISARM): P.DISARMED,
    (P.ARMED, E.TAKEOFF): P.TAUTEN,
    (P.ARMED, E.TAKEOFF_ALONE): P.LIFT,
    (P.ARMED, E.FAIL): P.DISARMED,
    (P.TAUTEN, E.TAUT): P.LIFT,
    (P.TAUTEN, E.LAND): P.SET_DOWN,
    (P.TAUTEN, E.RETURN): P.SET_DOWN,  # the load lies on the ground, and stays there
    (P.TAUTEN, E.RELEASED): P.LIFT,
    (P.LIFT, E.NOT_LIFTED): P.TAUTEN,
    (P.LIFT, E.DONE): P.HOLD,
    (P.LIFT, E.STEP): P.MISSION,
    (P.LIFT, E.LAND_STEP): P.LOWER,
    (P.LIFT, E.HOLD): P.HOLD,
    (P.LIFT, E.GUIDE): P.GUIDED,
    (P.LIFT, E.RETURN): P.RETURN,
    (P.LIFT, E.LAND): P.LOWER,
    (P.LIFT, E.CAUGHT): P.LIFT,
    (P.LIFT, E.CAUGHT_UP): P.LIFT,
    (P.LIFT, E.LOAD_DOWN): P.SET_DOWN,
    (P.LIFT, E.RELEASED): P.LIFT,
    (P.HOLD, E.HOLD): P.HOLD,
    (P.HOLD, E.MISSION): P.MISSION,
    (P.HOLD, E.GUIDE): P.GUIDED,
    (P.HOLD, E.RETURN): P.RETURN,
    (P.HOLD, E.LAND): P.LOWER,
    (P.HOLD, E.CAUGHT): P.HOLD,
    (P.HOLD, E.LOAD_DOWN): P.SET_DOWN,
    (P.HOLD, E.RELEASED): P.HOLD,
    (P.MISSION, E.DONE): P.HOLD,
    (P.MISSION, E.STEP): P.MISSION,
    (P.MISSION, E.LAND_STEP): P.LOWER,
    (P.MISSION, E.HOLD): P.HOLD,
    (P.MISSION, E.GUIDE): P.GUIDED,
    (P.MISSION, E.RETURN): P.RETURN,
    (P.MISSION, E.LAND): P.LOWER,
    (P.MISSION, E.CAUGHT): P.MISSION,
    (P.MISSION, E.CAUGHT_UP): P.MISSION,
    (P.MISSION, E.LOAD_DOWN): P.SET_DOWN,
    (P.RETURN, E.DONE): P.LOWER,
    (P.RETURN, E.HOLD): P.HOLD,
    (P.RETURN, E.MISSION): P.MISSION,
    (P.RETURN, E.GUIDE): P.GUIDED,
    (P.RETURN, E.LAND): P.LOWER,
    (P.RETURN, E.CAUGHT): P.RETURN,
    (P.RETURN, E.CAUGHT_UP): P.RETURN,
    (P.RETURN, E.LOAD_DOWN): P.SET_DOWN,
    (P.RETURN, E.RELEASED): P.RETURN,
    (P.GUIDED, E.GUIDE): P.GUIDED,
    (P.GUIDED, E.OTHER_SETPOINT): P.GUIDED,
    (P.GUIDED, E.HOLD): P.HOLD,
    (P.GUIDED, E.MISSION): P.MISSION,
    (P.GUIDED, E.RETURN): P.RETURN,
    (P.GUIDED, E.LAND): P.LOWER,
    (P.GUIDED, E.CAUGHT): P.GUIDED,
    (P.GUIDED, E.LOAD_DOWN): P.SET_DOWN,
    (P.GUIDED, E.RELEASED): P.GUIDED,
    (P.LOWER, E.STEP): P.MISSION,
    (P.LOWER, E.LAND_STEP): P.LOWER,
    (P.LOWER, E.HOLD): P.HOLD,
    (P.LOWER, E.MISSION): P.MISSION,
    (P.LOWER, E.GUIDE): P.GUIDED,
    (P.LOWER, E.RETURN): P.RETURN,
    (P.LOWER, E.CAUGHT): P.LOWER,
    (P.LOWER, E.LAND): P.LOWER,  # the load is placed no longer, and the flight ends
    (P.LOWER, E.LOAD_DOWN): P.SET_DOWN,
    (P.LOWER, E.LOAD_PLACED): P.MISSION,
    (P.LOWER, E.VEHICLE_DOWN): P.DISARMED,  # without a load
    (P.LOWER, E.RELEASED): P.LOWER,
    (P.SET_DOWN, E.VEHICLE_DOWN): P.DISARMED,
    (P.FAILSAFE, E.DISARM): P.DISARMED,
    **{(phase, E.FAIL): P.FAILSAFE for phase in IN_AIR},
    **{(phase, E.DISARM): P.DISARMED for phase in IN_AIR},  # forced disarming only
}


def markdown() -> str:
    """The table as Markdown: one row per event, one column per phase; empty where the event cannot happen."""
    phases, events = sorted(Phase), list(Event)
    names = [phase.name.lower().replace("_", " ") for phase in phases]
    rows = [["event", *names], ["---"] * (len(phases) + 1)]
    for event in events:
        after = [TRANSITIONS.get((phase, event)) for phase in phases]
        rows.append([event.value, *("" if to is None else names[phases.index(to)] for to in after)])
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)
