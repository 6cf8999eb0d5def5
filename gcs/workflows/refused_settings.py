"""Why a flight is refused whose mission the check before it has passed: the settings of the flight."""

from __future__ import annotations

from dataclasses import replace

from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import autopilot_parameters
from gcs.clients.flight import Outcome
from gcs.workflows.flight_options import FlightOptions, parse_setting

_OF_A_MISSION = "Mission denied: item "
_GROUPS = ("VEH_", "MIS_")  # of the parameters that decide which paths are possible


def with_blamed_settings(outcome: Outcome, options: FlightOptions) -> Outcome:
    """The outcome; if the mission is refused, also with the settings that the check before the flight does
    not know, since it has passed the mission with the values of the vehicle."""
    was_checked = not (options.force or options.allows_infeasible or options.planner)
    if outcome.name != "refused" or _OF_A_MISSION not in outcome.reason or not was_checked:
        return outcome
    own = autopilot_parameters(load_belief(options.vehicle))
    changed = [
        f"{name} is {own[name]:g} and not {value:g}"
        for name, value in map(parse_setting, options.settings)
        if name.startswith(_GROUPS) and name in own and value != own[name]
    ]
    if not changed:
        return outcome
    text = (
        f"the check before the flight passes it for vehicle {options.vehicle}, whose {', '.join(changed)}: "
        "choose values nearer to those of the vehicle, or change the mission"
    )
    return replace(outcome, reason=f"{outcome.reason}; {text}")
