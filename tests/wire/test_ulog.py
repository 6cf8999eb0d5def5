"""ULog bytes as pyulog reads them."""

from __future__ import annotations

from pathlib import Path

import pytest
from pyulog import ULog

from autopilot.wire import ulog
from autopilot.wire.ulog import Topic, UlogWriter

ONE = Topic("one", ("double d", "float[3] v", "uint32_t n", "uint16_t h", "uint8_t b", "bool flag"))
TWO = Topic("two", ("int32_t i",))


def read(tmp_path: Path, data: bytes) -> ULog:
    path = tmp_path / "log.ulg"
    path.write_bytes(data)
    return ULog(str(path))


def test_everything_comes_back(tmp_path: Path) -> None:
    writer = UlogWriter([ONE, TWO])
    data = writer.header(1000, {"sys_name": "Plumbline", "number": 7}, {"A": 1.5, "B": -2.0}, {"B": 3.0})
    data += writer.record(0, 1000, 0.1, 1.0, 2.0, 3.0, 4, 5, 6, True)
    data += writer.record(1, 2000, -9)
    data += ulog.parameter("A", 2.5)
    data += ulog.text(2500, 4, "careful")
    data += ulog.dropout(120)
    data += writer.record(0, 3000, 0.2, 1.5, 2.5, 3.5, 2**32 - 1, 0xFFFF, 0xFF, False)
    log = read(tmp_path, data)
    assert not log.file_corruption
    assert log.start_timestamp == 1000
    assert log.msg_info_dict == {"sys_name": "Plumbline", "number": 7}
    assert log.initial_parameters == {"A": 1.5, "B": -2.0}
    assert log.get_default_parameters(0) == {"B": 3.0}
    assert [(name, value) for _, name, value in log.changed_parameters] == [("A", 2.5)]
    (line,) = log.logged_messages
    assert (line.timestamp, line.log_level_str(), line.message) == (2500, "WARNING", "careful")
    assert [gap.duration for gap in log.dropouts] == [120]
    one = log.get_dataset("one").data
    assert one["timestamp"].tolist() == [1000, 3000]
    assert one["d"].tolist() == [0.1, 0.2]
    assert [one[f"v[{i}]"].tolist() for i in range(3)] == [[1.0, 1.5], [2.0, 2.5], [3.0, 3.5]]
    assert one["n"].tolist() == [4, 2**32 - 1]
    assert one["h"].tolist() == [5, 0xFFFF]
    assert one["b"].tolist() == [6, 0xFF]
    assert one["flag"].tolist() == [1, 0]
    assert log.get_dataset("two").data["i"].tolist() == [-9]


def test_a_log_that_was_cut_short_is_read_up_to_there(tmp_path: Path) -> None:
    writer = UlogWriter([TWO])
    data = writer.header(0, {}, {}, {}) + b"".join(writer.record(0, i, i) for i in range(100))
    assert len(read(tmp_path, data[:-7]).get_dataset("two").data["i"]) == 99


@pytest.mark.parametrize("topic", [ONE, TWO])
def test_fields_stand_without_gaps(topic: Topic) -> None:
    """PX4's tools know no alignment: the record is as long as its fields."""
    sizes = {"double": 8, "float[3]": 12, "uint32_t": 4, "int32_t": 4, "uint16_t": 2, "uint8_t": 1, "bool": 1}
    assert topic.packer.size == 8 + sum(sizes[field.split()[0]] for field in topic.fields)
