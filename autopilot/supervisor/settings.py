"""The supervisor's parameters as records, built from the parameter table."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, radians

from autopilot.guidance.heading import HeadingLimits
from autopilot.guidance.legs import least_move_s
from autopilot.trajectory.peaks import Body
from autopilot.trajectory.prepare import Limits
from autopilot.trajectory.rotor_demand import Bounds
from autopilot.vehicle.layout import GREATEST_FORCE_N, Layout
from autopilot.vehicle.parameters import SHAPE_ALWAYS, SHAPE_WITH_PLUMBLINE, AutopilotParameters
from autopilot.vehicle.rotors import authority, columns

ARDUPILOT_IDENTITY = 1  # MAV_IDENTITY
LEAST_AUTHORITY = 0.1  # over moments, of that of all rotors, with which a vehicle is flown


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Height and speeds of the load, where no request and no mission says otherwise."""

    takeoff_altitude_m: float
    speed_m_s: float
    accel_m_s2: float
    lift_speed_m_s: float
    taut_speed_m_s: float
    snap_speed_m_s: float  # greatest closing speed at which a slack cable is made taut
    return_altitude_m: float  # of the load on the way home, at least


@dataclass(frozen=True, slots=True)
class FailsafeSettings:
    """Limits beyond which the flight is given up."""

    load_error_limit_m: float
    tilt_limit_rad: float
    sensor_age_limit_s: float


@dataclass(frozen=True, slots=True)
class SetpointSettings:
    """How setpoints are understood, and for how long."""

    offboard_loss_us: int  # silence after which setpoints count as lost
    manual_loss_us: int
    guided_loss_us: int  # the same in ArduPilot's GUIDED, of setpoints that are not a place
    stick_speed_m_s: float  # of the load, for a stick at its end stop
    fastest_m_s: float  # velocity setpoint
    hover_share: float  # thrust of an attitude setpoint that hovers
    guided_mode: bool  # as in ArduPilot's GUIDED: heeded while holding, and a place stays asked for
    guides_vehicle: bool  # positions are of the vehicle, which is kept a cable length over the load


@dataclass(frozen=True, slots=True)
class FenceSettings:
    """The circular fence around home, and what a breach of any fence leads to."""

    action: int  # GF_ACTION
    radius_m: float  # 0: none
    height_m: float  # 0: none


@dataclass(frozen=True, slots=True)
class WinchSettings:
    """What the winch can do."""

    shortest_m: float  # cable
    longest_m: float
    speed_m_s: float
    accel_m_s2: float
    usable: bool  # the law can fly another length than it was designed for


@dataclass(frozen=True, slots=True)
class RotorSettings:
    """The rotors, and what they carry."""

    layout: Layout
    low_n: float  # least effort
    high_n: float  # greatest
    thrust_n: float  # that carries vehicle and load

    def can_fly_without(self, lost: int) -> bool:
        """Whether the rotors that are left keep vehicle and load in the air and level."""
        return self._left(lost, yaw=False)

    def can_hold_heading_without(self, lost: int) -> bool:
        """Whether they can turn it to where its nose is to point as well."""
        return self._left(lost, yaw=True)

    def _left(self, lost: int, yaw: bool) -> bool:
        whole, left = (
            authority(self.layout, gone, self.thrust_n, self.low_n, self.high_n, yaw) for gone in (0, lost)
        )
        return left >= LEAST_AUTHORITY * whole


@dataclass(frozen=True, slots=True)
class Settings:
    """The supervisor's parameters: of the believed vehicle, and by subject."""

    cable_length_m: float
    least_move_s: float
    gravity_m_s2: float
    load_weight_n: float
    weight_n: float  # of vehicle and load
    ramp_lag_s: float  # by which a sinking load keeps behind its setpoint, by the law
    limits: Limits  # of the paths of missions
    motion: MotionSettings
    heading: HeadingLimits
    failsafe: FailsafeSettings
    setpoints: SetpointSettings
    fence: FenceSettings
    winch: WinchSettings
    rotors: RotorSettings


