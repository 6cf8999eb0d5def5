"""The flight at one instant, as telemetry requires it: SI, world ENU from home, body FLU.

The onboard software provides one when `VehicleEndpoint.poll` requests it; no service accesses the core.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.packed import Row
from autopilot.geometry.so3 import Quat
from autopilot.wire.convert.battery import CHARGE_LEVELS, ChargeLevels
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import NO_FORCES, Forces
from autopilot.wire.dialect import plumbline as mavlink

_UNKNOWN: Vec3 = (math.nan, math.nan, math.nan)
_DOWN: Vec3 = (0.0, 0.0, -1.0)
_LEVEL: Quat = (1.0, 0.0, 0.0, 0.0)

# Sensors that this vehicle may have, as bits of SYS_STATUS
GYRO = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
ACCEL = mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
MAG = mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
BARO = mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
GPS = mavlink.MAV_SYS_STATUS_SENSOR_GPS
TRACKER = mavlink.MAV_SYS_STATUS_SENSOR_VISION_POSITION
MOTORS = mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
AHRS = mavlink.MAV_SYS_STATUS_AHRS
BATTERY = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
GEOFENCE = mavlink.MAV_SYS_STATUS_GEOFENCE  # present: there is a fence
PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK  # health: the vehicle may be armed


HEIGHT_LIMIT_PARAMETER = "GF_MAX_VER_DIST"  # the parameter that `breach` names if the flight is too high


class GpsFix(NamedTuple):
    """The last fix as the receiver reported it (not the estimate)."""

    time_us: int
    fix_type: int  # GPS_FIX_TYPE
    position: Vec3
    velocity: Vec3
    horizontal_std: float  # m
    vertical_std: float  # m
    satellites: int


class SensorReadings(NamedTuple):
    """The last readings of the vehicle's own sensors, body FLU; zeros for a sensor that has read nothing."""

    gyro: Vec3  # rad/s
    accel: Vec3  # specific force, m/s^2
    field_gauss: Vec3
    pressure_pa: float
    pressure_altitude_m: float
    temperature_degC: float
    field_us: int  # time of the last reading of the magnetometer, and of the barometer; -1: never
    pressure_us: int


class TestRatios(NamedTuple):
    """Squared innovations of the last readings over the limits above which they are refused; NaN: none."""

    velocity: float
    horizontal: float
    vertical: float
    magnetic: float


NO_TEST_RATIOS = TestRatios(math.nan, math.nan, math.nan, math.nan)


class Sortie(NamedTuple):
    """The present or the last flight, by the vehicle's clock in us; 0: not yet."""

    armed_us: int = 0
    takeoff_us: int = 0
    landed_us: int = 0


_NO_SORTIE = Sortie()


@dataclass
class Snapshot:
    """One instant of the flight. The defaults are a vehicle that stands at home and has measured nothing.

    A snapshot belongs to its reader, who may set fields. A subclass may compute fields when they are first
    read.
    """

    now_us: int
    boot_unix_us: int
    home: Home

    # state of the flight
    armed: bool
    phase: int  # PLUMBLINE_PHASE
    main_mode: int  # PX4's pair, see identity
    sub_mode: int
    landed_state: int  # MAV_LANDED_STATE
    system_status: int  # MAV_STATE
    requested_mode: int | None = None  # custom mode that was requested by its number

    home_position: Vec3 = ZERO  # where a return leads: HOME_POSITION, ENU

    fence_enabled: bool = True  # the fence is not switched off
    breach: str = ""  # of the fence; empty: none
    last_breach: str = ""  # the same of the last breach, over or not
    breaches: int = 0
    breach_us: int = 0

    # estimate of the vehicle
    x_quad: Vec3 = ZERO
    v_quad: Vec3 = ZERO
    quat_wxyz: Quat = _LEVEL
    omega_body: Vec3 = ZERO
    estimator_flags: int = 0  # ESTIMATOR_STATUS_FLAGS
    horizontal_std: float = math.nan  # m
    vertical_std: float = math.nan  # m
    test_ratios: TestRatios = NO_TEST_RATIOS

    # estimate of load and cable
    x_load: Vec3 = ZERO
    v_load: Vec3 = ZERO
    q_cable: Vec3 = _DOWN
    q_cable_dot: Vec3 = ZERO
    distance: float = 0.0
    cable_length: float = 0.0  # as set by the winch
    tension: float = 0.0
    taut: bool = False
    slack_events: int = 0

    # load (position, velocity) and vehicle in the built-in filter's estimate, while a custom estimator flies
    built_in: tuple[Vec3, Vec3, Vec3] | None = None

    # what the cascade tracks
    control_mode: int = mavlink.PLUMBLINE_CONTROL_NONE
    seq: int = 0  # mission item in force
    elapsed_s: float = 0.0
    duration_s: float = math.nan
    x_load_d: Vec3 = ZERO
    v_load_d: Vec3 = ZERO
    a_load_d: Vec3 = ZERO
    x_load_requested: Vec3 = ZERO  # the requested path; the above is as close to it as the vehicle can fly
    v_load_requested: Vec3 = ZERO
    q_cable_c: Vec3 = _DOWN
    x_quad_d: Vec3 = _UNKNOWN  # position setpoint of the vehicle; NaN while there is none
    quat_c_wxyz: Quat = _LEVEL

    # errors of the cascade, and its commands to the mixer
    e_x: Vec3 = ZERO
    e_v: Vec3 = ZERO
    e_q: Vec3 = ZERO
    e_q_dot: Vec3 = ZERO
    e_R: Vec3 = ZERO
    e_Omega: Vec3 = ZERO
    psi_R: float = 0.0
    psi_q: float = 0.0
    thrust: float = 0.0
    moment: Vec3 = ZERO

    # rotors
    forces: Forces = NO_FORCES  # commanded, N
    rotor_min: float = 0.0
    rotor_max: float = math.inf
    saturated: int = 0  # bit i: rotor i+1 was cut
    rotors: int = 4  # number of rotors
    rotor_rpm: tuple[float, ...] = (0.0,) * 4  # last reported by the speed controllers, one per rotor
    rotors_lost: int = 0  # bit i: rotor i+1 does not follow its commands

    # the rest of the vehicle
    sensors_present: int = 0  # the bits above
    sensors_healthy: int = 0
    gps: GpsFix | None = None
    readings: SensorReadings | None = None  # None: no inertial sample yet
    sortie: Sortie = _NO_SORTIE
    vibration: Vec3 = ZERO  # m/s^2, body
    clipped_samples: int = 0  # of the accelerometer, at its full scale
    wind: Vec3 = _UNKNOWN  # m/s, the direction towards which it blows
    battery_voltage: float = math.nan  # V
    battery_current: float = math.nan  # A
    battery_used_mah: float = math.nan
    battery_remaining: float = math.nan  # 0 ... 1
    charge_levels: ChargeLevels = CHARGE_LEVELS

    # mission
    mission_current: int = 0
    mission_total: int = 0
    mission_state: int = mavlink.MISSION_STATE_NO_MISSION
    reel_rate: float = 0.0  # m/s at which the winch lets out the cable
    released: bool = False  # the gripper has let go of cable and load
    plan_ids: tuple[int, int, int] = (0, 0, 0)  # of mission, fence, rally points; 0: there is none

    instant: Row | None = None  # the packed `Instant`, if available: machine code makes frames of it
    # while it is the same object, only the plans of `telemetry.WATCHED` can change
    change_token: object = None
