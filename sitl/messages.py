"""The datagrams of a tick in machine code: readings that leave the sensors, and the truth, as frames in a
buffer."""

from __future__ import annotations

from math import nan
from typing import Any, NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, apply_transposed, norm, sub
from autopilot.geometry.packed import Row, pack, unpack
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.wire.compiled import Bytes, Origin, put_frame
from autopilot.wire.convert.flight import load_state_values, rotor_state_values
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import (
    ACCEL,
    GYRO,
    MAG,
    PRESSURE,
    SIMULATOR_COMPONENT,
    SPEED_REPORT_US,
    TEMPERATURE,
    esc_status_values,
    forces_from_row,
    hil_gps_values,
    hil_sensor_values,
    hil_state_quaternion_values,
    load_sensor_values,
    odometry_values,
    rotor_speed_rpm,
)
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.simulator_frames import (
    ESC_STATUS,
    HIL_GPS,
    HIL_SENSOR,
    HIL_STATE_QUATERNION,
    LOAD_SENSOR,
    LOAD_STATE,
    ODOMETRY,
    ROTOR_STATE,
)
from sitl.plant.attachment import attachment_position
from sitl.plant.rotors import COMMAND, FORCE, STRENGTH, RotorRows
from sitl.sensors.barometer import BarometerReading
from sitl.sensors.cable_sensor import CableReading
from sitl.sensors.gnss import FLOATING, LOST, GnssReading
from sitl.sensors.imu import ImuReading
from sitl.sensors.load_tracker import LoadReading
from sitl.sensors.magnetometer import MagnetometerReading
from sitl.sensors.pose_tracker import PoseReading
from sitl.sensors.profile import ReportedStd
from sitl.world import (
    BARO,
    CABLE,
    GNSS,
    IMU,
    LOAD,
    MOCAP,
    READING,
    STAMP_US,
    World,
    WorldModel,
    WorldRows,
    pop_arrived,
    rotors_of,
)
from sitl.world import MAG as MAGNETOMETER

VEHICLE_SYSTEM = 1
# sends the messages of our dialect: tools that do not know them would count their sequence numbers as losses
DIALECT_COMPONENT = 27
TRACKER, CAMERA, ENCODER = 0, 1, 2  # LOAD_SENSOR.sensor_id
DIALECT_FRAMES = 2  # frames of our dialect that `put_truth` writes, after one of the common dialect
_TRUTH = mavlink.PLUMBLINE_SOURCE_TRUTH
_FLOAT, _NO_FIX = mavlink.GPS_FIX_TYPE_RTK_FLOAT, mavlink.GPS_FIX_TYPE_NO_FIX
_UNKNOWN_M = 655.35  # UINT16_MAX cm: unknown
_NAN3: Vec3 = (nan, nan, nan)


class MessageConstants(NamedTuple):
    """The contents of the messages besides the readings."""

    std: ReportedStd
    home: Home
    fix_type: int  # GPS_FIX_TYPE
    satellites: int
    cable_id: int  # LOAD_SENSOR.sensor_id of the cable sensor


class LatestReadings(NamedTuple):
    """The last readings of the sensors that HIL_SENSOR repeats at every tick."""

    inertial: ImuReading
    field: MagnetometerReading
    height: BarometerReading


@kernel
def pressure_pa(altitude_m: float) -> float:
    """Pressure of the international standard atmosphere below 11 km; altitude above mean sea level."""
    pressure: float = 101_325.0 * max(1.0 - 2.25577e-5 * altitude_m, 0.0) ** 5.25588
    return pressure


@kernel
def _put(kind: Any, values: Any, payload: Bytes, buffer: Bytes, at: int, sequence: int) -> int:
    return put_frame(kind, values, payload, buffer, at, Origin(sequence, VEHICLE_SYSTEM, SIMULATOR_COMPONENT))


@kernel
def rotor_speed(rows: WorldRows, i: int) -> float:
    """The speed that the speed controller of a rotor measures, rpm; 0 if there is no such rotor."""
    rotors = rotors_of(rows)
    if i >= rotors.table.shape[0]:
        return 0.0
    max_force = rotors.table[i, STRENGTH] * unpack(WorldModel, rows.model, 0).truth.rotor_max
    return rotor_speed_rpm(rotors.rows[FORCE, i], max_force)


