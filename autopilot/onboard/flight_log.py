"""The on-board flight log: from arming until shortly after disarming, as ULog bytes for the shell to store.

The topics have PX4's names and fields where PX4 has them, so that its tools draw them; those that begin with
`load_`, `cascade_`, `rotor_` and `estimator_plumbline` are specific to Plumbline. World axes are NED, body
axes FRD, units SI, as in PX4. The log contains what the autopilot knows, not the truth of a simulated flight.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from typing import NamedTuple

from autopilot.onboard.log_records import SampleRecords
from autopilot.onboard.log_topics import FAST, SLOW, Numbers, Sample
from autopilot.services.files import LOG_FOLDER, LOG_NAME, LOG_SUFFIX, LOG_TIME, Path
from autopilot.services.streams import NEVER_US
from autopilot.wire import ulog
from autopilot.wire.codec import FLOAT32_MAX
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.parameter_table import ParameterTable
from autopilot.wire.periods import next_multiple
from autopilot.wire.ulog import UlogWriter

TAIL_US = 1_000_000  # for which the log continues after disarming
SLOW_PERIOD_US = 1_000_000  # between two records of the slow topics
MAX_WAITING_BYTES = 4 * 2**20  # bytes that the shell has not taken; beyond that, records are dropped
MAX_EARLY_TEXTS = 20  # texts sent before arming with which the log begins


class LogChunk(NamedTuple):
    """Bytes to be appended to the previous ones of the same file; `is_last`: nothing follows."""

    path: Path
    data: bytes
    is_last: bool


class CompiledLogging(NamedTuple):
    """The part of the log that machine code writes."""

    due_us: int
    period_us: int
    until_us: int
    records: SampleRecords


class FlightLog:
    """Writes one log for each flight. Call `step` at every tick at which it `is_due`, and `take_chunk`
    whenever the shell can store."""

    def __init__(self, table: ParameterTable, release: str, boot_unix_us: int, home: Home) -> None:
        self._table = table
        self._release = release
        self._boot_unix_us = boot_unix_us
        self._wall_clock_us: int | None = None
        self._writer = UlogWriter(topic for topic, _ in (*FAST, *SLOW))
        self._records = SampleRecords(self._writer, home)
        self._next_us = 0  # when there is something to do, unless one of these two changes:
        self._armed: bool | None = None
        self._step_version = -1  # version of the parameters at the last step
        self._path: Path | None = None  # of the log that is open
        self._due_us = self._slow_us = 0
        self._disarmed_us = -1  # -1: armed
        self._state: tuple[bool, int] = (False, 0)  # armed, phase: a change is logged immediately
        self._chunks: list[bytes] = []
        self._waiting = 0
        self._dropped_us = -1  # time since which records are dropped, -1: none are
        self._last_chunk: LogChunk | None = None
        self._parameters: dict[str, float] = {}
        self._version = -1
        self._abandoned = False  # the log of this flight is lost
        self._texts: deque[tuple[int, int, str]] = deque(maxlen=MAX_EARLY_TEXTS)

    @property
    def path(self) -> Path | None:
        """The log that is being written."""
        return self._path

    def set_wall_clock(self, unix_us: int) -> None:
        """Set the time of the wall clock, by which the next log is named if the vehicle's clock differs."""
        self._wall_clock_us = unix_us

    def add_text(self, now_us: int, severity: int, text: str) -> None:
        """Record a text that was sent to the operators."""
        if self._path is None:
            self._texts.append((now_us, severity, text))
        else:
            self._add(ulog.text(now_us, severity, text), now_us)

    def is_due(self, now_us: int, armed: bool) -> bool:
        """Whether `step` has anything to do."""
        return (
            now_us >= self._next_us or armed is not self._armed or self._table.version != self._step_version
        )

    def compiled_logging(self, now_us: int, armed: bool, phase: int) -> CompiledLogging | None:
        """When the fast topics are due, which machine code can write, and when `step` has more to do, if
        nothing changes but the time; None: it has more to do at the tick `now_us`."""
        if armed is not self._armed or self._table.version != self._step_version or self._dropped_us >= 0:
            return None
        if self._path is None or not armed:
            return (
                None
                if now_us >= self._next_us
                else CompiledLogging(NEVER_US, 1, self._next_us, self._records)
            )
        if self._state != (armed, phase) or self._table.version != self._version:
            return None
        period_us = round(1e6 / self._table["LOG_RATE_HZ"])
        return CompiledLogging(self._due_us, period_us, self._slow_us, self._records)

    def records_written(self, records: bytes, due_us: int, now_us: int) -> None:
        """Machine code has written these records of the fast topics; the next are due at `due_us`."""
        self._due_us = self._next_us = due_us
        self._add(records, now_us)

    def step(
        self,
        now_us: int,
        armed: bool,
        used_names: Callable[[], set[str]],
        make_sample: Callable[[], Sample],
    ) -> None:
        """Begin, continue or end the log; `used_names` returns the names in the log folder, `make_sample` the
        instant."""
        self._armed, self._step_version = armed, self._table.version
        rate_hz = self._table["LOG_RATE_HZ"]
        self._next_us = NEVER_US
        if self._path is None:
            self._abandoned = self._abandoned and armed
            if not armed or rate_hz <= 0.0 or self._abandoned:
                return
            self._begin(now_us, used_names())
        if armed:
            self._disarmed_us = -1
        elif self._disarmed_us < 0:
            self._disarmed_us = now_us
        elif now_us - self._disarmed_us >= TAIL_US:
            self.end()
            return
        if self._table.version != self._version:
            self._log_parameter_changes(now_us)
        if now_us >= self._due_us and rate_hz > 0.0:
            period_us = round(1e6 / rate_hz)
            self._due_us = next_multiple(now_us, period_us)
            self._log(make_sample(), now_us)
        if rate_hz > 0.0:
            self._next_us = self._due_us
        if not armed:
            self._next_us = min(self._next_us, self._disarmed_us + TAIL_US)

    def end(self) -> None:
        """End the open log."""
        if self._path is not None:
            self._last_chunk = LogChunk(self._path, b"".join(self._chunks), True)
            self._path = None
            self._chunks.clear()
            self._waiting = 0

    def abandon(self) -> None:
        """Drop the open log, which the shell could not store. The next begins at the next arming."""
        self._path = self._last_chunk = None
        self._abandoned = True
        self._next_us = NEVER_US
        self._chunks.clear()
        self._waiting = 0

    def take_chunk(self, min_bytes: int = 1) -> LogChunk | None:
        """The part to be stored, if it has `min_bytes` or the log has ended."""
        if self._last_chunk is not None:
            chunk, self._last_chunk = self._last_chunk, None
            return chunk
        if self._path is None or self._waiting < min_bytes:
            return None
        data = b"".join(self._chunks)
        self._chunks.clear()
        self._waiting = 0
        return LogChunk(self._path, data, False)

    def _begin(self, now_us: int, used_names: set[str]) -> None:
        unix_us = self._boot_unix_us + now_us if self._wall_clock_us is None else self._wall_clock_us
        self._path = (*LOG_FOLDER, _next_name(unix_us, used_names))
        self._due_us = self._slow_us = now_us
        self._disarmed_us = self._dropped_us = -1
        table = self._table
        self._parameters, self._version = table.values(), table.version
        defaults = {
            name: default
            for name, value in self._parameters.items()
            if (default := table.describe(name).default) != value
        }
        facts: dict[str, str | int] = {
            "sys_name": "Plumbline",
            "ver_hw": "SITL",
            "ver_sw": self._release,
            "time_boot_utc_s": self._boot_unix_us // 1_000_000,
        }
        self._add(self._writer.header(now_us, facts, self._parameters, defaults), now_us)
        for sent_us, severity, line in self._texts:
            self._add(ulog.text(sent_us, severity, line), now_us)
        self._texts.clear()

    def _log_parameter_changes(self, now_us: int) -> None:
        values = self._table.values()
        for name, value in values.items():
            if self._parameters.get(name) != value:
                self._add(ulog.parameter(name, value), now_us)
        self._parameters, self._version = values, self._table.version

    def _log(self, sample: Sample, now_us: int) -> None:
        state = (sample.snapshot.armed, sample.snapshot.phase)
        self._add(self._records.records_at(sample, now_us), now_us)
        if now_us >= self._slow_us or state != self._state:
            self._slow_us = next_multiple(now_us, SLOW_PERIOD_US)
            self._state = state
            for number, (_, build) in enumerate(SLOW, start=len(FAST)):
                self._record(number, build(sample), now_us)

    def _record(self, topic: int, numbers: Numbers, now_us: int) -> None:
        try:
            record = self._writer.record(topic, now_us, *numbers)
        except OverflowError:  # a diverged flight has numbers beyond the range of float32
            record = self._writer.record(topic, now_us, *map(_clipped_to_float32, numbers))
        self._add(record, now_us)

    def _add(self, data: bytes, now_us: int) -> None:
        dropping = self._dropped_us >= 0 and self._waiting > 0  # until the shell has taken the waiting bytes
        if dropping or self._waiting + len(data) > MAX_WAITING_BYTES:
            if self._dropped_us < 0:
                self._dropped_us = now_us
            return
        if self._dropped_us >= 0:
            data = ulog.dropout((now_us - self._dropped_us) // 1000) + data
            self._dropped_us = -1
        self._chunks.append(data)
        self._waiting += len(data)


def _next_name(unix_us: int, used_names: Iterable[str]) -> str:
    """The UTC time as a file name that is sorted behind those of all earlier logs, whatever the clock was."""
    earlier = [match.groups(default="0") for match in map(LOG_NAME.fullmatch, used_names) if match]
    following = [(stem, int(count) + 1) for stem, count in earlier]
    stem, count = max([(_utc(unix_us // 1_000_000), 0), *following])
    return f"{stem}_{count:03}{LOG_SUFFIX}" if count else f"{stem}{LOG_SUFFIX}"


def _utc(unix_s: int) -> str:
    """2026-01-31_12-30-59."""
    return datetime.fromtimestamp(unix_s, UTC).strftime(LOG_TIME)


def _clipped_to_float32(value: float) -> float:
    return min(max(value, -FLOAT32_MAX), FLOAT32_MAX) if isinstance(value, float) else value
