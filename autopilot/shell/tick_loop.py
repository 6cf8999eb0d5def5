"""Lockstep in machine code: tick after tick without Python, as long as nothing is to be decided, or asked.

`fly_on` waits for the sensors of the next tick, flies it, writes the streams that are due, and answers, until
something else is to be done: a datagram comes that is not the plain next tick, none comes in time, the
supervisor is to decide, or a tick is near at which more is to be said.
"""

from __future__ import annotations

import socket
from typing import Any, NamedTuple

import numpy as np

from autopilot.core.sensor_inbox import Tick
from autopilot.core.tick import TO_DECIDE
from autopilot.geometry.addresses import ask_kernel_at, bytes_at, call_kernel_at
from autopilot.geometry.entry import entry_of
from autopilot.geometry.kernel import kernel, threaded
from autopilot.onboard.onboard import Onboard
from autopilot.onboard.running import (
    ALONE_US,
    ARMED,
    ASIDE_COMPONENT,
    ASIDE_SEQUENCE,
    ASKED,
    ASKED_UNTIL_US,
    ASKED_US,
    CARRIES,
    CARRYING,
    COMPONENT,
    DIALECT_COMPONENT,
    DIALECT_SEQUENCE,
    DURATION_S,
    EVER_FIXED,
    FIELDS,
    FIRST_US,
    FIXED,
    LENGTH,
    LOCKSTEP,
    LOG_PERIOD_US,
    LOG_US,
    LOGGED,
    MODE,
    MOST_ASKED,
    NOW_US,
    OWN_COMPONENT,
    OWN_SEQUENCE,
    OWN_SYSTEM,
    PERIOD_US,
    PHASE,
    QUESTION_US,
    RAN,
    READINGS,
    RELEASED,
    ROTOR_MAX,
    ROTOR_MIN,
    ROTORS,
    SAID,
    SENSED,
    SENSED_BEGIN,
    SENSED_END,
    SEQ,
    SEQUENCE,
    SINCE_US,
    SYSTEM,
    TICK,
    TIMESYNC,
    TRACKS,
    UNTIL_US,
    WINDOW_US,
    Ints,
    Questions,
    Running,
    ask_answer,
    ask_reading,
    ask_streams,
)
from autopilot.services.stream_frames import STREAMS_ROOM
from autopilot.shell.machine_sockets import (
    NOWHERE,
    SUPPORTED,
    receive_at,
    send_at,
    send_to_at,
    system_address,
    usable,
)
from autopilot.shell.options import LARGEST_DATAGRAM, Address
from autopilot.wire.compiled import FRAME_ROOM, Bytes, Origin, put_frame

# why `fly_on` returns
UNTIL, SILENCE, HEARD, DECIDE = range(4)


class Wire(NamedTuple):
    """The socket towards the simulator, what came by it, and the way to the ground station."""

    fd: int
    heard: Bytes
    size: Ints  # (1,) of `heard`
    ground_fd: int
    ground: Bytes  # its address, as the system has it


class Met(NamedTuple):
    """What ended the ticks without Python."""

    ran: bool  # there were any
    more: bool = False  # and there may be more
    datagram: bytes | None = None  # that is to be handled
    decide: Tick | None = None  # a tick that is to be decided upon


NOTHING = Met(False)


@kernel
def _tell(run: Running, now_us: int, sane: bool) -> bool:
    """Write the streams and the records of the flight log that are due at this tick, behind those of the
    ticks before; ask the ground station at the end of a window, and return whether it is one. `sane`: the
    inertial sample is."""
    numbers, streams = run.numbers, run.streams
    bits = 0
    for k in range(streams.due.shape[0]):
        interval_us = streams.due[k, 0]
        if now_us // interval_us != (now_us - numbers[PERIOD_US]) // interval_us:
            bits |= streams.due[k, 1]
    logs = now_us >= numbers[LOG_US]
    if bits != 0 or logs:
        _put_instant(run, now_us)
    if bits != 0:
        _put_streams(run, bits)
    ends = now_us >= numbers[QUESTION_US]
    if ends:
        numbers[QUESTION_US] = now_us - now_us % numbers[WINDOW_US] + numbers[WINDOW_US]
        origin = Origin(numbers[ASIDE_SEQUENCE], numbers[OWN_SYSTEM], numbers[ASIDE_COMPONENT])
        values = (0, now_us * 1000)
        end = put_frame(TIMESYNC, values, streams.payload, streams.said, numbers[SAID], origin)
        run.windows[numbers[ASKED]] = numbers[SAID] = end
        numbers[ASKED] += 1
        numbers[ASKED_US] = now_us
        numbers[ASIDE_SEQUENCE] = (numbers[ASIDE_SEQUENCE] + 1) & 0xFF
    if logs:
        _put_records(run, now_us, sane)
    return bool(ends)


