"""What the simulator link does to readings and commands: the rounding of its messages, without the messages.

Readings are rounded to single precision in NED and FRD, fixes to 1e-7 degrees, so that a flight without a
wire is the same flight. Nothing else is done here: the autopilot decides which readings it accepts.
"""

from __future__ import annotations

from math import cos, nan, pi, radians, sqrt
from typing import NamedTuple

import numpy as np

from autopilot.control.actuators.mixer import FORCE
from autopilot.estimation import inbox as box
from autopilot.estimation.records import (
    PLAIN,
    RTK_FIXED,
    RTK_FLOAT,
    Array,
    DirectionReading,
    GnssReading,
    LoadReading,
    PoseReading,
)
from autopilot.geometry.frames import quat_enu_flu_from_ned_frd, quat_ned_frd_from_enu_flu
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above, to_single
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.packed import Row, pack
from autopilot.wire.convert.geodesy import EARTH_RADIUS_M, Home
from autopilot.wire.convert.scaling import saturated
from autopilot.wire.convert.simulator import REEL_MAX, ROTOR_FMAX, SPEED_REPORT_US
from sitl.messages import rotor_speed
from sitl.plant.rotors import REQUESTED
from sitl.sensors.gnss import FIXED, LOST
from sitl.sensors.profile import Profile, reported_std
from sitl.world import BARO, CABLE, GNSS, IMU, LOAD, MAG, MOCAP, READING, STAMP_US, WorldRows, pop_arrived


class Wire(NamedTuple):
    """The standard deviations that the trackers state, as they arrive (negative: not measured), and home."""

    pose_position_std: float
    pose_attitude_std: float
    pose_velocity_std: float
    load_position_std: float
    load_velocity_std: float
    direction_std: float
    fix_horizontal_std: float
    fix_vertical_std: float
    fix_float_std: float
    rtk: float  # GnssReading.rtk of a fix that is not RTK_FLOAT
    home: Vec3  # degrees north and east, m
    metres_per_degree: float
    east_metres_per_degree: float
    cosine: float  # of the latitude


@kernel
def _single3(row: Row, first: int) -> Vec3:
    return (to_single(row[first]), to_single(row[first + 1]), to_single(row[first + 2]))


@kernel
def put_forces(rotors: Array, table: Array, world: WorldRows) -> None:
    """Pass the commanded rotor forces (N) to the world, rounded as in HIL_ACTUATOR_CONTROLS; `rotors` and
    `table` are the mixer's."""
    rotors_of_world = world.rotors
    for i in range(min(table.shape[0] - 1, world.rotor_table.shape[0])):
        rotors_of_world[REQUESTED, i] = to_single(rotors[FORCE, i] / ROTOR_FMAX) * ROTOR_FMAX


@kernel
def rounded_reel_rate(rate: float) -> float:
    """The winch's rate (m/s), rounded as in HIL_ACTUATOR_CONTROLS."""
    return to_single(rate / REEL_MAX) * REEL_MAX


@kernel
def _pose(row: Row, wire: Wire) -> PoseReading:
    sent = quat_ned_frd_from_enu_flu((row[READING + 3], row[READING + 4], row[READING + 5], row[READING + 6]))
    quat = quat_enu_flu_from_ned_frd(
        (to_single(sent[0]), to_single(sent[1]), to_single(sent[2]), to_single(sent[3]))
    )
    v_quad = ZERO if wire.pose_velocity_std < 0.0 else _single3(row, READING + 7)
    return PoseReading(
        0.0,
        _single3(row, READING),
        quat,
        v_quad,
        wire.pose_position_std,
        wire.pose_attitude_std,
        wire.pose_velocity_std,
    )


@kernel
def _load(row: Row, wire: Wire) -> LoadReading:
    v_load = ZERO if wire.load_velocity_std < 0.0 else _single3(row, READING + 3)
    return LoadReading(0.0, _single3(row, READING), v_load, wire.load_position_std, wire.load_velocity_std)


@kernel
def _fix(row: Row, wire: Wire) -> GnssReading:
    """A fix, rounded as in HIL_GPS: position in 1e-7 degrees and millimetres, velocity in centimetres."""
    home, scale_north, scale_east = wire.home, wire.metres_per_degree, wire.east_metres_per_degree
    east_deg = row[READING] / scale_east
    north_deg = row[READING + 1] / scale_north
    latitude = np.rint((home[0] + north_deg) / 1e-7)
    longitude = np.rint((home[1] + east_deg) / 1e-7)
    altitude = np.rint((home[2] + row[READING + 2]) * 1e3)
    position = (
        (longitude * 1e-7 - home[1]) * scale_north * wire.cosine,
        (latitude * 1e-7 - home[0]) * scale_north,
        altitude * 1e-3 - home[2],
    )
    velocity = (
        np.rint(row[READING + 3] * 100.0) * 0.01,
        np.rint(row[READING + 4] * 100.0) * 0.01,
        -(np.rint(-row[READING + 5] * 100.0) * 0.01),
    )
    quality = row[READING + 6]
    horizontal = if_above(quality, FIXED, wire.fix_float_std, wire.fix_horizontal_std)
    vertical = if_above(quality, FIXED, wire.fix_float_std, wire.fix_vertical_std)
    rtk = if_above(quality, FIXED, RTK_FLOAT, wire.rtk)
    return GnssReading(0.0, position, velocity, horizontal, vertical, rtk)


