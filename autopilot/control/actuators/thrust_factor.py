"""The share of the assumed thrust that the rotors give, estimated from their speeds.

| symbol | code | unit | |
|---|---|---|---|
| F | reported_thrust | N | thrust from the last reported rotor speeds: F_max (speed / full speed)^2 each |
| f | thrust | N | assumed thrust, `rotor_model`, with the present factor |
| k | factor | | share of its command that a rotor gives |
| T | | s | time constant |

    k' = k (1 + (dt / T) (F - f) / f)

A sagging battery, or a thrust curve that differs from the assumed one, weakens all rotors by the same
factor. The commands are then F / k, the limits are k times as large, and everything that uses the thrust uses
the actual thrust. The speeds show a force only to within `DEAD_BAND`: a factor closer to one counts as one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autopilot.control.actuators.mixer import FORCE, MISSED_COUNT, REPORTED_SPEED, MixerResult, clamp, mix
from autopilot.control.records import Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import Vec3
from autopilot.geometry.packed import with_field
from autopilot.vehicle.rotors import STRENGTH
from autopilot.wire.convert.simulator import ROTOR_FMAX, force_at

Array = NDArray[np.float64]

MIN_FACTOR, MAX_FACTOR = 0.4, 1.3
DEAD_BAND = 0.02
_MIN_THRUST_SHARE = 0.25  # of the vehicle's weight: less thrust than that is not used


@kernel
def full_speed_force(strength: float, vehicle: Vehicle, limited: float) -> float:
    """The force (N) of a rotor at full speed; rotors without limits report speeds of the nominal force."""
    return if_above(limited, 0.0, strength * vehicle.rotor_max, ROTOR_FMAX)


@kernel
def learned_factor(
    factor: float, thrust: float, vehicle: Vehicle, limited: float, table: Array, rotors: Array, share: float
) -> float:
    """The factor after a period that is `share` of the time constant; `thrust` (N) is the assumed thrust now.
    The factor is kept while no speeds have been reported or a rotor gives less than it must."""
    reported_thrust = missed_count = 0.0
    for i in range(table.shape[0] - 1):
        full = full_speed_force(table[i, STRENGTH], vehicle, limited)
        reported_thrust = reported_thrust + force_at(rotors[REPORTED_SPEED, i], full)
        missed_count = missed_count + rotors[MISSED_COUNT, i]
    min_thrust = _MIN_THRUST_SHARE * vehicle.quad_mass * vehicle.gravity
    updated = factor * (1.0 + share * (reported_thrust - thrust) / max(thrust, min_thrust))
    updated = clamp(updated, MIN_FACTOR, MAX_FACTOR)
    updated = if_above(missed_count, 0.0, factor, updated)
    return if_above(min(reported_thrust, thrust), min_thrust, updated, factor)


@kernel
def applied_factor(factor: float) -> float:
    """The factor that is applied."""
    return factor - clamp(factor - 1.0, -DEAD_BAND, DEAD_BAND)


@kernel
def mix_with_factor(
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
    scaled = with_field(vehicle, "rotor_min", factor * vehicle.rotor_min)
    scaled = with_field(scaled, "rotor_max", factor * vehicle.rotor_max)
    mixed = mix(thrust, moment, scaled, limited, table, rotors)
    for i in range(table.shape[0] - 1):
        rotors[FORCE, i] = rotors[FORCE, i] / factor
    return mixed
