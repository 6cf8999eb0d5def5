"""Condition of the vehicle, shown in telemetry and not used for flight: sensors, vibration, battery.

Where no sensor measures the battery, charge, current and voltage are those of a model,
`autopilot.vehicle.battery`, in which rotors that carry the bare vehicle draw BAT_HOVER_W.

Vibration is defined as in ArduPilot: the acceleration less its mean below 5 Hz, squared, averaged below 2 Hz,
square root.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

from autopilot.estimation.inbox import is_valid_imu
from autopilot.estimation.records import ImuReading
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.packed import Row, pack, unpack
from autopilot.services import snapshot
from autopilot.vehicle.battery import (
    Battery,
    charge_left,
    drawn_current,
    rotor_power_coefficient,
    rotor_power_term,
    source_voltage,
    terminal_voltage,
)
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.wire.convert.battery import BatteryReading, ChargeLevels, battery_percent, charge_state
from autopilot.wire.convert.simulator import ACCEL, GYRO, MAG, PRESSURE
from autopilot.wire.dialect import plumbline as mavlink

_FRESH_US = 500_000  # a sensor is healthy while its last reading is no older
_MEAN_HZ, _SQUARE_HZ = 5.0, 2.0
_FIELDS = (
    (ACCEL, snapshot.ACCEL),
    (GYRO, snapshot.GYRO),
    (MAG, snapshot.MAG),
    (PRESSURE, snapshot.BARO),
)
_NEVER = (-1, -1, -1, -1)
_LOW_BATTERY = {  # what is told of a measured battery, by MAV_BATTERY_CHARGE_STATE, which counts up to empty
    mavlink.MAV_BATTERY_CHARGE_STATE_LOW: "Battery low, {} % left",
    mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL: "Battery nearly empty, {} % left: land",
    mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY: "Battery empty, {} % left: land at once",
}


class Condition(NamedTuple):
    """The data carried from tick to tick."""

    last_received_us: tuple[int, int, int, int] = _NEVER  # when each of _FIELDS was read last
    fix_us: int = -1
    mean: Vec3 = ZERO  # m/s^2, body
    square: Vec3 = ZERO
    used_as: float = 0.0
    current: float = 0.0  # A


def battery_constants(table: AutopilotParameters) -> Battery:
    """The constants of the battery, from the parameters."""
    rotors = len(table.layout)
    return Battery(
        table["BAT_CAPACITY"] * 3.6,
        table["BAT_CELLS"],
        table["BAT_R"],
        rotor_power_coefficient(table["BAT_HOVER_W"], table["VEH_QUAD_MASS"] * table["VEH_GRAVITY"], rotors),
    )


def remaining_charge(condition: Condition, battery: Battery) -> float:
    """Share of the charge that is left."""
    return charge_left(condition.used_as, battery)


def voltage(condition: Condition, battery: Battery) -> float:
    """Voltage at the terminals, V."""
    return terminal_voltage(source_voltage(condition.used_as, battery), condition.current, battery)


def low_battery_text(before: BatteryReading, now: BatteryReading, levels: ChargeLevels) -> str | None:
    """What to tell of a measured battery that was found as `before` and is `now`."""
    state = charge_state(now, levels)
    if state <= charge_state(before, levels) or state not in _LOW_BATTERY:
        return None
    return _LOW_BATTERY[state].format(battery_percent(now))


@kernel
def _updated_time(last_received_us: int, now_us: int, fields: int, field: int) -> int:
    return now_us if fields & field else last_received_us


@kernel
def update_condition(
    condition: Row, imu: Row, forces: Row, battery: Row, fields: int, has_fix: bool, now_us: int, dt: float
) -> None:
    """Advance a `Condition` to the next tick, `dt` seconds later.

    `imu` is the `ImuReading` of this tick, `forces` what the rotors give (N), `battery` the `Battery`;
    `fields` is HIL_SENSOR.fields_updated, `has_fix` whether there was a HIL_GPS.
    """
    before, sample = unpack(Condition, condition, 0), unpack(ImuReading, imu, 0)
    last_received_us = (
        _updated_time(before.last_received_us[0], now_us, fields, ACCEL),
        _updated_time(before.last_received_us[1], now_us, fields, GYRO),
        _updated_time(before.last_received_us[2], now_us, fields, MAG),
        _updated_time(before.last_received_us[3], now_us, fields, PRESSURE),
    )
    mean, square = before.mean, before.square
    if is_valid_imu(sample) and dt > 0.0:
        slow, fast = dt / (dt + 0.5 / (pi * _MEAN_HZ)), dt / (dt + 0.5 / (pi * _SQUARE_HZ))
        a = sample.accel
        if before.last_received_us[0] < 0:
            mean = a
        mean = (
            mean[0] + slow * (a[0] - mean[0]),
            mean[1] + slow * (a[1] - mean[1]),
            mean[2] + slow * (a[2] - mean[2]),
        )
        square = (
            square[0] + fast * ((a[0] - mean[0]) ** 2 - square[0]),
            square[1] + fast * ((a[1] - mean[1]) ** 2 - square[1]),
            square[2] + fast * ((a[2] - mean[2]) ** 2 - square[2]),
        )
    used = before.used_as + before.current * dt
    work, constants = rotor_power_term(forces, forces.shape[0]), unpack(Battery, battery, 0)
    current = drawn_current(work, source_voltage(used, constants), constants)
    pack(
        Condition(last_received_us, now_us if has_fix else before.fix_us, mean, square, used, current),
        condition,
        0,
    )


def vibration(condition: Condition) -> Vec3:
    """Vibration along the body axes, m/s^2."""
    x, y, z = condition.square
    return sqrt(x), sqrt(y), sqrt(z)


def present_and_healthy(condition: Condition, now_us: int) -> tuple[int, int]:
    """Sensors present (ever read) and healthy (read recently), as bits of SYS_STATUS."""
    present = healthy = 0
    last_received_us = (*condition.last_received_us, condition.fix_us)
    for last_us, bit in zip(last_received_us, (*(bit for _, bit in _FIELDS), snapshot.GPS), strict=True):
        if last_us >= 0:
            present |= bit
            healthy |= bit if now_us - last_us <= _FRESH_US else 0
    return present, healthy
