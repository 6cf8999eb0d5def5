"""When the supervisor has nothing to decide: the ticks that pass without it.

After each decision `next_stretch` determines what is flown from here, until when no time limit expires, and
what must stay true meanwhile. `may_need_decision` checks at each tick, in machine code, whether it still is.
If so, `advance` would change nothing. `may_need_decision` may call for a decision needlessly, but never
misses one. What a stretch cannot judge (setpoints, which come at any time, fences, a winch that is being
stopped, loads that are being caught) is decided at every tick.
"""

from __future__ import annotations

from math import inf, isfinite, nan
from typing import NamedTuple

from autopilot.control.records import HeadingReference, State
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, column, norm, sub
from autopilot.geometry.packed import IntPerLane
from autopilot.guidance.heading import EAST_REFERENCE
from autopilot.guidance.legs import (
    LOAD_POSITION,
    QUAD_POSITION,
    CatchLoad,
    Creep,
    LagWait,
    Leg,
    LevelHold,
    PathStop,
    Swing,
    SwingDamping,
    winch_hold_height,
)
from autopilot.guidance.setpoint_follower import TrackAttitude
from autopilot.supervisor.motion import tracks_position
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    IN_AIR,
    ActionWhenArmed,
    Flight,
    Phase,
    can_fly,
    has_fence,
    leg_time_s,
    needs_load_estimate,
)
from autopilot.supervisor.watches.battery import acts_on_charge, due_event
from autopilot.supervisor.watches.cable_pull import PULL_US, SLACK_PULL_SHARE, TAUT_PULL_SHARE
from autopilot.supervisor.watches.fence import NO_ACTION
from autopilot.supervisor.watches.idle import FAILSAFE_DISARM_US, IDLE_DISARM_US
from autopilot.supervisor.watches.slack import LIFT_OFF_US, MIN_GAP
from autopilot.supervisor.watches.tautening import give_up_us, last_setpoint_height, max_load_offset
from autopilot.supervisor.watches.touchdown import (
    LOAD_DEPTH,
    ON_GROUND_DEPTH,
    STILL_SPEED,
    STILL_US,
    STOPPED_RANGE,
    STOPPED_US,
    VEHICLE_DEPTH,
)
from autopilot.trajectory.slack_cable import TOUCH_SPEED
from autopilot.wire.convert.battery import BATTERY_PERIOD_US
from autopilot.wire.periods import next_multiple

UNCONTROLLED = 0  # mode in which no rotor is controlled, besides the control modes of the legs
FOREVER_US = 2**52  # later than any flight lasts
# what else ends a stretch
NO_WATCH, TAUT, LOAD_DOWN, VEHICLE_DOWN = 0, 1, 2, 3


class Stretch(NamedTuple):
    """What is flown from `first_us` on, and what ends it."""

    mode: int  # UNCONTROLLED or a control mode
    idle: bool  # the rotors idle, while none is controlled
    first_us: IntPerLane
    stop_us: IntPerLane  # when it ends at the latest
    period_us: int  # between the ticks for which the setpoints are computed
    watch: int
    threshold: float  # m: of the watch
    offset_limit: float  # m: of the setpoint of a vehicle that pulls its cable taut, beside the load
    condition_met: (
        bool  # the supervisor has already noted that load or vehicle is down, or that the cable pulls
    )
    stopped_height: float  # m, near which the vehicle is known to have stopped; infinite: it sinks
    error_limit: float  # m: of the tracked position; infinite where none is tracked
    load_suspended: bool  # the load should hang on the cable
    taut_length: float  # m, from load to vehicle; while a winch reels, that of the present tick
    load_weight: float  # N
    load_required: bool  # the load must be known for the flight to continue
    released: bool
    tilt_limit: float  # rad; infinite on the ground
    anchor_height: float  # m, held while an attitude is tracked
    upward: Vec3  # attitude modes: where the thrust, or the cable seen from the load, is to point
    thrust: float  # N, commanded with an attitude; NaN: the thrust that holds the height
    heading: HeadingReference
    rotors_lost: int = 0  # bit i: rotor i+1 is known to be lost


