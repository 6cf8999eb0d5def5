"""flight.mcap: the flight for Foxglove, PlotJuggler and Rerun, in protobuf schemas of Foxglove and Plumbline,
and a message of ROS 2 for the battery.

| topic | schema | what |
|---|---|---|
| /flight | plumbline.Flight | the columns of flight.parquet as fields, at each sample |
| /tf | foxglove.FrameTransforms | vehicle and load in world |
| /scene | foxglove.SceneUpdate | vehicle, load and paths at the start; the cable until the load is released |
| /load/flown, /load/asked | foxglove.PosesInFrame | flown and requested path, at the start |
| /battery | sensor_msgs/msg/BatteryState | the battery as the vehicle reports it, measured or calculated |
| /texts | foxglove.Log | status texts of the vehicle |

World ENU, body FLU, SI. Times count from boot.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, cos, hypot, inf, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gcs.analysis.axes import Floats
from gcs.analysis.battery_state import DEFINITION, TYPE_NAME, encoded_battery_state
from gcs.analysis.parquet import flight_columns
from gcs.analysis.samples import PHASE_NAMES, Samples
from gcs.analysis.tracks import BatteryTrack, Telemetry
from gcs.errors import GcsError, from_clone

_WORLD, _VEHICLE, _LOAD = "world", "vehicle", "load"
_CABLE_INTERVAL_S = 0.04  # shortest time between two drawings of the cable
_MAX_POINTS = 4000  # of a path
_NANO = 1e9
# colours as red, green, blue, alpha
_DARK, _AMBER, _BLUE, _GREY = (
    (0.2, 0.25, 0.3, 1.0),
    (0.85, 0.6, 0.0, 1.0),
    (0.0, 0.45, 0.7, 1.0),
    (0.6, 0.6, 0.6, 1.0),
)
_LEVELS = (5, 5, 5, 4, 3, 2, 2, 1)  # of foxglove.Log by MAV_SEVERITY: fatal, error, warning, info, debug


class Layout(NamedTuple):
    """Sizes of what is drawn, m."""

    rotors_m: tuple[tuple[float, float], ...]  # forward and to the left of the centre of mass
    load_radius_m: float


def require_libraries() -> None:
    """Raise GcsError if the libraries that write the file are not installed."""
    try:
        import mcap_protobuf.writer  # noqa: F401
    except ImportError:
        raise GcsError(f"flight.mcap needs more libraries: pip install {from_clone('mcap')}") from None


def write_mcap(path: Path, telemetry: Telemetry, samples: Samples, layout: Layout) -> None:
    """Write the file; GcsError if the libraries are not installed."""
    require_libraries()
    from mcap.writer import Writer

    with path.open("wb") as file:
        log: Any = Writer(file)
        log.start()
        channels: dict[str, int] = {}
        messages = sorted(_messages(telemetry, samples, layout), key=lambda one: one[0])
        for time_s, topic, message in messages:
            if topic not in channels:
                channels[topic] = _channel(log, topic, message)
            data = message if isinstance(message, bytes) else message.SerializeToString()
            ns = round(time_s * _NANO)
            log.add_message(channels[topic], ns, data, ns)
        log.finish()


def _channel(log: Any, topic: str, message: Any) -> int:
    """The number of a new channel for messages like this one: protobuf, or the encoded battery."""
    from mcap.well_known import MessageEncoding, SchemaEncoding
    from mcap_protobuf.schema import register_schema

    if isinstance(message, bytes):
        schema = log.register_schema(TYPE_NAME, SchemaEncoding.ROS2, DEFINITION.encode())
        return int(log.register_channel(topic, MessageEncoding.CDR, schema))
    return int(log.register_channel(topic, MessageEncoding.Protobuf, register_schema(log, type(message))))


def _messages(telemetry: Telemetry, samples: Samples, layout: Layout) -> Iterator[tuple[float, str, Any]]:
    """(time, topic, message) of all messages, unordered; a message that is bytes is a battery's state."""
    known = np.isfinite(samples.actual_m).all(axis=1) & np.isfinite(samples.vehicle_m).all(axis=1)
    if known.any():
        start_s = float(samples.time_s[known][0])
        yield start_s, "/scene", _static_entities(layout, start_s, samples, known)
        yield from _paths(samples, start_s, known)
        yield from _transforms(samples, known)
        yield from _cable(samples, known)
    yield from _columns(telemetry, samples)
    yield from _texts(telemetry)
    yield from _battery(telemetry.reported_battery)


