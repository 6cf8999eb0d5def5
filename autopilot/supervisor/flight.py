"""The record of a flight as the supervisor keeps it, and what it looks at when it decides."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from math import cos, hypot, inf, nan, radians, sqrt
from typing import NamedTuple

from autopilot.control.records import Jet
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.guidance.legs import Leg, asked_jet, least_move_s
from autopilot.guidance.setpoint_follower import SILENT, SMOOTH_SHARE, Circle, FollowLimits, Stream
from autopilot.trajectory.peaks import Body
from autopilot.trajectory.prepare import UNPREPARED, Limits, Prepared
from autopilot.trajectory.rotor_demand import Bounds
from autopilot.vehicle.parameters import SHAPE_ALWAYS, SHAPE_WITH_PLUMBLINE
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import NO_FENCE, Fence
from autopilot.wire.parameter_table import ParameterTable
from missions.model import Step


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


ARDUPILOT_IDENTITY = 1  # MAV_IDENTITY
ON_GROUND = frozenset({Phase.DISARMED, Phase.ARMED})
CARRYING = frozenset({Phase.LIFT, Phase.HOLD, Phase.MISSION, Phase.RETURN, Phase.LOWER, Phase.GUIDED})
IN_AIR = CARRYING | {Phase.TAUTEN, Phase.SET_DOWN}


class Event(Enum):
    """What makes a phase end."""

    ARM = "arm"
    DISARM = "disarm"
    TAKEOFF = "take off"
    TAUT = "cable taut"
    DONE = "legs done"
    HOLD = "hold"
    MISSION = "fly the mission"
    GUIDE = "follow setpoints"
    RETURN = "return"
    LAND = "land"
    LOAD_DOWN = "load on the ground"
    VEHICLE_DOWN = "vehicle on the ground"
    FAIL = "give up"


class Selected(Enum):
    """What arming begins."""

    NOTHING = "hold"
    TAKEOFF = "take-off"
    MISSION = "mission"
    OFFBOARD = "offboard"


class Guide(Enum):
    """Whose word is followed in the phase GUIDED."""

    OFFBOARD = "setpoints"
    MANUAL = "the stick"
    ORBIT = "a circle"


@dataclass(frozen=True, slots=True)
class MissionPlan:
    """The mission in force: its steps, the mission item each came from, and how many items there are."""

    steps: tuple[Step, ...] = ()
    sequence: tuple[int, ...] = ()
    items: int = 0
    prepared: Prepared = UNPREPARED


@dataclass(frozen=True, slots=True)
class Flight:
    """Where the flight stands. `legs[0]` is being flown since `leg_start_us`."""

    phase: Phase = Phase.DISARMED
    phase_start_us: int = 0
    legs: tuple[Leg, ...] = ()
    leg_start_us: int = 0
    selected: Selected = Selected.NOTHING
    plan: MissionPlan = MissionPlan()
    step: int = 0
    on_mission: bool = False
    mission_done: bool = False
    takeoff_altitude_m: float = 0.0
    speed_m_s: float = 0.0
    still_since_us: int = -1  # since when the touchdown conditions hold, -1: they do not
    step_anchor: Vec3 | None = None  # where the present mission step began
    following: tuple[Leg, ...] = ()  # what will be flown after `legs`, where that is known
    slack_since_us: int = -1  # since when the cable does not pull while it should, -1: it pulls
    slack_step: int = -1  # mission step in which it last went slack
    taut_length_m: float = 0.0  # from load to vehicle when lifting began: of the cable as it is
    guide: Guide = Guide.OFFBOARD
    offboard: Stream = SILENT
    manual: Stream = SILENT
    circle: Circle | None = None
    home: Vec3 = ZERO  # where a return leads, ENU; its height is that of the ground
    rally: tuple[Vec3, ...] = ()  # where it leads as well, if that is nearer
    fence: Fence = NO_FENCE
    breach: str = ""  # why load or vehicle may not be where it is, or is about to be
    breaches: int = 0
    breach_us: int = 0  # when the last one began
    released: bool = False  # the load: what is flown and asked for is the vehicle, by itself
    cable_m: float | None = None  # length that the winch has given the cable; None: VEH_CABLE_LEN
    reel_rate: float = 0.0  # m/s, at which it grows now
    reel_accel: float = 0.0  # m/s^2
    reel_to_m: float | None = None  # length that the present mission step asks for
    heeds: bool = True  # holding, it follows a setpoint at once: ArduPilot's GUIDED, not its LOITER


@dataclass(frozen=True, slots=True)
class Settings:
    """The supervisor's parameters."""

    cable_length_m: float
    takeoff_altitude_m: float
    speed_m_s: float
    accel_m_s2: float
    lift_speed_m_s: float
    taut_speed_m_s: float
    load_error_limit_m: float
    tilt_limit_rad: float
    sensor_age_limit_s: float
    gravity_m_s2: float
    least_move_s: float
    limits: Limits  # of the paths of missions
    ramp_lag_s: float  # by which a sinking load keeps behind its setpoint, by the law
    load_weight_n: float
    snap_speed_m_s: float  # greatest closing speed at which a slack cable is made taut
    offboard_loss_us: int  # silence after which setpoints count as lost
    manual_loss_us: int
    stick_speed_m_s: float  # of the load, for a stick pushed home
    fastest_m_s: float  # velocity setpoint
    hover_share: float  # thrust of an attitude setpoint that hovers
    weight_n: float  # of vehicle and load
    fence_action: int  # GF_ACTION
    fence_radius_m: float  # 0: none
    fence_height_m: float  # 0: none
    shortest_m: float  # cable, by the winch
    longest_m: float
    reel_speed_m_s: float
    reel_accel_m_s2: float
    reels: bool  # the law can fly another length than it was made for
    guided_mode: bool  # setpoints as in ArduPilot's GUIDED: heeded while holding, and a place stays asked for
    guided_loss_us: int  # silence after which other setpoints count as lost there
    guides_vehicle: bool  # position setpoints are for the vehicle, which is kept a cable length over the load


