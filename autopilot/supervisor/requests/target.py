"""Following a target by request."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

from autopilot.guidance.setpoint_follower import SetpointStream
from autopilot.guidance.target import first_report
from autopilot.services.records import Verdict
from autopilot.services.requests import FollowTarget, SetMode
from autopilot.supervisor.motion import commanded_motion
from autopilot.supervisor.requests.guided import start_guided
from autopilot.supervisor.requests.limits import MAX_DISTANCE_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, temporarily_denied
from autopilot.supervisor.setpoint_source import TARGET_LOSS_US, is_target_lost, waiting_for_target
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import ON_GROUND, Flight, SetpointSource, View


def follow_target(flight: Flight, request: FollowTarget, view: View, settings: Settings) -> Decision:
    """Take a report of the target. Ground stations may send it in every mode: it is then only kept."""
    position = request.position
    if not hypot(*position) <= MAX_DISTANCE_M:
        return flight, denied(f"Target refused: more than {MAX_DISTANCE_M:g} m from home")
    known = flight.setpoints.target
    if known is None or view.now_us - known.at_us > TARGET_LOSS_US:
        load = commanded_motion(flight, view, settings)[0]
        target = first_report(position, request.velocity, view.now_us, load)
    else:
        target = known.reported(position, request.velocity, view.now_us, settings.target_place)
    beside = SetpointStream(target.setpoint(settings.target_place), view.now_us)
    return replace(flight, setpoints=replace(flight.setpoints, target=target, beside_target=beside)), ACCEPTED


def follow_me(flight: Flight, request: SetMode, view: View, settings: Settings) -> Decision:
    """FOLLOWME: accompany the target, or wait for it."""
    name = request.name or "FOLLOWME"
    if flight.phase in ON_GROUND:
        return flight, temporarily_denied(f"{name} denied: take off first")
    is_known = flight.setpoints.target is not None and not is_target_lost(flight, view.now_us)
    ready = flight if is_known else waiting_for_target(flight, view.now_us)
    after, verdict = start_guided(ready, SetpointSource.TARGET, name, view, settings)
    if verdict.result != ACCEPTED.result:
        return flight, verdict
    return after, verdict if is_known else Verdict(ACCEPTED.result, f"{name}: waiting for FOLLOW_TARGET")
