"""Ticks that machine code can fly by itself: the data for them, and their results.

Most ticks are alike: readings arrive, no decision is needed, an answer is sent, and perhaps streams that
machine code can write. `Onboard` determines until when nothing else is due (`Onboard.tick_batch`), a loop in
machine code flies these ticks (`autopilot.shell.tick_loop`), and `Onboard.finish_batch` takes over the
results. `Onboard` does everything else.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from autopilot.core.sensor_inbox import address_of_read
from autopilot.core.tick import CoreRows, placeholder_law
from autopilot.estimation.records import Array
from autopilot.geometry.addresses import call_kernel_returning
from autopilot.geometry.packed import Row, width
from autopilot.onboard.flight_log import CompiledLogging
from autopilot.onboard.log_records import SampleRecords
from autopilot.onboard.log_topics import FAST
from autopilot.onboard.snapshot import InstantConstants, SnapshotSource, address_of_instant
from autopilot.onboard.tick_answer import address_of_answer
from autopilot.services.endpoint import CompiledStreams
from autopilot.services.instant import Instant
from autopilot.services.stream_frames import MAX_STREAMS_BYTES, StreamFrames, address_of_streams
from autopilot.services.streams import NEVER_US
from autopilot.supervisor.state import UNARMED
from autopilot.wire.codec import FrameWriter
from autopilot.wire.compiled import MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES, Bytes, wire_record
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.ulog import UlogWriter

Ints = NDArray[np.int64]

# the contents of `TickBatch.numbers`: of the clock
NOW_US, TICK, PERIOD_US, UNTIL_US, TICKS_RUN = range(5)
# of the present tick's readings, if it was not completed: `Tick`; and whether any tick had a HIL_GPS
READINGS, FIELDS, HAS_FIX, ANY_FIX = range(5, 9)
# of the answer: its writer, its contents, its number of bytes, whether the inertial sample was sane
SEQUENCE, SYSTEM, COMPONENT, ARMED, LOCKSTEP, RELEASED, LENGTH, IMU_SANE = range(9, 17)
# of the streams: their writers, and the number of bytes written
STREAM_SYSTEM, STREAM_COMPONENT, STREAM_SEQUENCE, DIALECT_COMPONENT, DIALECT_SEQUENCE, UNSENT_BYTES = range(
    17, 23
)
# of what is flown, as arguments of `put_instant`
(
    HAS_SETPOINTS,
    SETPOINTS_START_US,
    CONTROL_MODE,
    LEG_START_US,
    PHASE,
    SEQ,
    LOAD_TRACKED,
    ROTORS,
) = range(23, 31)
# of the timesync requests: when the next is due, and the length of a window; `TimesyncRequests`; how many
# windows wait to be sent, and the time of the last request; the component that sends them
NEXT_REQUEST_US, WINDOW_US, NO_WAIT_UNTIL_US, SEND_SINGLY_US, MAX_WINDOWS = range(31, 36)
WAITING_WINDOWS, LAST_REQUEST_US, REQUEST_COMPONENT, REQUEST_SEQUENCE = range(36, 40)
# of the flight log: when it is due, its period, bytes that were written, range of the inertial sample's bytes
LOG_US, LOG_PERIOD_US, LOGGED_BYTES, IMU_BEGIN, IMU_END = range(40, 45)
NUMBERS = 45
_MAX_UNSENT_BYTES = 8 * MAX_STREAMS_BYTES  # bytes of streams without Python
_MAX_LOGGED_BYTES = 65_536
MAX_WAITING_WINDOWS = 16  # that can wait to be sent
# the contents of `TickBatch.limits`
DURATION_S, ASSUMED_LOAD_KG, ROTOR_MIN, ROTOR_MAX, HEADING = range(5)

TIMESYNC = wire_record(mavlink.MAVLink_timesync_message, __name__)

call_read_sensors: Any = call_kernel_returning(types.int64, types.int64, types.int64, types.boolean)
call_answer_tick: Any = call_kernel_returning(types.int64, types.boolean)
call_put_streams: Any = call_kernel_returning(types.int64, types.int64, types.int64)


class Code(NamedTuple):
    """Addresses of kernels."""

    read: int
    fly_tick: int
    answer_tick: int
    put_instant: int
    put_streams: int
    put_sample: int


class TimesyncRequests(NamedTuple):
    """The timesync requests that the shell allows machine code to send to the ground station."""

    no_wait_until_us: int  # answers to requests before this time are not waited for
    send_singly_us: int  # from this time on windows are sent one by one
    max_windows: int  # before it, so many windows are sent together
    unsent: tuple[bytes, ...]  # the closed windows, and the messages of the open window


NO_TIMESYNC_REQUESTS = TimesyncRequests(0, 0, 0, (b"",))


class LogBuffers(NamedTuple):
    """The data from which the flight log's records are made, for `put_sample`, and where they are put."""

    home: Row
    row: Row
    copies: Ints
    word: Bytes
    records: Bytes
    logged: Bytes


