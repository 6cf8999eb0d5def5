"""Any number of rotors: limits, first-order lag of each, and thrust and moment on the body, (2-13).

| symbol | code | frame, unit | |
|---|---|---|---|
| F_i | rows[FORCE, i] | N | present force of a rotor |
| u_i | rows[TARGET, i] | N | its target: the command as far as it can follow |
| x_i, y_i | table | body, in units of `arm` | position |
| c_i | table | in units of `torque_ratio` | drag torque per force, signed as the moment about up |
| tau_i | table | in units of `rotor_tau` | F_i' = (u_i - F_i) / tau_i |

    f = sum F_i     M_x = sum y_i F_i     M_y = -sum x_i F_i     M_z = sum c_i F_i
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import Vec3
from autopilot.vehicle.layout import MAX_ROTORS, Layout
from sitl.plant.drive import driven_force, is_driven
from sitl.plant.records import Truth

Array = NDArray[np.float64]

# rows of `RotorRows.rows`, one column per rotor, with room for the greatest number
REQUESTED, COMMAND, TARGET, FORCE, END, SHARE, BEFORE, BEGIN, MIDDLE = range(9)
# columns of `RotorRows.table`, one row per rotor
ROLL, PITCH, YAW, STRENGTH, LAG, FAILED_SHARE = range(6)


class RotorRows(NamedTuple):
    """The rotors of a vehicle, in arrays: the same machine code flies any number of them."""

    table: Array  # (n, 6) constants, which only parameters change
    rows: Array  # (9, MAX_ROTORS) N: requested at this tick, in force, target, present, at the end of a step;
    # share of its command that it gives; before a step; at the beginning and in the middle of a step


class Wrench(NamedTuple):
    """Thrust f in N and moment M in N m, body frame."""

    thrust: float
    moment: Vec3


def rotor_table(layout: Layout, failed_shares: tuple[float, ...] = ()) -> Array:
    """The table of these rotors; `failed_shares`: of its command, what each gives when it has failed."""
    table = np.zeros((len(layout), 6))
    for row, rotor in zip(table, layout, strict=True):
        row[:] = (rotor.y, -rotor.x, rotor.yaw, rotor.strength, rotor.lag, 1.0)
    if failed_shares:
        table[:, FAILED_SHARE] = failed_shares
    return table


def rotors_at_rest() -> Array:
    """The rows of intact rotors at rest."""
    rows = np.zeros((9, MAX_ROTORS))
    rows[SHARE] = 1.0
    return rows


@kernel
def _clamp(force: float, low: float, high: float) -> float:
    # a comparison with nan is false: a command that is not a number gives the lower limit
    return if_above(force, low, if_above(high, force, force, high), low)


@kernel
def set_targets(rotors: RotorRows, truth: Truth) -> None:
    """Write the target of each rotor: its command within its limits, after drive and failure."""
    rows = rotors.rows
    driven = is_driven(truth)
    for i in range(rotors.table.shape[0]):
        strength = rotors.table[i, STRENGTH]
        low, high = strength * truth.rotor_min, strength * truth.rotor_max
        force = _clamp(rows[COMMAND, i], low, high)
        if driven:
            force = driven_force(force, high, truth.drive, truth.supply)
        rows[TARGET, i] = rows[SHARE, i] * force


@kernel
def copy_row(rotors: RotorRows, source: int, target: int) -> None:
    """Copy a row."""
    rows = rotors.rows
    for i in range(rotors.table.shape[0]):
        rows[target, i] = rows[source, i]


@kernel
def decay(x: float) -> float:
    """exp(-x) for x >= 0 from sums and products alone, so that every back end gives the same bits.

    Halve x until the Taylor series to the thirteenth power is exact to rounding, then square as often.
    """
    if x > 700.0:
        return 0.0
    halvings = 0
    while x > 0.25:
        x *= 0.5
        halvings += 1
    series = 1.0
    for n in range(13, 0, -1):
        series = 1.0 - x * series / n
    for _ in range(halvings):
        series *= series
    return series


@kernel
def wrenches(rotors: RotorRows, truth: Truth, h: float) -> tuple[Wrench, Wrench, Wrench]:
    """Thrust and moment of the rotors now, after h/2 and after h (s); their forces at these times are written
    to the rows BEGIN, MIDDLE and END."""
    table, rows = rotors.table, rotors.rows
    f0 = f1 = f2 = 0.0
    x0 = x1 = x2 = 0.0
    y0 = y1 = y2 = 0.0
    z0 = z1 = z2 = 0.0
    lag, half = -1.0, 0.0  # share of the difference to the target that remains after h/2
    for i in range(table.shape[0]):
        if table[i, LAG] != lag:
            lag = table[i, LAG]
            half = 0.0
            if lag * truth.rotor_tau > 0.0:
                half = decay(0.5 * h / (lag * truth.rotor_tau))
        target, begin = rows[TARGET, i], rows[FORCE, i]
        if not lag * truth.rotor_tau > 0.0:
            begin = target
        middle = target + half * (begin - target)
        end = target + half * half * (begin - target)
        rows[BEGIN, i], rows[MIDDLE, i], rows[END, i] = begin, middle, end
        roll, pitch, yaw = table[i, ROLL], table[i, PITCH], table[i, YAW]
        f0, f1, f2 = f0 + begin, f1 + middle, f2 + end
        x0, x1, x2 = x0 + roll * begin, x1 + roll * middle, x2 + roll * end
        y0, y1, y2 = y0 + pitch * begin, y1 + pitch * middle, y2 + pitch * end
        z0, z1, z2 = z0 + yaw * begin, z1 + yaw * middle, z2 + yaw * end
    arm, ratio = truth.arm, truth.torque_ratio
    return (
        Wrench(f0, (arm * x0, arm * y0, ratio * z0)),
        Wrench(f1, (arm * x1, arm * y1, ratio * z1)),
        Wrench(f2, (arm * x2, arm * y2, ratio * z2)),
    )
