"""Looking back: a reading is compared with the state at the time it was taken.

The correction it gives is added to the present state and to every state since, so that the next reading
is not corrected for the same error again.
"""

from __future__ import annotations

from autopilot.estimation.records import HISTORY_LENGTH, QUAT, History
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat, quat_multiply


@kernel
def row_before(head: int, history: History, time_s: float) -> tuple[int, float]:
    """The row at or before `time_s` (else the oldest) and the share of the way to the next row."""
    row = head
    for _ in range(HISTORY_LENGTH - 1):
        if history[row, 0] <= time_s:
            break
        earlier = (row - 1) % HISTORY_LENGTH
        if history[earlier, 0] == -float("inf") or history[earlier, 0] > history[row, 0]:
            return row, 0.0
        row = earlier
    if row == head or history[row, 0] > time_s:
        return row, 0.0
    later = (row + 1) % HISTORY_LENGTH
    return row, (time_s - history[row, 0]) / (history[later, 0] - history[row, 0])


@kernel
def look_back(head: int, history: History, time_s: float, first: int) -> Quat:
    """Columns first ... first+3 at `time_s`, interpolated linearly."""
    row, share = row_before(head, history, time_s)
    later = (row + 1) % HISTORY_LENGTH if share > 0.0 else row
    rest = 1.0 - share
    return (
        rest * history[row, first] + share * history[later, first],
        rest * history[row, first + 1] + share * history[later, first + 1],
        rest * history[row, first + 2] + share * history[later, first + 2],
        rest * history[row, first + 3] + share * history[later, first + 3],
    )


@kernel
def shift(head: int, history: History, since_s: float, first: int, value: Vec3, rate: Vec3) -> None:
    """Add `value` - tau `rate` to columns first ... first+2 of every row from the one at or before `since_s`
    on, tau being the row's age: the past of a present that moves by `value` and is faster by `rate`."""
    now = history[head, 0]
    row = head
    for _ in range(HISTORY_LENGTH - 1):
        tau = now - history[row, 0]
        for i in range(3):
            history[row, first + i] += value[i] - tau * rate[i]
        earlier = (row - 1) % HISTORY_LENGTH
        if history[row, 0] <= since_s or not -float("inf") < history[earlier, 0] <= history[row, 0]:
            break
        row = earlier


@kernel
def renew(history: History, first: int, value: Vec3) -> None:
    """Set columns first ... first+2 of every row: all that was thought before a new start is forgotten.

    Else readings older than the start would be held against it, for as long as the tracker's latency.
    """
    for row in range(HISTORY_LENGTH):
        for i in range(3):
            history[row, first + i] = value[i]


@kernel
def turn(head: int, history: History, since_s: float, turned: Quat) -> None:
    """Turn the attitude of every row from the one at or before `since_s` on by `turned` (body frame)."""
    row = head
    for _ in range(HISTORY_LENGTH - 1):
        quat = quat_multiply(
            (history[row, QUAT], history[row, QUAT + 1], history[row, QUAT + 2], history[row, QUAT + 3]),
            turned,
        )
        for i in range(4):
            history[row, QUAT + i] = quat[i]
        earlier = (row - 1) % HISTORY_LENGTH
        if history[row, 0] <= since_s or not -float("inf") < history[earlier, 0] <= history[row, 0]:
            break
        row = earlier