@kernel
def _speeds(rows: WorldRows, first: int, now_us: int) -> Any:
    rpm = (
        rotor_speed(rows, first),
        rotor_speed(rows, first + 1),
        rotor_speed(rows, first + 2),
        rotor_speed(rows, first + 3),
    )
    return esc_status_values(now_us, first, rpm)


@kernel
def put_sensors(
    rows: WorldRows, now_us: int, latest: Row, constants: Row, buffer: Bytes, payload: Bytes, sequence: int
) -> tuple[int, int]:
    """Take the readings that have left the sensors by now out of the queues, and write their frames,
    HIL_SENSOR last.

    Returns the number of bytes and the sequence number of the next frame. `latest` is a `LatestReadings`,
    which is updated, `constants` a `MessageConstants`; `payload` is scratch of MAX_PAYLOAD_BYTES bytes.
    """
    shared = unpack(MessageConstants, constants, 0)
    std = shared.std
    queue = rows.queue
    at = fields = 0
    reading = pop_arrived(MOCAP, now_us, rows)
    while reading >= 0:
        row = queue[MOCAP, reading]
        pose = unpack(PoseReading, row, READING)
        values = odometry_values(
            int(row[STAMP_US]),
            pose.position,
            pose.quat_wxyz,
            pose.velocity,
            pose.omega_body,
            std.mocap_position,
            std.mocap_attitude,
            std.mocap_velocity,
        )
        at = _put(ODOMETRY, values, payload, buffer, at, sequence)
        sequence += 1
        reading = pop_arrived(MOCAP, now_us, rows)
    reading = pop_arrived(LOAD, now_us, rows)
    while reading >= 0:
        row = queue[LOAD, reading]
        load = unpack(LoadReading, row, READING)
        velocity_std = std.load_velocity if load.velocity[0] == load.velocity[0] else nan
        tracked = load_sensor_values(
            int(row[STAMP_US]),
            load.position,
            load.velocity,
            _NAN3,
            std.load_position,
            velocity_std,
            nan,
            TRACKER,
        )
        at = _put(LOAD_SENSOR, tracked, payload, buffer, at, sequence)
        sequence += 1
        reading = pop_arrived(LOAD, now_us, rows)
    reading = pop_arrived(CABLE, now_us, rows)
    while reading >= 0:
        row = queue[CABLE, reading]
        cable = unpack(CableReading, row, READING)
        if cable.detected > 0.0:
            sighted = load_sensor_values(
                int(row[STAMP_US]),
                _NAN3,
                _NAN3,
                cable.direction_body,
                nan,
                nan,
                std.direction,
                shared.cable_id,
            )
            at = _put(LOAD_SENSOR, sighted, payload, buffer, at, sequence)
            sequence += 1
        reading = pop_arrived(CABLE, now_us, rows)
    reading = pop_arrived(GNSS, now_us, rows)
    while reading >= 0:
        row = queue[GNSS, reading]
        fix = unpack(GnssReading, row, READING)
        fix_type, horizontal, vertical = shared.fix_type, std.gnss_horizontal, std.gnss_vertical
        if fix.quality == FLOATING:
            fix_type, horizontal, vertical = _FLOAT, std.gnss_float, std.gnss_float
        elif fix.quality == LOST:
            fix_type, horizontal, vertical = _NO_FIX, _UNKNOWN_M, _UNKNOWN_M
        gnss = hil_gps_values(
            int(row[STAMP_US]),
            fix_type,
            fix.position,
            fix.velocity,
            horizontal,
            vertical,
            shared.satellites,
            shared.home,
        )
        at = _put(HIL_GPS, gnss, payload, buffer, at, sequence)
        sequence += 1
        reading = pop_arrived(GNSS, now_us, rows)
    if now_us % SPEED_REPORT_US == 0:
        for first in range(0, rows.rotor_table.shape[0], 4):
            at = _put(ESC_STATUS, _speeds(rows, first, now_us), payload, buffer, at, sequence)
            sequence += 1
    last = unpack(LatestReadings, latest, 0)
    inertial, field, height = last.inertial, last.field, last.height
    reading = pop_arrived(IMU, now_us, rows)
    while reading >= 0:
        inertial = unpack(ImuReading, queue[IMU, reading], READING)
        fields |= ACCEL | GYRO
        reading = pop_arrived(IMU, now_us, rows)
    reading = pop_arrived(MAGNETOMETER, now_us, rows)
    while reading >= 0:
        field = unpack(MagnetometerReading, queue[MAGNETOMETER, reading], READING)
        fields |= MAG
        reading = pop_arrived(MAGNETOMETER, now_us, rows)
    reading = pop_arrived(BARO, now_us, rows)
    while reading >= 0:
        height = unpack(BarometerReading, queue[BARO, reading], READING)
        fields |= PRESSURE | TEMPERATURE
        reading = pop_arrived(BARO, now_us, rows)
    pack(LatestReadings(inertial, field, height), latest, 0)
    altitude = shared.home.altitude_m + height.height
    hil_sensor = hil_sensor_values(
        now_us,
        inertial.accel_body,
        inertial.gyro_body,
        field.field_body,
        pressure_pa(altitude),
        altitude,
        15.0 - 0.0065 * altitude,
        fields,
        0,
    )
    at = _put(HIL_SENSOR, hil_sensor, payload, buffer, at, sequence)
    return at, (sequence + 1) & 0xFF


