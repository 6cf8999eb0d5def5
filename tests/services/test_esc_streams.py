"""Telemetry of the speed controllers: four of them in each message."""

from __future__ import annotations

import pytest

from autopilot.wire.dialect import plumbline as m
from tests.doubles.streams import sent

NOW_US = 5_000_000


@pytest.mark.parametrize("count", [4, 6, 8, 14])
def test_every_rotor_stands_once_in_groups_of_four(snap, count):
    rpm = tuple(1000.0 + 10.0 * i for i in range(count))
    snapshot = snap(NOW_US, rotors=count, rotor_rpm=rpm, battery_voltage=11.1, battery_current=9.0)
    status, info = (sent(snapshot, i) for i in (m.MAVLINK_MSG_ID_ESC_STATUS, m.MAVLINK_MSG_ID_ESC_INFO))
    groups = list(range(0, count, 4))
    assert [x.index for x in status] == [x.index for x in info] == groups
    told = [speed for x in status for speed in x.rpm]
    assert told == [*rpm, *[0] * (len(told) - count)]
    assert sum(current for x in status for current in x.current) == pytest.approx(9.0, rel=1e-6)
    assert {round(volts, 5) for x in status for volts in x.voltage} <= {0.0, 11.1}
    assert sum(volts > 0.0 for x in status for volts in x.voltage) == count
    assert {x.count for x in info} == {count}
    assert [bin(x.info).count("1") for x in info] == [min(4, count - first) for first in groups]
    assert {x.time_usec for x in (*status, *info)} == {NOW_US}


def test_the_current_goes_by_the_cube_of_the_speed(snap):
    snapshot = snap(NOW_US, rotor_rpm=(1000.0, 2000.0, -1000.0, 0.0), battery_current=10.0)
    (status,) = sent(snapshot, m.MAVLINK_MSG_ID_ESC_STATUS)
    assert status.rpm == [1000, 2000, -1000, 0]
    assert status.current == pytest.approx([1.0, 8.0, 1.0, 0.0], rel=1e-6)


def test_a_rotor_that_is_lost_is_marked(snap):
    (info,) = sent(snap(NOW_US, rotors_lost=0b0100), m.MAVLINK_MSG_ID_ESC_INFO)
    assert list(info.failure_flags) == [0, 0, 32, 0]


def test_nothing_is_said_of_a_battery_that_nobody_knows(snap):
    (status,) = sent(snap(NOW_US, rotor_rpm=(0.0,) * 4), m.MAVLINK_MSG_ID_ESC_STATUS)
    assert (list(status.voltage), list(status.current)) == ([0.0] * 4, [0.0] * 4)
