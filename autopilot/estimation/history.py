"""Past states: a reading is compared with the state at the time it was taken.

The ring holds past states. A correction of the present state is also applied to all past states to which a
later reading may refer: a present error dx, dv was dx - tau dv at the time tau earlier. The next reading,
perhaps taken before this correction, therefore does not correct the same error again.
"""

from __future__ import annotations

from autopilot.estimation.records import (
    ACROSS,
    ATTITUDE,
    DIRECTION,
    POSITION,
    Q_CABLE,
    Q_RATE,
    QUAT,
    RATE,
    RING_LENGTH,
    V_QUAD,
    VELOCITY,
    X_QUAD,
    Array,
    EstimatorState,
    History,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, apply, cross, scale, sub
from autopilot.geometry.so3 import Quat, quat_exp, quat_multiply, rotation_from_quat

NEVER = -float("inf")


@kernel
def reading_age(elapsed_us: float, imu_age: float) -> float:
    """Age (s) of a reading, counted from the instant of the estimate, which the inertial unit shows.

    No reading overtakes the inertial unit: a reading that seems to is treated as of the same instant.
    """
    return max(0.0, elapsed_us * 1e-6 - imu_age)


@kernel
def store_state(state: EstimatorState, history: History) -> None:
    """Write the state into its row of the ring."""
    row = history.ring[state.head]
    vehicle, load = state.vehicle, state.load
    row[0] = state.time_s
    for i in range(3):
        row[X_QUAD + i] = vehicle.x_quad[i]
        row[V_QUAD + i] = vehicle.v_quad[i]
        row[Q_CABLE + i] = load.q_cable[i]
        row[ACROSS + i] = load.across[i]
        row[Q_RATE + i] = load.q_cable_dot[i]
    for i in range(4):
        row[QUAT + i] = vehicle.quat_wxyz[i]


@kernel
def row_before(head: int, ring: Array, time_s: float) -> tuple[int, float]:
    """The row at or before `time_s` (else the oldest) and the share of the way to the next row."""
    row = head
    for _ in range(RING_LENGTH - 1):
        if ring[row, 0] <= time_s:
            break
        earlier = (row - 1) % RING_LENGTH
        if ring[earlier, 0] == NEVER or ring[earlier, 0] > ring[row, 0]:
            return row, 0.0
        row = earlier
    if row == head or ring[row, 0] > time_s:
        return row, 0.0
    later = (row + 1) % RING_LENGTH
    return row, (time_s - ring[row, 0]) / (ring[later, 0] - ring[row, 0])


@kernel
def interpolate3(ring: Array, row: int, share: float, first: int) -> Vec3:
    """Columns first ... first+2 at `share` of the way from `row` to the next, linearly."""
    later = (row + 1) % RING_LENGTH if share > 0.0 else row
    rest = 1.0 - share
    return (
        rest * ring[row, first] + share * ring[later, first],
        rest * ring[row, first + 1] + share * ring[later, first + 1],
        rest * ring[row, first + 2] + share * ring[later, first + 2],
    )


@kernel
def interpolate4(ring: Array, row: int, share: float, first: int) -> Quat:
    """Columns first ... first+3, as `interpolate3`."""
    later = (row + 1) % RING_LENGTH if share > 0.0 else row
    rest = 1.0 - share
    return (
        rest * ring[row, first] + share * ring[later, first],
        rest * ring[row, first + 1] + share * ring[later, first + 1],
        rest * ring[row, first + 2] + share * ring[later, first + 2],
        rest * ring[row, first + 3] + share * ring[later, first + 3],
    )


@kernel
def turning_velocity(head: int, ring: Array, time_s: float, r: Vec3) -> Vec3:
    """(R r)' of a vector that is fixed to the body: over the step between the rows about `time_s`; zero where
    there is no such step yet."""
    row, _ = row_before(head, ring, time_s)
    if row == head:
        row = (row - 1) % RING_LENGTH
    later = (row + 1) % RING_LENGTH
    dt = ring[later, 0] - ring[row, 0]
    if not 0.0 < dt < -NEVER:
        return ZERO
    before, after = interpolate4(ring, row, 0.0, QUAT), interpolate4(ring, later, 0.0, QUAT)
    change = sub(apply(rotation_from_quat(after), r), apply(rotation_from_quat(before), r))
    return scale(1.0 / dt, change)


@kernel
def correct_past_states(head: int, history: History, memory_s: float) -> None:
    """Apply the correction in `error` to every row back to `memory_s` before now, and to the row before
    that."""
    ring, e = history.ring, history.error[0]
    turn = quat_exp((e[ATTITUDE], e[ATTITUDE + 1], e[ATTITUDE + 2]))
    now = ring[head, 0]
    row = head
    for _ in range(RING_LENGTH - 1):
        tau = now - ring[row, 0]
        for i in range(3):
            ring[row, X_QUAD + i] += e[POSITION + i] - tau * e[VELOCITY + i]
            ring[row, V_QUAD + i] += e[VELOCITY + i]
        quat = quat_multiply(
            turn, (ring[row, QUAT], ring[row, QUAT + 1], ring[row, QUAT + 2], ring[row, QUAT + 3])
        )
        for i in range(4):
            ring[row, QUAT + i] = quat[i]
        q = (ring[row, Q_CABLE], ring[row, Q_CABLE + 1], ring[row, Q_CABLE + 2])
        across = (ring[row, ACROSS], ring[row, ACROSS + 1], ring[row, ACROSS + 2])
        along = cross(q, across)
        da = e[DIRECTION] - tau * e[RATE]
        db = e[DIRECTION + 1] - tau * e[RATE + 1]
        for i in range(3):
            ring[row, Q_CABLE + i] += da * across[i] + db * along[i]
            ring[row, ACROSS + i] -= da * q[i]
            ring[row, Q_RATE + i] += e[RATE] * across[i] + e[RATE + 1] * along[i]
        earlier = (row - 1) % RING_LENGTH
        if tau > memory_s or not NEVER < ring[earlier, 0] <= ring[row, 0]:
            break
        row = earlier


@kernel
def reset_past_states(history: History, first: int, count: int, value: Quat) -> None:
    """Set `count` columns of every row: at a new start, all past estimates are forgotten.

    Otherwise readings older than the start would be compared with them, for as long as the sensor's latency.
    """
    for row in range(RING_LENGTH):
        for i in range(count):
            history.ring[row, first + i] = value[i]