@kernel
def _put_records(run: Running, now_us: int, sane: bool) -> None:
    """Write the records of an instant that has been put together."""
    numbers, log = run.numbers, run.log
    numbers[LOG_US] = now_us - now_us % numbers[LOG_PERIOD_US] + numbers[LOG_PERIOD_US]
    rows = (run.streams.instant, run.readings.imu, log.home, now_us, log.row)
    call_kernel_at(run.code.put_sample, (rows, log.copies, log.wide, log.records))
    at = numbers[LOGGED]
    for i in range(len(log.records)):
        if sane or not numbers[SENSED_BEGIN] <= i < numbers[SENSED_END]:
            log.logged[at] = log.records[i]
            at += 1
    numbers[LOGGED] = at


@kernel
def _put_instant(run: Running, now_us: int) -> None:
    """Put the instant of this tick together."""
    numbers, streams = run.numbers, run.streams
    at = 0
    if numbers[TRACKS]:
        at = (now_us - numbers[FIRST_US]) // numbers[PERIOD_US]
    call_kernel_at(
        run.code.put_instant,
        (
            run.flown,
            run.targets,
            run.asked,
            at,
            numbers[MODE],
            (now_us - numbers[SINCE_US]) * 1e-6,
            run.limits[DURATION_S],
            now_us,
            numbers[PHASE],
            numbers[SEQ],
            numbers[CARRYING] != 0,
            numbers[CARRIES] != 0,
            run.limits[ROTOR_MIN],
            run.limits[ROTOR_MAX],
            numbers[ROTORS],
            streams.instant,
        ),
    )


@kernel
def _put_streams(run: Running, bits: int) -> None:
    """Write a set of streams of an instant that has been put together."""
    numbers, streams = run.numbers, run.streams
    begin = numbers[SAID]
    length, numbers[OWN_SEQUENCE], numbers[DIALECT_SEQUENCE] = ask_streams(
        run.code.put_streams,
        (
            bits,
            streams.instant,
            streams.home,
            numbers[OWN_SYSTEM],
            numbers[OWN_COMPONENT],
            numbers[OWN_SEQUENCE],
            numbers[DIALECT_COMPONENT],
            numbers[DIALECT_SEQUENCE],
            streams.payload,
            streams.said[begin:],
        ),
    )
    numbers[SAID] = begin + length


@kernel
def _send_windows(wire: Wire, run: Running) -> None:
    """Send the windows that are over, once they are enough or the ground will soon be waited for."""
    numbers, said = run.numbers, run.streams.said.ctypes.data
    if numbers[ASKED] < numbers[MOST_ASKED] and numbers[ASKED_US] < numbers[ALONE_US]:
        return
    begin = 0
    for i in range(numbers[ASKED]):
        end = run.windows[i]
        send_to_at(wire.ground_fd, said + begin, end - begin, wire.ground.ctypes.data, len(wire.ground))
        begin = end
    if begin > 0:  # what was said last was a question: nothing is left
        numbers[ASKED] = numbers[SAID] = 0


@kernel
def _goes_on(run: Running, next_us: int) -> bool:
    """Whether there is nothing else to be done at the next tick, and room for what is."""
    numbers = run.numbers
    asks = next_us >= numbers[QUESTION_US]
    if next_us >= numbers[UNTIL_US] or (asks and next_us >= numbers[ASKED_UNTIL_US]):
        return False
    said, logged = numbers[SAID] + STREAMS_ROOM + FRAME_ROOM, numbers[LOGGED] + len(run.log.records)
    return bool(said <= len(run.streams.said) and logged <= len(run.log.logged))


