"""Rotors that follow slowly: what they give now, and the demand that makes them follow faster.

| symbol  | code name      | frame | unit   | meaning                                       |
|---------|----------------|-------|--------|-----------------------------------------------|
| r       | thrust, moment | B     | N, N m | what the rotors give, by belief               |
| u       | thrust, moment | B     | N, N m | what they are asked to give                   |
| p       | thrust, moment | B     | N, N m | what the law wants                            |
| tau     | lag            |       | s      | r' = (u - r) / tau                            |
| tau_a   | lag_wanted     |       | s      | r' = (p - r) / tau_a, as it should look       |

A demand u held for a period dt moves r by (1 - exp(-dt/tau)) (u - r). It moves as if the lag were tau_a when

    u = r + gain (p - r),    gain = (1 - exp(-dt/tau_a)) / (1 - exp(-dt/tau))

(2-13) is linear and the rotors are alike, so that thrust and moment lag as each rotor does. What the mixer
cuts off is known and goes into the belief. By the gain the law's noise grows, too, on its way to the rotors.
"""

from __future__ import annotations

from math import exp
from typing import NamedTuple

from autopilot.control.records import Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, sub
from autopilot.mixer import mix


class LagConstants(NamedTuple):
    """For one control period."""

    follow: float  # 1 - exp(-dt / tau)
    gain: float


class Rotating(NamedTuple):
    """What the rotors give, by belief."""

    thrust: float  # N
    moment: Vec3  # N m, body


def lag_constants(lag: float, lag_wanted: float, dt: float) -> LagConstants:
    """For rotors of this lag (s), wanted to be of that; a wanted lag that is no shorter changes nothing."""
    follow = 1.0 - exp(-dt / lag) if lag > 0.0 else 1.0
    if lag_wanted >= lag:
        return LagConstants(follow, 1.0)
    wanted = 1.0 - exp(-dt / lag_wanted) if lag_wanted > 0.0 else 1.0
    return LagConstants(follow, wanted / follow)


@kernel
def hasten(
    rotors: Rotating,
    thrust: float,
    moment: Vec3,
    constants: LagConstants,
    vehicle: Vehicle,
    limited: float,
) -> tuple[Rotating, float, Vec3]:
    """What the rotors will give a period later, and the thrust (N) and moment (N m) to ask of them now."""
    asked = rotors.thrust + constants.gain * (thrust - rotors.thrust)
    asked_moment = axpy(constants.gain, sub(moment, rotors.moment), rotors.moment)
    mixed = mix(asked, asked_moment, vehicle, limited)
    after = Rotating(
        rotors.thrust + constants.follow * (mixed.thrust_done - rotors.thrust),
        axpy(constants.follow, sub(mixed.moment_done, rotors.moment), rotors.moment),
    )
    return after, asked, asked_moment
