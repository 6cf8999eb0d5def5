"""Following a target by request."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

from autopilot.geometry.linear import norm
from autopilot.guidance.setpoint_follower import SetpointStream
from autopilot.guidance.target import Target, first_report
from autopilot.services.records import Verdict
from autopilot.services.requests import FollowTarget, SetMode
from autopilot.supervisor.motion import commanded_motion
from autopilot.supervisor.requests.guided import start_guided
from autopilot.supervisor.requests.limits import MAX_DISTANCE_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, temporarily_denied
from autopilot.supervisor.setpoint_source import (
    TARGET_LOSS_US,
    is_target_awaited,
    is_target_lost,
    waiting_for_target,
)
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import ON_GROUND, Flight, SetpointSource, View, fence_problem


def follow_target(flight: Flight, request: FollowTarget, view: View, settings: Settings) -> Decision:
    """Take a report of the target. Ground stations may send it in every mode: it is then only kept. The load
    waits for a target that leads it beyond the fence."""
    if not hypot(*request.position) <= MAX_DISTANCE_M:
        return _not_followed(flight, f"more than {MAX_DISTANCE_M:g} m from home", view)
    target = _reported(flight, request, view, settings)
    setpoint = target.setpoint(settings.target_place)
    known = replace(flight, setpoints=replace(flight.setpoints, target=target))
    fence = fence_problem(flight, setpoint.position, settings)
    if fence:
        return _not_followed(known, fence, view)
    limit_m_s = settings.setpoints.max_speed_m_s
    stream = SetpointStream(setpoint, view.now_us)
    followed = replace(known, setpoints=replace(known.setpoints, beside_target=stream))
    if not flight.follows_target:
        return followed, ACCEPTED
    if norm(target.velocity) > limit_m_s:
        text = f"Target faster than {limit_m_s:g} m/s (MPC_XY_VEL_MAX): it escapes"
        return followed, Verdict(ACCEPTED.result, text, warns=True)
    found = is_target_awaited(flight)
    return followed, Verdict(ACCEPTED.result, "Target found: following it" if found else None)


def _reported(flight: Flight, request: FollowTarget, view: View, settings: Settings) -> Target:
    """The target by this report, and by those before it if it was not lost."""
    motion, before = (request.position, request.velocity, request.accel), flight.setpoints.target
    if before is None or view.now_us - before.at_us > TARGET_LOSS_US:
        return first_report(*motion, view.now_us, commanded_motion(flight, view, settings)[0])
    return before.reported(*motion, view.now_us, settings.target_place)


def _not_followed(flight: Flight, reason: str, view: View) -> Decision:
    """The flight that waits for a target which is where the load may not be; told where it is followed."""
    waiting = waiting_for_target(flight, view.now_us)
    if not flight.follows_target:
        return waiting, ACCEPTED
    return waiting, Verdict(ACCEPTED.result, f"Target not followed: {reason}", warns=True)


def follow_me(flight: Flight, request: SetMode, view: View, settings: Settings) -> Decision:
    """FOLLOWME: accompany the target, or wait for it."""
    name = request.name or "FOLLOWME"
    if flight.phase in ON_GROUND:
        return flight, temporarily_denied(f"{name} denied: take off first")
    is_known = not is_target_awaited(flight) and not is_target_lost(flight, view.now_us)
    ready = flight if is_known else waiting_for_target(flight, view.now_us)
    after, verdict = start_guided(ready, SetpointSource.TARGET, name, view, settings)
    if verdict.result != ACCEPTED.result:
        return flight, verdict
    return after, verdict if is_known else Verdict(ACCEPTED.result, f"{name}: waiting for FOLLOW_TARGET")
