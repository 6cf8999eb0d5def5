"""Whether the machine is fast enough to fly in real time, by what the simulator says of its answers."""

from __future__ import annotations

from typing import Any

MOST_MISSED = 0.01  # share of the commands of a second


class Punctuality:
    """The share of the commands that came too late, second by second; in lockstep nothing is told of it."""

    def __init__(self) -> None:
        self._last: tuple[int, int, int] | None = None  # time, tick, missed commands

    def hear(self, status: Any, tick: int) -> tuple[str, ...]:
        """Why the vehicle is not to be armed by SIM_STATUS, heard at this tick of ours; empty: nothing."""
        last, self._last = self._last, (status.time_usec, tick, status.missed)
        if last is None or status.time_usec <= last[0]:
            return ()
        ticks, missed = max(tick - last[1], 1), status.missed - last[2]
        if missed <= MOST_MISSED * ticks:
            return ()
        return (
            f"machine too slow: {missed} of {ticks} commands came too late in the last second; "
            "start sitl without --real-time",
        )
