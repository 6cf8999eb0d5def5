"""The share of the assumed thrust that the rotors give, estimated from their speeds.

| symbol | code | unit | |
|---|---|---|---|
| F | told | N | thrust from the last reported rotor speeds: F_max (speed / full speed)^2 each |
| f | thrust | N | assumed thrust, `rotor_model`, with the present factor |
| k | factor | | share of its command that a rotor gives |
| T | | s | time constant |

    k' = k (1 + (dt / T) (F - f) / f)

A sagging battery, or a thrust curve that differs from the assumed one, weakens all rotors by the same
factor. The commands are then F / k, the limits are k times as large, and everything that uses the thrust uses
the actual thrust. The speeds show a force only to within `UNTOLD`: a factor closer to one counts as one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autopilot.control.actuators.mixer import FORCE, MISSED, TOLD, MixerResult, clamp, mix
from autopilot.control.records import Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import Vec3
from autopilot.geometry.packed import with_field
from autopilot.vehicle.rotors import STRENGTH
from autopilot.wire.convert.simulator import force_at

Array = NDArray[np.float64]

LEAST, GREATEST = 0.4, 1.3
UNTOLD = 0.02
_FLYING = 0.25  # of the vehicle's weight: less thrust than that is not used


@kernel
def learned_factor(
    factor: float, thrust: float, vehicle: Vehicle, table: Array, rotors: Array, share: float
) -> float:
    """The factor after a period that is `share` of the time constant; `thrust` (N) is the assumed thrust now.
    The factor is kept while no speeds have been reported or a rotor gives less than it must."""
    told = missed = 0.0
    for i in range(table.shape[0] - 1):
        told = told + force_at(rotors[TOLD, i], table[i, STRENGTH] * vehicle.rotor_max)
        missed = missed + rotors[MISSED, i]
    least = _FLYING * vehicle.quad_mass * vehicle.gravity
    moved = factor * (1.0 + share * (told - thrust) / max(thrust, least))
    moved = clamp(moved, LEAST, GREATEST)
    moved = if_above(missed, 0.0, factor, moved)
    return if_above(min(told, thrust), least, moved, factor)


@kernel
def counted(factor: float) -> float:
    """The factor that is applied."""
    return factor - clamp(factor - 1.0, -UNTOLD, UNTOLD)


@kernel
def mix_with(
    factor: float,
    thrust: float,
    moment: Vec3,
    vehicle: Vehicle,
    limited: float,
    table: Array,
    rotors: Array,
) -> MixerResult:
    """As `mix`, for rotors that give `factor` of what is commanded: the row FORCE contains the commands, the
    result what the rotors give."""
    weaker = with_field(vehicle, "rotor_min", factor * vehicle.rotor_min)
    weaker = with_field(weaker, "rotor_max", factor * vehicle.rotor_max)
    mixed = mix(thrust, moment, weaker, limited, table, rotors)
    for i in range(table.shape[0] - 1):
        rotors[FORCE, i] = rotors[FORCE, i] / factor
    return mixed
