"""Rotors of different lag are made alike, so that thrust and moment lag as one.

| symbol | code | unit | |
|---|---|---|---|
| tau | | s | the lag that all are to have, VEH_ROTOR_TAU |
| k_i | Rotor.lag | | lag of a rotor, of tau (`lag_factor` of its file) |
| p_i | rotors[FORCE], before | N | what the mixer wants of it |
| y_i | rotors[GIVES] | N | what it gives by belief |
| u_i | rotors[FORCE], after | N | what it is asked for |

    a = 1 - exp(-T / tau)     b_i = 1 - exp(-T / (k_i tau))
    u_i = y_i + (a / b_i) (p_i - y_i), within its limits
    y_i <- y_i + b_i (u_i - y_i)

Without limits y_i <- y_i + a (p_i - y_i): that of a rotor of lag tau, exactly. What a limit cuts is made up
for as y_i tells. A delay only shifts u_i and y_i together. Where all rotors are alike nothing is done.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autopilot.control.actuators.mixer import FORCE, GIVES, clamp
from autopilot.control.actuators.rotor_model import ActuationConstants
from autopilot.control.records import Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.vehicle.layout import Layout
from autopilot.vehicle.rotors import STRENGTH

Array = NDArray[np.float64]

# columns behind those of the mixer's table: a / b_i, and b_i; its last row has 1 where any rotor is unlike
GAIN, MOVED = 8, 9


def with_lags(table: Array, layout: Layout, actuation: ActuationConstants) -> Array:
    """(n + 1, 10): the mixer's table with the two columns of these rotors."""
    found = np.zeros((table.shape[0], 10))
    found[:, : table.shape[1]] = table
    like = 1.0 - actuation.kept
    for row, rotor in zip(found, layout, strict=False):
        moved = 1.0 - actuation.kept ** (1.0 / rotor.lag) if rotor.lag * actuation.lag > 0.0 else 1.0
        row[GAIN], row[MOVED] = like / moved, moved
    found[-1, GAIN] = float(any(rotor.lag != 1.0 for rotor in layout) and actuation.lag > 0.0)
    return found


@kernel
def make_alike(rotors: Array, table: Array, vehicle: Vehicle, limited: float) -> None:
    """Ask each rotor for what makes it lag as the others do."""
    last = table.shape[0] - 1
    if table[last, GAIN] == 0.0:
        return
    for i in range(last):
        gives = rotors[GIVES, i]
        asked = gives + table[i, GAIN] * (rotors[FORCE, i] - gives)
        if limited != 0.0:
            strength = table[i, STRENGTH]
            asked = clamp(asked, strength * vehicle.rotor_min, strength * vehicle.rotor_max)
        rotors[FORCE, i] = asked
        rotors[GIVES, i] = gives + table[i, MOVED] * (asked - gives)