@kernel
def _newest(sensor: int, now_us: int, rows: WorldRows) -> int:
    """Row of the sensor's newest reading that arrives at this tick, or -1; removes the older ones."""
    newest = -1
    index = pop_arrived(sensor, now_us, rows)
    while index >= 0:
        newest = index
        index = pop_arrived(sensor, now_us, rows)
    return newest


@kernel
def deliver_readings(rows: WorldRows, now_us: int, wire: Wire, inbox: Array) -> int:
    """Put the readings that arrive at this tick into the autopilot's inbox; return their number.

    Row 0 is the inertial unit's: HIL_SENSOR contains its newest sample, or repeats the last one.
    """
    newest = _newest(IMU, now_us, rows)
    inbox[0, box.KIND] = box.IMU
    inbox[0, box.SAMPLE_TIME_US] = now_us if newest >= 0 else box.REPEATED_SAMPLE
    if newest >= 0:
        row = rows.queue[IMU, newest]
        for i in range(3):
            inbox[0, box.READING + i] = to_single(row[READING + 3 + i])
            inbox[0, box.READING + 3 + i] = to_single(row[READING + i])
    count = 1
    index = pop_arrived(MOCAP, now_us, rows)
    while index >= 0:
        inbox[count, box.KIND], inbox[count, box.SAMPLE_TIME_US] = (
            box.POSE,
            rows.queue[MOCAP, index, STAMP_US],
        )
        pack(_pose(rows.queue[MOCAP, index], wire), inbox[count], box.READING)
        count += 1
        index = pop_arrived(MOCAP, now_us, rows)
    index = pop_arrived(LOAD, now_us, rows)
    while index >= 0:
        inbox[count, box.KIND], inbox[count, box.SAMPLE_TIME_US] = box.LOAD, rows.queue[LOAD, index, STAMP_US]
        pack(_load(rows.queue[LOAD, index], wire), inbox[count], box.READING)
        count += 1
        index = pop_arrived(LOAD, now_us, rows)
    index = pop_arrived(CABLE, now_us, rows)
    while index >= 0:
        row = rows.queue[CABLE, index]
        if row[READING + 3] > 0.0:  # the cable is seen
            direction = DirectionReading(0.0, _single3(row, READING), wire.direction_std)
            inbox[count, box.KIND], inbox[count, box.SAMPLE_TIME_US] = box.DIRECTION, row[STAMP_US]
            pack(direction, inbox[count], box.READING)
            count += 1
        index = pop_arrived(CABLE, now_us, rows)
    newest = _newest(GNSS, now_us, rows)
    if newest >= 0 and rows.queue[GNSS, newest, READING + 6] < LOST:
        inbox[count, box.KIND], inbox[count, box.SAMPLE_TIME_US] = box.FIX, rows.queue[GNSS, newest, STAMP_US]
        pack(_fix(rows.queue[GNSS, newest], wire), inbox[count], box.READING)
        count += 1
    newest = _newest(BARO, now_us, rows)
    if newest >= 0:
        inbox[count, box.KIND] = box.HEIGHT
        altitude = to_single(wire.home[2] + rows.queue[BARO, newest, READING])
        inbox[count, box.READING] = altitude - wire.home[2]
        count += 1
    newest = _newest(MAG, now_us, rows)
    if newest >= 0:
        inbox[count, box.KIND] = box.FIELD
        for i in range(3):
            inbox[count, box.READING + i] = to_single(rows.queue[MAG, newest, READING + i])
        count += 1
    if now_us % SPEED_REPORT_US == 0:
        for first in range(0, rows.rotor_table.shape[0], 4):
            inbox[count, box.KIND] = box.ROTOR_SPEEDS
            inbox[count, box.READING] = first
            for i in range(4):
                inbox[count, box.READING + 1 + i] = rotor_speed(rows, first + i)
            count += 1
    return count


def max_readings(rows: WorldRows) -> int:
    """The greatest number of readings that can arrive at one tick."""
    return int(rows.queue.shape[0] * rows.queue.shape[1]) + len(rows.rotor_table)


def wire_of(profile: Profile, noise_scale: float, home: Home) -> Wire:
    """What the trackers of a profile state, rounded as in their messages."""
    stated = reported_std(profile, noise_scale)
    mocap, load = profile.mocap, profile.load_tracker

    def received_std(std: float) -> float:
        """The deviation as the receiver computes it from a variance that was sent."""
        variance = float(np.float32(std * std))
        return sqrt(variance) if variance >= 0.0 else nan

    metres, cosine = EARTH_RADIUS_M * pi / 180.0, cos(radians(home.latitude_deg))
    measured = mocap is not None and mocap.velocity_noise_m_s is not None
    load_measured = load is not None and load.velocity_noise_m_s is not None
    return Wire(
        received_std(stated.mocap_position),
        received_std(stated.mocap_attitude),
        received_std(stated.mocap_velocity) if measured else box.NOT_MEASURED,
        float(np.float32(stated.load_position)),
        float(np.float32(stated.load_velocity)) if load_measured else box.NOT_MEASURED,
        float(np.float32(stated.direction)),
        saturated(stated.gnss_horizontal * 100.0, 0, 0xFFFE) * 0.01,
        saturated(stated.gnss_vertical * 100.0, 0, 0xFFFE) * 0.01,
        saturated(stated.gnss_float * 100.0, 0, 0xFFFE) * 0.01,
        RTK_FIXED if profile.gnss is not None and profile.gnss.fix == "rtk" else PLAIN,
        (home.latitude_deg, home.longitude_deg, home.altitude_m),
        metres,
        metres * cosine,
        cosine,
    )
