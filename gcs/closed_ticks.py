"""Simulator and autopilot in one process, tick after tick in machine code, as the programs fly in lockstep.

`fly_on` hands the sensors of each tick to the autopilot and its answer to the world, until something is to be
done that machine code does not do. What the ground station is to hear of it is kept, window by window.
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

# why `fly_on` returns, beside HEARD and DECIDE: the tick is to be flown in Python; its answer is to be taken
# there; or the world stands at a tick of which nothing is told yet
UNTIL, ANSWERED, MOVED = 4, 5, 6
_TRUTH_ROOM = 262_144  # bytes
_LARGEST = 65_535  # bytes of a datagram of sensors


class Between(NamedTuple):
    """What lies between the two, and the truth for the ground station."""

    sensors: Bytes  # of the first tick
    truth: Bytes
    ends: Ints  # of each of the autopilot's windows that is over: how far it goes there, and when it ends, us
    sizes: Ints  # bytes of `sensors`, and of `truth`


class Window(NamedTuple):
    """What the ground station hears of a window of time: truth, and what the vehicle says."""

    truth: bytes
    said: bytes
    ends_us: int = 0  # with a question; 0: it is open


class Flown(NamedTuple):
    """What has been flown in machine code; the last window is the open one."""

    windows: tuple[Window, ...] = ()
    moved: bool = False  # the world stands at a tick of which nothing is told yet
    decide: Tick | None = None  # the tick is begun, and to be decided upon


NOTHING = Flown()


@kernel
def fly_on(between: Between, flying: Flying, moving: Moving) -> int:
    """Fly ticks until one is near that is none of these; the world stands where the last sensors are of."""
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
    """Runs `fly_on` where it can be run."""

    def __init__(self, onboard: Onboard, simulator: HilSimulator) -> None:
        self._onboard, self._simulator = onboard, simulator
        self._between = Between(
            np.zeros(_LARGEST, np.uint8),
            np.zeros(_TRUTH_ROOM, np.uint8),
            np.zeros((MOST_WINDOWS, 2), np.int64),
            np.zeros(2, np.int64),
        )
        self._fly_on: Any = None  # machine code, once it was asked for

    def run(self, said: bytes, silent_until_us: int) -> Flown:
        """Fly what can be flown so from where the truth of the world's tick is told and its sensors are not.
        `said`: what the vehicle has said in the window that is open; before `silent_until_us` the ground
        station says nothing."""
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
        """Have the machine code ready, if it can be used."""
        moving = self._simulator.running()
        if moving is not None:
            self._ready(self._onboard.rehearsed_running(), moving)

    def _ready(self, flying: Flying, moving: Moving) -> Any:
        self._fly_on = self._fly_on or entry_of(fly_on, self._between, flying, moving)
        return self._fly_on
