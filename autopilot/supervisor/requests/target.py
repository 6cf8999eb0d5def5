"""Following a target by request."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

from autopilot.geometry.linear import norm
from autopilot.guidance.setpoint_follower import SetpointStream
from autopilot.guidance.target import first_report
from autopilot.services.records import Verdict
from autopilot.services.requests import FollowTarget, SetMode
from autopilot.supervisor.motion import commanded_motion
from autopilot.supervisor.requests.guided import start_guided
from autopilot.supervisor.requests.limits import MAX_DISTANCE_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, temporarily_denied
from autopilot.supervisor.setpoint_source import TARGET_LOSS_US, WAIT, is_target_lost, waiting_for_target
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import ON_GROUND, Flight, Phase, SetpointSource, View, fence_problem


def follow_target(flight: Flight, request: FollowTarget, view: View, settings: Settings) -> Decision:
    """Take a report of the target. Ground stations may send it in every mode: it is then only kept. The load
    waits for a target that leads it beyond the fence."""
    position = request.position
    if not hypot(*position) <= MAX_DISTANCE_M:
        return flight, denied(f"Target refused: more than {MAX_DISTANCE_M:g} m from home")
    known = flight.setpoints.target
    if known is None or view.now_us - known.at_us > TARGET_LOSS_US:
        load = commanded_motion(flight, view, settings)[0]
        target = first_report(position, request.velocity, view.now_us, load)
    else:
        target = known.reported(position, request.velocity, view.now_us, settings.target_place)
    setpoint = target.setpoint(settings.target_place)
    follows = flight.phase == Phase.GUIDED and flight.setpoints.source == SetpointSource.TARGET
    after = replace(flight, setpoints=replace(flight.setpoints, target=target))
    fence = fence_problem(flight, setpoint.position, settings)
    if fence:
        verdict = denied(f"Target refused: {fence}") if follows else ACCEPTED
        return waiting_for_target(after, view.now_us), verdict
    stream = SetpointStream(setpoint, view.now_us)
    limit_m_s = settings.setpoints.max_speed_m_s
    is_too_fast = follows and norm(target.velocity) > limit_m_s
    text = f"Target faster than {limit_m_s:g} m/s (MPC_XY_VEL_MAX): it escapes" if is_too_fast else None
    followed = replace(after, setpoints=replace(after.setpoints, beside_target=stream))
    return followed, Verdict(ACCEPTED.result, text)


def follow_me(flight: Flight, request: SetMode, view: View, settings: Settings) -> Decision:
    """FOLLOWME: accompany the target, or wait for it."""
    name = request.name or "FOLLOWME"
    if flight.phase in ON_GROUND:
        return flight, temporarily_denied(f"{name} denied: take off first")
    waits = flight.setpoints.beside_target.setpoint is WAIT
    is_known = not waits and not is_target_lost(flight, view.now_us)
    ready = flight if is_known else waiting_for_target(flight, view.now_us)
    after, verdict = start_guided(ready, SetpointSource.TARGET, name, view, settings)
    if verdict.result != ACCEPTED.result:
        return flight, verdict
    return after, verdict if is_known else Verdict(ACCEPTED.result, f"{name}: waiting for FOLLOW_TARGET")