@threaded
def fly_on(wire: Wire, run: Running) -> int:
    """Fly ticks until one is near that is none of these (UNTIL), or until another datagram is HEARD, or none
    (SILENCE); DECIDE: this tick's estimate is made, and the supervisor is to decide upon it."""
    numbers, kept, code = run.numbers, run.readings, run.code
    now_us, period_us = numbers[NOW_US], numbers[PERIOD_US]
    dt, decided = period_us * 1e-6, False
    while _goes_on(run, now_us + period_us):
        size = receive_at(wire.fd, wire.heard.ctypes.data, len(wire.heard))
        wire.size[0] = size
        if size < 0:
            return SILENCE
        count, time_us, fields, fixed = ask_reading(
            code.read,
            (
                bytes_at(wire.heard.ctypes.data, size),
                kept.home,
                now_us,
                run.rows.inbox,
                kept.imu,
                kept.slow,
                kept.fix,
                kept.payload,
            ),
        )
        if count < 0 or count > run.rows.inbox.shape[0] or time_us != now_us + period_us:
            return HEARD
        tick = numbers[TICK] + 1
        what = ask_kernel_at(code.fly_tick, (run.rows, run.law, count, time_us, tick, dt, decided))
        if what == TO_DECIDE:
            numbers[READINGS], numbers[FIELDS], numbers[FIXED] = count, fields, fixed
            return DECIDE
        now_us = time_us
        length, sane = ask_answer(
            code.answer_tick,
            (
                run.health,
                kept.imu,
                run.forces,
                run.battery,
                fields,
                fixed,
                now_us,
                dt,
                run.frame,
                run.payload,
                numbers[SEQUENCE],
                numbers[SYSTEM],
                numbers[COMPONENT],
                numbers[ARMED] != 0,
                numbers[LOCKSTEP] != 0,
                numbers[RELEASED] != 0,
                0.0,
            ),
        )
        numbers[SEQUENCE] = (numbers[SEQUENCE] + 1) & 0xFF
        numbers[LENGTH], numbers[SENSED] = length, sane
        numbers[NOW_US], numbers[TICK] = now_us, tick
        numbers[EVER_FIXED] |= fixed
        numbers[RAN] += 1
        if _tell(run, now_us, sane):
            _send_windows(wire, run)
        send_at(wire.fd, run.frame.ctypes.data, length)
    return UNTIL


class TickLoop:
    """Runs `fly_on` where it can be run."""

    def __init__(self, sock: socket.socket, ground: socket.socket, address: Address) -> None:
        """`sock` is connected to the simulator; `ground` sends to the ground station at `address`."""
        at = system_address(address)
        self._usable = usable(sock) and usable(ground) and at is not None
        heard, to = np.zeros(LARGEST_DATAGRAM, np.uint8), np.frombuffer(at or NOWHERE, np.uint8).copy()
        self._wire = Wire(sock.fileno(), heard, np.zeros(1, np.int64), ground.fileno(), to)
        self._fly_on: Any = None  # machine code, once it was asked for

    def run(self, onboard: Onboard, questions: Questions) -> Met:
        """Fly the ticks that can be flown so; what ended them."""
        run = onboard.running(questions) if self._usable else None
        if run is None:
            return NOTHING
        wire, numbers = self._wire, run.numbers
        if self._fly_on is None:
            self._fly_on = entry_of(fly_on, wire, run)
        why = self._fly_on(wire, run)
        ran = onboard.ran()
        if why == HEARD:
            return Met(ran, datagram=wire.heard[: wire.size[0]].tobytes())
        if why == DECIDE:
            now_us, readings = int(numbers[NOW_US] + numbers[PERIOD_US]), int(numbers[READINGS])
            tick = Tick(now_us, readings, int(numbers[FIELDS]), bool(numbers[FIXED]), ())
            return Met(ran, decide=tick)
        return Met(ran, more=ran and why == UNTIL)


def rehearse(onboard: Onboard) -> None:
    """Have the machine code of `fly_on` ready, where it is used."""
    if SUPPORTED:
        none = np.zeros(1, np.uint8)
        wire = Wire(-1, none, np.zeros(1, np.int64), -1, none)
        entry_of(fly_on, wire, onboard.rehearsed_running())
