"""Arming, and why it is refused; disarming, and flight termination."""

from __future__ import annotations

import math
from itertools import chain

from autopilot.geometry.linear import norm
from autopilot.services.records import Verdict
from autopilot.services.requests import Arm, RunPrearmChecks, Terminate
from autopilot.supervisor.heading import with_heading_before_flight
from autopilot.supervisor.machine import transition, try_transition
from autopilot.supervisor.requests.mission import start_at_current_step
from autopilot.supervisor.requests.modes import hold
from autopilot.supervisor.requests.takeoff import start_takeoff, takeoff_problem
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, temporarily_denied
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ON_GROUND,
    UNARMED,
    ActionWhenArmed,
    Event,
    Fall,
    Flight,
    Phase,
    View,
    fence_problem,
    interrupt_mission,
    lost_rotors_text,
)
from autopilot.supervisor.watches.idle import FAILSAFE_DISARM_US
from autopilot.wire.dialect import plumbline as mavlink

GROUND_SPEED_M_S = 0.3  # a vehicle that moves faster is not armed
TILT_TO_ARM_RAD = math.radians(20.0)


def arming_problems(flight: Flight, view: View, settings: Settings) -> tuple[str, ...]:
    """What keeps the vehicle from being armed, in words."""
    # `view.estimate_problems` are the estimator's: `autopilot.estimation.filter.problem_texts`
    problems = [*chain.from_iterable(flight.external_arming_problems.values()), *view.estimate_problems]
    if flight.fall == Fall.FALLING:
        problems.insert(0, "falling, not at rest yet")
    if flight.phase == Phase.FAILSAFE:
        left_s = 1e-6 * (flight.phase_start_us + FAILSAFE_DISARM_US - view.now_us)
        problems.insert(0, f"flight terminated, wait {left_s:.1f} s")
    if not view.tilt_rad <= TILT_TO_ARM_RAD:
        problems.append(f"tilted by {math.degrees(view.tilt_rad):.0f} deg")
    if not norm(view.v_quad) <= GROUND_SPEED_M_S:
        found = f"moving at {norm(view.v_quad):.1f} m/s (at most {GROUND_SPEED_M_S})"
        problems.append(f"{found}: hold it still, or wait for less wind")
    if flight.low_battery is not None and flight.is_battery_empty:
        problems.append(f"battery nearly empty, {flight.low_battery.percent} % left")
    if flight.rotors_lost_before:
        lost = lost_rotors_text(flight.rotors_lost_before)
        problems.append(f"{lost} did not follow the commands of the last flight")
    weight_n = settings.weight_n - (settings.load_weight_n if flight.cable.released else 0.0)
    if weight_n >= settings.rotors.greatest_thrust_n:
        problems.append(
            f"cannot hover, weighs {weight_n:.2f} N, rotors give {settings.rotors.greatest_thrust_n:.2f} N"
        )
    here = view.x_quad if flight.cable.released else view.x_load
    fence_reason = fence_problem(flight, here, settings)
    if fence_reason:
        problems.append(fence_reason)
    return tuple(problems)


def arm(flight: Flight, request: Arm, view: View, settings: Settings) -> Decision:
    """Arm, and begin what was selected; or disarm, in the air by force only, and select nothing."""
    if not request.arm:
        if flight.phase == Phase.DISARMED:
            return hold(flight, request, view, settings)
        if flight.phase == Phase.FAILSAFE and not request.force:
            return flight, ACCEPTED  # the rotors stand already
        in_air = flight.phase not in ON_GROUND
        if in_air and not request.force:
            return flight, denied("Disarming denied: in the air")
        after = try_transition(flight, Event.DISARM, view, settings)
        if after is None:
            return flight, denied("Disarming denied")
        return after, Verdict(ACCEPTED.result, "Disarmed in the air by force", True) if in_air else ACCEPTED
    if flight.phase not in UNARMED:
        return flight, ACCEPTED  # already armed: answered as PX4 and ArduPilot do
    problems = arming_problems(flight, view, settings)
    if flight.phase == Phase.FAILSAFE:
        return flight, temporarily_denied(f"Arming denied: {problems[0]}")
    if problems and not request.force:
        return flight, denied(f"Arming denied: {problems[0]}")
    after = transition(with_heading_before_flight(flight, view), Event.ARM, view, settings)
    if flight.action_when_armed == ActionWhenArmed.MISSION:
        started, verdict = start_at_current_step(after, view, settings)
        return (started if verdict.result == ACCEPTED.result else flight), verdict
    if flight.action_when_armed == ActionWhenArmed.TAKEOFF:
        # the fence may have been changed since the take-off was requested
        problem = takeoff_problem(after, after.mission.takeoff_altitude_m, view, settings)
        if problem:
            return flight, denied(f"Take-off denied: {problem}")
        return start_takeoff(after, view, settings), ACCEPTED
    return after, ACCEPTED


def run_checks(flight: Flight, request: RunPrearmChecks, view: View, settings: Settings) -> Decision:
    """Report what keeps the vehicle from being armed, as a warning, by which clients recognise a reason."""
    if flight.phase not in UNARMED:
        return flight, temporarily_denied("Pre-arm checks denied: armed")
    problems = arming_problems(flight, view, settings)
    text = f"Not ready to arm: {'; '.join(problems)}" if problems else "Ready to arm"
    return flight, Verdict(mavlink.MAV_RESULT_ACCEPTED, text, warns=bool(problems))


def terminate(flight: Flight, request: Terminate, view: View, settings: Settings) -> Decision:
    """Stop the rotors, wherever the vehicle is."""
    after = try_transition(interrupt_mission(flight), Event.FAIL, view, settings)
    if after is None:
        return flight, ACCEPTED
    return after, Verdict(ACCEPTED.result, "Flight terminated by command, rotors stopped", warns=True)
