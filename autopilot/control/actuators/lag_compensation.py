"""The demand that makes slow rotors follow faster.

| symbol  | code name      | frame | unit   | meaning                                       |
|---------|----------------|-------|--------|-----------------------------------------------|
| r       | now            | B     | N, N m | what the rotors give when the demand is in force |
| u       |                | B     | N, N m | what they are asked to give                   |
| p       | wanted         | B     | N, N m | what the law wants                            |
| tau     | lag            |       | s      | r' = (u - r) / tau                            |
| tau_a   | lag_wanted     |       | s      | r' = (p - r) / tau_a, as it should look       |

A demand u held for a period dt moves r by (1 - exp(-dt/tau)) (u - r). It moves as if the lag were tau_a when

    u = r + gain (p - r),    gain = (1 - exp(-dt/tau_a)) / (1 - exp(-dt/tau))

(2-13) is linear and the rotors are alike, so that thrust and moment lag as each rotor does. What the
rotors give is known from `actuation`. By the gain the law's noise grows, too, on its way to the rotors.
"""

from __future__ import annotations

from math import exp

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, sub


def lag_gain(lag: float, lag_wanted: float, dt: float) -> float:
    """For rotors of this lag (s), wanted to be of that; a wanted lag that is no shorter changes nothing."""
    if lag_wanted >= lag:
        return 1.0
    wanted = 1.0 - exp(-dt / lag_wanted) if lag_wanted > 0.0 else 1.0
    return wanted / (1.0 - exp(-dt / lag))


@kernel
def hasten(
    thrust_now: float, moment_now: Vec3, thrust: float, moment: Vec3, gain: float
) -> tuple[float, Vec3]:
    """The thrust (N) and moment (N m) to ask for, where `thrust` and `moment` are wanted."""
    return thrust_now + gain * (thrust - thrust_now), axpy(gain, sub(moment, moment_now), moment_now)
