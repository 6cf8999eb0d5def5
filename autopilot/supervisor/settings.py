"""The supervisor's parameters as records, built from the parameter table."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from autopilot.guidance.heading import HeadingLimits
from autopilot.guidance.target import TargetPlace
from autopilot.trajectory.peaks import Body
from autopilot.trajectory.prepare import PathLimits
from autopilot.trajectory.rotor_demand import bounds_along_paths
from autopilot.trajectory.timeline import min_move_duration
from autopilot.vehicle.layout import MAX_ROTOR_FORCE_N, Layout
from autopilot.vehicle.parameters import AutopilotParameters, law_of, shapes_paths, standing_height_m
from autopilot.vehicle.rotors import (
    allocation_columns,
    control_authority,
    mixer_table,
    thrust_and_moment_per_force,
)
from autopilot.wire.convert.battery import ChargeLevels

ARDUPILOT_IDENTITY = 1  # MAV_IDENTITY
HEIGHT_OVER_TARGET = 2  # FLW_TGT_ALT_M
LONGEST_SMOOTHING_S = 10.0  # of the velocity of a target, with FLW_TGT_RS = 1
MIN_AUTHORITY = 0.1  # least authority over moments to fly with, as a share of that of all rotors


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Height and speeds of the load, unless a request or a mission sets others."""

    takeoff_altitude_m: float
    speed_m_s: float
    accel_m_s2: float
    lift_speed_m_s: float
    descent_speed_m_s: float  # far above the ground
    taut_speed_m_s: float
    weight_lead_m: float  # of the setpoint over a vehicle whose taut cable pulls with the load's weight
    snap_speed_m_s: float  # greatest closing speed at which a slack cable is made taut
    return_altitude_m: float  # least height of the load on the way home


@dataclass(frozen=True, slots=True)
class FailsafeSettings:
    """Limits beyond which a failsafe triggers."""

    load_error_limit_m: float
    tilt_limit_rad: float
    sensor_age_limit_s: float


@dataclass(frozen=True, slots=True)
class BatterySettings:
    """At which charge a measured battery counts as low, and what follows."""

    levels: ChargeLevels
    action: int


@dataclass(frozen=True, slots=True)
class SetpointSettings:
    """How setpoints are interpreted, and how long they are valid."""

    offboard_loss_us: int  # silence after which setpoints count as lost
    manual_loss_us: int
    guided_loss_us: int  # the same in ArduPilot's GUIDED, for setpoints that are not a place
    stick_speed_m_s: float  # of the load, for a stick at its end stop
    max_speed_m_s: float  # velocity setpoint
    hover_share: float  # thrust share of an attitude setpoint with which the vehicle hovers
    ardupilot_guided: bool  # as in ArduPilot's GUIDED: obeyed while holding, and a place remains the setpoint
    target_is_vehicle: bool  # positions are those of the vehicle, which is kept a cable length over the load


@dataclass(frozen=True, slots=True)
class FenceSettings:
    """The circular fence around home, and the reaction to a breach of any fence."""

    action: int  # GF_ACTION
    radius_m: float  # 0: none
    height_m: float  # 0: none


@dataclass(frozen=True, slots=True)
class WinchSettings:
    """Limits of the winch."""

    min_length_m: float  # length of the cable
    max_length_m: float
    speed_m_s: float
    accel_m_s2: float
    problem: str  # why the law cannot fly a length other than the one it was designed for; empty if it can


