"""BATTERY_STATUS written and read."""

from __future__ import annotations

from math import isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.wire.convert.battery import (
    BatteryReading,
    ChargeLevels,
    battery_status_message,
    charge_state,
    read_battery_status,
)
from autopilot.wire.dialect import plumbline as mavlink


@given(st.floats(0.0, 130.0), st.floats(0.0, 327.0), st.floats(0.0, 1e6), st.floats(0.0, 1.0))
def test_read_as_written(voltage, current, used_mah, remaining):
    """To a millivolt, ten milliampere, a mAh and a per cent; packs of more than 65 V take two entries."""
    found = read_battery_status(battery_status_message(BatteryReading(voltage, current, used_mah, remaining)))
    assert found.voltage == pytest.approx(voltage, abs=0.001)
    assert found.current == pytest.approx(current, abs=0.005001)
    assert found.used_mah == pytest.approx(used_mah, abs=0.500001)
    assert found.remaining == pytest.approx(remaining, abs=0.005001)


def test_what_is_not_known_is_not_told():
    assert all(map(isnan, read_battery_status(battery_status_message(BatteryReading(nan, nan, nan, nan)))))


@pytest.mark.parametrize(
    ("remaining", "state"),
    [
        (1.0, mavlink.MAV_BATTERY_CHARGE_STATE_OK),
        (0.16, mavlink.MAV_BATTERY_CHARGE_STATE_OK),
        (0.15, mavlink.MAV_BATTERY_CHARGE_STATE_LOW),
        (0.08, mavlink.MAV_BATTERY_CHARGE_STATE_LOW),
        (0.07, mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL),
        (0.06, mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL),
        (0.05, mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY),
        (0.0, mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY),
        (nan, mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED),
    ],
)
def test_the_charge_state_is_that_of_the_stated_charge(remaining, state):
    message = battery_status_message(BatteryReading(remaining=remaining))
    assert message.charge_state == state
    assert charge_state(read_battery_status(message)) == state


def test_the_levels_of_a_battery_may_be_others():
    levels, reading = ChargeLevels(0.6, 0.5, 0.4), BatteryReading(remaining=0.5)
    assert battery_status_message(reading, levels).charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL
    assert charge_state(reading, levels) == mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL


def test_cells_that_are_measured_one_by_one_are_added_up():
    message = battery_status_message(BatteryReading(voltage=12.0))
    message.voltages = [4000, 3900, 4100, *[0xFFFF] * 7]
    assert read_battery_status(message).voltage == pytest.approx(12.0)
    assert message.type == mavlink.MAV_BATTERY_TYPE_LIPO