def _battery(battery: BatteryTrack) -> Iterator[tuple[float, str, Any]]:
    columns = battery.time_s, battery.voltage_v, battery.current_a, 0.01 * battery.left_pct
    for received_s, voltage_v, current_a, share_left in np.stack(columns, axis=1).tolist():
        time_s = max(received_s, 0.0)
        message = encoded_battery_state(round(time_s * _NANO), voltage_v, current_a, share_left)
        yield time_s, "/battery", message


def _columns(telemetry: Telemetry, samples: Samples) -> Iterator[tuple[float, str, Any]]:
    """One message per sample; NaN for unknown values."""
    columns = flight_columns(telemetry, samples)
    flight = _flight_class(columns)
    times = columns["time_s"]
    values = {name: array.tolist() for name, array in columns.items() if name != "time_s"}
    for i, time_s in enumerate(times.tolist()):
        message = flight(phase=PHASE_NAMES.get(int(samples.phase[i]), ""))
        _set_time(message.timestamp, time_s)
        for name, column in values.items():
            setattr(message, name, float(column[i]))
        yield time_s, "/flight", message


def _flight_class(columns: dict[str, Any]) -> Any:
    """The class of a message with a double for each column."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

    file = descriptor_pb2.FileDescriptorProto(
        name="plumbline/Flight.proto",
        package="plumbline",
        syntax="proto3",
        dependency=[timestamp_pb2.DESCRIPTOR.name],
    )
    message = file.message_type.add(name="Flight")
    kinds = descriptor_pb2.FieldDescriptorProto
    optional = kinds.LABEL_OPTIONAL
    stamp = ".google.protobuf.Timestamp"
    message.field.add(name="timestamp", number=1, type=kinds.TYPE_MESSAGE, type_name=stamp, label=optional)
    message.field.add(name="phase", number=2, type=kinds.TYPE_STRING, label=optional)
    for number, name in enumerate((name for name in columns if name != "time_s"), start=3):
        message.field.add(name=name, number=number, type=kinds.TYPE_DOUBLE, label=optional)
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("plumbline.Flight"))


def _transforms(samples: Samples, known: Any) -> Iterator[tuple[float, str, Any]]:
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

    for i in np.flatnonzero(known).tolist():
        time_s = float(samples.time_s[i])
        found = FrameTransforms()
        for frame, position, quaternion in (
            (_VEHICLE, samples.vehicle_m[i], samples.quat_wxyz[i]),
            (_LOAD, samples.actual_m[i], (1.0, 0.0, 0.0, 0.0)),
        ):
            one = found.transforms.add(parent_frame_id=_WORLD, child_frame_id=frame)
            _set_time(one.timestamp, time_s)
            _set_vector(one.translation, position)
            _set_quaternion(one.rotation, quaternion)
        yield time_s, "/tf", found


def _paths(samples: Samples, start_s: float, known: Any) -> Iterator[tuple[float, str, Any]]:
    from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame

    for topic, path in (
        ("/load/flown", samples.actual_m[known & samples.attached]),
        ("/load/asked", samples.requested_m[np.isfinite(samples.requested_m).all(axis=1)]),
    ):
        poses = PosesInFrame(frame_id=_WORLD)
        _set_time(poses.timestamp, start_s)
        for point in _thinned(path):
            pose = poses.poses.add()
            _set_vector(pose.position, point)
            pose.orientation.w = 1.0
        yield start_s, topic, poses


def _static_entities(layout: Layout, start_s: float, samples: Samples, known: Any) -> Any:
    """The entities that do not move in their frames: vehicle, load and the paths."""
    from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    update = SceneUpdate()
    vehicle = _entity(update, start_s, _VEHICLE, _VEHICLE)
    radius = 0.6 * max(hypot(x, y) for x, y in layout.rotors_m)
    for x, y in layout.rotors_m:
        arm = vehicle.cubes.add()
        half_yaw = 0.5 * atan2(y, x)
        arm.pose.orientation.w, arm.pose.orientation.z = cos(half_yaw), sin(half_yaw)
        _set_vector(arm.pose.position, (0.5 * x, 0.5 * y, 0.0))
        _set_vector(arm.size, (hypot(x, y), 0.02, 0.02))
        _set_colour(arm.color, _DARK)
        disc = vehicle.cylinders.add(bottom_scale=1.0, top_scale=1.0)
        _set_vector(disc.pose.position, (x, y, 0.03))
        disc.pose.orientation.w = 1.0
        _set_vector(disc.size, (2.0 * radius, 2.0 * radius, 0.005))
        _set_colour(disc.color, (*_BLUE[:3], 0.4))
    ball = _entity(update, start_s, _LOAD, _LOAD).spheres.add()
    ball.pose.orientation.w = 1.0
    _set_vector(ball.size, (2.0 * layout.load_radius_m,) * 3)
    _set_colour(ball.color, _AMBER)
    for name, path, colour in (
        ("flown", samples.actual_m[known & samples.attached], _BLUE),
        ("asked", samples.requested_m[np.isfinite(samples.requested_m).all(axis=1)], _GREY),
    ):
        line = _entity(update, start_s, name, _WORLD).lines.add(type=LinePrimitive.LINE_STRIP, thickness=0.01)
        line.pose.orientation.w = 1.0
        _set_colour(line.color, colour)
        for point in _thinned(path):
            _set_vector(line.points.add(), point)
    return update


def _cable(samples: Samples, known: Any) -> Iterator[tuple[float, str, Any]]:
    """The line of the cable every `_CABLE_INTERVAL_S`; deleted when the load is released."""
    from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    last_s, drawn = -inf, False
    for i in np.flatnonzero(known).tolist():
        time_s = float(samples.time_s[i])
        update = SceneUpdate()
        if not samples.attached[i]:
            if drawn:
                _set_time(update.deletions.add(id="cable").timestamp, time_s)
                drawn = False
                yield time_s, "/scene", update
            continue
        if time_s - last_s < _CABLE_INTERVAL_S:
            continue
        line = _entity(update, time_s, "cable", _WORLD).lines.add(
            type=LinePrimitive.LINE_STRIP, thickness=0.005
        )
        line.pose.orientation.w = 1.0
        _set_colour(line.color, _DARK)
        for end in (samples.vehicle_m[i], samples.actual_m[i]):
            _set_vector(line.points.add(), end)
        last_s, drawn = time_s, True
        yield time_s, "/scene", update


def _texts(telemetry: Telemetry) -> Iterator[tuple[float, str, Any]]:
    from foxglove_schemas_protobuf.Log_pb2 import Log

    for text in telemetry.texts:
        time_s = max(text.time_s, 0.0)
        level: Any = _LEVELS[text.severity] if 0 <= text.severity < len(_LEVELS) else 0
        message = Log(level=level, message=text.text, name="vehicle")
        _set_time(message.timestamp, time_s)
        yield time_s, "/texts", message


def _entity(update: Any, time_s: float, name: str, frame: str) -> Any:
    entity = update.entities.add(id=name, frame_id=frame, frame_locked=True)
    _set_time(entity.timestamp, time_s)
    return entity


def _set_time(timestamp: Any, time_s: float) -> None:
    timestamp.FromNanoseconds(round(time_s * _NANO))


def _set_vector(vector: Any, xyz: Any) -> None:
    vector.x, vector.y, vector.z = map(float, xyz)


def _set_quaternion(quaternion: Any, wxyz: Any) -> None:
    finite = bool(np.isfinite(wxyz).all())
    values = map(float, wxyz) if finite else (1.0, 0.0, 0.0, 0.0)
    quaternion.w, quaternion.x, quaternion.y, quaternion.z = values


def _set_colour(colour: Any, rgba: tuple[float, float, float, float]) -> None:
    colour.r, colour.g, colour.b, colour.a = rgba


def _thinned(path: Floats) -> Floats:
    return path[:: max(1, -(-len(path) // _MAX_POINTS))]
