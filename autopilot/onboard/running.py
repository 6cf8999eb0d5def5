"""Ticks that machine code can fly by itself: the data for them, and their results.

Most ticks are alike: readings arrive, no decision is needed, an answer is sent, and perhaps streams that
machine code can write. `Onboard` determines until when nothing else is due (`running`), a loop in machine
code flies these ticks (`autopilot.shell.tick_loop`), and `Onboard.ran` takes over the results. `Onboard` does
everything else.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from autopilot.core.sensor_inbox import address_of_read
from autopilot.core.tick import CoreRows, any_law
from autopilot.estimation.records import Array
from autopilot.geometry.addresses import kernel_giving
from autopilot.geometry.packed import Row, width
from autopilot.onboard.flight_log import LogRunning
from autopilot.onboard.log_records import SampleRecords
from autopilot.onboard.log_topics import FAST
from autopilot.onboard.snapshot import UNARMED, Moments, Standing, address_of_instant
from autopilot.onboard.tick_answer import address_of_answer
from autopilot.services.endpoint import Written
from autopilot.services.instant import Instant
from autopilot.services.stream_frames import STREAMS_ROOM, StreamFrames, address_of_streams
from autopilot.services.streams import NEVER_US
from autopilot.wire.codec import FrameWriter
from autopilot.wire.compiled import FRAME_ROOM, PAYLOAD_ROOM, Bytes, wire_record
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.ulog import UlogWriter

Ints = NDArray[np.int64]

# the contents of `Running.numbers`: of the clock
NOW_US, TICK, PERIOD_US, UNTIL_US, RAN = range(5)
# of the present tick's readings, if it was not completed: `Tick`; and whether any tick had a HIL_GPS
READINGS, FIELDS, FIXED, EVER_FIXED = range(5, 9)
# of the answer: its writer, its contents, its number of bytes, whether the inertial sample was sane
SEQUENCE, SYSTEM, COMPONENT, ARMED, LOCKSTEP, RELEASED, LENGTH, SENSED = range(9, 17)
# of the streams: their writers, and the number of bytes written
OWN_SYSTEM, OWN_COMPONENT, OWN_SEQUENCE, DIALECT_COMPONENT, DIALECT_SEQUENCE, SAID = range(17, 23)
# of what is flown, as arguments of `put_instant`
TRACKS, FIRST_US, MODE, SINCE_US, PHASE, SEQ, CARRYING, CARRIES, ROTORS = range(23, 32)
# of the questions: when the next is due, and the length of a window; `Questions`; how many windows wait to be
# sent, and the time of the last question; the component that asks
QUESTION_US, WINDOW_US, ASKED_UNTIL_US, ALONE_US, MOST_ASKED = range(32, 37)
ASKED, ASKED_US, ASIDE_COMPONENT, ASIDE_SEQUENCE = range(37, 41)
# of the flight log: when it is due, its period, bytes that were written, range of the inertial sample's bytes
LOG_US, LOG_PERIOD_US, LOGGED, SENSED_BEGIN, SENSED_END = range(41, 46)
NUMBERS = 46
_MOST_SAID = 8 * STREAMS_ROOM  # bytes of streams without Python
_MOST_LOGGED = 65_536
MOST_WINDOWS = 16  # that can wait to be sent
# the contents of `Running.limits`
DURATION_S, ROTOR_MIN, ROTOR_MAX = range(3)

TIMESYNC = wire_record(mavlink.MAVLink_timesync_message, __name__)

ask_reading: Any = kernel_giving(types.int64, types.int64, types.int64, types.boolean)
ask_answer: Any = kernel_giving(types.int64, types.boolean)
ask_streams: Any = kernel_giving(types.int64, types.int64, types.int64)


class Code(NamedTuple):
    """Addresses of kernels."""

    read: int
    fly_tick: int
    answer_tick: int
    put_instant: int
    put_streams: int
    put_sample: int


class Questions(NamedTuple):
    """The questions that the shell allows machine code to ask the ground station."""

    until_us: int  # answers to questions before this time are not waited for
    alone_us: int  # from this time on windows are sent one by one
    most: int  # before it, so many windows are sent together
    unsent: tuple[bytes, ...]  # the closed windows, and the messages of the open window


NO_QUESTIONS = Questions(0, 0, 0, (b"",))


class Log(NamedTuple):
    """The data from which the flight log's records are made, for `put_sample`, and where they are put."""

    home: Row
    row: Row
    copies: Ints
    wide: Bytes
    records: Bytes
    logged: Bytes


