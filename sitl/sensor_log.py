"""The log of the sensors: at each tick the frames that the autopilot receives, beside the true state.

A log is bytes: a line of JSON (`calibration` describes the sensors, `columns` names the numbers of a tick),
then blocks of two counts (int64), of ticks and of bytes; the numbers of the ticks (float64, one row each);
and the frames of the sensors of all these ticks, one after another. `gcs.analysis.readings` makes tables.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, times
from autopilot.geometry.packed import pack, unpack, width
from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.wire.compiled import Bytes
from sitl.plant.records import PlantState
from sitl.plant.rotors import FORCE, REQUESTED
from sitl.sensors.barometer import BarometerState
from sitl.sensors.cable_sensor import CableState
from sitl.sensors.gnss import GnssState
from sitl.sensors.imu import ImuState
from sitl.sensors.load_tracker import LoadTrackerState
from sitl.sensors.magnetometer import MagnetometerState
from sitl.sensors.pose_tracker import PoseState
from sitl.world import (
    BARO,
    CABLE,
    GNSS,
    HEAD,
    IMU,
    LOAD,
    MAG,
    MOCAP,
    STAMP_US,
    Floats,
    Ints,
    World,
    WorldModel,
    WorldRows,
)

_TICKS, _FRAMES_BYTES = 1024, 1 << 20  # for which there is room
# entries of `LogRows.used`
TICKS, BYTES = 0, 1


class Instant(NamedTuple):
    """The numbers of a tick; those of the rotors follow. The errors of sensors are those of their next
    readings."""

    now_us: int
    frame_bytes: int  # of the sensors' frames
    imu_us: int  # times of measurement of what HIL_SENSOR carries
    magnetometer_us: int
    barometer_us: int
    load_attached: bool
    cable_length: float  # m
    wind: Vec3  # ENU, m/s
    plant: PlantState
    imu: ImuState
    mocap: PoseState
    load: LoadTrackerState
    cable: CableState
    gnss: Vec3  # ENU, m: correlated error of the position
    multipath: Vec3
    barometer: float  # m
    magnetometer: MagnetometerState


def _xyz(name: str, unit: str = "") -> list[str]:
    return [f"{name}_{axis}{unit}" for axis in "xyz"]


COLUMNS = (
    *("time_us", "frame_bytes", "imu_us", "magnetometer_us", "barometer_us", "load_attached"),
    *("cable_length_m", *_xyz("wind", "_m_s")),
    *(*_xyz("load_true", "_m"), *_xyz("load_velocity_true", "_m_s")),
    *(*_xyz("cable_true"), *_xyz("cable_rate_true", "_per_s")),
    *(*_xyz("vehicle_true", "_m"), *_xyz("vehicle_velocity_true", "_m_s")),
    *("vehicle_quaternion_w", *_xyz("vehicle_quaternion"), *_xyz("vehicle_rate", "_rad_s")),
    *("cable_taut", "cable_slack_events", "vehicle_on_ground", "load_on_ground"),
    *(*_xyz("vehicle_acceleration", "_m_s2"), "cable_tension_n", "diverged", "cable_snap_speed_m_s"),
    *_xyz("vehicle_angular_acceleration", "_rad_s2"),
    *(*_xyz("imu_accel_bias", "_m_s2"), *_xyz("imu_gyro_bias", "_rad_s")),
    *(*_xyz("mocap_offset", "_m"), *_xyz("mocap_wander", "_m")),
    *(*_xyz("load_tracker_offset", "_m"), *_xyz("load_tracker_wander", "_m")),
    *(*_xyz("cable_sensor_mounting", "_rad"), *_xyz("gnss_wander", "_m"), *_xyz("gnss_multipath", "_m")),
    *("barometer_drift_m", *_xyz("magnetometer_offset", "_gauss")),
    *(f"rotor_force_{i + 1}_n" for i in range(MAX_ROTORS)),
    *(f"rotor_command_{i + 1}_n" for i in range(MAX_ROTORS)),
)
_ROTORS = width(Instant)


class LogRows(NamedTuple):
    """Ticks that are still to be written, which machine code appends to."""

    instants: Floats  # (ticks, numbers of a tick); without room for a tick, nothing is logged
    frames: Bytes
    used: Ints  # (2,) ticks and bytes that are in use
    limits: Ints  # (2,) from which on there is no room for another tick


NOT_LOGGED = LogRows(
    np.zeros((0, len(COLUMNS))), np.zeros(0, np.uint8), np.zeros(2, np.int64), np.ones(2, np.int64)
)


@kernel
def has_room(log: LogRows) -> bool:
    """Whether another tick can be appended, or nothing is logged."""
    return bool(log.used[TICKS] < log.limits[TICKS] and log.used[BYTES] < log.limits[BYTES])


@kernel
def _last_stamp_us(sensor: int, rows: WorldRows) -> int:
    """The time stamp of the reading that was last taken out of the queue of a sensor."""
    capacity = rows.queue.shape[1]
    return int(rows.queue[sensor, (rows.clock[sensor, HEAD] + capacity - 1) % capacity, STAMP_US])


@kernel
def put_instant(log: LogRows, rows: WorldRows, frames: Bytes, length: int) -> None:
    """Append the present tick, whose sensors' frames are the first `length` bytes of `frames` and have just
    been taken out of the queues."""
    world, gnss = unpack(World, rows.world, 0), unpack(WorldModel, rows.model, 0).gnss
    errors, receiver = rows.errors, unpack(GnssState, rows.errors[GNSS], 0)
    instant = Instant(
        world.now_us,
        length,
        _last_stamp_us(IMU, rows),
        _last_stamp_us(MAG, rows),
        _last_stamp_us(BARO, rows),
        not world.released,
        world.cable_length,
        world.wind,
        world.plant,
        unpack(ImuState, errors[IMU], 0),
        unpack(PoseState, errors[MOCAP], 0),
        unpack(LoadTrackerState, errors[LOAD], 0),
        unpack(CableState, errors[CABLE], 0),
        times(gnss.position_error, receiver.error),
        times(gnss.multipath_error, receiver.multipath),
        unpack(BarometerState, errors[BARO], 0).error[0],
        unpack(MagnetometerState, errors[MAG], 0),
    )
    row, start = log.instants[log.used[TICKS]], log.used[BYTES]
    pack(instant, row, 0)
    for i in range(MAX_ROTORS):
        row[_ROTORS + i] = rows.rotors[FORCE, i]
        row[_ROTORS + MAX_ROTORS + i] = rows.rotors[REQUESTED, i]
    for i in range(length):
        log.frames[start + i] = frames[i]
    log.used[TICKS] += 1
    log.used[BYTES] += length


class SensorLog:
    """Writes the log of a simulator to a function that takes bytes."""

    def __init__(self, write: Callable[[bytes], object]) -> None:
        self._write = write
        self._begun = False
        self.rows = NOT_LOGGED
        self._put: Callable[..., None] | None = None  # machine code, after its first use

    def begin(self, calibration: dict[str, Any], max_frame_bytes: int) -> None:
        """Begin a run of the world, whose ticks have at most so many bytes of frames. A later run of a
        simulator continues the log: its ticks begin at time 0 again."""
        if not self._begun:
            self._begun = True
            header = {"columns": COLUMNS, "calibration": calibration}
            self._write(json.dumps(header, allow_nan=False).encode() + b"\n")
        # at least two ticks, however long the queues are
        size = max(2 * max_frame_bytes, _FRAMES_BYTES)
        self.rows = LogRows(
            np.zeros((_TICKS, len(COLUMNS))),
            np.zeros(size, np.uint8),
            np.zeros(2, np.int64),
            np.array([_TICKS, size - max_frame_bytes], np.int64),
        )

    def put(self, rows: WorldRows, frames: Bytes, length: int) -> None:
        """Write the present tick, see `put_instant`."""
        self._put = self._put or entry_point_of(put_instant, self.rows, rows, frames, length)
        self._put(self.rows, rows, frames, length)
        self.flush()

    def flush(self) -> None:
        """Write the ticks that machine code has appended."""
        ticks, size = self.rows.used.tolist()
        if ticks:
            counts, instants = self.rows.used.tobytes(), self.rows.instants[:ticks].tobytes()
            self._write(counts + instants + self.rows.frames[:size].tobytes())
            self.rows.used[:] = 0
