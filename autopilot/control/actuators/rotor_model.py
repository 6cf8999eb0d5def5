"""The assumed present output of the rotors, and the commands that are still on their way to them.

| symbol  | code name      | frame | unit   | meaning                                              |
|---------|----------------|-------|--------|------------------------------------------------------|
| u_k     | queue          | B     | N, N m | thrust and moment that the mixer gave at tick k      |
| r       | thrust, moment | B     | N, N m | what the rotors give at the present tick             |
| d       | delay          |       | s      | from a command to the instant at which it takes      |
|         |                |       |        | effect, on the clock of the estimate                 |
| tau     | lag            |       | s      | r' = (u - r) / tau                                   |
| T       | period         |       | s      | of the control law                                   |

The estimate applies to the instant of the inertial unit's samples: tick k is that instant, and d includes
the unit's delay. With d = n T + c, 0 <= c < T, the command in force is u_{k-n-1} for c seconds after tick k,
then u_{k-n} until the next tick. (2-13) is linear and the rotors are alike, so that thrust and moment lag as
each rotor does.
"""

from __future__ import annotations

from math import exp, floor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3

Queue = NDArray[np.float64]


class ActuationConstants(NamedTuple):
    """Delay and lag for one control period."""

    whole_periods: int  # n, whole periods in the delay
    remainder: float  # c, s
    lag: float  # tau, s
    decay_remainder: float  # share of the difference left after c: exp(-c / tau)
    decay_rest: float  # after T - c
    decay_period: float  # after T
    decay_half_remainder: float  # after c / 2
    decay_half_period: float  # after T / 2


class Actuation(NamedTuple):
    """Assumed output at a tick, before the command of that tick. `queue[i]` is (f, M) of u_{k-1-i}."""

    queue: Queue
    thrust: float  # N
    moment: Vec3  # N m, body


def actuation_constants(delay: float, lag: float, period: float) -> ActuationConstants:
    """Constants for a transport delay and a first-order lag of the rotors, all in seconds."""
    # a delay that is a whole number of periods except for rounding counts as that number
    whole_periods = floor(delay / period + 1e-9)
    remainder = max(0.0, delay - whole_periods * period)

    def decay(duration: float) -> float:
        return exp(-duration / lag) if lag > 0.0 else (0.0 if duration > 0.0 else 1.0)

    return ActuationConstants(
        whole_periods,
        remainder,
        lag,
        decay(remainder),
        decay(period - remainder),
        decay(period),
        decay(0.5 * remainder),
        decay(0.5 * period),
    )


def queue_rows(constants: ActuationConstants) -> int:
    """Number of commands that must be stored for this delay."""
    return constants.whole_periods + 2


def steady_actuation(thrust: float, rows: int) -> Actuation:
    """Rotors that have been commanded this thrust (N) for a long time; `rows` is from `queue_rows`."""
    queue = np.zeros((rows, 4))
    queue[:, 0] = thrust
    return Actuation(queue, thrust, ZERO)


@kernel
def lagged(thrust: float, moment: Vec3, queue: Queue, row: int, decay: float) -> tuple[float, Vec3]:
    """Thrust and moment of the rotors when the share `decay` of the difference to command `row` is left."""
    f, x = float(queue[row, 0]), float(queue[row, 1])
    y, z = float(queue[row, 2]), float(queue[row, 3])
    return f + decay * (thrust - f), (
        x + decay * (moment[0] - x),
        y + decay * (moment[1] - y),
        z + decay * (moment[2] - z),
    )


@kernel
def after_delay(actuation: Actuation, constants: ActuationConstants) -> tuple[float, Vec3]:
    """What the rotors will give when the command of this tick takes effect: thrust N, moment N m."""
    thrust, moment = actuation.thrust, actuation.moment
    if constants.remainder > 0.0:
        thrust, moment = lagged(
            thrust, moment, actuation.queue, constants.whole_periods, constants.decay_remainder
        )
    for i in range(constants.whole_periods):
        row = constants.whole_periods - 1 - i
        thrust, moment = lagged(thrust, moment, actuation.queue, row, constants.decay_period)
    return thrust, moment


@kernel
def advance(actuation: Actuation, thrust: float, moment: Vec3, constants: ActuationConstants) -> Actuation:
    """The assumed output a period later. `thrust` (N) and `moment` (N m, body) are the command of this tick;
    the queue is changed in place."""
    queue = actuation.queue
    for row in range(queue.shape[0] - 1, 0, -1):
        for i in range(4):
            queue[row, i] = queue[row - 1, i]
    queue[0, 0] = thrust
    queue[0, 1] = moment[0]
    queue[0, 2] = moment[1]
    queue[0, 3] = moment[2]
    thrust_now, moment_now = actuation.thrust, actuation.moment
    # now that the queue contains the command of this tick, u_{k-n-1} is row n + 1
    if constants.remainder > 0.0:
        thrust_now, moment_now = lagged(
            thrust_now, moment_now, queue, constants.whole_periods + 1, constants.decay_remainder
        )
    thrust_now, moment_now = lagged(
        thrust_now, moment_now, queue, constants.whole_periods, constants.decay_rest
    )
    return Actuation(queue, thrust_now, moment_now)