class View(NamedTuple):
    """What the supervisor sees of the world at a tick: estimates, ENU from home."""

    now_us: int
    x_quad: Vec3
    v_quad: Vec3
    x_load: Vec3
    v_load: Vec3
    taut: bool
    tilt_rad: float
    complaints: tuple[str, ...]
    pull_n: float = nan  # of the cable on the vehicle, as the accelerometer tells; NaN: it does not
    height_std: float = 0.0  # m, of heights over home, where a receiver tells them


class Report(NamedTuple):
    """What came of an advance: texts (severity, text) for the operator, mission items reached."""

    texts: tuple[tuple[int, str], ...] = ()
    reached: tuple[int, ...] = ()


def settings_from(table: ParameterTable, ramp_lag_s: float, reels: bool, follows_shaped: bool) -> Settings:
    """The supervisor's settings from the parameter table, and what the law says of itself.

    `ramp_lag_s`: by how much time the load keeps behind on a ramp. `reels`: it flies other lengths of the
    cable.
    `follows_shaped`: shaping its paths beforehand pays.
    """
    return Settings(
        cable_length_m=table["VEH_CABLE_LEN"],
        takeoff_altitude_m=table["MIS_TAKEOFF_ALT"],
        speed_m_s=table["MIS_SPEED"],
        accel_m_s2=table["MIS_ACCEL"],
        lift_speed_m_s=table["MIS_LIFT_SPEED"],
        taut_speed_m_s=min(table["MIS_TAUT_SPEED"], table["MIS_SNAP_SPEED"]),
        load_error_limit_m=table["FS_LOAD_ERR"],
        tilt_limit_rad=radians(table["FS_TILT_DEG"]),
        sensor_age_limit_s=table["FS_SENSOR_S"],
        gravity_m_s2=table["VEH_GRAVITY"],
        least_move_s=least_move_s(table["VEH_CABLE_LEN"], table["VEH_GRAVITY"]),
        limits=limits_from(table, follows_shaped),
        ramp_lag_s=ramp_lag_s,
        load_weight_n=table["VEH_LOAD_MASS"] * table["VEH_GRAVITY"],
        snap_speed_m_s=table["MIS_SNAP_SPEED"],
        offboard_loss_us=round(1e6 * table["COM_OF_LOSS_T"]),
        manual_loss_us=round(1e6 * table["COM_RC_LOSS_T"]),
        stick_speed_m_s=table["MPC_VEL_MANUAL"],
        fastest_m_s=table["MPC_XY_VEL_MAX"],
        hover_share=table["MPC_THR_HOVER"],
        weight_n=(table["VEH_QUAD_MASS"] + table["VEH_LOAD_MASS"]) * table["VEH_GRAVITY"],
        fence_action=int(table["GF_ACTION"]),
        fence_radius_m=table["GF_MAX_HOR_DIST"],
        fence_height_m=table["GF_MAX_VER_DIST"],
        shortest_m=table["WNC_LEN_MIN"],
        longest_m=table["WNC_LEN_MAX"],
        reel_speed_m_s=table["WNC_SPEED"],
        reel_accel_m_s2=table["WNC_ACCEL"],
        reels=reels,
        guided_mode=int(table["MAV_IDENTITY"]) == ARDUPILOT_IDENTITY,
        guided_loss_us=round(1e6 * table["GUID_TIMEOUT"]),
        guides_vehicle=table["GDE_TARGET"] != 0.0,
    )


