"""The supervisor's state: the record of a flight, the view on which it decides, and functions of both."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum, IntEnum
from itertools import chain
from math import hypot, inf, nan, sqrt
from typing import NamedTuple

from autopilot.control.records import Jet
from autopilot.geometry.linear import IDENTITY, ZERO, Mat3, Vec3
from autopilot.guidance.heading import HEADING_EAST, Aim, Heading
from autopilot.guidance.legs import Leg, PathResume
from autopilot.guidance.setpoint_follower import NO_STREAM, SMOOTH_SHARE, Circle, FollowLimits, SetpointStream
from autopilot.guidance.target import Target
from autopilot.services.snapshot import HEIGHT_LIMIT_PARAMETER
from autopilot.supervisor.settings import Settings
from autopilot.trajectory.prepare import UNPREPARED, PreparedPaths
from autopilot.wire.convert.battery import BatteryReading, ChargeLevels, battery_percent, charge_state
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import NO_FENCE, Fence, read_fence, read_rally
from autopilot.wire.items import Visit, WireItem
from missions.model import HeadingCommand, PlaceLoad, Step


class Phase(IntEnum):
    """Phases of flight, numbered as PLUMBLINE_PHASE."""

    DISARMED = mavlink.PLUMBLINE_PHASE_DISARMED
    ARMED = mavlink.PLUMBLINE_PHASE_ARMED
    TAUTEN = mavlink.PLUMBLINE_PHASE_TAUTEN
    LIFT = mavlink.PLUMBLINE_PHASE_LIFT
    HOLD = mavlink.PLUMBLINE_PHASE_HOLD
    MISSION = mavlink.PLUMBLINE_PHASE_MISSION
    RETURN = mavlink.PLUMBLINE_PHASE_RETURN
    LOWER = mavlink.PLUMBLINE_PHASE_LOWER
    SET_DOWN = mavlink.PLUMBLINE_PHASE_SET_DOWN
    FAILSAFE = mavlink.PLUMBLINE_PHASE_FAILSAFE
    GUIDED = mavlink.PLUMBLINE_PHASE_GUIDED


Text = tuple[int, str]  # severity, text
INFO, WARNING, CRITICAL = (
    mavlink.MAV_SEVERITY_INFO,
    mavlink.MAV_SEVERITY_WARNING,
    mavlink.MAV_SEVERITY_CRITICAL,
)
ON_GROUND = frozenset({Phase.DISARMED, Phase.ARMED})
UNARMED = frozenset({Phase.DISARMED, Phase.FAILSAFE})  # the rotors stand
CARRYING = frozenset({Phase.LIFT, Phase.HOLD, Phase.MISSION, Phase.RETURN, Phase.LOWER, Phase.GUIDED})
IN_AIR = CARRYING | {Phase.TAUTEN, Phase.SET_DOWN}
LANDING = frozenset({Phase.LOWER, Phase.SET_DOWN})


class Event(Enum):
    """Events that begin a phase."""

    ARM = "arm"
    DISARM = "disarm"
    TAKEOFF = "take off"
    TAKEOFF_ALONE = "take off without a load"
    TAUT = "cable taut"
    NOT_LIFTED = "cable slack, load not lifted"
    DONE = "legs done"
    STEP = "mission step"
    LAND_STEP = "mission step: land, or place the load"
    HOLD = "hold"
    MISSION = "fly the mission"
    GUIDE = "follow setpoints"
    OTHER_SETPOINT = "setpoint of another kind"
    RETURN = "return"
    LAND = "land"
    CAUGHT = "load caught"
    CAUGHT_UP = "near the path again"
    RELEASED = "load released"
    LOAD_DOWN = "load on the ground"
    LOAD_PLACED = "load on the ground, to stay there"
    VEHICLE_DOWN = "vehicle on the ground"
    FAIL = "give up"
    FOUND_IN_FLIGHT = "found in flight"


class ActionWhenArmed(Enum):
    """What begins when the vehicle is armed."""

    NOTHING = "hold"
    TAKEOFF = "take-off"
    MISSION = "mission"
    OFFBOARD = "offboard"


class Fall(Enum):
    """What the vehicle does after its rotors have stopped in the air."""

    NONE = "they have not, or it rests on the ground"
    FALLING = "it falls"
    UNKNOWN = "its inertial unit is silent"


class SetpointSource(Enum):
    """Setpoint source while GUIDED."""

    OFFBOARD = "setpoints"
    MANUAL = "the stick"
    ORBIT = "a circle"
    TARGET = "a target"


@dataclass(frozen=True, slots=True)
class MissionPlan:
    """The mission in force: its steps, the mission item each came from, and how many items there are."""

    steps: tuple[Step, ...] = ()
    sequence: tuple[int, ...] = ()
    item_count: int = 0
    prepared: PreparedPaths = UNPREPARED
    # of each step: the heading aims that it sets, with the item of each
    aims: tuple[tuple[tuple[int, HeadingCommand], ...], ...] = ()
    # of the last step of each loop without end: the step to which it leads; not before all others, END: none
    loops: Mapping[int, int] = field(default_factory=dict)
    visits: tuple[Visit, ...] = ()  # to the items, in the order in which they are flown

    def next_step(self, step: int) -> int | None:
        """The step that follows; None after the last one."""
        following = self.loops.get(step, step + 1)
        return following if following < len(self.steps) else None

    def step_of_item(self, item: int, step: int, reset: bool) -> int | None:
        """The step that is flown if an item becomes the present one at this step, with its jumps taken as
        often as until then, or anew (`reset`): that of the item, of where it jumps to, or else the first one
        behind it; None if there is none."""
        lap = next((visit.lap for visit in reversed(self.visits) if visit.step <= step), 0)
        found = [visit for visit in self.visits if visit.item == item and visit.step < len(self.steps)]
        if not found:
            return next((i for i, last in enumerate(self.sequence) if last >= item), None)
        if reset:
            return found[0].step
        same_lap = (visit.step for visit in found if visit.lap == lap)
        later = (visit.step for visit in found if visit.step > step)
        return next(chain(same_lap, later), found[-1].step)


class AimedItems(NamedTuple):
    """Items that have set an aim of the heading, and are not reported as reached yet."""

    done: tuple[int, ...]
    turning: int | None  # reached when the nose points at `aim`
    aim: Aim


@dataclass(frozen=True, slots=True)
class MissionProgress:
    """The mission, how far it is flown, and its height and speed."""

    plan: MissionPlan = MissionPlan()
    step: int = 0  # of the plan: the present one, or the one to begin with
    active: bool = False
    waiting: bool = False  # begins when its paths are prepared
    # of a mission that is complete: the item that it ended with, after the flight the first; else None
    final_item: int | None = None
    step_anchor: Vec3 | None = None  # where the present step began
    aimed: AimedItems | None = None
    stopped_run: PathResume | None = None  # how signals or a trajectory continue that were interrupted
    takeoff_altitude_m: float = 0.0
    speed_m_s: float = 0.0  # of transfers
    # the same before paths had to wait; None: they have not waited since it was set
    speed_before_waits_m_s: float | None = None

    def at_speed(self, speed_m_s: float) -> MissionProgress:
        """The mission with this speed of transfers, whether or not paths have waited."""
        return replace(self, speed_m_s=speed_m_s, speed_before_waits_m_s=None)

    @property
    def requested_speed_m_s(self) -> float:
        """The speed of transfers that was last set."""
        return self.speed_m_s if self.speed_before_waits_m_s is None else self.speed_before_waits_m_s

    @property
    def done(self) -> bool:
        """Whether the mission is complete, and not begun again."""
        return self.final_item is not None


class LowBattery(NamedTuple):
    """How low a measured battery is."""

    charge_state: int  # MAV_BATTERY_CHARGE_STATE: LOW, CRITICAL or EMERGENCY
    percent: int  # of the charge that is left


@dataclass(frozen=True, slots=True)
class CableState:
    """What is known of cable, winch and gripper."""

    released: bool = False  # the load: positions and setpoints are then those of the vehicle
    length_m: float | None = None  # as set by the winch; None: VEH_CABLE_LEN
    reel_rate: float = 0.0  # m/s, at which the length grows now
    reel_accel: float = 0.0  # m/s^2
    reel_target_m: float | None = None  # length that the present mission step requires
    ground_place: Vec3 = ZERO  # where the load lay when its cable began to be pulled taut
    taut_length_m: float = 0.0  # from load to vehicle when lifting began: the true length of the cable
    slack_since_us: int = -1  # since when the cable does not pull while it should, -1: it pulls
    slack_step: int = -1  # mission step in which it last went slack
    failed_lifts: int = 0  # times that it came slack with the load still on the ground, since arming


@dataclass(frozen=True, slots=True)
class Setpoints:
    """The setpoints received, and the source of those that are followed while GUIDED."""

    source: SetpointSource = SetpointSource.OFFBOARD
    offboard: SetpointStream = NO_STREAM
    manual: SetpointStream = NO_STREAM
    circle: Circle | None = None
    target: Target | None = None
    beside_target: SetpointStream = NO_STREAM  # where the load is to be while it follows the target
    heading_setpoint_us: int = -1  # when the setpoint was received whose heading is the present aim


@dataclass(frozen=True, slots=True)
class Area:
    """Places that matter to the flight, and whether the fence is breached."""

    home: Vec3 = ZERO  # where a return leads, ENU; its height is that of the ground
    rally: tuple[Vec3, ...] = ()  # where a return leads instead if that is nearer
    fence: Fence = NO_FENCE
    fence_enabled: bool = True  # the fence is not switched off
    breach: str = ""  # why load or vehicle may not be where it is, or where it is about to be
    last_breach: str = ""  # the same of the last breach, over or not
    breaches: int = 0
    breach_us: int = 0  # when the last one began
    leads_out: bool = False  # the commanded motion leads beyond the fence
    inside_since_us: int = -1  # since when nothing violates the fence; -1: something does

    @classmethod
    def of(cls, lists: Mapping[int, Sequence[WireItem]], home: Home) -> Area:
        """These fence and rally points, by their MAV_MISSION_TYPE; `home` is the origin of the world.
        MissionItemError if the items are none."""
        area = cls()
        for kind, items in lists.items():
            area = area.with_items(kind, items, home)
        return area

    def with_fence_switched(self, on: bool) -> Area:
        """The same with the fence in force or not; a previous breach is forgotten."""
        return replace(self, fence_enabled=on, breach="")

    def with_items(self, kind: int, items: Sequence[WireItem], home: Home) -> Area:
        """The same with another fence or other rally points."""
        if kind == mavlink.MAV_MISSION_TYPE_FENCE:
            return replace(self, fence=read_fence(items, home), breach="")
        return replace(self, rally=read_rally(items, home))


@dataclass(frozen=True, slots=True)
class Flight:
    """State of the flight. `legs[0]` is being flown since `leg_start_us`."""

    phase: Phase = Phase.DISARMED
    phase_start_us: int = 0
    legs: tuple[Leg, ...] = ()
    leg_start_us: int = 0
    following: tuple[Leg, ...] = ()  # what will be flown after `legs`, where that is known
    condition_since_us: int = -1  # since when the condition that ends the phase holds, -1: it does not
    # m, height near which a vehicle that is set down has stopped, and since when; infinite: it still sinks
    stopped_height: float = inf
    stopped_since_us: int = -1
    action_when_armed: ActionWhenArmed = ActionWhenArmed.NOTHING
    # while holding, it follows any setpoint: ArduPilot's GUIDED, not its LOITER
    accepts_setpoints: bool = True
    mission: MissionProgress = MissionProgress()
    cable: CableState = CableState()
    setpoints: Setpoints = Setpoints()
    area: Area = Area()
    rotors_lost: int = 0  # bit i: rotor i+1 does not obey its commands
    rotors_lost_before: int = 0  # the same of the last flight
    out_of_control_since_us: int = -1  # since when it is off its path and not controlled, -1: it is not
    fall: Fall = Fall.NONE
    low_battery: LowBattery | None = None  # None: it is not, or not measured
    answered_charge_state: int = 0  # MAV_BATTERY_CHARGE_STATE to which this flight has reacted
    heading: Heading = HEADING_EAST
    returning: bool = False  # home, or landing there
    is_failsafe: bool = False  # it was not commanded to do what it does, but reacts to a failure
    # reasons not to arm that are not part of the flight's state, by source: the storage, the clock
    external_arming_problems: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def is_battery_empty(self) -> bool:
        """Whether so little is left of a measured battery that no flight may begin."""
        low = self.low_battery
        return low is not None and low.charge_state >= mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL

    @property
    def is_circling(self) -> bool:
        """Whether it flies round a circle."""
        return self.phase == Phase.GUIDED and self.setpoints.source == SetpointSource.ORBIT

    @property
    def follows_target(self) -> bool:
        """Whether it accompanies a target, or waits for one to do so."""
        return self.phase == Phase.GUIDED and self.setpoints.source == SetpointSource.TARGET


class View(NamedTuple):
    """What the supervisor sees of the world at a tick: estimates, ENU from home."""

    now_us: int
    x_quad: Vec3
    v_quad: Vec3
    x_load: Vec3
    v_load: Vec3
    taut: bool
    tilt_rad: float
    estimate_problems: tuple[str, ...]
    pull_n: float = nan  # of the cable on the vehicle, by the accelerometer; NaN: not known
    height_std: float = 0.0  # m, of heights over home, if they come from a receiver
    attitude: Mat3 = IDENTITY
    estimate_loss: str = ""  # why not even a landing is possible by these estimates
    law_fault: str = ""  # why the custom law does not fly any more
    rotors_lost: int = 0  # bit i: rotor i+1 does not obey its commands
    estimator_fault: str = ""  # why the custom estimator does not fly any more
    load_unobserved: bool = False  # no sensor has ever seen the load
    load_tracked: bool = True  # a sensor measures its position; else its distance is the assumed length


class Report(NamedTuple):
    """The results of an advance: texts for the operator, mission items reached."""

    texts: tuple[Text, ...] = ()
    reached: tuple[int, ...] = ()


def is_placing(flight: Flight) -> bool:
    """Whether the load is lowered to be released on the ground, behind which the mission continues."""
    mission, steps = flight.mission, flight.mission.plan.steps
    return (
        flight.phase == Phase.LOWER
        and mission.active
        and not flight.cable.released
        and isinstance(steps[mission.step], PlaceLoad)
    )


def is_landing(flight: Flight) -> bool:
    """Whether the flight ends with what it does now."""
    return flight.phase in LANDING and not is_placing(flight)


def interrupt_mission(flight: Flight) -> Flight:
    """The flight with its mission interrupted, or no longer waiting to begin; the step is kept."""
    return replace(flight, mission=replace(flight.mission, active=False, waiting=False))


def without_load(flight: Flight) -> Flight:
    """The flight with its gripper open, which flies on as the vehicle alone."""
    return replace(flight, cable=replace(flight.cable, released=True, slack_since_us=-1))


def with_battery(flight: Flight, reading: BatteryReading, levels: ChargeLevels) -> Flight:
    """The flight with a battery that measures this, NaN: nothing."""
    state = charge_state(reading, levels)
    is_low = state >= mavlink.MAV_BATTERY_CHARGE_STATE_LOW
    low = LowBattery(state, battery_percent(reading)) if is_low else None
    return flight if low == flight.low_battery else replace(flight, low_battery=low)


def can_fly(flight: Flight, settings: Settings) -> bool:
    """Whether the rotors that are not lost can fly the vehicle."""
    return not flight.rotors_lost or settings.rotors.can_fly_without(flight.rotors_lost)


def lost_rotors_text(lost: int) -> str:
    """The rotors that are lost (bits), by their numbers."""
    numbers = [str(i + 1) for i in range(lost.bit_length()) if lost >> i & 1]
    return f"rotor{'s' * (len(numbers) > 1)} {', '.join(numbers)}"


def takeoff_event(flight: Flight) -> Event:
    """The event that begins a take-off: with a load, the cable is pulled taut first."""
    return Event.TAKEOFF_ALONE if flight.cable.released else Event.TAKEOFF


def follow_limits(flight: Flight, settings: Settings) -> FollowLimits:
    """Limits for following setpoints."""
    rate = SMOOTH_SHARE * sqrt(settings.gravity_m_s2 / settings.cable_length_m)
    return FollowLimits(
        flight.mission.speed_m_s, settings.setpoints.max_speed_m_s, settings.motion.accel_m_s2, rate
    )


def first_fence_violation(fence: Fence, places: Iterable[Vec3], settings: Settings) -> str:
    """Why the load may not be at one of these places; an empty string if it may be at all of them."""
    return next(filter(None, (fence_violation(fence, place, settings) for place in places)), "")


class FenceViolation(NamedTuple):
    """Why load or vehicle may not be at a place: the limit, by how much it is exceeded (m), and what was
    measured there."""

    limit: str
    beyond_m: float
    measured: str


def fence_violation(fence: Fence, x_load: Vec3, settings: Settings) -> str:
    """Why load or vehicle may not be there, the vehicle a cable length above; an empty string if they may."""
    found = measured_fence_violation(fence, x_load, settings)
    if found is None:
        return ""
    return f"{found.limit} ({found.measured})" if HEIGHT_LIMIT_PARAMETER in found.limit else found.limit


def measured_fence_violation(fence: Fence, x_load: Vec3, settings: Settings) -> FenceViolation | None:
    """The same with what it is measured by; None if they may be there."""
    limits, distance_m = settings.fence, hypot(x_load[0], x_load[1])
    if 0.0 < limits.radius_m < distance_m:
        text = f"beyond the fence, GF_MAX_HOR_DIST {limits.radius_m:g} m from home"
        return FenceViolation(text, distance_m - limits.radius_m, f"{distance_m:.2f} m from home")
    height_m = x_load[2] + settings.cable_length_m
    if 0.0 < limits.height_m < height_m:
        text = f"beyond the fence, {HEIGHT_LIMIT_PARAMETER} {limits.height_m:g} m above home"
        return FenceViolation(text, height_m - limits.height_m, f"vehicle at {height_m:.2f} m")
    text = fence.violation(x_load[0], x_load[1])
    if not text:
        return None
    depth_m = fence.depth(x_load[0], x_load[1])
    return FenceViolation(text, depth_m, f"{depth_m:.2f} m from its edge")


def has_fence(flight: Flight, settings: Settings) -> bool:
    """Whether there is a fence, in force or not: zones that were uploaded, or limits by parameters."""
    limits = settings.fence
    return bool(flight.area.fence.zones) or limits.radius_m > 0.0 or limits.height_m > 0.0


def is_fence_active(flight: Flight, settings: Settings) -> bool:
    """Whether the fence is in force: GF_ACTION names a reaction to a breach, and it is not switched off."""
    return settings.fence.action != 0 and flight.area.fence_enabled


def fence_problem(flight: Flight, place: Vec3, settings: Settings) -> str:
    """Why a fence in force forbids to fly there: of the load, or of the vehicle if it has released the load;
    an empty string if it does not."""
    if not is_fence_active(flight, settings):
        return ""
    load = load_position_below(place, settings) if flight.cable.released else place
    return fence_violation(flight.area.fence, load, settings)


def needs_load_estimate(flight: Flight) -> bool:
    """Whether the load must be known for the flight to continue: not if it is released, or lies on the ground
    while the vehicle lands beside it."""
    return not flight.cable.released and flight.phase != Phase.SET_DOWN


def load_position_below(x_quad: Vec3, settings: Settings) -> Vec3:
    """Where a load would hang under the vehicle."""
    return (x_quad[0], x_quad[1], x_quad[2] - settings.cable_length_m)


def leg_time_s(flight: Flight, now_us: int) -> float:
    """Time in the present leg."""
    return (now_us - flight.leg_start_us) * 1e-6


def with_condition(flight: Flight, holds: bool, now_us: int) -> Flight:
    """The flight, with the time since when the condition that ends its phase holds."""
    since_us = held_since(holds, flight.condition_since_us, now_us)
    return flight if since_us == flight.condition_since_us else replace(flight, condition_since_us=since_us)


def held_since(holds: bool, since_us: int, now_us: int) -> int:
    """Since when a condition holds that has held since then (-1: it did not); -1 if it does not hold now."""
    if not holds:
        return -1
    return since_us if since_us >= 0 else now_us


def has_lasted(since_us: int, duration_us: int, now_us: int) -> bool:
    """Whether what holds since then (-1: it does not) has held for so long."""
    return since_us >= 0 and now_us - since_us >= duration_us


def setpoint(flight: Flight, now_us: int) -> Jet | None:
    """Position and derivatives to fly now, of load or vehicle depending on the leg; None without a leg."""
    return jet_ahead(flight, leg_time_s(flight, now_us)) if flight.legs else None


def jet_ahead(flight: Flight, t: float) -> Jet:
    """Position and derivatives `t` seconds into the present leg, or into following legs if these are known.

    A following leg counts only if its control mode is that of the leg before it.
    """
    leg = flight.legs[0]
    for after in (*flight.legs[1:], *flight.following):
        if t < leg.duration_s or after.control_mode != leg.control_mode:
            break
        t -= leg.duration_s
        leg = after
    return leg.jet(t)
