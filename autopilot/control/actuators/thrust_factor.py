"""How much of what they are believed to give the rotors give, as their speeds tell.

| symbol | code | unit | |
|---|---|---|---|
| F | told | N | thrust by the rotor speeds that were told last: F_max (speed / full speed)^2 each |
| f | thrust | N | thrust by belief, `rotor_model`, with the factor that was known |
| k | factor | | what a rotor gives, of what it is asked for |
| T | | s | time constant |

    k' = k (1 + (dt / T) (F - f) / f)

A battery that sags, and a thrust curve that is not the believed one, take the same share of every rotor.
Commands are then for F / k, limits k times as large, and all that reckons with thrust reckons with what there
is. The speeds tell no force to more than `UNTOLD`: a factor nearer to one than that counts as one.
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
_FLYING = 0.25  # of the vehicle's weight: less thrust than that tells nothing


@kernel
def learned_factor(
    factor: float, thrust: float, vehicle: Vehicle, table: Array, rotors: Array, share: float
) -> float:
    """The factor a period later, `share` of the time constant; `thrust` (N) is believed now. Rotors that have
    told nothing, or miss what they are asked for, tell nothing of it."""
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
    """The factor that is reckoned with."""
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
    """As `mix`, but the forces in the row FORCE are asked for by rotors that give `factor` of them; the
    result is what they give."""
    weaker = with_field(vehicle, "rotor_min", factor * vehicle.rotor_min)
    weaker = with_field(weaker, "rotor_max", factor * vehicle.rotor_max)
    mixed = mix(thrust, moment, weaker, limited, table, rotors)
    for i in range(table.shape[0] - 1):
        rotors[FORCE, i] = rotors[FORCE, i] / factor
    return mixed