def uncontrolled_stretch(until_us: int, now_us: int, idle: bool) -> Stretch:
    """A stretch in which no rotor is controlled."""
    return Stretch(
        mode=UNCONTROLLED,
        idle=idle,
        first_us=now_us,
        stop_us=until_us,
        period_us=1,
        watch=NO_WATCH,
        threshold=0.0,
        offset_limit=0.0,
        condition_met=False,
        stopped_height=inf,
        error_limit=inf,
        load_suspended=False,
        taut_length=0.0,
        load_weight=1.0,
        load_required=False,
        released=False,
        tilt_limit=inf,
        anchor_height=0.0,
        upward=ZERO,
        thrust=nan,
        heading=EAST_REFERENCE,
    )


def next_stretch(
    flight: Flight, settings: Settings, now_us: int, period_us: int, preview_s: float
) -> Stretch:
    """What is flown from this tick on; ticks are `period_us` apart, the law looks ahead by `preview_s`."""
    if flight.phase not in IN_AIR:
        return uncontrolled_stretch(_uncontrolled_end_us(flight, now_us), now_us, flight.phase == Phase.ARMED)
    leg = flight.legs[0]
    load_required = needs_load_estimate(flight)
    load_suspended = flight.phase in CARRYING and not flight.cable.released
    liftoff_end_us = flight.phase_start_us + LIFT_OFF_US
    end_times = [_leg_end_us(flight, leg)]
    if flight.phase == Phase.LIFT and now_us < liftoff_end_us:
        load_suspended = False
        end_times.append(liftoff_end_us)
    elif flight.phase == Phase.LOWER and isinstance(leg, Creep):
        load_suspended = False
    watch, threshold, end_us = _active_watch(flight, leg, settings)
    end_times.append(end_us)
    if _is_decided_at_every_tick(flight, leg, settings):
        end_times.append(now_us)
    if acts_on_charge(settings):  # sweeps read the charge when something is decided
        end_times.append(next_multiple(now_us, BATTERY_PERIOD_US))
    anchor_height, upward, thrust = _attitude(leg, leg_time_s(flight, now_us) + preview_s)
    return Stretch(
        mode=leg.control_mode,
        idle=False,
        first_us=now_us,
        stop_us=min(end_times),
        period_us=max(period_us, 1),
        watch=watch,
        threshold=threshold,
        offset_limit=max_load_offset(settings),
        condition_met=flight.condition_since_us >= 0,
        stopped_height=flight.stopped_height,
        error_limit=settings.failsafe.load_error_limit_m if tracks_position(flight) else inf,
        load_suspended=load_suspended,
        taut_length=flight.cable.taut_length_m,
        load_weight=settings.load_weight_n,
        load_required=load_required,
        released=flight.cable.released,
        tilt_limit=settings.failsafe.tilt_limit_rad,
        anchor_height=anchor_height,
        upward=upward,
        thrust=thrust,
        heading=_heading_reference(flight, leg, preview_s),
        rotors_lost=flight.rotors_lost,
    )


def _uncontrolled_end_us(flight: Flight, now_us: int) -> int:
    """When the next decision is due without a request while no rotor is controlled."""
    if flight.phase == Phase.FAILSAFE:
        return flight.phase_start_us + FAILSAFE_DISARM_US + 1
    if flight.phase == Phase.ARMED:
        # a setpoint may begin the take-off at any tick
        awaits_takeoff = flight.action_when_armed == ActionWhenArmed.OFFBOARD
        return now_us if awaits_takeoff else flight.phase_start_us + IDLE_DISARM_US + 1
    return FOREVER_US


def _is_decided_at_every_tick(flight: Flight, leg: Leg, settings: Settings) -> bool:
    return bool(
        leg.control_mode not in (LOAD_POSITION, QUAD_POSITION)
        or isinstance(leg, CatchLoad | LagWait)
        or flight.cable.slack_since_us >= 0
        or flight.out_of_control_since_us >= 0
        or not can_fly(flight, settings)
        or flight.phase == Phase.GUIDED
        or due_event(flight, settings) is not None
        or (isinstance(leg, PathStop) and winch_hold_height(leg) is not None)
        or not flight.heading.is_settled
        or flight.mission.aimed is not None
        or (settings.fence.action != NO_ACTION and flight.phase in CARRYING and has_fence(flight, settings))
    )


