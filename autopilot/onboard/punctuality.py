"""Whether the machine is fast enough to fly in real time, judged by the simulator's count of late answers."""

from __future__ import annotations

from typing import Any

MAX_MISSED_SHARE = 0.01  # share of the commands in one second


class Punctuality:
    """The share of the commands that came too late, second by second; in lockstep it is not reported."""

    def __init__(self) -> None:
        self._last: tuple[int, int, int] | None = None  # time, tick, missed commands

    def arming_problems(self, status: Any, tick: int) -> tuple[str, ...]:
        """Why the vehicle must not be armed, from SIM_STATUS received at this tick; empty: no reason."""
        last, self._last = self._last, (status.time_usec, tick, status.missed)
        if last is None or status.time_usec <= last[0]:
            return ()
        ticks, missed = max(tick - last[1], 1), status.missed - last[2]
        if missed <= MAX_MISSED_SHARE * ticks:
            return ()
        return (
            f"machine too slow: {missed} of {ticks} commands came too late in the last second; "
            "start sitl without --real-time",
        )
