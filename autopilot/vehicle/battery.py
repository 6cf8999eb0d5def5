"""The battery: voltage by charge and current, and what the rotors draw. One model for truth and belief.

A rotor of force F draws power as momentum theory has it, P ~ F^(3/2), scaled so that rotors that carry the
bare vehicle draw what it needs in hover. The voltage is that of lithium cells by their charge, less R I; with
P = (U - R I) I the current follows. What the power exceeds that the battery can give, it does not give.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.packed import Row

ELECTRONICS_W = 3.0  # on the ground: flight computer and radio
# (share of the charge left, open-circuit voltage of a cell); a common lithium-polymer cell
CELL = ((0.0, 3.0), (0.05, 3.45), (0.2, 3.68), (0.5, 3.82), (0.9, 4.05), (1.0, 4.2))


class Battery(NamedTuple):
    """A battery by its numbers."""

    capacity_as: float  # A s
    cells: float
    resistance: float  # ohm
    watts_per: float  # W / N^(3/2), of one rotor


@kernel
def watts_per(hover_w: float, weight: float, rotors: int) -> float:
    """W / N^(3/2) of one of so many rotors that draw `hover_w` (W) in all while they carry `weight` (N)."""
    each = weight / rotors
    return hover_w / (rotors * (each * sqrt(each)))


@kernel
def open_voltage(charge: float) -> float:
    """Open-circuit voltage of a cell with this share of its charge, which counts as 0 ... 1."""
    found = CELL[0][1]
    for i in range(len(CELL) - 1):
        low, v_low = CELL[i]
        high, v_high = CELL[i + 1]
        passed = if_above(charge, low, if_above(charge, high, high, charge) - low, 0.0)
        found += (v_high - v_low) * passed / (high - low)
    return found


@kernel
def charge_left(used_as: float, battery: Battery) -> float:
    """Share of the charge that is left when so much (A s) was used."""
    left = 1.0 - used_as / battery.capacity_as
    return if_above(left, 0.0, left, 0.0)


@kernel
def terminal_voltage(used_as: float, current: float, battery: Battery) -> float:
    """V at the terminals."""
    found = battery.cells * open_voltage(charge_left(used_as, battery)) - battery.resistance * current
    return if_above(found, 0.0, found, 0.0)


@kernel
def work_of(forces: Row, rotors: int) -> float:
    """The sum of F^(3/2) (N^(3/2)) over these rotors; one that pushes the other way does none."""
    work = 0.0
    for i in range(rotors):
        lifting = if_above(forces[i], 0.0, forces[i], 0.0)
        work += lifting * sqrt(lifting)
    return work


@kernel
def drawn_current(work: float, used_as: float, battery: Battery) -> float:
    """A, by what `work_of` says and what was used before (A s)."""
    power = ELECTRONICS_W + battery.watts_per * work
    open_v = battery.cells * open_voltage(charge_left(used_as, battery))
    if battery.resistance == 0.0:
        return power / open_v
    # at most what the battery can give
    root = open_v * open_v - 4.0 * battery.resistance * power
    return (open_v - sqrt(if_above(root, 0.0, root, 0.0))) / (2.0 * battery.resistance)