@kernel
def put_truth(
    world_row: Row,
    model_row: Row,
    rotors: RotorRows,
    constants: Row,
    buffer: Bytes,
    payload: Bytes,
    sequence: int,
    dialect_sequence: int,
) -> int:
    """Write HIL_STATE_QUATERNION, LOAD_STATE and ROTOR_STATE of this tick; returns the number of bytes.

    The first has the sequence number `sequence` of SIMULATOR_COMPONENT; those of the others begin at
    `dialect_sequence`, of DIALECT_COMPONENT.
    """
    world, truth = unpack(World, world_row, 0), unpack(WorldModel, model_row, 0).truth
    state, home = world.plant, unpack(MessageConstants, constants, 0).home
    accel = state.accel_quad
    attachment = attachment_position(state.x_quad, rotation_from_quat(state.quat_wxyz), truth)
    vehicle = hil_state_quaternion_values(
        world.now_us,
        state.quat_wxyz,
        state.omega_body,
        state.x_quad,
        state.v_quad,
        norm(sub(state.v_quad, world.wind)),
        apply_transposed(rotation_from_quat(state.quat_wxyz), (accel[0], accel[1], accel[2] + truth.gravity)),
        home,
    )
    at = _put(HIL_STATE_QUATERNION, vehicle, payload, buffer, 0, sequence)
    load = load_state_values(
        world.now_us,
        _TRUTH,
        state.x_load,
        state.v_load,
        state.q_cable,
        state.q_cable_dot,
        norm(sub(state.x_load, attachment)),
        state.tension,
        state.taut > 0.0,
        int(state.slack_events),
    )
    load_origin = Origin(dialect_sequence & 0xFF, VEHICLE_SYSTEM, DIALECT_COMPONENT)
    rotor_origin = Origin((dialect_sequence + 1) & 0xFF, VEHICLE_SYSTEM, DIALECT_COMPONENT)
    at = put_frame(LOAD_STATE, load, payload, buffer, at, load_origin)
    low, high = truth.rotor_min, truth.rotor_max
    saturated = 0
    count = rotors.table.shape[0]
    for i in range(count):
        strength = rotors.table[i, STRENGTH]
        if not strength * low <= rotors.rows[COMMAND, i] <= strength * high:
            saturated |= 1 << i
    forces = forces_from_row(rotors.rows[FORCE], 0)
    rotor_state = rotor_state_values(world.now_us, _TRUTH, forces, low, high, saturated, count)
    return put_frame(ROTOR_STATE, rotor_state, payload, buffer, at, rotor_origin)


NO_READINGS = LatestReadings(ImuReading(ZERO, ZERO), MagnetometerReading(ZERO), BarometerReading(0.0))
