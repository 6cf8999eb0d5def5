"""Where the load is after each step of a mission, how long its cable is, and how long the step takes.

The only interpreter of steps: upload checks, fence and winch checks before flight, preparation of paths,
feasibility and the legs of the flight all use it to find where a step leads, so that they cannot differ.

Positions are in m, ENU. They are the load's until it is released, and the vehicle's afterwards.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from math import dist, pi, sqrt

from autopilot.geometry.linear import ZERO, Vec3, add, dot
from autopilot.trajectory.descent import descent_pace
from autopilot.trajectory.load_path import evaluate_load_path, path_tables
from autopilot.trajectory.slack_cable import set_down_duration_s, tauten_duration_s
from autopilot.trajectory.transfer import Pace, lift_pace, pace
from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    Mission,
    PlaceLoad,
    Release,
    ReturnHome,
    Signals,
    Speed,
    Step,
    SwitchFence,
    Takeoff,
    Trajectory,
    Waypoint,
    Winch,
)
from missions.places import place_after

# Estimates, only for progress bars and time-outs: what the autopilot needs, besides the vehicle's motion, to
# detect that the cable is taut, and the touch-downs of load and vehicle.
DETECTION_S = 3.0
USUAL_CABLE_M = 0.7  # of a vehicle whose cable is not given
REEL_M_S = 0.3  # default speed of a winch
RELEASE_S = 2.0  # hold after the load was released: the vehicle jumps up and comes back
# of transfers, by default (MIS_SPEED, MIS_ACCEL)
SPEED_M_S, ACCEL_M_S2 = 1.5, 1.5
# a move of the load takes at least this many periods of its pendulum, however short it is
MIN_MOVE_PERIODS = 1.2
GRAVITY_M_S2 = 9.81
AT_REST_M2_S2 = 1e-4  # squared speed at which signals that end count as at rest


LOOP = "a jump without end"  # what makes a position unknown
MIN_REEL_M = 1e-4  # a winch this near to its length has nothing to do


def cable_length_problem(target_m: float, min_length_m: float, max_length_m: float) -> str:
    """Why a winch refuses this cable length, given WNC_LEN_MIN and WNC_LEN_MAX; empty if it does not."""
    if min_length_m - MIN_REEL_M <= target_m <= max_length_m + MIN_REEL_M:
        return ""
    limits = f"{min_length_m:.4g} ... {max_length_m:.4g} m (WNC_LEN_MIN, WNC_LEN_MAX)"
    return f"a cable of {target_m:.2f} m; must be {limits}"


def min_move_duration(cable_length: float, gravity: float) -> float:
    """Least duration (s) of a move that carries the load.

    With a limit of the acceleration alone, a short move would be quick: 5 cm would take 0.7 s, and its higher
    derivatives would turn the vehicle over. Measured with the cascade of the thesis and true rotor limits at
    0.7 m of cable: lost below 0.9 s, tension down to a third at 1.3 s, no rotor at its limit from 2 s on.
    """
    return MIN_MOVE_PERIODS * 2.0 * pi * sqrt(cable_length / gravity)


@dataclass(frozen=True, slots=True)
class VerticalSpeeds:
    """Speeds (m/s) at which the slack cable is pulled taut, at which the load is lifted and lowered unless
    the mission's speed is less, and at which it is lowered far above the ground; the defaults are those of
    MIS_TAUT_SPEED, MIS_LIFT_SPEED and MPC_Z_V_AUTO_DN."""

    tauten_m_s: float = 0.15
    lift_m_s: float = 0.8
    descent_m_s: float = 1.5


USUAL_SPEEDS = VerticalSpeeds()


@dataclass(frozen=True, slots=True)
class MissionState:
    """The state that the steps of a mission change, between two steps.

    `expected` is the best guess of the position; None: the mission may begin anywhere. `unknown_after` names
    what makes it only a guess and not where a setpoint comes to rest: after an attitude run it is unknown how
    far the load has drifted, and a release leaves the vehicle about a cable length above where the load hung.
    """

    expected: Vec3 | None = ZERO
    unknown_after: str = ""
    cable_m: float | None = None  # None: not given
    released: bool = False
    fence_on: bool = True  # the fence is not switched off
    speed_m_s: float = SPEED_M_S  # peak speed of transfers
    usual_speed_m_s: float = SPEED_M_S  # the same where the mission sets none

    @property
    def position(self) -> Vec3 | None:
        """The position of the setpoint; None if it is unknown."""
        return None if self.unknown_after else self.expected

    def behind_loop(self) -> MissionState:
        """The state of what follows a loop that ends so: the loop may be left anywhere."""
        # a release leaves the height unknown as well
        return self if self.released and self.unknown_after else replace(self, unknown_after=LOOP)


AT_ORIGIN = MissionState()
ANYWHERE = MissionState(expected=None)


@dataclass(frozen=True, slots=True)
class TimelineEntry:
    """A step with the states before and after it, and its expected duration.

    `transfer` is the pace at which the load travels from rest to rest; 0 s if it does not.
    `home` is the place to which a return leads, None for other steps.
    """

    item: int
    step: Step
    before: MissionState
    after: MissionState
    transfer: Pace
    duration_s: float
    home: Vec3 | None = None

    @property
    def transfer_s(self) -> float:
        """Time in which the load travels from rest to rest."""
        return self.transfer.duration_s

    @property
    def begin(self) -> Vec3:
        """The expected position before the step; the origin if nothing is known."""
        return self.before.expected or ZERO

    @property
    def end(self) -> Vec3:
        """The expected position after the step; the origin if nothing is known."""
        return self.after.expected or ZERO


def timeline(
    steps: Iterable[Step],
    start: MissionState = AT_ORIGIN,
    home: Vec3 = ZERO,
    accel_m_s2: float = ACCEL_M_S2,
    vertical: VerticalSpeeds = USUAL_SPEEDS,
    gravity_m_s2: float = GRAVITY_M_S2,
    loop_ends: Collection[int] = (),
) -> Iterator[TimelineEntry]:
    """The steps in order, from `start`. A return leads to `home`; transfers peak at `accel_m_s2`, and take at
    least `min_move_duration`; the load is lifted and lowered at `vertical` speeds. What stands behind one of
    the `loop_ends` probably begins where the loop ends."""
    before = start
    for item, step in enumerate(steps):
        after = state_after(step, before, home)
        moving, waiting = _travel_and_wait(step, before, after, accel_m_s2, vertical, gravity_m_s2)
        place = home if isinstance(step, ReturnHome) else None
        yield TimelineEntry(item, step, before, after, moving, moving.duration_s + waiting, place)
        before = after.behind_loop() if item in loop_ends else after


def state_after(step: Step, before: MissionState, home: Vec3 = ZERO) -> MissionState:
    """The state after a step. A take-off from an unknown place is assumed to be from the origin."""
    here = before.expected
    there = place_after(step, here, home)
    match step:
        case Takeoff() | Waypoint():
            is_known = isinstance(step, Waypoint) or here is None
            return replace(before, expected=there, unknown_after="" if is_known else before.unknown_after)
        case ReturnHome() | Delay():
            return replace(before, expected=there)
        case Land():
            # without a load the vehicle may land beside the load that lies there
            unknown_after = before.unknown_after or ("a landing beside the load" if before.released else "")
            return before if here is None else replace(before, expected=there, unknown_after=unknown_after)
        case Speed(speed_m_s=speed):
            return replace(before, speed_m_s=before.usual_speed_m_s if speed is None else speed)
        case SwitchFence(on=fence_on):
            return replace(before, fence_on=fence_on)
        case Winch(length_m=length_change):
            cable = None if before.cable_m is None else before.cable_m + length_change
            return replace(before, expected=there, cable_m=cable)
        case Release():
            if before.released:
                return before
            low = 0.0 if here is None or isinstance(step, PlaceLoad) else here[2]
            above = here if here is None else (here[0], here[1], low + (before.cable_m or 0.0))
            return replace(before, expected=above, unknown_after="a release", released=True)
        case Trajectory():
            return replace(before, expected=there)
        case Signals():
            x, v = _path_end(step)
            moving = dot(v, v) > AT_REST_M2_S2
            unknown_after = "signals that end in motion" if moving else before.unknown_after
            return replace(
                before, expected=None if here is None else add(here, x), unknown_after=unknown_after
            )
        case AttitudeRun():
            return replace(before, unknown_after="an attitude run")
    raise AssertionError(step)


@lru_cache(maxsize=64)
def _path_end(step: Signals) -> tuple[Vec3, Vec3]:
    """Displacement and velocity at the end of signals. Each start of a mission needs those of all its paths
    several times."""
    x, v, *_ = evaluate_load_path(path_tables(step), step.duration_s)
    return x, v


def return_place(here: Vec3, home: Vec3, rally: Iterable[Vec3]) -> Vec3:
    """Where a return commanded by mode leads: home or a rally point, whichever is nearest in horizontal
    distance. A return among the steps of a mission leads home."""
    return min((home, *rally), key=lambda place: dist(place[:2], here[:2]))


def _travel_and_wait(
    step: Step,
    before: MissionState,
    after: MissionState,
    accel: float,
    vertical: VerticalSpeeds,
    gravity: float,
) -> tuple[Pace, float]:
    """The pace at which the load travels, and the time (s) in which it does not."""
    speed, waiting = before.speed_m_s, 0.0
    cable = USUAL_CABLE_M if before.cable_m is None else before.cable_m
    match step:
        case Takeoff():
            waiting = DETECTION_S + tauten_duration_s(cable, vertical.tauten_m_s)
            speed = min(speed, vertical.lift_m_s)
        case Land():
            waiting = DETECTION_S + (0.0 if before.released else set_down_duration_s(cable))
            speed = min(speed, vertical.lift_m_s)
        case Waypoint(hold_s=hold):
            waiting = hold
        case Winch(speed_m_s=rate):
            speed = min(speed, rate or REEL_M_S)
        case PlaceLoad() if before.position is not None and not before.released:
            waiting = DETECTION_S + RELEASE_S
            speed = min(speed, vertical.lift_m_s)
        case Release():
            return Pace(0.0), RELEASE_S
        case Delay() | AttitudeRun() | Signals() | Trajectory():
            return Pace(0.0), step.duration_s
    if before.expected is None or after.expected is None:
        return Pace(0.0), waiting
    # the vehicle stays above a load that is placed
    lowered = isinstance(step, PlaceLoad)
    distance = before.expected[2] if lowered else dist(before.expected, after.expected)
    min_move_s = 0.0 if isinstance(step, Winch) else min_move_duration(max(cable, 0.0), gravity)
    if lowered or isinstance(step, Land):
        return descent_pace(distance, vertical.descent_m_s, speed, accel, min_move_s), waiting
    at_pace = pace if isinstance(step, Waypoint | ReturnHome) else lift_pace
    return at_pace(distance, speed, accel, min_move_s), waiting


def expected_duration_s(
    mission: Mission,
    speed: float = SPEED_M_S,
    accel: float = ACCEL_M_S2,
    cable_m: float | None = None,
    vertical: VerticalSpeeds = USUAL_SPEEDS,
) -> float:
    """Expected seconds from arming to the end of the mission: the sum over its steps."""
    return sum(entry.duration_s for entry in expected_timeline(mission, speed, accel, cable_m, vertical))


def expected_timeline(
    mission: Mission,
    speed: float = SPEED_M_S,
    accel: float = ACCEL_M_S2,
    cable_m: float | None = None,
    vertical: VerticalSpeeds = USUAL_SPEEDS,
) -> tuple[TimelineEntry, ...]:
    """The timeline of a mission that begins at home."""
    start = MissionState(speed_m_s=speed, usual_speed_m_s=speed, cable_m=cable_m)
    return tuple(timeline(mission.steps, start, accel_m_s2=accel, vertical=vertical))