class Readings(NamedTuple):
    """Where readings are put, as in `SensorInbox`."""

    home: Row
    imu: Row
    slow: Row
    fix: Row
    payload: Bytes


class Streams(NamedTuple):
    """The data from which streams are written, and where they are put."""

    due: Ints  # (n, 2): interval in us, set of streams
    instant: Row
    home: Row
    payload: Bytes
    said: Bytes


class Running(NamedTuple):
    """The data of the next ticks, before `numbers[UNTIL_US]`: the tick at that time is left to Python."""

    numbers: Ints
    limits: Row
    rows: CoreRows
    law: Any
    readings: Readings
    health: Row
    battery: Row
    forces: Row
    frame: Bytes
    payload: Bytes
    flown: tuple[Row, Row, Row, Row]  # as `put_instant` takes them
    targets: Array
    asked: Array
    streams: Streams
    windows: Ints  # where the messages of each closed window that is not sent end
    log: Log
    code: Code


class Runner:
    """Assembles `Running`, and reads the results from it."""

    def __init__(self, moments: Moments, battery: Row, writer: FrameWriter, lockstep: bool) -> None:
        """`battery` is the row of the battery's constants, `writer` that of the answers."""
        self._moments, self._battery = moments, battery
        self._writer, self._lockstep = writer, lockstep
        self._numbers, self._limits = np.zeros(NUMBERS, np.int64), np.zeros(3)
        self._instant = np.zeros(width(Instant))
        self._said = np.zeros(_MOST_SAID, np.uint8)
        self._windows = np.zeros(MOST_WINDOWS, np.int64)
        self._logged = np.zeros(_MOST_LOGGED, np.uint8)
        self._frame, self._payload = np.zeros(FRAME_ROOM, np.uint8), np.zeros(PAYLOAD_ROOM, np.uint8)
        # records of no log, as long as there is none
        self._records = SampleRecords(UlogWriter(topic for topic, _ in FAST), moments.options.home)
        self._code: Code | None = None  # after the first call
        self._written: Written | None = None

    @property
    def written(self) -> Written:
        """The streams that were written last."""
        assert self._written is not None
        return self._written

    @property
    def said(self) -> list[bytes]:
        """The messages that are not sent yet: each closed window, and the open one."""
        said = self._said[: self._numbers[SAID]].tobytes()
        ends = self._windows[: self._numbers[ASKED]].tolist()
        return [said[begin:end] for begin, end in zip((0, *ends), (*ends, len(said)), strict=True)]

    @property
    def logged(self) -> bytes:
        """The records of the flight log."""
        return self._logged[: self._numbers[LOGGED]].tobytes()

    @property
    def next_log_us(self) -> int:
        """When the next records are due."""
        return int(self._numbers[LOG_US])

    @property
    def next_question_us(self) -> int:
        """When the next question is due."""
        return int(self._numbers[QUESTION_US])

    def running(
        self,
        times: tuple[int, int, int, int],
        known: Standing,
        seq: int,
        written: Written,
        log: LogRunning | None,
        asked: tuple[int, int, Questions],
    ) -> Running | None:
        """The data of the next ticks; `times`: the time now (us), the number of this tick, its duration (us),
        the time of the first tick that is left to Python (us). `seq`: the mission item under way; `asked`:
        when the next question is due, the length of a window (us), and the allowed questions. None if nothing
        is compiled, or too much waits to be sent."""
        moments = self._moments
        core, frames, writer = moments.core, written.frames, self._writer
        if log is not None:
            self._records = log.records
        code = self._code = self._code or self._addresses(known)
        questions = asked[2]
        unsent = b"".join(questions.unsent)
        too_much = (
            len(unsent) + STREAMS_ROOM + FRAME_ROOM > _MOST_SAID or len(questions.unsent) > MOST_WINDOWS
        )
        if code is None or too_much:
            return None
        ends = list(accumulate(map(len, questions.unsent[:-1])))
        self._said[: len(unsent)] = np.frombuffer(unsent, np.uint8)
        self._windows[: len(ends)] = ends
        flight, laid, own, dialect = core.flight, core.laid, frames.autopilot, frames.dialect
        carrying, carries, rotor_min, rotor_max, rotors = known.facts
        first_us = 0 if laid is None else laid.first_us
        self._written = written
        self._numbers[:] = (
            *(*times, 0),
            *(0, 0, 0, 0),
            *(writer.sequence, writer.system, writer.component),
            *(flight.phase not in UNARMED, self._lockstep, flight.cable.released, 0, 0),
            *(own.system, own.component, own.sequence, dialect.component, dialect.sequence, len(unsent)),
            *(known.tracks, first_us, known.control_mode, known.since_us, known.phase, seq),
            *(carrying, carries, rotors),
            *(*asked[:2], questions.until_us, questions.alone_us, min(questions.most, MOST_WINDOWS)),
            *(len(ends), 0),
            *(written.aside.component, written.aside.sequence),
            *((NEVER_US, 1) if log is None else (log.due_us, log.period_us)),
            *(0, *self._records.sensed),
        )
        self._limits[:] = known.duration_s, rotor_min, rotor_max
        return self._together(core.law, known, written, code)

    def rehearsed(self) -> Running:
        """What `running` returns, only for compiling; it cannot be flown."""
        moments = self._moments
        frames = StreamFrames(FrameWriter(1, 1), FrameWriter(1, 2), moments.options.home)
        written = Written("", 0, np.zeros((0, 2), np.int64), frames, frames.autopilot)
        known = moments.standing(moments.core.flight)
        return self._together(any_law(moments.core.law_rows), known, written, Code(0, 0, 0, 0, 0, 0))

    def _together(self, law: Any, known: Standing, written: Written, code: Code) -> Running:
        moments, frames = self._moments, written.frames
        core, readings, records = moments.core, moments.readings, self._records
        return Running(
            self._numbers,
            self._limits,
            core.rows,
            law,
            Readings(readings.home, readings.imu, readings.slow, readings.fix, readings.payload),
            moments.health,
            self._battery,
            core.force_row,
            self._frame,
            self._payload,
            known.rows,
            known.targets,
            known.asked,
            Streams(written.due, self._instant, frames.home, frames.payload, self._said),
            self._windows,
            Log(records.home, records.row, records.copies, records.wide, records.records, self._logged),
            code,
        )

    def ran(self) -> tuple[int, int, bool, bytes] | None:
        """The time (us) and number of the last tick flown by machine code, whether its inertial sample is
        sane, and the answer to it; None: no tick was flown. Updates the writers and `Moments.fixed`."""
        numbers = self._numbers
        if numbers[RAN] == 0:
            return None
        frames = self.written.frames
        self._writer.sequence = int(numbers[SEQUENCE])
        frames.autopilot.sequence = int(numbers[OWN_SEQUENCE])
        frames.dialect.sequence = int(numbers[DIALECT_SEQUENCE])
        self.written.aside.sequence = int(numbers[ASIDE_SEQUENCE])
        if numbers[EVER_FIXED]:
            self._moments.fixed = True
        answer = self._frame[: numbers[LENGTH]].tobytes()
        return int(numbers[NOW_US]), int(numbers[TICK]), bool(numbers[SENSED]), answer

    def _addresses(self, known: Standing) -> Code | None:
        moments = self._moments
        fly_tick = moments.core.address_of_tick()
        if fly_tick == 0:
            return None
        return Code(
            address_of_read(moments.readings),
            fly_tick,
            address_of_answer(),
            address_of_instant(known, self._instant),
            address_of_streams(self._instant),
            self._records.address(self._instant, moments.readings.imu),
        )
