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
from autopilot.onboard.snapshot import Moment, Moments, Options
from autopilot.onboard.tick_answer import answer_tick
from autopilot.services.mission_store import StoredMission
from autopilot.services.stream_frames import BITS, StreamFrames
from autopilot.vehicle.battery import Battery
from autopilot.vehicle.layout import MOST
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.wire.codec import FrameWriter
from autopilot.wire.compiled import FRAME_ROOM, PAYLOAD_ROOM
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.ulog import UlogWriter


def rehearse_telemetry(setup: Setup, parameters: AutopilotParameters) -> None:
    """Assemble an instant, write its streams, and log it."""
    core, options = FlightCore(setup), Options(Home(), 0)
    moments = Moments(
        core, options, parameters, packed(Condition()), SensorInbox(options.home, core.rows.inbox)
    )
    moment = Moment(moments, StoredMission(), 0)
    StreamFrames(FrameWriter(1, 1), FrameWriter(1, 2), Home()).frames(sum(BITS.values()), moment.instant)
    imu = packed(ImuReading(ZERO, ZERO))
    sample = Sample(moment, moment.instant, imu, True, lambda: moment.estimator)
    SampleRecords(UlogWriter(topic for topic, _ in FAST), Home()).of(sample, 0)


def rehearse_answer() -> None:
    """Answer a tick."""
    frame, payload = np.zeros(FRAME_ROOM, np.uint8), np.zeros(PAYLOAD_ROOM, np.uint8)
    imu, battery = packed(ImuReading(ZERO, ZERO)), packed(Battery(1.0, 1.0, 0.0, 0.0))
    condition, forces = packed(Condition()), np.zeros(MOST)
    rows = (condition, imu, forces, battery)
    answer_tick(*rows, 0, False, 0, 0.0, frame, payload, 0, 1, 1, False, True, False, 0.0)
