"""The battery: its voltage by charge and current, and what the rotors draw. One model for truth and belief.

A rotor of force F draws power according to momentum theory, P ~ F^(3/2), scaled so that the rotors draw the
given hover power when they carry the vehicle without its load. The voltage is that of lithium cells at their
charge, minus R I; P = (U - R I) I gives the current. The battery gives no power beyond its maximum.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.packed import Row

_TINY = 1e-30  # avoids a division by 0
ELECTRONICS_W = 3.0  # on the ground: flight computer and radio
# (share of the charge left, open-circuit voltage of a cell); a common lithium-polymer cell
CELL_VOLTAGES = ((0.0, 3.0), (0.05, 3.45), (0.2, 3.68), (0.5, 3.82), (0.9, 4.05), (1.0, 4.2))


class Battery(NamedTuple):
    """Properties of a battery."""

    capacity_as: float  # A s
    cells: float
    resistance: float  # ohm
    rotor_power_coefficient: float  # W / N^(3/2), of one rotor


@kernel
def rotor_power_coefficient(hover_w: float, weight: float, rotors: int) -> float:
    """W / N^(3/2) of each of `rotors` rotors that together draw `hover_w` (W) and carry `weight` (N)."""
    each = weight / rotors
    return hover_w / (rotors * (each * sqrt(each)))


@kernel
def open_voltage(charge: float) -> float:
    """Open-circuit voltage of a cell with this share of its charge, limited to 0 ... 1."""
    found = CELL_VOLTAGES[0][1]
    for i in range(len(CELL_VOLTAGES) - 1):
        low, v_low = CELL_VOLTAGES[i]
        high, v_high = CELL_VOLTAGES[i + 1]
        passed = if_above(charge, low, if_above(charge, high, high, charge) - low, 0.0)
        found += (v_high - v_low) * passed / (high - low)
    return found


@kernel
def charge_left(used_as: float, battery: Battery) -> float:
    """Share of the charge that is left after `used_as` (A s) were used."""
    left = 1.0 - used_as / battery.capacity_as
    return if_above(left, 0.0, left, 0.0)


@kernel
def source_voltage(used_as: float, battery: Battery) -> float:
    """Voltage in V without current, after `used_as` (A s) were used."""
    return battery.cells * open_voltage(charge_left(used_as, battery))


@kernel
def terminal_voltage(open_v: float, current: float, battery: Battery) -> float:
    """Voltage at the terminals in V, for that without current."""
    found = open_v - battery.resistance * current
    return if_above(found, 0.0, found, 0.0)


@kernel
def rotor_power_term(forces: Row, rotors: int) -> float:
    """The sum of F^(3/2) (N^(3/2)) over these rotors; one with a negative force adds nothing."""
    power_term = 0.0
    for i in range(rotors):
        upward_force = if_above(forces[i], 0.0, forces[i], 0.0)
        power_term += upward_force * sqrt(upward_force)
    return power_term


@kernel
def drawn_current(power_term: float, open_v: float, battery: Battery) -> float:
    """Current in A, for the result of `rotor_power_term` and the voltage without current (V)."""
    power = ELECTRONICS_W + battery.rotor_power_coefficient * power_term
    if battery.resistance == 0.0:
        return if_above(open_v, 0.0, power / (open_v + _TINY), 0.0)
    # at most what the battery can give
    discriminant = open_v * open_v - 4.0 * battery.resistance * power
    return (open_v - sqrt(if_above(discriminant, 0.0, discriminant, 0.0))) / (2.0 * battery.resistance)
