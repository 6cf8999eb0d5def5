"""Condition of the vehicle that telemetry shows and nothing flies by: sensors heard, vibration, battery.

No sensor tells of the battery: charge, current and voltage are those of a model. A rotor of force f draws
power as momentum theory has it, P ~ f^(3/2), scaled so that four rotors that carry the bare vehicle draw
BAT_HOVER_W. Voltage is that of a lithium cell by its charge, less the sag of the current.

Vibration is what ArduPilot calls so: the acceleration less its mean below 5 Hz, squared, averaged below 2 Hz,
square root.
"""

from __future__ import annotations

from itertools import pairwise
from math import pi, sqrt
from typing import NamedTuple

from autopilot.core.sensor_inbox import Tick
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.services import snapshot
from autopilot.wire.convert import ACCEL, GYRO, MAG, PRESSURE, Forces
from autopilot.wire.parameter_table import ParameterTable

_FRESH_US = 500_000  # a sensor is healthy while its last word is no older
_MEAN_HZ, _SQUARE_HZ = 5.0, 2.0
_FIELDS = (
    (ACCEL, snapshot.ACCEL),
    (GYRO, snapshot.GYRO),
    (MAG, snapshot.MAG),
    (PRESSURE, snapshot.BARO),
)
_ELECTRONICS_W = 3.0  # on the ground: flight computer and radio
# (share of the charge left, open-circuit voltage of a cell); a common lithium-polymer cell
_CELL = ((0.0, 3.0), (0.05, 3.45), (0.2, 3.68), (0.5, 3.82), (0.9, 4.05), (1.0, 4.2))
_NEVER: tuple[int, ...] = (-1,) * len(_FIELDS)


class BatteryConstants(NamedTuple):
    """The battery by its parameters."""

    capacity_as: float  # A s
    cells: float
    resistance: float  # ohm
    watts_per: float  # W / N^(3/2), of one rotor


class Condition(NamedTuple):
    """All that is carried from tick to tick."""

    heard_us: tuple[int, ...] = _NEVER  # when each of _FIELDS was heard last
    fix_us: int = -1
    mean: Vec3 = ZERO  # m/s^2, body
    square: Vec3 = ZERO
    used_as: float = 0.0
    current: float = 0.0  # A


def battery_constants(table: ParameterTable) -> BatteryConstants:
    """From the parameters."""
    weight = table["VEH_QUAD_MASS"] * table["VEH_GRAVITY"]
    rotor = (weight / 4.0) ** 1.5
    return BatteryConstants(
        table["BAT_CAPACITY"] * 3.6, table["BAT_CELLS"], table["BAT_R"], table["BAT_HOVER_W"] / (4.0 * rotor)
    )


def open_voltage(charge: float) -> float:
    """Open-circuit voltage of a cell with this share of its charge."""
    for (low, v_low), (high, v_high) in pairwise(_CELL):
        if charge <= high:
            return v_low + (v_high - v_low) * max(charge - low, 0.0) / (high - low)
    return _CELL[-1][1]


def remaining(condition: Condition, battery: BatteryConstants) -> float:
    """Share of the charge that is left."""
    return max(0.0, 1.0 - condition.used_as / battery.capacity_as)


def voltage(condition: Condition, battery: BatteryConstants) -> float:
    """V at the terminals."""
    open_v = battery.cells * open_voltage(remaining(condition, battery))
    return max(0.0, open_v - battery.resistance * condition.current)


def _current(forces: Forces, used_as: float, battery: BatteryConstants) -> float:
    power = _ELECTRONICS_W + battery.watts_per * sum(max(f, 0.0) ** 1.5 for f in forces)
    open_v = battery.cells * open_voltage(max(0.0, 1.0 - used_as / battery.capacity_as))
    # P = (U - R I) I; at most what the battery can give
    root = open_v * open_v - 4.0 * battery.resistance * power
    if battery.resistance == 0.0:
        return float(power / open_v)
    return float((open_v - sqrt(max(root, 0.0))) / (2.0 * battery.resistance))


def follow(
    before: Condition, tick: Tick, forces: Forces, battery: BatteryConstants, now_us: int, dt: float
) -> Condition:
    """The condition one tick of `dt` seconds later, with the rotors giving `forces` (N)."""
    fields = tick.fields_updated
    heard = tuple(
        now_us if fields & field else last for last, (field, _) in zip(before.heard_us, _FIELDS, strict=True)
    )
    mean, square = before.mean, before.square
    imu = tick.imu
    if imu is not None and dt > 0.0:
        slow, fast = dt / (dt + 0.5 / (pi * _MEAN_HZ)), dt / (dt + 0.5 / (pi * _SQUARE_HZ))
        a = imu.accel
        if before.heard_us[0] < 0:
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
    return Condition(
        heard,
        now_us if tick.gps is not None else before.fix_us,
        mean,
        square,
        used,
        _current(forces, used, battery),
    )


def vibration(condition: Condition) -> Vec3:
    """m/s^2 along the body axes."""
    x, y, z = condition.square
    return sqrt(x), sqrt(y), sqrt(z)


def sensors(condition: Condition, now_us: int) -> tuple[int, int]:
    """Sensors present (ever heard) and healthy (heard of late), as bits of SYS_STATUS."""
    present = healthy = 0
    heard = (*condition.heard_us, condition.fix_us)
    for last_us, bit in zip(heard, (*(bit for _, bit in _FIELDS), snapshot.GPS), strict=True):
        if last_us >= 0:
            present |= bit
            healthy |= bit if now_us - last_us <= _FRESH_US else 0
    return present, healthy
