"""Arming, and why it is refused; disarming, and flight termination."""

from __future__ import annotations

import math
from itertools import chain

from autopilot.geometry.linear import norm
from autopilot.services.records import Verdict
from autopilot.services.requests import Arm, RunPrearmChecks, Terminate
from autopilot.supervisor.heading import heading_before_flight
from autopilot.supervisor.machine import happen, must_happen
from autopilot.supervisor.requests.mission import begin_mission
from autopilot.supervisor.requests.takeoff import take_off
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ON_GROUND,
    Event,
    Flight,
    Phase,
    Selected,
    View,
    beyond_fence,
    off_mission,
)
from autopilot.wire.dialect import plumbline as mavlink

GROUND_SPEED_M_S = 0.3  # a vehicle that moves faster is not armed
TILT_TO_ARM_RAD = math.radians(20.0)


def arming_complaints(flight: Flight, view: View, settings: Settings) -> tuple[str, ...]:
    """What keeps the vehicle from being armed, in words."""
    # `view.complaints` are the estimator's: `autopilot.estimation.filter.complaints`
    found = [*chain.from_iterable(flight.hindrances.values()), *view.complaints]
    if not view.tilt_rad <= TILT_TO_ARM_RAD:
        found.append(f"tilted by {math.degrees(view.tilt_rad):.0f} deg")
    if not norm(view.v_quad) <= GROUND_SPEED_M_S:
        found.append(f"moving at {norm(view.v_quad):.1f} m/s")
    here = view.x_quad if flight.cable.released else view.x_load
    where = beyond_fence(flight, here, settings)
    if where:
        found.append(where)
    return tuple(found)


def arm(flight: Flight, request: Arm, view: View, settings: Settings) -> Decision:
    """Arm, and begin what was selected; or disarm, in the air by force only."""
    if not request.arm:
        if flight.phase == Phase.DISARMED:
            return flight, ACCEPTED
        aloft = flight.phase not in ON_GROUND
        if aloft and not request.force:
            return flight, denied("Disarming denied: in the air")
        after = happen(flight, Event.DISARM, view, settings)
        if after is None:
            return flight, denied("Disarming denied")
        return after, Verdict(ACCEPTED.result, "Disarmed in the air by force", True) if aloft else ACCEPTED
    if flight.phase != Phase.DISARMED:
        return flight, ACCEPTED  # already armed: answered as PX4 and ArduPilot do
    complaints = arming_complaints(flight, view, settings)
    if complaints and not request.force:
        return flight, denied(f"Arming denied: {complaints[0]}")
    after = must_happen(heading_before_flight(flight, view), Event.ARM, view, settings)
    if flight.selected == Selected.MISSION:
        begun, verdict = begin_mission(after, view, settings)
        return (begun if verdict.result == ACCEPTED.result else flight), verdict
    if flight.selected == Selected.TAKEOFF:
        return take_off(after, view, settings), ACCEPTED
    return after, ACCEPTED


def run_checks(flight: Flight, request: RunPrearmChecks, view: View, settings: Settings) -> Decision:
    """Report what keeps the vehicle from being armed, as a warning, by which clients recognise a reason."""
    complaints = arming_complaints(flight, view, settings)
    text = "; ".join(complaints) or "Ready to arm"
    return flight, Verdict(mavlink.MAV_RESULT_ACCEPTED, text, warns=bool(complaints))


def terminate(flight: Flight, request: Terminate, view: View, settings: Settings) -> Decision:
    """Stop the rotors, wherever the vehicle is."""
    after = happen(off_mission(flight), Event.FAIL, view, settings)
    if after is None:
        return flight, ACCEPTED
    return after, ACCEPTED
