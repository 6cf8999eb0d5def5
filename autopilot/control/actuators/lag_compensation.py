"""The rotor demand that makes slow rotors follow faster.

| symbol  | code name      | frame | unit   | meaning                                       |
|---------|----------------|-------|--------|-----------------------------------------------|
| r       | now            | B     | N, N m | what the rotors give when the demand takes effect |
| u       |                | B     | N, N m | the demand                                    |
| p       | wanted         | B     | N, N m | what the law wants                            |
| tau     | lag            |       | s      | r' = (u - r) / tau                            |
| tau_a   | lag_wanted     |       | s      | r' = (p - r) / tau_a, the lag that is wanted  |

A demand u held for a period dt moves r by (1 - exp(-dt/tau)) (u - r). It moves as if the lag were tau_a when

    u = r + gain (p - r),    gain = (1 - exp(-dt/tau_a)) / (1 - exp(-dt/tau))

(2-13) is linear and the rotors are alike, so that thrust and moment lag as each rotor does. What the
rotors give is known from `actuation`. The gain also amplifies the noise of the law's output.
"""

from __future__ import annotations

from math import exp

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, sub


def lag_gain(lag: float, lag_wanted: float, dt: float) -> float:
    """The gain that makes rotors of this lag (s) follow with `lag_wanted` (s); one if that is not shorter."""
    if lag_wanted >= lag:
        return 1.0
    wanted = 1.0 - exp(-dt / lag_wanted) if lag_wanted > 0.0 else 1.0
    return wanted / (1.0 - exp(-dt / lag))


@kernel
def hasten(
    thrust_now: float, moment_now: Vec3, thrust: float, moment: Vec3, gain: float
) -> tuple[float, Vec3]:
    """The thrust (N) and moment (N m) to demand if the law wants `thrust` and `moment`."""
    return thrust_now + gain * (thrust - thrust_now), axpy(gain, sub(moment, moment_now), moment_now)