def settings_from(
    table: AutopilotParameters, ramp_lag_s: float, reels: bool, follows_shaped: bool
) -> Settings:
    """The supervisor's settings from the parameter table, and what the law says of itself.

    `ramp_lag_s`: by how much time the load keeps behind on a ramp. `reels`: it flies other lengths of the
    cable. `follows_shaped`: shaping its paths beforehand pays.
    """
    length, gravity, load_mass = table["VEH_CABLE_LEN"], table["VEH_GRAVITY"], table["VEH_LOAD_MASS"]
    return Settings(
        cable_length_m=length,
        least_move_s=least_move_s(length, gravity),
        gravity_m_s2=gravity,
        load_weight_n=load_mass * gravity,
        weight_n=(table["VEH_QUAD_MASS"] + load_mass) * gravity,
        ramp_lag_s=ramp_lag_s,
        limits=limits_from(table, follows_shaped),
        motion=MotionSettings(
            takeoff_altitude_m=table["MIS_TAKEOFF_ALT"],
            speed_m_s=table["MIS_SPEED"],
            accel_m_s2=table["MIS_ACCEL"],
            lift_speed_m_s=table["MIS_LIFT_SPEED"],
            taut_speed_m_s=min(table["MIS_TAUT_SPEED"], table["MIS_SNAP_SPEED"]),
            snap_speed_m_s=table["MIS_SNAP_SPEED"],
            return_altitude_m=table["RTL_RETURN_ALT"],
        ),
        heading=HeadingLimits(
            rate=radians(table["MPC_YAWRAUTO_MAX"]),
            fastest=radians(table["MPC_MAN_Y_MAX"]),
            accel=radians(table["MPC_YAWRAUTO_ACC"]),
        ),
        failsafe=FailsafeSettings(
            load_error_limit_m=table["FS_LOAD_ERR"],
            tilt_limit_rad=radians(table["FS_TILT_DEG"]),
            sensor_age_limit_s=table["FS_SENSOR_S"],
        ),
        setpoints=SetpointSettings(
            offboard_loss_us=round(1e6 * table["COM_OF_LOSS_T"]),
            manual_loss_us=round(1e6 * table["COM_RC_LOSS_T"]),
            guided_loss_us=round(1e6 * table["GUID_TIMEOUT"]),
            stick_speed_m_s=table["MPC_VEL_MANUAL"],
            fastest_m_s=table["MPC_XY_VEL_MAX"],
            hover_share=table["MPC_THR_HOVER"],
            guided_mode=int(table["MAV_IDENTITY"]) == ARDUPILOT_IDENTITY,
            guides_vehicle=table["GDE_TARGET"] != 0.0,
        ),
        fence=FenceSettings(
            action=int(table["GF_ACTION"]),
            radius_m=table["GF_MAX_HOR_DIST"],
            height_m=table["GF_MAX_VER_DIST"],
        ),
        winch=WinchSettings(
            shortest_m=table["WNC_LEN_MIN"],
            longest_m=table["WNC_LEN_MAX"],
            speed_m_s=table["WNC_SPEED"],
            accel_m_s2=table["WNC_ACCEL"],
            usable=reels,
        ),
        rotors=_rotors(table, (table["VEH_QUAD_MASS"] + load_mass) * gravity),
    )


def _rotors(table: AutopilotParameters, weight_n: float) -> RotorSettings:
    low, high = table["VEH_ROTOR_MIN"], table["VEH_ROTOR_MAX"]
    if table["VEH_ROTOR_LIM"] == 0.0:
        low, high = -GREATEST_FORCE_N, GREATEST_FORCE_N
    return RotorSettings(table.layout, low, high, weight_n)


def limits_from(table: AutopilotParameters, follows_shaped: bool) -> Limits:
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
        columns(table.layout),
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
