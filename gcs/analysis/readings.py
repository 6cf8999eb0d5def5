"""The readings of a flight's sensors and the true state, as tables: made of the log of `sitl.sensor_log`.

Columns are those of docs/sensors.md. World ENU, body FLU, SI units. The readings are those that the
autopilot received, with the rounding of their messages.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from autopilot.shell.atomic_file import write_atomically
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.convert.simulator import ACCEL, GYRO, MAG, PRESSURE
from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.axes import Floats, enu_from_ned, flu_from_frd, quat_enu_flu_from_ned_frd
from gcs.analysis.columns import Columns
from gcs.analysis.readings_ulog import readings_ulog
from gcs.analysis.tracks import Ints
from gcs.formats.arrow import array_of, path_for_arrow

if TYPE_CHECKING:
    import pyarrow

CALIBRATION_FILE, ULOG_FILE = "calibration.json", "sensors.ulg"
TRUTH = "truth"  # the table of the true state
_MICRO = 1e-6
_TRACKER = 0  # LOAD_SENSOR.sensor_id
_ALL = {"imu": ACCEL | GYRO, "magnetometer": MAG, "barometer": PRESSURE}  # HIL_SENSOR.fields_updated
_FLAGS = ("load_attached", "cable_taut", "vehicle_on_ground", "load_on_ground", "diverged")
_COUNTS = ("cable_slack_events",)

Table = dict[str, Any]  # columns of numbers by name


class Readings(NamedTuple):
    """The tables by the names of their sensors and `truth`, and the contents of calibration.json and
    sensors.ulg."""

    tables: dict[str, pyarrow.Table]
    calibration: dict[str, Any]
    ulog: bytes


class _Log(NamedTuple):
    """The ticks of a log."""

    instants: dict[str, Floats]  # by the names of its columns, (n,)
    frames: dict[int, list[bytes]]  # of the sensors, by message id
    ticks: dict[int, Ints]  # of these frames: rows of `instants`
    calibration: dict[str, Any]


def readings_of(log: bytes, until_s: float) -> Readings:
    """The readings that arrived until this time, of a log that may be cut off at its end."""
    found = _parsed(log, round(until_s / _MICRO))
    sensors = found.calibration["sensors"]
    tables = dict(_sensor_tables(found))
    fitted = {**{name: tables[name] for name in (*sensors, "rotor_speed")}, TRUTH: _truth(found)}
    arrow = {name: _arrow(table) for name, table in fitted.items()}
    return Readings(arrow, found.calibration, readings_ulog(fitted))


def write_readings(folder: Path, readings: Readings) -> None:
    """Write a file for each table, sensors.ulg and calibration.json."""
    from pyarrow import parquet

    delete_readings(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in readings.tables.items():
        parquet.write_table(table, path_for_arrow(folder / f"{name}.parquet"), compression="zstd")
    (folder / ULOG_FILE).write_bytes(readings.ulog)
    text = json.dumps(readings.calibration, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    write_atomically(folder / CALIBRATION_FILE, text.encode())


def load_readings(folder: Path) -> Readings | None:
    """What `write_readings` has written there; None if it has not."""
    from pyarrow import parquet

    calibration = folder / CALIBRATION_FILE
    if not calibration.is_file():
        return None
    files = sorted(folder.glob("*.parquet"))
    tables = {file.stem: parquet.read_table(path_for_arrow(file)) for file in files}
    known = json.loads(calibration.read_text(encoding="utf-8"))
    return Readings(tables, known, (folder / ULOG_FILE).read_bytes())


def delete_readings(folder: Path) -> None:
    """Delete what `write_readings` has written there."""
    if (folder / CALIBRATION_FILE).is_file():
        for file in (*folder.glob("*.parquet"), folder / ULOG_FILE, folder / CALIBRATION_FILE):
            file.unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()


def _parsed(log: bytes, until_us: int) -> _Log:
    """The last run of the world in a log."""
    head, _, _ = log.partition(b"\n")
    header = json.loads(head)
    names, at = header["columns"], len(head) + 1
    rows, frames = [np.zeros((0, len(names)))], []
    while at + 16 <= len(log):
        ticks, size = np.frombuffer(log, np.int64, 2, at).tolist()
        first, at = at + 16, at + 16 + 8 * ticks * len(names) + size
        if at <= len(log):
            rows.append(np.frombuffer(log, np.float64, ticks * len(names), first).reshape(ticks, -1))
            frames.append(log[at - size : at])
    instants = dict(zip(names, np.concatenate(rows).T, strict=True))
    restarts = np.flatnonzero(np.diff(instants["time_us"]) <= 0)
    first = int(restarts[-1]) + 1 if len(restarts) else 0
    end = first + int(np.searchsorted(instants["time_us"][first:], until_us, side="right"))
    ends = np.concatenate(([0], np.cumsum(instants["frame_bytes"]))).astype(np.int64)
    found, starts = _split(b"".join(frames), int(ends[first]), int(ends[end]))
    return _Log(
        {name: column[first:end] for name, column in instants.items()},
        found,
        {kind: np.searchsorted(ends[first + 1 :], at, side="right") for kind, at in starts.items()},
        header["calibration"],
    )


def _split(data: bytes, start: int, end: int) -> tuple[dict[int, list[bytes]], dict[int, list[int]]]:
    """The frames in a range of the data, and where they begin, by message id."""
    frames, starts = defaultdict[int, list[bytes]](list), defaultdict[int, list[int]](list)
    while start < end:
        kind = data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16
        stop = start + 12 + data[start + 1]
        frames[kind].append(data[start:stop])
        starts[kind].append(start)
        start = stop
    return frames, starts


def _sensor_tables(log: _Log) -> Iterator[tuple[str, Table]]:
    """Names and columns of the tables of all sensors, also of those that are not fitted."""
    time_us = log.instants["time_us"]

    def messages(kind: int) -> tuple[Columns, Ints]:
        return Columns(kind, log.frames.get(kind, [])), log.ticks.get(kind, np.zeros(0, np.int64))

    onboard, ticks = messages(mavlink.MAVLINK_MSG_ID_HIL_SENSOR)
    updated = onboard.integers("fields_updated")
    columns = {
        "imu": {
            **_axes("accel", "m_s2", flu_from_frd(onboard["xacc yacc zacc"])),
            **_axes("gyro", "rad_s", flu_from_frd(onboard["xgyro ygyro zgyro"])),
        },
        "magnetometer": _axes("field", "gauss", flu_from_frd(onboard["xmag ymag zmag"])),
        "barometer": {
            "pressure_pa": onboard["abs_pressure"] * 100.0,
            "altitude_m": onboard["pressure_alt"],
            "temperature_degC": onboard["temperature"],
        },
    }
    for name, bits in _ALL.items():
        times = {"time_s": time_us * _MICRO, "measured_s": log.instants[f"{name}_us"] * _MICRO}
        new = updated & bits == bits
        yield (
            name,
            {
                **{key: values[ticks][new] for key, values in times.items()},
                **{key: values[new] for key, values in columns[name].items()},
            },
        )

    def stamped(c: Columns, ticks: Ints) -> Table:
        return {"time_s": time_us[ticks] * _MICRO, "measured_s": c["time_usec"] * _MICRO}

    pose, ticks = messages(mavlink.MAVLINK_MSG_ID_ODOMETRY)
    yield "mocap", {**stamped(pose, ticks), **_pose(pose)}
    load, ticks = messages(mavlink.MAVLINK_MSG_ID_LOAD_SENSOR)
    tracked = load.integers("sensor_id") == _TRACKER
    tracker = {
        **stamped(load, ticks),
        **_axes("", "m", enu_from_ned(load["x y z"])),
        **_axes("velocity", "m_s", enu_from_ned(load["vx vy vz"])),
        "position_std_m": load["position_std"],
        "velocity_std_m_s": load["velocity_std"],
    }
    yield "load_tracker", {name: values[tracked] for name, values in tracker.items()}
    direction = {
        **stamped(load, ticks),
        **_axes("direction", "", flu_from_frd(load["dx dy dz"])),
        "direction_std_rad": load["direction_std"],
    }
    yield "cable_sensor", {name: values[~tracked] for name, values in direction.items()}
    fix, ticks = messages(mavlink.MAVLINK_MSG_ID_HIL_GPS)
    yield "gnss", {**stamped(fix, ticks), **_fix(fix, Home(**log.calibration["home"]))}
    speeds, ticks = messages(mavlink.MAVLINK_MSG_ID_ESC_STATUS)
    yield "rotor_speed", _rotor_speeds(speeds, time_us[ticks] * _MICRO, _rotor_count(log))


def _axes(name: str, unit: str, values: Floats) -> Table:
    """(n, 3) as three columns `name_axis_unit`."""
    return {"_".join(filter(None, (name, axis, unit))): values[:, i] for i, axis in enumerate("xyz")}


def _pose(c: Columns) -> Table:
    quat_wxyz, variances = quat_enu_flu_from_ned_frd(c["q"]), c["pose_covariance"]
    return {
        **_axes("", "m", enu_from_ned(c["x y z"])),
        **{f"quaternion_{part}": quat_wxyz[:, i] for i, part in enumerate("wxyz")},
        **_axes("velocity", "m_s", enu_from_ned(c["vx vy vz"])),
        **_axes("rate", "rad_s", flu_from_frd(c["rollspeed pitchspeed yawspeed"])),
        "position_std_m": np.sqrt(variances[:, 0]),
        "attitude_std_rad": np.sqrt(variances[:, 15]),
        "velocity_std_m_s": np.sqrt(c["velocity_covariance"][:, 0]),
    }


def _fix(c: Columns, home: Home) -> Table:
    degE7, mm = c.integers("lat"), c.integers("alt")
    places = [
        enu_from_geodetic(*place, home)
        for place in zip(degE7.tolist(), c.integers("lon").tolist(), mm.tolist(), strict=True)
    ]
    return {
        "latitude_deg": degE7 * 1e-7,
        "longitude_deg": c["lon"] * 1e-7,
        "altitude_m": mm * 1e-3,
        **_axes("", "m", np.array(places).reshape(-1, 3)),
        **_axes("velocity", "m_s", enu_from_ned(c["vn ve vd"] * 0.01)),
        "horizontal_std_m": c["eph"] * 0.01,
        "vertical_std_m": c["epv"] * 0.01,
        "fix_type": c.integers("fix_type"),
        "satellites": c.integers("satellites_visible"),
    }


def _rotor_speeds(c: Columns, time_s: Floats, rotors: int) -> Table:
    """A message has the speeds of four rotors from its index on."""
    first, rpm = c.integers("index"), c["rpm"]
    return {
        "time_s": time_s[first == 0],
        **{f"rotor_{i + 1}_rpm": rpm[first == i - i % 4, i % 4] for i in range(rotors)},
    }


def _rotor_count(log: _Log) -> int:
    return len(log.calibration["vehicle"]["rotors"])


def _truth(log: _Log) -> Table:
    """The true state, without the columns of the log itself and of sensors and rotors that there are not."""
    fitted, rotors = log.calibration["sensors"], _rotor_count(log)
    missing = ("frame_bytes", "time_us", *(f"{name}_us" for name in _ALL))
    table: Table = {"time_s": log.instants["time_us"] * _MICRO}
    for name, values in log.instants.items():
        if name in missing or any(name.startswith(f"{one}_") for one in _SENSORS if one not in fitted):
            continue
        if name.startswith("rotor_") and int(name.split("_")[2]) > rotors:
            continue
        table[name] = values != 0.0 if name in _FLAGS else values
        if name in _COUNTS:
            table[name] = values.astype(np.int32)
        if name.startswith("rotor_command_"):  # logged with the next tick, as the answer to this one
            table[name] = np.append(values[1:], np.nan)[: len(values)]
    return table


_SENSORS = ("mocap", "load_tracker", "cable_sensor", "gnss", "barometer", "magnetometer")


def _arrow(table: Table) -> pyarrow.Table:
    """The Arrow table; what was not measured is null."""
    import pyarrow as pa

    arrays = [
        array_of(values, np.isnan(values)) if values.dtype.kind == "f" else array_of(values)
        for values in table.values()
    ]
    return pa.Table.from_arrays(arrays, list(table))
