"""Makes rotors of different lag alike, so that thrust and moment have one lag.

| symbol | code | unit | |
|---|---|---|---|
| tau | | s | the lag that all rotors get, VEH_ROTOR_TAU |
| k_i | Rotor.lag | | lag of a rotor divided by tau (`lag_factor` of its file) |
| p_i | rotors[FORCE], before | N | the mixer's force for it |
| y_i | rotors[ASSUMED_FORCE] | N | what it is assumed to give |
| u_i | rotors[FORCE], after | N | its command |

    a = 1 - exp(-T / tau)     b_i = 1 - exp(-T / (k_i tau))
    u_i = y_i + (a / b_i) (p_i - y_i), within its limits
    y_i <- y_i + b_i (u_i - y_i)

Without limits y_i <- y_i + a (p_i - y_i), exactly that of a rotor of lag tau. What a limit cuts off is made
up for later, because y_i contains it. A delay only shifts u_i and y_i together. If all rotors are alike,
nothing is changed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autopilot.control.actuators.mixer import ASSUMED_FORCE, FORCE, clamp
from autopilot.control.actuators.rotor_model import ActuationConstants
from autopilot.control.records import Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.vehicle.layout import Layout
from autopilot.vehicle.rotors import STRENGTH

Array = NDArray[np.float64]

# columns behind those of the mixer's table: a / b_i, and b_i; GAIN of its last row is 1 if any rotor differs
LAG_GAIN, LAG_SHARE = 8, 9


def with_lag_columns(table: Array, layout: Layout, actuation: ActuationConstants) -> Array:
    """(n + 1, 10): the mixer's table with the two columns of these rotors."""
    found = np.zeros((table.shape[0], 10))
    found[:, : table.shape[1]] = table
    common_share = 1.0 - actuation.decay_period
    for row, rotor in zip(found, layout, strict=False):
        lag_share = (
            1.0 - actuation.decay_period ** (1.0 / rotor.lag) if rotor.lag * actuation.lag > 0.0 else 1.0
        )
        row[LAG_GAIN], row[LAG_SHARE] = common_share / lag_share, lag_share
    found[-1, LAG_GAIN] = float(any(rotor.lag != 1.0 for rotor in layout) and actuation.lag > 0.0)
    return found


@kernel
def equalise_lags(rotors: Array, table: Array, vehicle: Vehicle, limited: float) -> None:
    """Replace each rotor's force by the command that makes it lag as the others do."""
    last = table.shape[0] - 1
    if table[last, LAG_GAIN] == 0.0:
        return
    for i in range(last):
        assumed = rotors[ASSUMED_FORCE, i]
        commanded = assumed + table[i, LAG_GAIN] * (rotors[FORCE, i] - assumed)
        if limited != 0.0:
            strength = table[i, STRENGTH]
            commanded = clamp(commanded, strength * vehicle.rotor_min, strength * vehicle.rotor_max)
        rotors[FORCE, i] = commanded
        rotors[ASSUMED_FORCE, i] = assumed + table[i, LAG_SHARE] * (commanded - assumed)
