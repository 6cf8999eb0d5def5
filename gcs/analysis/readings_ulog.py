"""The readings of a flight as a ULog, in PX4's topics as far as PX4 has them.

World NED, body FRD. A record's `timestamp` is the time of arrival and `timestamp_sample` that of measurement;
the records of `sensor_combined` and of the truth have one time, as in PX4.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from autopilot.wire.ulog import RECORD_HEAD, Topic, UlogWriter
from gcs.analysis.axes import Floats, enu_from_ned, flu_from_frd, quat_enu_flu_from_ned_frd
from gcs.analysis.tracks import Ints

# each of these changes of axes is its own inverse
_ned, _frd, _quat = enu_from_ned, flu_from_frd, quat_enu_flu_from_ned_frd
_LOCAL_NED = 1.0  # vehicle_odometry.pose_frame and .velocity_frame
_STATED = (("position", "m"), ("attitude", "rad"), ("velocity", "m_s"))  # standard deviations of a pose
_LOAD = (("load_true", "m"), ("load_velocity_true", "m_s"), ("cable_true", ""), ("cable_rate_true", "per_s"))

Table = Mapping[str, Any]


class _Records(NamedTuple):
    """The records of a topic: times in s, and the numbers of its fields side by side."""

    topic: Topic
    time_s: Floats  # (n,)
    numbers: list[Any]  # each (n,) or (n, k)


def readings_ulog(tables: Mapping[str, Table]) -> bytes:
    """The log of these tables (`gcs.analysis.readings`), of the sensors that there are."""
    found = list(_topics(tables))
    writer = UlogWriter([one.topic for one in found])
    times_us = [np.rint(one.time_s * 1e6).astype(np.int64) for one in found]
    blocks = [_bytes_of(writer, i, one, times_us[i]) for i, one in enumerate(found)]
    begin_us = min((int(times[0]) for times in times_us if len(times)), default=0)
    header = writer.header(begin_us, {"sys_name": "Plumbline", "ver_hw": "PLUMBLINE"}, {}, {})
    # in the order of their times
    order = np.argsort(np.concatenate(times_us), kind="stable")
    sizes = np.concatenate([np.full(len(block), block.shape[1]) for block in blocks])[order]
    starts = np.empty(len(order), np.int64)
    starts[order] = np.cumsum(sizes) - sizes
    data, first = np.zeros(int(sizes.sum()), np.uint8), 0
    for block in blocks:
        data[starts[first : first + len(block), None] + np.arange(block.shape[1])] = block
        first += len(block)
    return header + data.tobytes()


def _bytes_of(writer: UlogWriter, number: int, records: _Records, time_us: Ints) -> Any:
    """(n, size) the bytes of the records of the topic with this number."""
    numbers, fields = np.column_stack(records.numbers), records.topic.numbers
    zeros = writer.record(number, 0, *(0,) * len(fields))
    layout = np.dtype(
        {
            "names": ["time", *(f"n{i}" for i in range(len(fields)))],
            "formats": ["<u8", *(f"<{'f' if is_float else 'u'}{size}" for size, is_float, _ in fields)],
            "offsets": [RECORD_HEAD, *(RECORD_HEAD + first for _, _, first in fields)],
            "itemsize": len(zeros),
        }
    )
    data = np.tile(np.frombuffer(zeros, np.uint8), (len(time_us), 1))
    rows = data.view(layout)[:, 0]
    rows["time"] = time_us
    for i in range(len(fields)):
        rows[f"n{i}"] = numbers[:, i]
    return data


def _vector(table: Table, name: str, unit: str = "") -> Floats:
    return np.stack([table["_".join(filter(None, (name, axis, unit)))] for axis in "xyz"], axis=-1)


def _attitude(table: Table, name: str) -> Floats:
    return _quat(np.stack([table[f"{name}_{part}"] for part in "wxyz"], axis=-1))


def _variance(std: Floats) -> Floats:
    """(n, 3) the same variance on each axis."""
    return np.repeat(std[:, None] ** 2, 3, axis=1)


def _floats(*names: str) -> tuple[str, ...]:
    return tuple(f"float[3] {name}" for name in names)


def _topics(tables: Mapping[str, Table]) -> Iterator[_Records]:
    """The topics of the sensors that there are, and of the truth."""

    def sampled(name: str, fields: tuple[str, ...], table: Table, *numbers: Any) -> _Records:
        topic = Topic(name, ("uint64_t timestamp_sample", *fields))
        return _Records(topic, table["time_s"], [np.rint(table["measured_s"] * 1e6), *numbers])

    if imu := tables.get("imu"):
        gyro, accel = _vector(imu, "gyro", "rad_s"), _vector(imu, "accel", "m_s2")
        topic = Topic("sensor_combined", _floats("gyro_rad", "accelerometer_m_s2"))
        yield _Records(topic, imu["measured_s"], [_frd(gyro), _frd(accel)])
    if field := tables.get("magnetometer"):
        gauss = _frd(_vector(field, "field", "gauss"))
        yield sampled("vehicle_magnetometer", _floats("magnetometer_ga"), field, gauss)
    if baro := tables.get("barometer"):
        fields = ("float pressure", "float temperature")
        yield sampled("sensor_baro", fields, baro, baro["pressure_pa"], baro["temperature_degC"])
    if fix := tables.get("gnss"):
        velocity = _ned(_vector(fix, "velocity", "m_s"))
        yield sampled(
            "sensor_gps",
            (
                *("double latitude_deg", "double longitude_deg", "double altitude_msl_m"),
                *("float eph", "float epv", "float vel_m_s", "float vel_n_m_s", "float vel_e_m_s"),
                *("float vel_d_m_s", "uint8_t fix_type", "uint8_t satellites_used"),
            ),
            fix,
            *(fix[name] for name in ("latitude_deg", "longitude_deg", "altitude_m")),
            *(fix["horizontal_std_m"], fix["vertical_std_m"], np.hypot(velocity[:, 0], velocity[:, 1])),
            *(velocity, fix["fix_type"], fix["satellites"]),
        )
    if pose := tables.get("mocap"):
        frame = np.full(len(pose["time_s"]), _LOCAL_NED)
        yield sampled(
            "vehicle_mocap_odometry",
            (
                *("float[3] position", "float[4] q", *_floats("velocity", "angular_velocity")),
                *_floats("position_variance", "orientation_variance", "velocity_variance"),
                *("uint8_t pose_frame", "uint8_t velocity_frame"),
            ),
            pose,
            *(_ned(_vector(pose, "", "m")), _attitude(pose, "quaternion")),
            *(_ned(_vector(pose, "velocity", "m_s")), _frd(_vector(pose, "rate", "rad_s"))),
            *(_variance(pose[f"{name}_std_{unit}"]) for name, unit in _STATED),
            *(frame, frame),
        )
    if load := tables.get("load_tracker"):
        position, velocity = _ned(_vector(load, "", "m")), _ned(_vector(load, "velocity", "m_s"))
        yield sampled("load_position", _floats("position", "velocity"), load, position, velocity)
    if camera := tables.get("cable_sensor"):
        direction = _frd(_vector(camera, "direction"))
        yield sampled("load_direction", _floats("direction"), camera, direction)
    yield from _truth(tables["truth"])


def _truth(truth: Table) -> Iterator[_Records]:
    position, velocity = (
        _ned(_vector(truth, f"vehicle{part}_true", unit)) for part, unit in (("", "m"), ("_velocity", "m_s"))
    )
    accel = _ned(_vector(truth, "vehicle_acceleration", "m_s2"))
    rate, time_s = _frd(_vector(truth, "vehicle_rate", "rad_s")), truth["time_s"]
    names = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az")
    place = Topic("vehicle_local_position_groundtruth", tuple(f"float {name}" for name in names))
    yield _Records(place, time_s, [position, velocity, accel])
    attitude = _attitude(truth, "vehicle_quaternion")
    yield _Records(Topic("vehicle_attitude_groundtruth", ("float[4] q",)), time_s, [attitude])
    yield _Records(Topic("vehicle_angular_velocity_groundtruth", _floats("xyz")), time_s, [rate])
    load = Topic(
        "load_state_groundtruth",
        (*_floats("position", "velocity", "cable", "cable_rate"), "float tension", "bool taut"),
    )
    vectors = [_vector(truth, name, unit) for name, unit in _LOAD]
    yield _Records(load, time_s, [*map(_ned, vectors), truth["cable_tension_n"], truth["cable_taut"]])
