"""Every kernel of telemetry and flight log called once, so that none has to be compiled in the air."""

from __future__ import annotations

import numpy as np

from autopilot.core.flight_core import FlightCore, Setup
from autopilot.core.health import Condition
from autopilot.core.sensor_inbox import SensorInbox
from autopilot.estimation.records import ImuReading
from autopilot.geometry.linear import ZERO
from autopilot.geometry.packed import packed
from autopilot.onboard.log_records import SampleRecords
from autopilot.onboard.log_topics import FAST, Sample
from autopilot.onboard.snapshot import CoreSnapshot, Options, SnapshotSource
from autopilot.onboard.tick_answer import answer_tick
from autopilot.services.identity import Identity
from autopilot.services.mission_store import StoredMission
from autopilot.services.stream_frames import BITS, StreamFrames
from autopilot.services.telemetry import STREAMS
from autopilot.vehicle.battery import Battery
from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.wire.codec import FrameWriter
from autopilot.wire.compiled import MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.ulog import UlogWriter


def warm_up_telemetry(setup: Setup, parameters: AutopilotParameters, identity: Identity) -> None:
    """Assemble an instant, build and write its streams, and log it."""
    core, options = FlightCore(setup), Options(Home(), 0)
    source = SnapshotSource(
        core, options, parameters, packed(Condition()), SensorInbox(options.home, core.rows.inbox)
    )
    snapshot = CoreSnapshot(source, StoredMission(), 0)
    StreamFrames(FrameWriter(1, 1), FrameWriter(1, 2), Home()).frames(sum(BITS.values()), snapshot.instant)
    for stream in STREAMS.values():
        stream.build(snapshot, identity)
    imu = packed(ImuReading(ZERO, ZERO))
    sample = Sample(snapshot, snapshot.instant, imu, True, lambda: snapshot.estimator)
    SampleRecords(UlogWriter(topic for topic, _ in FAST), Home()).records_at(sample, 0)


def warm_up_answer() -> None:
    """Answer a tick."""
    frame, payload = np.zeros(MAX_FRAME_BYTES, np.uint8), np.zeros(MAX_PAYLOAD_BYTES, np.uint8)
    imu, battery = packed(ImuReading(ZERO, ZERO)), packed(Battery(1.0, 1.0, 0.0, 0.0))
    condition, forces = packed(Condition()), np.zeros(MAX_ROTORS)
    rows = (condition, imu, forces, battery)
    answer_tick(*rows, 0, False, 0, 0.0, frame, payload, 0, 1, 1, False, True, False, 0.0)
