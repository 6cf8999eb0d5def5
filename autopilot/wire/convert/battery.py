"""BATTERY_STATUS, from the simulator and from the vehicle; the parts of it that SYS_STATUS repeats."""

from __future__ import annotations

from math import isnan, nan
from typing import Any, NamedTuple

from autopilot.wire.convert.scaling import saturated
from autopilot.wire.dialect import plumbline as mavlink

_INT16, _UINT16 = 2**15 - 1, 2**16 - 1
_CELLS = 10  # entries of BATTERY_STATUS.voltages


class ChargeLevels(NamedTuple):
    """Shares of the charge at which it counts as low: BAT_LOW_THR, BAT_CRIT_THR and BAT_EMERGEN_THR, with
    PX4's defaults."""

    low: float = 0.15
    critical: float = 0.07
    emergency: float = 0.05


CHARGE_LEVELS = ChargeLevels()
BATTERY_PERIOD_US = 200_000  # between two readings of a simulated battery


class BatteryReading(NamedTuple):
    """What is known of a battery; NaN for what is unknown."""

    voltage: float = nan  # V
    current: float = nan  # A
    used_mah: float = nan
    remaining: float = nan  # 0 ... 1


NO_READING = BatteryReading()


def battery_mv(reading: BatteryReading) -> int:
    """The voltage in mV, as in SYS_STATUS; the greatest number: unknown."""
    return _UINT16 if isnan(reading.voltage) else saturated(reading.voltage * 1e3, 0, _UINT16 - 1)


def battery_ca(reading: BatteryReading) -> int:
    """The current in units of 10 mA; -1: unknown."""
    return -1 if isnan(reading.current) else saturated(reading.current * 100.0, 0, _INT16)


def battery_percent(reading: BatteryReading) -> int:
    """The remaining charge in per cent; -1: unknown."""
    return -1 if isnan(reading.remaining) else saturated(reading.remaining * 100.0, 0, 100)


def percent_by_used(reading: BatteryReading, full_percent: float, capacity_mah: float) -> float:
    """The remaining charge in per cent by the charge that was used of `full_percent`, which is reported in
    finer steps; where the two disagree by more than their steps, the charge as reported."""
    stated = 100.0 * reading.remaining
    percent = max(0.0, full_percent - 100.0 * reading.used_mah / capacity_mah)
    return percent if abs(percent - stated) <= 0.5 + 100.0 / capacity_mah else stated


def charge_state(reading: BatteryReading, levels: ChargeLevels = CHARGE_LEVELS) -> int:
    """MAV_BATTERY_CHARGE_STATE of the remaining charge in per cent; UNDEFINED if that is unknown."""
    if isnan(reading.remaining):
        return mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED
    stated = battery_percent(reading) / 100.0
    if stated <= levels.emergency:
        return mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY
    if stated <= levels.critical:
        return mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL
    if stated <= levels.low:
        return mavlink.MAV_BATTERY_CHARGE_STATE_LOW
    return mavlink.MAV_BATTERY_CHARGE_STATE_OK


def battery_status_message(reading: BatteryReading, levels: ChargeLevels = CHARGE_LEVELS) -> Any:
    """BATTERY_STATUS of a pack whose cells are not measured singly: the first entry is its voltage, the
    second what exceeds the range of the first."""
    first = battery_mv(reading)
    voltages = [first, *[_UINT16] * (_CELLS - 1)]
    if first == _UINT16 - 1:
        voltages[1] = saturated(reading.voltage * 1e3 - first, 0, _UINT16 - 1)
    return mavlink.MAVLink_battery_status_message(
        id=0,
        battery_function=mavlink.MAV_BATTERY_FUNCTION_ALL,
        type=mavlink.MAV_BATTERY_TYPE_LIPO,
        temperature=_INT16,
        voltages=voltages,
        current_battery=battery_ca(reading),
        current_consumed=-1 if isnan(reading.used_mah) else saturated(reading.used_mah, 0, 2**31 - 1),
        energy_consumed=-1,
        battery_remaining=battery_percent(reading),
        charge_state=charge_state(reading, levels),
    )


def read_battery_status(m: Any) -> BatteryReading:
    """Inverse of `battery_status_message`; also reads a message that contains the cells singly."""
    known_mv = [entry for entry in m.voltages if entry != _UINT16]
    return BatteryReading(
        sum(known_mv) * 1e-3 if known_mv else nan,
        m.current_battery * 0.01 if m.current_battery >= 0 else nan,
        float(m.current_consumed) if m.current_consumed >= 0 else nan,
        m.battery_remaining / 100.0 if m.battery_remaining >= 0 else nan,
    )