@dataclass(frozen=True, slots=True)
class RotorSettings:
    """The rotors, and the weight that they carry."""

    layout: Layout
    min_effort_n: float  # least effort of a rotor
    max_effort_n: float  # greatest effort of a rotor
    hover_thrust_n: float  # carries vehicle and load

    @property
    def greatest_thrust_n(self) -> float:
        """Thrust (N) at which the first rotor reaches its limit."""
        return thrust_and_moment_per_force(mixer_table(self.layout))[0] * self.max_effort_n

    def can_fly_without(self, lost: int) -> bool:
        """Whether the remaining rotors can keep vehicle and load in the air and level."""
        return self._keeps_authority(lost, yaw=False)

    def can_hold_heading_without(self, lost: int) -> bool:
        """Whether the remaining rotors can control the heading as well."""
        return self._keeps_authority(lost, yaw=True)

    def _keeps_authority(self, lost: int, yaw: bool) -> bool:
        full, remaining = (
            control_authority(
                self.layout, missing, self.hover_thrust_n, self.min_effort_n, self.max_effort_n, yaw
            )
            for missing in (0, lost)
        )
        return remaining >= MIN_AUTHORITY * full


@dataclass(frozen=True, slots=True)
class Settings:
    """The supervisor's parameters: those of the assumed vehicle, and the others by subject."""

    cable_length_m: float
    standing_height_m: float  # of the cable's attachment above the ground on which the vehicle stands
    min_move_s: float
    gravity_m_s2: float
    load_weight_n: float
    weight_n: float  # of vehicle and load
    ramp_lag_s: float  # time by which a sinking load lags behind its setpoint with this law
    limits: PathLimits  # of the paths of missions
    motion: MotionSettings
    heading: HeadingLimits
    failsafe: FailsafeSettings
    battery: BatterySettings
    setpoints: SetpointSettings
    target_place: TargetPlace
    fence: FenceSettings
    winch: WinchSettings
    rotors: RotorSettings


def settings_from(
    table: AutopilotParameters, ramp_lag_s: float, supports_reeling: bool, follows_shaped: bool
) -> Settings:
    """The supervisor's settings from the parameter table and the properties of the law.

    `ramp_lag_s`: the time by which the load lags on a ramp. `supports_reeling`: the law can fly other
    lengths of the cable. `follows_shaped`: shaping paths beforehand is worthwhile with this law.
    """
    length, gravity, load_mass = table["VEH_CABLE_LEN"], table["VEH_GRAVITY"], table["VEH_LOAD_MASS"]
    return Settings(
        cable_length_m=length,
        standing_height_m=standing_height_m(table),
        min_move_s=min_move_duration(length, gravity),
        gravity_m_s2=gravity,
        load_weight_n=load_mass * gravity,
        weight_n=(table["VEH_QUAD_MASS"] + load_mass) * gravity,
        ramp_lag_s=ramp_lag_s,
        limits=path_limits(table, follows_shaped),
        motion=MotionSettings(
            takeoff_altitude_m=table["MIS_TAKEOFF_ALT"],
            speed_m_s=table["MIS_SPEED"],
            accel_m_s2=table["MIS_ACCEL"],
            lift_speed_m_s=table["MIS_LIFT_SPEED"],
            descent_speed_m_s=table["MPC_Z_V_AUTO_DN"],
            taut_speed_m_s=min(table["MIS_TAUT_SPEED"], table["MIS_SNAP_SPEED"]),
            weight_lead_m=load_mass * gravity / table["QP_KZ"] if table["QP_KZ"] > 0.0 else 0.0,
            snap_speed_m_s=table["MIS_SNAP_SPEED"],
            return_altitude_m=table["RTL_RETURN_ALT"],
        ),
        heading=HeadingLimits(
            approach_rate=radians(table["MPC_YAWRAUTO_MAX"]),
            max_rate=radians(table["MPC_MAN_Y_MAX"]),
            accel=radians(table["MPC_YAWRAUTO_ACC"]),
        ),
        failsafe=FailsafeSettings(
            load_error_limit_m=table["FS_LOAD_ERR"],
            tilt_limit_rad=radians(table["FS_TILT_DEG"]),
            sensor_age_limit_s=table["FS_SENSOR_S"],
        ),
        battery=BatterySettings(
            levels=ChargeLevels(table["BAT_LOW_THR"], table["BAT_CRIT_THR"], table["BAT_EMERGEN_THR"]),
            action=int(table["COM_LOW_BAT_ACT"]),
        ),
        setpoints=SetpointSettings(
            offboard_loss_us=round(1e6 * table["COM_OF_LOSS_T"]),
            manual_loss_us=round(1e6 * table["COM_RC_LOSS_T"]),
            guided_loss_us=round(1e6 * table["GUID_TIMEOUT"]),
            stick_speed_m_s=table["MPC_VEL_MANUAL"],
            max_speed_m_s=table["MPC_XY_VEL_MAX"],
            hover_share=table["MPC_THR_HOVER"],
            ardupilot_guided=int(table["MAV_IDENTITY"]) == ARDUPILOT_IDENTITY,
            target_is_vehicle=table["GDE_TARGET"] != 0.0,
        ),
        target_place=TargetPlace(
            height_m=table["FLW_TGT_HT"],
            height_over_target=int(table["FLW_TGT_ALT_M"]) == HEIGHT_OVER_TARGET,
            distance_m=table["FLW_TGT_DST"],
            angle=radians(table["FLW_TGT_FA"]),
            max_turning_m_s=table["FLW_TGT_MAX_VEL"],
            smoothing_s=LONGEST_SMOOTHING_S * table["FLW_TGT_RS"],
        ),
        fence=FenceSettings(
            action=int(table["GF_ACTION"]),
            radius_m=table["GF_MAX_HOR_DIST"],
            height_m=table["GF_MAX_VER_DIST"],
        ),
        winch=WinchSettings(
            min_length_m=table["WNC_LEN_MIN"],
            max_length_m=table["WNC_LEN_MAX"],
            speed_m_s=table["WNC_SPEED"],
            accel_m_s2=table["WNC_ACCEL"],
            problem="" if supports_reeling else f"the law {law_of(table)} flies one length of the cable",
        ),
        rotors=_rotors(table, (table["VEH_QUAD_MASS"] + load_mass) * gravity),
    )


