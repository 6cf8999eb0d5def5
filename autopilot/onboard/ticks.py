"""A tick of the flight software in machine code; the caller receives the sensors and sends the answer.

`fly_next` flies it and writes the streams that are due, as long as no decision is needed and no answer of the
ground has to be waited for (`goes_on`): see `autopilot.onboard.running`.
"""

from __future__ import annotations

from autopilot.core.sensor_inbox import Tick
from autopilot.core.tick import TO_DECIDE
from autopilot.geometry.addresses import ask_kernel_at, bytes_at, call_kernel_at
from autopilot.geometry.kernel import kernel
from autopilot.onboard.running import (
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
    Running,
    ask_answer,
    ask_reading,
    ask_streams,
)
from autopilot.services.stream_frames import STREAMS_ROOM
from autopilot.wire.compiled import FRAME_ROOM, Origin, put_frame
from autopilot.wire.periods import next_multiple

# result of a tick: it was FLOWN, or flown and a window ENDED with it. Or Python must fly it: the datagram
# that was HEARD is not the plain next tick, or the estimate is made and the supervisor must DECIDE
FLOWN, ENDED, HEARD, DECIDE = range(4)


@kernel
def fly_next(run: Running, address: int, size: int) -> int:
    """Fly the tick whose sensors are the `size` bytes at `address`; the answer is put into `run.frame`."""
    numbers, kept, code = run.numbers, run.readings, run.code
    before_us, period_us = numbers[NOW_US], numbers[PERIOD_US]
    dt, decided = period_us * 1e-6, False
    count, now_us, fields, fixed = ask_reading(
        code.read,
        (
            bytes_at(address, size),
            kept.home,
            before_us,
            run.rows.inbox,
            kept.imu,
            kept.slow,
            kept.fix,
            kept.payload,
        ),
    )
    if count < 0 or count > run.rows.inbox.shape[0] or now_us != before_us + period_us:
        return HEARD
    tick = numbers[TICK] + 1
    what = ask_kernel_at(code.fly_tick, (run.rows, run.law, count, now_us, tick, dt, decided))
    if what == TO_DECIDE:
        numbers[READINGS], numbers[FIELDS], numbers[FIXED] = count, fields, fixed
        return DECIDE
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
    return ENDED if _tell(run, now_us, sane) else FLOWN


def begun(run: Running) -> Tick:
    """The tick for which the supervisor must decide."""
    numbers = run.numbers
    now_us, readings = int(numbers[NOW_US] + numbers[PERIOD_US]), int(numbers[READINGS])
    return Tick(now_us, readings, int(numbers[FIELDS]), bool(numbers[FIXED]), ())


@kernel
def goes_on(run: Running) -> bool:
    """Whether the next tick requires nothing else, and there is room for its output."""
    numbers = run.numbers
    next_us = numbers[NOW_US] + numbers[PERIOD_US]
    asks = next_us >= numbers[QUESTION_US]
    if next_us >= numbers[UNTIL_US] or (asks and next_us >= numbers[ASKED_UNTIL_US]):
        return False
    said, logged = numbers[SAID] + STREAMS_ROOM + FRAME_ROOM, numbers[LOGGED] + len(run.log.records)
    return bool(said <= len(run.streams.said) and logged <= len(run.log.logged))


@kernel
def _tell(run: Running, now_us: int, sane: bool) -> bool:
    """Write the streams and the records of the flight log that are due at this tick, after those of the
    previous ticks; at the end of a window, write the question to the ground station. Returns whether a window
    ends. `sane`: whether the inertial sample is sane."""
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
        numbers[QUESTION_US] = next_multiple(now_us, numbers[WINDOW_US])
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
    """Write the records of an instant that has been assembled."""
    numbers, log = run.numbers, run.log
    numbers[LOG_US] = next_multiple(now_us, numbers[LOG_PERIOD_US])
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
    """Assemble the instant of this tick."""
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
    """Write a set of streams of an instant that has been assembled."""
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