def _active_watch(flight: Flight, leg: Leg, settings: Settings) -> tuple[int, float, int]:
    """What is watched for, its level in m, and when it will have been true for long enough."""
    condition_met = flight.condition_since_us >= 0
    if flight.phase == Phase.TAUTEN and len(flight.legs) == 1 and isinstance(leg, Creep):
        end_us = flight.condition_since_us + PULL_US if condition_met else give_up_us(flight, settings) + 1
        return TAUT, last_setpoint_height(leg, settings), end_us
    if flight.phase in (Phase.LOWER, Phase.SET_DOWN) and isinstance(leg, Creep):
        end_us = flight.condition_since_us + STILL_US if condition_met else FOREVER_US
        if leg.control_mode == LOAD_POSITION:
            return LOAD_DOWN, LOAD_DEPTH + settings.ramp_lag_s * TOUCH_SPEED, end_us
        if flight.stopped_since_us >= 0:
            end_us = min(end_us, flight.stopped_since_us + STOPPED_US)
        return VEHICLE_DOWN, VEHICLE_DEPTH, end_us
    return NO_WATCH, 0.0, FOREVER_US


def _leg_end_us(flight: Flight, leg: Leg) -> int:
    """The first microsecond at which the present leg has ended by the comparison that `advance` makes."""
    if leg.duration_s == inf:
        return FOREVER_US
    end_us = flight.leg_start_us + round(leg.duration_s * 1e6) - 2
    while leg_time_s(flight, end_us) < leg.duration_s:
        end_us += 1
    return end_us


def _attitude(leg: Leg, t: float) -> tuple[float, Vec3, float]:
    """Height to hold, direction and thrust (N; NaN: the one that holds the height) of an attitude leg."""
    if isinstance(leg, LevelHold):
        return 0.0, leg.upward(t), leg.thrust_n
    if not isinstance(leg, Swing | SwingDamping | TrackAttitude):
        return 0.0, ZERO, nan
    thrust = leg.setpoint.thrust_n if isinstance(leg, TrackAttitude) else None
    return leg.anchor[2], leg.upward(t), nan if thrust is None else thrust


def _heading_reference(flight: Flight, leg: Leg, ahead_s: float) -> HeadingReference:
    """The heading `ahead_s` seconds from now; b1 of an attitude that body rates lead."""
    if isinstance(leg, TrackAttitude) and leg.attitude is not None:
        return HeadingReference(column(leg.attitude, 0), ZERO, ZERO)
    return flight.heading.reference(ahead_s)


@kernel
def may_need_decision(
    stretch: Stretch,
    now_us: int,
    state: State,
    known: bool,
    taut: bool,
    load_tracked: bool,
    tilt: float,
    pull: float,
    target: Vec3,
) -> bool:
    """Whether the supervisor might have something to decide at this tick.

    `known`: the estimate is good enough to fly on; `tilt` in rad; `pull` of the cable in N; `target`: the
    position that load or vehicle should have now.
    """
    elapsed = now_us - stretch.first_us
    if now_us >= stretch.stop_us or elapsed % stretch.period_us != 0:
        return True
    if stretch.mode == UNCONTROLLED:
        return False
    finite = (
        isfinite(norm(state.x_quad))
        and isfinite(norm(state.v_quad))
        and isfinite(norm(state.x_load))
        and isfinite(norm(state.v_load))
        and isfinite(pull)
    )
    if not finite or not tilt <= stretch.tilt_limit or not known:
        return True
    tracked = state.x_quad if stretch.mode == QUAD_POSITION else state.x_load
    if not norm(sub(tracked, target)) <= stretch.error_limit:
        return True
    pull_share = pull / stretch.load_weight
    if stretch.load_suspended:
        gap = stretch.taut_length - norm(sub(state.x_quad, state.x_load))
        if not taut or (load_tracked and gap > MIN_GAP and pull_share < SLACK_PULL_SHARE):
            return True
    if stretch.watch == TAUT:
        offset = (state.x_load[0] - target[0], state.x_load[1] - target[1], 0.0)
        if target[2] > stretch.threshold or not norm(offset) <= stretch.offset_limit:
            return True
        return (pull_share > TAUT_PULL_SHARE and taut) != stretch.condition_met
    if stretch.watch == LOAD_DOWN:
        return (state.x_load[2] - target[2] > stretch.threshold) != stretch.condition_met
    if stretch.watch == VEHICLE_DOWN:
        depth = state.x_quad[2] - target[2]
        stopped = depth > stretch.threshold
        down = stopped and (depth > ON_GROUND_DEPTH or abs(state.v_quad[2]) < STILL_SPEED)
        stays = abs(state.x_quad[2] - stretch.stopped_height) <= STOPPED_RANGE
        return down != stretch.condition_met or stopped != stays
    return False