def _rotors(table: AutopilotParameters, weight_n: float) -> RotorSettings:
    low, high = table["VEH_ROTOR_MIN"], table["VEH_ROTOR_MAX"]
    if table["VEH_ROTOR_LIM"] == 0.0:
        low, high = -MAX_ROTOR_FORCE_N, MAX_ROTOR_FORCE_N
    return RotorSettings(table.layout, low, high, weight_n)


def path_limits(table: AutopilotParameters, follows_shaped: bool) -> PathLimits:
    """The limits within which paths are shaped: the assumed vehicle, and the MIS_ parameters."""
    rotor_range = table["VEH_ROTOR_MIN"], table["VEH_ROTOR_MAX"]
    body = Body(
        table["VEH_QUAD_MASS"],
        table["VEH_LOAD_MASS"],
        table["VEH_CABLE_LEN"],
        (table["VEH_J_XX"], table["VEH_J_YY"], table["VEH_J_ZZ"]),
        table["VEH_GRAVITY"],
        table["VEH_ARM_LEN"],
        table["VEH_TORQUE"],
        table["PLB_DRAG"],
        table["PLB_DRAG_2"],
        allocation_columns(table.layout),
    )
    bounds = bounds_along_paths(
        body,
        rotor_range if table["VEH_ROTOR_LIM"] != 0.0 else None,
        0.01 * table["MIS_ROTOR_MARG"],
        0.01 * table["MIS_TENSION"],
        radians(table["MIS_TILT_DEG"]),
        1e-3 * table["VEH_ROTOR_TAU"],
    )
    return PathLimits(
        body,
        bounds,
        shapes_paths(table, follows_shaped),
        table["MIS_SHAPE_ERR"],
        int(table["MIS_INFEASIBLE"]),
        table["MIS_SPEED"],
        table["MIS_ACCEL"],
        table["MIS_TIME_OPT"] != 0.0,
    )