class SensorBuffers(NamedTuple):
    """Where readings are put, as in `SensorInbox`."""

    home: Row
    imu: Row
    slow: Row
    fix: Row
    payload: Bytes


class StreamBuffers(NamedTuple):
    """The data from which streams are written, and where they are put."""

    due: Ints  # (n, 2): interval in us, set of streams
    instant: Row
    home: Row
    payload: Bytes
    unsent: Bytes


class TickBatch(NamedTuple):
    """The data of the next ticks, before `numbers[UNTIL_US]`: the tick at that time is left to Python."""

    numbers: Ints
    limits: Row
    rows: CoreRows
    law: Any
    readings: SensorBuffers
    health: Row
    battery: Row
    forces: Row
    frame: Bytes
    payload: Bytes
    state_rows: tuple[Row, Row, Row, Row]  # as `put_instant` takes them
    targets: Array
    requested: Array
    streams: StreamBuffers
    window_ends: Ints  # where the messages of each closed window that is not sent end
    log: LogBuffers
    code: Code


class BatchBuilder:
    """Assembles `TickBatch`, and reads the results from it."""

    def __init__(self, source: SnapshotSource, battery: Row, writer: FrameWriter, lockstep: bool) -> None:
        """`battery` is the row of the battery's constants, `writer` that of the answers."""
        self._snapshot_source, self._battery = source, battery
        self._writer, self._lockstep = writer, lockstep
        self._numbers, self._limits = np.zeros(NUMBERS, np.int64), np.zeros(5)
        self._instant = np.zeros(width(Instant))
        self._unsent = np.zeros(_MAX_UNSENT_BYTES, np.uint8)
        self._window_ends = np.zeros(MAX_WAITING_WINDOWS, np.int64)
        self._logged = np.zeros(_MAX_LOGGED_BYTES, np.uint8)
        self._frame, self._payload = (
            np.zeros(MAX_FRAME_BYTES, np.uint8),
            np.zeros(MAX_PAYLOAD_BYTES, np.uint8),
        )
        # records of no log, as long as there is none
        self._records = SampleRecords(UlogWriter(topic for topic, _ in FAST), source.options.home)
        self._code: Code | None = None  # after the first call
        self._streams: CompiledStreams | None = None

    @property
    def streams(self) -> CompiledStreams:
        """The streams that were written last."""
        assert self._streams is not None
        return self._streams

    @property
    def unsent(self) -> list[bytes]:
        """The messages that are not sent yet: each closed window, and the open one."""
        unsent = self._unsent[: self._numbers[UNSENT_BYTES]].tobytes()
        ends = self._window_ends[: self._numbers[WAITING_WINDOWS]].tolist()
        return [unsent[begin:end] for begin, end in zip((0, *ends), (*ends, len(unsent)), strict=True)]

    @property
    def log_bytes(self) -> bytes:
        """The records of the flight log."""
        return self._logged[: self._numbers[LOGGED_BYTES]].tobytes()

    @property
    def next_log_us(self) -> int:
        """When the next records are due."""
        return int(self._numbers[LOG_US])

    @property
    def next_request_us(self) -> int:
        """When the next timesync request is due."""
        return int(self._numbers[NEXT_REQUEST_US])

    def next_batch(
        self,
        times: tuple[int, int, int, int],
        constants: InstantConstants,
        seq: int,
        streams: CompiledStreams,
        log: CompiledLogging | None,
        schedule: tuple[int, int, TimesyncRequests],
    ) -> TickBatch | None:
        """The data of the next ticks; `times`: the time now (us), the number of this tick, its duration (us),
        the time of the first tick that is left to Python (us). `seq`: the mission item under way; `schedule`:
        when the next request is due, the length of a window (us), and the allowed requests. None if nothing
        is compiled, or too much waits to be sent."""
        source = self._snapshot_source
        core, frames, writer = source.core, streams.frames, self._writer
        if log is not None:
            self._records = log.records
        code = self._code = self._code or self._kernel_addresses(constants)
        requests = schedule[2]
        unsent_bytes = b"".join(requests.unsent)
        is_full = (
            len(unsent_bytes) + MAX_STREAMS_BYTES + MAX_FRAME_BYTES > _MAX_UNSENT_BYTES
            or len(requests.unsent) > MAX_WAITING_WINDOWS
        )
        if code is None or is_full:
            return None
        ends = list(accumulate(map(len, requests.unsent[:-1])))
        self._unsent[: len(unsent_bytes)] = np.frombuffer(unsent_bytes, np.uint8)
        self._window_ends[: len(ends)] = ends
        flight, setpoints, autopilot_writer, dialect_writer = (
            core.flight,
            core.planned,
            frames.autopilot,
            frames.dialect,
        )
        load_tracked, load_kg, rotor_min, rotor_max, rotors, heading = constants.load_and_vehicle
        setpoints_start_us = 0 if setpoints is None else setpoints.first_us
        self._streams = streams
        self._numbers[:] = (
            *(*times, 0),
            *(0, 0, 0, 0),
            *(writer.sequence, writer.system, writer.component),
            *(flight.phase not in UNARMED, self._lockstep, flight.cable.released, 0, 0),
            *(
                autopilot_writer.system,
                autopilot_writer.component,
                autopilot_writer.sequence,
                dialect_writer.component,
                dialect_writer.sequence,
                len(unsent_bytes),
            ),
            *(
                constants.has_setpoints,
                setpoints_start_us,
                constants.control_mode,
                constants.start_us,
                constants.phase,
                seq,
            ),
            *(load_tracked, rotors),
            *(
                *schedule[:2],
                requests.no_wait_until_us,
                requests.send_singly_us,
                min(requests.max_windows, MAX_WAITING_WINDOWS),
            ),
            *(len(ends), 0),
            *(streams.request_writer.component, streams.request_writer.sequence),
            *((NEVER_US, 1) if log is None else (log.due_us, log.period_us)),
            *(0, *self._records.imu_range),
        )
        self._limits[:] = constants.duration_s, load_kg, rotor_min, rotor_max, heading
        return self._assemble(core.law, constants, streams, code)

    def warmup_batch(self) -> TickBatch:
        """What `next_batch` returns, only for compiling; it cannot be flown."""
        source = self._snapshot_source
        frames = StreamFrames(FrameWriter(1, 1), FrameWriter(1, 2), source.options.home)
        streams = CompiledStreams("", 0, np.zeros((0, 2), np.int64), frames, frames.autopilot)
        constants = source.instant_constants(source.core.flight)
        return self._assemble(
            placeholder_law(source.core.law_rows), constants, streams, Code(0, 0, 0, 0, 0, 0)
        )

    def _assemble(
        self, law: Any, constants: InstantConstants, streams: CompiledStreams, code: Code
    ) -> TickBatch:
        source, frames = self._snapshot_source, streams.frames
        core, readings, records = source.core, source.readings, self._records
        return TickBatch(
            self._numbers,
            self._limits,
            core.rows,
            law,
            SensorBuffers(readings.home, readings.imu, readings.slow, readings.fix, readings.payload),
            source.health,
            self._battery,
            core.force_row,
            self._frame,
            self._payload,
            constants.rows,
            constants.targets,
            constants.requested,
            StreamBuffers(streams.due, self._instant, frames.home, frames.payload, self._unsent),
            self._window_ends,
            LogBuffers(
                records.home, records.row, records.copies, records.word, records.records, self._logged
            ),
            code,
        )

    def result(self) -> tuple[int, int, bool, bytes] | None:
        """The time (us) and number of the last tick flown by machine code, whether its inertial sample is
        sane, and the answer to it; None: no tick was flown. Updates the writers and
        `SnapshotSource.has_fix`."""
        numbers = self._numbers
        if numbers[TICKS_RUN] == 0:
            return None
        frames = self.streams.frames
        self._writer.sequence = int(numbers[SEQUENCE])
        frames.autopilot.sequence = int(numbers[STREAM_SEQUENCE])
        frames.dialect.sequence = int(numbers[DIALECT_SEQUENCE])
        self.streams.request_writer.sequence = int(numbers[REQUEST_SEQUENCE])
        if numbers[ANY_FIX]:
            self._snapshot_source.has_fix = True
        answer = self._frame[: numbers[LENGTH]].tobytes()
        return int(numbers[NOW_US]), int(numbers[TICK]), bool(numbers[IMU_SANE]), answer

    def _kernel_addresses(self, constants: InstantConstants) -> Code | None:
        source = self._snapshot_source
        fly_tick = source.core.address_of_tick()
        if fly_tick == 0:
            return None
        return Code(
            address_of_read(source.readings),
            fly_tick,
            address_of_answer(),
            address_of_instant(constants, self._instant),
            address_of_streams(self._instant),
            self._records.address(self._instant, source.readings.imu),
        )
