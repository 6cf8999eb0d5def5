"""Simulator and autopilot in one process, tick after tick in machine code, as the programs fly in lockstep.

`fly_on` passes the sensors of each tick to the autopilot and its answer to the world, until something must be
done that machine code does not do. The data for the ground station are stored, window by window.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from autopilot.core.sensor_inbox import Tick
from autopilot.geometry.entry import entry_of
from autopilot.geometry.kernel import kernel
from autopilot.onboard.onboard import Onboard
from autopilot.onboard.running import ASKED, LENGTH, MOST_ASKED, MOST_WINDOWS, NOW_US, Ints, Questions
from autopilot.onboard.running import Running as Flying
from autopilot.onboard.ticks import DECIDE, ENDED, HEARD, begun, fly_next
from autopilot.onboard.ticks import goes_on as autopilot_goes_on
from autopilot.wire.compiled import Bytes
from sitl.hil import HilSimulator
from sitl.running import Running as Moving
from sitl.ticks import TRUTH_OF_A_TICK, move_on, put_sensors_next, put_truth_due
from sitl.ticks import goes_on as world_goes_on

# why `fly_on` returns, besides HEARD and DECIDE: Python must fly the tick; Python must pass its answer to the
# world; or the world has advanced to a tick of which nothing has been sent yet
UNTIL, ANSWERED, MOVED = 4, 5, 6
_TRUTH_ROOM = 262_144  # bytes
_LARGEST = 65_535  # bytes of a datagram of sensors


class Between(NamedTuple):
    """The data passed between the two, and the truth for the ground station."""

    sensors: Bytes  # of the first tick
    truth: Bytes
    ends: Ints  # of each window of the autopilot that has ended: where it ends in `truth`, and its time, us
    sizes: Ints  # bytes of `sensors`, and of `truth`


class Window(NamedTuple):
    """What the ground station receives for a window of time: the truth, and the datagrams of the vehicle."""

    truth: bytes
    said: bytes
    ends_us: int = 0  # the time of the question that ends it; 0: the window is open


class Flown(NamedTuple):
    """The result of ticks flown in machine code; the last window is the open one."""

    windows: tuple[Window, ...] = ()
    moved: bool = False  # the world has advanced to a tick of which nothing has been sent yet
    decide: Tick | None = None  # the tick that has begun and needs a decision of the supervisor


NOTHING = Flown()


@kernel
def fly_on(between: Between, flying: Flying, moving: Moving) -> int:
    """Fly ticks until the next step requires Python; return the reason. Except after MOVED, the world is then
    at the tick of the last sensors."""
    numbers, sizes = flying.numbers, between.sizes
    address, size = between.sensors.ctypes.data, sizes[0]
    while autopilot_goes_on(flying) and numbers[ASKED] < numbers[MOST_ASKED]:
        if sizes[1] + TRUTH_OF_A_TICK > len(between.truth):
            return UNTIL
        what = fly_next(flying, address, size)
        if what >= HEARD:
            return what
        if what == ENDED:
            between.ends[numbers[ASKED] - 1] = sizes[1], numbers[NOW_US]
        if not move_on(moving, flying.frame.ctypes.data, numbers[LENGTH]):
            return ANSWERED
        if not world_goes_on(moving):
            return MOVED
        sizes[1] += put_truth_due(moving, between.truth[sizes[1] :])
        size = put_sensors_next(moving)
        address = moving.buffer.ctypes.data
    return UNTIL


class ClosedTicks:
    """Runs `fly_on` at times when that is possible."""

    def __init__(self, onboard: Onboard, simulator: HilSimulator) -> None:
        self._onboard, self._simulator = onboard, simulator
        self._between = Between(
            np.zeros(_LARGEST, np.uint8),
            np.zeros(_TRUTH_ROOM, np.uint8),
            np.zeros((MOST_WINDOWS, 2), np.int64),
            np.zeros(2, np.int64),
        )
        self._fly_on: Any = None  # machine code, once it was needed

    def run(self, said: bytes, silent_until_us: int) -> Flown:
        """Fly as many ticks as possible in machine code. At the start, the truth of the world's present tick
        has been sent and its sensors have not. `said`: the datagrams of the vehicle in the open window; the
        ground station sends nothing before `silent_until_us`."""
        onboard, simulator, between = self._onboard, self._simulator, self._between
        moving = simulator.running()
        if moving is None:
            return NOTHING
        flying = onboard.running(Questions(silent_until_us, silent_until_us, MOST_WINDOWS, (said,)))
        if flying is None:
            return NOTHING
        sensors = simulator.sensor_datagram()
        between.sensors[: len(sensors)] = np.frombuffer(sensors, np.uint8)
        between.sizes[:] = len(sensors), 0
        why = self._ready(flying, moving)(between, flying, moving)
        decide = begun(flying) if why == DECIDE else None
        if not onboard.ran():
            return Flown(decide=decide)
        simulator.ran(framed=why != MOVED)
        *heard, last = onboard.said
        truth, windows, begin = between.truth[: between.sizes[1]].tobytes(), [], 0
        for said_then, (end, ends_us) in zip(heard, between.ends[: len(heard)].tolist(), strict=True):
            windows.append(Window(truth[begin:end], said_then, ends_us))
            begin = end
        return Flown((*windows, Window(truth[begin:], last)), why == MOVED, decide)

    def rehearse(self) -> None:
        """Load or compile the machine code now, if it can be used."""
        moving = self._simulator.running()
        if moving is not None:
            self._ready(self._onboard.rehearsed_running(), moving)

    def _ready(self, flying: Flying, moving: Moving) -> Any:
        self._fly_on = self._fly_on or entry_of(fly_on, self._between, flying, moving)
        return self._fly_on
