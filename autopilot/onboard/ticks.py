"""A tick of the flight software in machine code; the caller receives the sensors and sends the answer.

`fly_next` flies it and writes the streams that are due, as long as no decision is needed and no answer of the
ground has to be waited for (`can_continue`): see `autopilot.onboard.tick_batch`.
"""

from __future__ import annotations

from autopilot.core.sensor_inbox import Tick
from autopilot.core.tick import TO_DECIDE
from autopilot.geometry.addresses import bytes_at, call_int_kernel_at, call_kernel_at
from autopilot.geometry.kernel import kernel
from autopilot.onboard.tick_batch import (
    ANY_FIX,
    ARMED,
    ASSUMED_LOAD_KG,
    COMPONENT,
    CONTROL_MODE,
    DIALECT_COMPONENT,
    DIALECT_SEQUENCE,
    DURATION_S,
    FIELDS,
    HAS_FIX,
    HAS_SETPOINTS,
    HEADING,
    IMU_BEGIN,
    IMU_END,
    IMU_SANE,
    LAST_REQUEST_US,
    LEG_START_US,
    LENGTH,
    LOAD_TRACKED,
    LOCKSTEP,
    LOG_PERIOD_US,
    LOG_US,
    LOGGED_BYTES,
    NEXT_REQUEST_US,
    NO_WAIT_UNTIL_US,
    NOW_US,
    PERIOD_US,
    PHASE,
    READINGS,
    RELEASED,
    REQUEST_COMPONENT,
    REQUEST_SEQUENCE,
    ROTOR_MAX,
    ROTOR_MIN,
    ROTORS,
    SEQ,
    SEQUENCE,
    SETPOINTS_START_US,
    STREAM_COMPONENT,
    STREAM_SEQUENCE,
    STREAM_SYSTEM,
    SYSTEM,
    TICK,
    TICKS_RUN,
    TIMESYNC,
    UNSENT_BYTES,
    UNTIL_US,
    WAITING_WINDOWS,
    WINDOW_US,
    TickBatch,
    call_answer_tick,
    call_put_streams,
    call_read_sensors,
)
from autopilot.services.stream_frames import MAX_STREAMS_BYTES
from autopilot.wire.compiled import MAX_FRAME_BYTES, Origin, put_frame
from autopilot.wire.periods import next_multiple

# result of a tick: it was FLOWN, or flown and a window ENDED with it. Or Python must fly it: the datagram
# that was HEARD is not the plain next tick, or the estimate is made and the supervisor must DECIDE
FLOWN, WINDOW_ENDED, OTHER_DATAGRAM, NEEDS_DECISION = range(4)