def limits_from(table: ParameterTable, follows_shaped: bool = True) -> Limits:
    """What paths are shaped to: the believed vehicle, and the MIS_ parameters."""
    low, high = table["VEH_ROTOR_MIN"], table["VEH_ROTOR_MAX"]
    margin = 0.01 * table["MIS_ROTOR_MARG"] * (high - low)
    limited = table["VEH_ROTOR_LIM"] != 0.0
    load_mass, gravity = table["VEH_LOAD_MASS"], table["VEH_GRAVITY"]
    body = Body(
        table["VEH_QUAD_MASS"],
        load_mass,
        table["VEH_CABLE_LEN"],
        (table["VEH_J_XX"], table["VEH_J_YY"], table["VEH_J_ZZ"]),
        gravity,
        table["VEH_ARM_LEN"],
        table["VEH_TORQUE"],
        table["PLB_DRAG"],
        table["PLB_DRAG_2"],
    )
    bounds = Bounds(
        low + margin if limited else -inf,
        high - margin if limited else inf,
        0.01 * table["MIS_TENSION"] * load_mass * gravity,
        cos(radians(table["MIS_TILT_DEG"])),
        1e-3 * table["VEH_ROTOR_TAU"],
    )
    shaping = table["MIS_SHAPE"]
    shaped = shaping == SHAPE_ALWAYS or (shaping == SHAPE_WITH_PLUMBLINE and follows_shaped)
    return Limits(
        body,
        bounds,
        shaped,
        table["MIS_SHAPE_ERR"],
        int(table["MIS_INFEASIBLE"]),
        table["MIS_SPEED"],
        table["MIS_ACCEL"],
        table["MIS_TIME_OPT"] != 0.0,
    )


def pace_of(flight: Flight, settings: Settings) -> FollowLimits:
    """How setpoints are followed."""
    rate = SMOOTH_SHARE * sqrt(settings.gravity_m_s2 / settings.cable_length_m)
    return FollowLimits(flight.speed_m_s, settings.fastest_m_s, settings.accel_m_s2, rate)


def forbidden(fence: Fence, x_load: Vec3, settings: Settings) -> str:
    """Why load or vehicle may not be there, the vehicle a cable length above; an empty string if they may."""
    if settings.fence_radius_m > 0.0 and hypot(x_load[0], x_load[1]) > settings.fence_radius_m:
        return f"more than GF_MAX_HOR_DIST {settings.fence_radius_m:g} m from home"
    if settings.fence_height_m > 0.0 and x_load[2] + settings.cable_length_m > settings.fence_height_m:
        return f"higher than GF_MAX_VER_DIST {settings.fence_height_m:g} m"
    return fence.complaint(x_load[0], x_load[1])


def carries(flight: Flight) -> bool:
    """Whether the load must be known to go on: not one that is released or lies, the vehicle landing
    beside it."""
    return not flight.released and flight.phase != Phase.SET_DOWN


def below(x_quad: Vec3, settings: Settings) -> Vec3:
    """Where a load would hang under the vehicle."""
    return (x_quad[0], x_quad[1], x_quad[2] - settings.cable_length_m)


def leg_time_s(flight: Flight, now_us: int) -> float:
    """Time in the present leg."""
    return (now_us - flight.leg_start_us) * 1e-6


def setpoint(flight: Flight, now_us: int) -> Jet | None:
    """Position and derivatives to be flown now, of load or vehicle as the leg says; None without a leg."""
    return jet_ahead(flight, leg_time_s(flight, now_us)) if flight.legs else None


def jet_ahead(flight: Flight, t: float) -> Jet:
    """Position and derivatives `t` seconds into the present leg, or into what follows where that is known.

    Only legs that control the same as the present one follow it for this.
    """
    leg = flight.legs[0]
    for after in (*flight.legs[1:], *flight.following):
        if t < leg.duration_s or after.control_mode != leg.control_mode:
            break
        t -= leg.duration_s
        leg = after
    return leg.jet(t)


def asked_setpoint(flight: Flight, now_us: int) -> Jet | None:
    """As `setpoint`, but of the path that the mission asks for, which what is flown may keep near to only."""
    return asked_jet(flight.legs[0], leg_time_s(flight, now_us)) if flight.legs else None
