"""flight.mcap as the `mcap` library reads it: what Foxglove, PlotJuggler and Rerun show."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mcap_protobuf", reason="pip install -e '.[mcap]'")

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from autopilot.wire.convert.battery import BatteryReading
from gcs.analysis.mcap import Layout, write_mcap
from gcs.analysis.parquet import flight_columns
from gcs.analysis.samples import samples_of
from tests.doubles import recorded_flights as flights

ROTORS_M = ((-0.126, 0.0), (0.0, -0.126), (0.126, 0.0), (0.0, 0.126))
Messages = dict[str, list[tuple[float, Any]]]  # by topic: time in s, message


def written(flight: flights.Flight, folder: Path) -> tuple[Messages, dict[str, str]]:
    """The messages by topic, and the schemas of the topics."""
    telemetry = flight.telemetry()
    path = folder / "flight.mcap"
    write_mcap(path, telemetry, samples_of(telemetry), Layout(ROTORS_M, 0.02))
    found: Messages = {}
    schemas = {}
    reader = make_reader(io.BytesIO(path.read_bytes()), decoder_factories=[DecoderFactory()])
    last = 0
    for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
        assert schema is not None and schema.encoding == channel.message_encoding == "protobuf"
        assert message.log_time >= last
        last = message.log_time
        schemas[channel.topic] = schema.name
        found.setdefault(channel.topic, []).append((1e-9 * message.log_time, decoded))
    return found, schemas


@pytest.fixture(scope="module")
def delivery(tmp_path_factory: pytest.TempPathFactory) -> tuple[Messages, dict[str, str]]:
    return written(flights.delivery(), tmp_path_factory.mktemp("mcap"))


def test_schemas_are_those_that_viewers_know(delivery: tuple[Messages, dict[str, str]]) -> None:
    assert delivery[1] == {
        "/flight": "plumbline.Flight",
        "/tf": "foxglove.FrameTransforms",
        "/scene": "foxglove.SceneUpdate",
        "/load/flown": "foxglove.PosesInFrame",
        "/load/asked": "foxglove.PosesInFrame",
        "/texts": "foxglove.Log",
    }


def test_frames_are_where_vehicle_and_load_are(delivery: tuple[Messages, dict[str, str]]) -> None:
    samples = samples_of(flights.delivery().telemetry())
    transforms = delivery[0]["/tf"]
    assert len(transforms) == len(samples.time_s)
    for i in (0, 700, len(transforms) - 1):
        time_s, message = transforms[i]
        assert time_s == pytest.approx(samples.time_s[i])
        places = {one.child_frame_id: one.translation for one in message.transforms}
        assert all(one.parent_frame_id == "world" for one in message.transforms)
        for frame, place in (("vehicle", samples.vehicle_m[i]), ("load", samples.actual_m[i])):
            np.testing.assert_allclose((places[frame].x, places[frame].y, places[frame].z), place)


def test_every_rotor_is_drawn_at_its_place(delivery: tuple[Messages, dict[str, str]]) -> None:
    (vehicle,) = [
        one for _, update in delivery[0]["/scene"] for one in update.entities if one.id == "vehicle"
    ]
    drawn = [(disc.pose.position.x, disc.pose.position.y) for disc in vehicle.cylinders]
    np.testing.assert_array_equal(drawn, ROTORS_M)
    assert len(vehicle.cubes) == len(ROTORS_M)


def test_every_column_of_the_table_is_a_field(delivery: tuple[Messages, dict[str, str]]) -> None:
    telemetry = flights.delivery().telemetry()
    columns = flight_columns(telemetry, samples_of(telemetry))
    del columns["time_s"]
    rows = delivery[0]["/flight"]
    assert {field.name for field in rows[0][1].DESCRIPTOR.fields} == {"timestamp", "phase", *columns}
    for name in ("load_error_x_m", "cable_tension_n", "rotor_force_3_n", "cable_taut"):
        found = [getattr(message, name) for _, message in rows]
        np.testing.assert_array_equal(found, np.asarray(columns[name], dtype=float))
    assert {message.phase for _, message in rows} >= {"lift", "hold", "mission", "lower"}


def test_the_cable_ends_where_the_load_is_let_go(delivery: tuple[Messages, dict[str, str]]) -> None:
    scene = delivery[0]["/scene"]
    drawn = [time for time, update in scene if any(entity.id == "cable" for entity in update.entities)]
    gone = [time for time, update in scene if any(one.id == "cable" for one in update.deletions)]
    (released,) = [time for time, log in delivery[0]["/texts"] if log.message == "Load released"]
    assert gone == pytest.approx([released], abs=0.05)
    assert max(drawn) < gone[0]
    assert np.diff(drawn).max() < 0.1


def test_a_flight_that_was_lost_is_written_as_far_as_it_is_known(tmp_path: Path) -> None:
    flight = flights.case_b(duration_s=3.0)
    flight.actual[-300:] = np.nan
    found, _ = written(flight, tmp_path)
    assert len(found["/tf"]) == len(flight.time_s) - 300
    assert len(found["/flight"]) == len(flight.time_s)


def test_a_log_without_a_flight_gives_an_empty_file(tmp_path: Path) -> None:
    flight = flights.flight(1.0, flights.still)
    flight.drop = lambda i, kind: True
    assert written(flight, tmp_path) == ({}, {})


def test_the_battery_is_the_message_that_ros_knows(tmp_path: Path) -> None:
    """Also of a vehicle without a simulated battery, which reports what it calculates."""
    ros = pytest.importorskip("mcap_ros2.decoder", reason="pip install -e '.[dev]'")
    flight = flights.case_b(duration_s=2.0)
    flight.batteries = [
        (1.0, BatteryReading(12.4, 6.5, 20.0, 0.97)),
        (2.0, BatteryReading(12.3, 6.25, 22.0, 0.96)),
        (3.25, BatteryReading()),
    ]
    telemetry = flight.telemetry()
    path = tmp_path / "flight.mcap"
    write_mcap(path, telemetry, samples_of(telemetry), Layout(ROTORS_M, 0.02))
    reader = make_reader(io.BytesIO(path.read_bytes()), decoder_factories=[ros.DecoderFactory()])
    found = list(reader.iter_decoded_messages(topics=["/battery"]))
    schemas = {(schema.name, schema.encoding, channel.message_encoding) for schema, channel, _, _ in found}
    assert schemas == {("sensor_msgs/msg/BatteryState", "ros2msg", "cdr")}
    stamps = [(battery.header.stamp.sec, battery.header.stamp.nanosec) for _, _, _, battery in found]
    assert stamps == [(1, 0), (2, 0), (3, 250_000_000)]
    assert [message.log_time for _, _, message, _ in found] == [s * 10**9 + ns for s, ns in stamps]
    batteries = [battery for _, _, _, battery in found]
    numbers = [(one.voltage, one.current, one.percentage) for one in batteries]
    assert numbers[:2] == [
        pytest.approx((12.4, -6.5, 0.97), rel=1e-6),
        pytest.approx((12.3, -6.25, 0.96), rel=1e-6),
    ]
    assert np.isnan(numbers[2]).all()
    assert np.isnan([(one.temperature, one.charge, one.capacity) for one in batteries]).all()
    kinds = [
        (one.power_supply_status, one.power_supply_health, one.power_supply_technology) for one in batteries
    ]
    assert kinds == 3 * [(2, 0, 3)], "discharging, of unknown health, lithium polymer"
    assert all(one.present and not one.cell_voltage and not one.serial_number for one in batteries)