@kernel
def fly_next(batch: TickBatch, address: int, size: int) -> int:
    """Fly the tick whose sensors are the `size` bytes at `address`; the answer is put into `batch.frame`."""
    numbers, sensors, code = batch.numbers, batch.readings, batch.code
    before_us, period_us = numbers[NOW_US], numbers[PERIOD_US]
    dt, decided = period_us * 1e-6, False
    count, now_us, fields, has_fix = call_read_sensors(
        code.read,
        (
            bytes_at(address, size),
            sensors.home,
            before_us,
            batch.rows.inbox,
            sensors.imu,
            sensors.slow,
            sensors.fix,
            sensors.payload,
        ),
    )
    if count < 0 or count > batch.rows.inbox.shape[0] or now_us != before_us + period_us:
        return OTHER_DATAGRAM
    tick = numbers[TICK] + 1
    outcome = call_int_kernel_at(code.fly_tick, (batch.rows, batch.law, count, now_us, tick, dt, decided))
    if outcome == TO_DECIDE:
        numbers[READINGS], numbers[FIELDS], numbers[HAS_FIX] = count, fields, has_fix
        return NEEDS_DECISION
    length, sane = call_answer_tick(
        code.answer_tick,
        (
            batch.health,
            sensors.imu,
            batch.forces,
            batch.battery,
            fields,
            has_fix,
            now_us,
            dt,
            batch.frame,
            batch.payload,
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
    numbers[LENGTH], numbers[IMU_SANE] = length, sane
    numbers[NOW_US], numbers[TICK] = now_us, tick
    numbers[ANY_FIX] |= has_fix
    numbers[TICKS_RUN] += 1
    return WINDOW_ENDED if _put_outputs(batch, now_us, sane) else FLOWN


def tick_to_decide(batch: TickBatch) -> Tick:
    """The tick for which the supervisor must decide."""
    numbers = batch.numbers
    now_us, readings = int(numbers[NOW_US] + numbers[PERIOD_US]), int(numbers[READINGS])
    return Tick(now_us, readings, int(numbers[FIELDS]), bool(numbers[HAS_FIX]), ())


@kernel
def can_continue(batch: TickBatch) -> bool:
    """Whether the next tick requires nothing else, and there is room for its output."""
    numbers = batch.numbers
    next_us = numbers[NOW_US] + numbers[PERIOD_US]
    timesync_due = next_us >= numbers[NEXT_REQUEST_US]
    if next_us >= numbers[UNTIL_US] or (timesync_due and next_us >= numbers[NO_WAIT_UNTIL_US]):
        return False
    message_bytes, log_bytes = (
        numbers[UNSENT_BYTES] + MAX_STREAMS_BYTES + MAX_FRAME_BYTES,
        numbers[LOGGED_BYTES] + len(batch.log.records),
    )
    return bool(message_bytes <= len(batch.streams.unsent) and log_bytes <= len(batch.log.logged))


@kernel
def _put_outputs(batch: TickBatch, now_us: int, sane: bool) -> bool:
    """Write the streams and the records of the flight log that are due at this tick, after those of the
    previous ticks; at the end of a window, write the timesync request to the ground station. Returns whether
    a window ends. `sane`: whether the inertial sample is sane."""
    numbers, streams = batch.numbers, batch.streams
    bits = 0
    for k in range(streams.due.shape[0]):
        interval_us = streams.due[k, 0]
        if now_us // interval_us != (now_us - numbers[PERIOD_US]) // interval_us:
            bits |= streams.due[k, 1]
    log_due = now_us >= numbers[LOG_US]
    if bits != 0 or log_due:
        _put_instant(batch, now_us)
    if bits != 0:
        _put_streams(batch, bits)
    window_ended = now_us >= numbers[NEXT_REQUEST_US]
    if window_ended:
        numbers[NEXT_REQUEST_US] = next_multiple(now_us, numbers[WINDOW_US])
        origin = Origin(numbers[REQUEST_SEQUENCE], numbers[STREAM_SYSTEM], numbers[REQUEST_COMPONENT])
        values = (0, now_us * 1000)
        end = put_frame(TIMESYNC, values, streams.payload, streams.unsent, numbers[UNSENT_BYTES], origin)
        batch.window_ends[numbers[WAITING_WINDOWS]] = numbers[UNSENT_BYTES] = end
        numbers[WAITING_WINDOWS] += 1
        numbers[LAST_REQUEST_US] = now_us
        numbers[REQUEST_SEQUENCE] = (numbers[REQUEST_SEQUENCE] + 1) & 0xFF
    if log_due:
        _put_records(batch, now_us, sane)
    return bool(window_ended)


@kernel
def _put_records(batch: TickBatch, now_us: int, sane: bool) -> None:
    """Write the records of an instant that has been assembled."""
    numbers, log = batch.numbers, batch.log
    numbers[LOG_US] = next_multiple(now_us, numbers[LOG_PERIOD_US])
    rows = (batch.streams.instant, batch.readings.imu, log.home, now_us, log.row)
    call_kernel_at(batch.code.put_sample, (rows, log.copies, log.word, log.records))
    offset = numbers[LOGGED_BYTES]
    for i in range(len(log.records)):
        if sane or not numbers[IMU_BEGIN] <= i < numbers[IMU_END]:
            log.logged[offset] = log.records[i]
            offset += 1
    numbers[LOGGED_BYTES] = offset


@kernel
def _put_instant(batch: TickBatch, now_us: int) -> None:
    """Assemble the instant of this tick."""
    numbers, streams = batch.numbers, batch.streams
    row = 0
    if numbers[HAS_SETPOINTS]:
        row = (now_us - numbers[SETPOINTS_START_US]) // numbers[PERIOD_US]
    call_kernel_at(
        batch.code.put_instant,
        (
            batch.state_rows,
            batch.targets,
            batch.requested,
            row,
            numbers[CONTROL_MODE],
            (now_us - numbers[LEG_START_US]) * 1e-6,
            batch.limits[DURATION_S],
            now_us,
            numbers[PHASE],
            numbers[SEQ],
            numbers[LOAD_TRACKED] != 0,
            batch.limits[ASSUMED_LOAD_KG],
            batch.limits[ROTOR_MIN],
            batch.limits[ROTOR_MAX],
            numbers[ROTORS],
            batch.limits[HEADING],
            streams.instant,
        ),
    )


@kernel
def _put_streams(batch: TickBatch, bits: int) -> None:
    """Write a set of streams of an instant that has been assembled."""
    numbers, streams = batch.numbers, batch.streams
    begin = numbers[UNSENT_BYTES]
    length, numbers[STREAM_SEQUENCE], numbers[DIALECT_SEQUENCE] = call_put_streams(
        batch.code.put_streams,
        (
            bits,
            streams.instant,
            streams.home,
            numbers[STREAM_SYSTEM],
            numbers[STREAM_COMPONENT],
            numbers[STREAM_SEQUENCE],
            numbers[DIALECT_COMPONENT],
            numbers[DIALECT_SEQUENCE],
            streams.payload,
            streams.unsent[begin:],
        ),
    )
    numbers[UNSENT_BYTES] = begin + length
