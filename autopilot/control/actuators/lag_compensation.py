"""The rotor demand that makes slow rotors follow faster.

| symbol  | code name      | frame | unit   | meaning                                           |
|---------|----------------|-------|--------|---------------------------------------------------|
| r       | thrust_now ..  | B     | N, N m | what the rotors give when the demand takes effect |
| u       |                | B     | N, N m | the demand                                        |
| p       | thrust, moment | B     | N, N m | what the law wants                                |
| tau     | lag            |       | s      | r' = (u - r) / tau                                |
| tau_a   | target_lag     |       | s      | r' = (p - r) / tau_a, the lag to be achieved      |

A demand u held for a period dt moves r by (1 - exp(-dt/tau)) (u - r). It moves as if the lag were tau_a when

    u = r + gain (p - r),    gain = (1 - exp(-dt/tau_a)) / (1 - exp(-dt/tau))

(2-13) is linear and the rotors are alike, so that thrust and moment lag as each rotor does. What the
rotors give is known from `actuation`. The gain also amplifies the noise of the law's output.
"""

from __future__ import annotations

from math import exp

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, sub


def lag_gain(lag: float, target_lag: float, dt: float) -> float:
    """The gain that makes rotors of this lag (s) follow with `target_lag` (s); one if that is not shorter."""
    if target_lag >= lag:
        return 1.0
    target_step = 1.0 - exp(-dt / target_lag) if target_lag > 0.0 else 1.0
    return target_step / (1.0 - exp(-dt / lag))


@kernel
def compensate_lag(
    thrust_now: float, moment_now: Vec3, thrust: float, moment: Vec3, gain: float
) -> tuple[float, Vec3]:
    """The thrust (N) and moment (N m) to demand if the law wants `thrust` and `moment`."""
    return thrust_now + gain * (thrust - thrust_now), axpy(gain, sub(moment, moment_now), moment_now)
