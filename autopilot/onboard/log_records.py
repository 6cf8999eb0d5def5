"""The records of the fast topics of the flight log, in machine code, from the row of an instant.

`put_sample` copies numbers according to a table derived from the columns of `log_topics`, into records that
already contain their heads and constants.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import isfinite, isinf, nan
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.entry import entry_point_of, kernel_address_of
from autopilot.geometry.frames import quat_ned_frd_from_enu_flu
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import Row, packed, width
from autopilot.onboard.log_topics import FAST, Column, Derived, Sample
from autopilot.services.instant import Instant
from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.wire.codec import FLOAT32_MAX
from autopilot.wire.compiled import Bytes
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.ulog import RECORD_HEAD, UlogWriter

_PULSE_MIN_US, _PULSE_MAX_US = 1000.0, 2000.0  # actuator_outputs, us
_SENSOR_COMBINED = next(i for i, (topic, _) in enumerate(FAST) if topic.name == "sensor_combined")
_FLOAT, _DOUBLE = -4, -8  # kinds of numbers; integers: their bytes


@cache
def _field_ranges(record: Any) -> dict[str, range]:
    """The numbers of a packed record that belong to each field."""
    hints, places, begin = get_type_hints(record), {}, 0
    for name in record._fields:
        places[name] = range(begin, begin + width(hints[name]))
        begin = places[name].stop
    return places


def _offset(record: Any, name: str) -> int:
    return _field_ranges(record)[name].start


# the row from which numbers are copied: an `Instant`, a `Derived`, the time
_DERIVED_OFFSET = width(Instant)
_TIME_OFFSET = _DERIVED_OFFSET + width(Derived)
_FORCES, _ROTOR_MAX = _offset(Instant, "forces"), _offset(Instant, "rotor_max")
_ROTORS = _offset(Instant, "rotors")
_QUAT, _QUAT_C = _offset(Instant, "quat_wxyz"), _offset(Instant, "quat_c_wxyz")
_FLAGS = _offset(Instant, "estimator_flags")
_HOME, _IMU = _DERIVED_OFFSET + _offset(Derived, "latitude_deg"), _DERIVED_OFFSET + _offset(Derived, "gyro")
_VALID = _DERIVED_OFFSET + _offset(Derived, "valid")
_HEIGHT_VALID = _DERIVED_OFFSET + _offset(Derived, "height_valid")
_QUAT_NED, _QUAT_C_NED = (
    _DERIVED_OFFSET + _offset(Derived, "quat_ned"),
    _DERIVED_OFFSET + _offset(Derived, "quat_c_ned"),
)
_SHARES, _PULSES = _DERIVED_OFFSET + _offset(Derived, "shares"), _DERIVED_OFFSET + _offset(Derived, "pulses")


@kernel
def put_sample(
    instant: Row,
    imu: Row,
    home: Row,
    now_us: int,
    row: Row,
    copies: NDArray[np.int64],
    word: Bytes,
    records: Bytes,
) -> None:
    """Write the numbers of an instant into its records. `imu` and `home`: packed `ImuReading` and `Home`.

    `copies` has a line for each number: its place in `row`, its sign (1 or -1), its kind, its first byte.
    `row` and `word`, eight bytes, are scratch. A float beyond the range of float32 becomes its largest
    number.
    """
    for i in range(_DERIVED_OFFSET):
        row[i] = instant[i]
    for i in range(3):
        row[_HOME + i] = home[i]
    for i in range(6):
        row[_IMU + i] = imu[i]
    flags = int(instant[_FLAGS])
    row[_VALID] = 1.0 if flags & mavlink.ESTIMATOR_POS_HORIZ_ABS else 0.0
    row[_HEIGHT_VALID] = 1.0 if flags & mavlink.ESTIMATOR_POS_VERT_ABS else 0.0
    row[_TIME_OFFSET] = now_us
    q = instant[_QUAT : _QUAT + 4]
    c = instant[_QUAT_C : _QUAT_C + 4]
    q_ned = quat_ned_frd_from_enu_flu((q[0], q[1], q[2], q[3]))
    c_ned = quat_ned_frd_from_enu_flu((c[0], c[1], c[2], c[3]))
    rotor_max = instant[_ROTOR_MAX]
    if not (isfinite(rotor_max) and rotor_max > 0.0):
        rotor_max = 1.0
    for i in range(4):
        row[_QUAT_NED + i], row[_QUAT_C_NED + i] = q_ned[i], c_ned[i]
    for i in range(MAX_ROTORS):
        share = instant[_FORCES + i] / rotor_max
        if share < 0.0:
            share = 0.0
        elif share > 1.0:
            share = 1.0
        pulse = _PULSE_MIN_US + (_PULSE_MAX_US - _PULSE_MIN_US) * share
        if i >= instant[_ROTORS]:
            share, pulse = nan, 0.0
        row[_SHARES + i], row[_PULSES + i] = share, pulse
    doubles, floats, integers = word.view(np.float64), word.view(np.float32), word.view(np.int64)
    for k in range(copies.shape[0]):
        number = row[copies[k, 0]]
        if copies[k, 1] < 0:
            number = -number
        size = copies[k, 2]
        if size == _FLOAT:
            floats[0] = number
            if isinf(floats[0]) and not isinf(number):
                floats[0] = FLOAT32_MAX if number > 0.0 else -FLOAT32_MAX
            size = 4
        elif size == _DOUBLE:
            doubles[0] = number
            size = 8
        else:
            integers[0] = int(number)
        for i in range(size):
            records[copies[k, 3] + i] = word[i]


def _column_sources(column: Column) -> list[tuple[int, int]]:
    """(place in the row, sign) of each number of a column."""
    record, first = (Instant, 0) if column.name in Instant._fields else (Derived, _DERIVED_OFFSET)
    place = _field_ranges(record)[column.name]
    first += place.start
    places = range(1, 1 + len(place))
    # applying the axes to three different numbers shows the place and the sign of each
    mapped = column.axes(tuple(map(float, places))) if column.axes else places
    return [(first + abs(int(one)) - 1, 1 if one > 0 else -1) for one in mapped]


class SampleRecords:
    """Writes the records of the fast topics."""

    def __init__(self, writer: UlogWriter, home: Home) -> None:
        copies: list[tuple[int, int, int, int]] = []
        records: list[bytes] = []
        self.home = packed(home)
        offset = 0
        for number, (topic, columns) in enumerate(FAST):
            constants: list[float] = []
            kinds = topic.numbers
            copies.append((_TIME_OFFSET, 1, 8, offset + RECORD_HEAD))
            for column in columns:
                if not isinstance(column, Column):
                    constants += column
                    continue
                for source, sign in _column_sources(column):
                    size, is_float, first = kinds[len(constants)]
                    kind = -size if is_float else size
                    copies.append((source, sign, kind, offset + RECORD_HEAD + first))
                    constants.append(0)
            records.append(writer.record(number, 0, *constants))
            if number == _SENSOR_COMBINED:
                self.imu_range = (offset, offset + len(records[-1]))
            offset += len(records[-1])
        self.copies = np.array(copies)
        self.records = np.frombuffer(b"".join(records), np.uint8).copy()
        self.row = np.zeros(_TIME_OFFSET + 1)
        self.word = np.zeros(8, np.uint8)
        self._put: Callable[..., None] | None = None  # machine code, after the first call

    def address(self, instant: Row, imu: Row) -> int:
        """The address of `put_sample`, compiled or loaded if necessary."""
        arguments = (instant, imu, self.home, 0, self.row, self.copies, self.word, self.records)
        return kernel_address_of(put_sample, *arguments)

    def records_at(self, sample: Sample, now_us: int) -> bytes:
        """The records of an instant, one after the other; that of the inertial sample only if it is sane."""
        arguments = (sample.instant, sample.imu, self.home, now_us, self.row, self.copies)
        if self._put is None:
            self._put = entry_point_of(put_sample, *arguments, self.word, self.records)
        self._put(*arguments, self.word, self.records)
        data = self.records.tobytes()
        if sample.imu_is_sane:
            return data
        begin, end = self.imu_range
        return data[:begin] + data[end:]
