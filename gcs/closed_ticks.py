"""Simulator and autopilot in one process, tick after tick in machine code, as the programs fly in lockstep.

`fly_ticks` passes the sensors of each tick to the autopilot and its answer to the world, until something must
be done that machine code does not do. The data for the ground station are stored, window by window.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from autopilot.core.sensor_inbox import Tick
from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.kernel import kernel
from autopilot.onboard.onboard import Onboard
from autopilot.onboard.tick_batch import (
    LENGTH,
    MAX_WAITING_WINDOWS,
    MAX_WINDOWS,
    NOW_US,
    WAITING_WINDOWS,
    Ints,
    TimesyncRequests,
)
from autopilot.onboard.tick_batch import TickBatch as AutopilotBatch
from autopilot.onboard.ticks import NEEDS_DECISION, OTHER_DATAGRAM, WINDOW_ENDED, fly_next, tick_to_decide
from autopilot.onboard.ticks import can_continue as autopilot_can_continue
from autopilot.wire.compiled import Bytes
from sitl.hil import HilSimulator
from sitl.tick_batch import TickBatch as WorldBatch
from sitl.ticks import MAX_TRUTH_BYTES, advance_with_answer, put_next_sensors, put_truth_if_due
from sitl.ticks import can_continue as world_can_continue

# why `fly_ticks` returns, besides HEARD and DECIDE: Python must fly the tick; Python must pass its answer to
# the world; or the world has advanced to a tick of which nothing has been sent yet
NEEDS_PYTHON, ANSWER_FOR_PYTHON, WORLD_MOVED = 4, 5, 6
_TRUTH_CAPACITY = 262_144  # bytes
_MAX_DATAGRAM = 65_535  # bytes of a datagram of sensors


class Exchange(NamedTuple):
    """The data passed between the two, and the truth for the ground station."""

    sensors: Bytes  # of the first tick
    truth: Bytes
    ends: Ints  # of each window of the autopilot that has ended: where it ends in `truth`, and its time, us
    sizes: Ints  # bytes of `sensors`, and of `truth`


class Window(NamedTuple):
    """What the ground station receives for a window of time: the truth, and the datagrams of the vehicle."""

    truth: bytes
    vehicle_datagrams: bytes
    ends_us: int = 0  # the time of the question that ends it; 0: the window is open


class FlownTicks(NamedTuple):
    """The result of ticks flown in machine code; the last window is the open one."""

    windows: tuple[Window, ...] = ()
    world_moved: bool = False  # the world has advanced to a tick of which nothing has been sent yet
    decide: Tick | None = None  # the tick that has begun and needs a decision of the supervisor


NOTHING = FlownTicks()


@kernel
def fly_ticks(exchange: Exchange, autopilot_batch: AutopilotBatch, world_batch: WorldBatch) -> int:
    """Fly ticks until the next step requires Python; return the reason. Except after WORLD_MOVED, the world
    is then at the tick of the last sensors."""
    numbers, sizes = autopilot_batch.numbers, exchange.sizes
    address, size = exchange.sensors.ctypes.data, sizes[0]
    while autopilot_can_continue(autopilot_batch) and numbers[WAITING_WINDOWS] < numbers[MAX_WINDOWS]:
        if sizes[1] + MAX_TRUTH_BYTES > len(exchange.truth):
            return NEEDS_PYTHON
        event = fly_next(autopilot_batch, address, size)
        if event >= OTHER_DATAGRAM:
            return event
        if event == WINDOW_ENDED:
            exchange.ends[numbers[WAITING_WINDOWS] - 1] = sizes[1], numbers[NOW_US]
        if not advance_with_answer(world_batch, autopilot_batch.frame.ctypes.data, numbers[LENGTH]):
            return ANSWER_FOR_PYTHON
        if not world_can_continue(world_batch):
            return WORLD_MOVED
        sizes[1] += put_truth_if_due(world_batch, exchange.truth[sizes[1] :])
        size = put_next_sensors(world_batch)
        address = world_batch.buffer.ctypes.data
    return NEEDS_PYTHON


class ClosedTicks:
    """Runs `fly_ticks` at times when that is possible."""

    def __init__(self, onboard: Onboard, simulator: HilSimulator) -> None:
        self._onboard, self._simulator = onboard, simulator
        self._exchange = Exchange(
            np.zeros(_MAX_DATAGRAM, np.uint8),
            np.zeros(_TRUTH_CAPACITY, np.uint8),
            np.zeros((MAX_WAITING_WINDOWS, 2), np.int64),
            np.zeros(2, np.int64),
        )
        self._compiled: Any = None  # machine code, once it was needed

    def run(self, vehicle_datagrams: bytes, silent_until_us: int) -> FlownTicks:
        """Fly as many ticks as possible in machine code. At the start, the truth of the world's present tick
        has been sent and its sensors have not. `vehicle_datagrams`: those in the open window; the
        ground station sends nothing before `silent_until_us`."""
        onboard, simulator, exchange = self._onboard, self._simulator, self._exchange
        world_batch = simulator.tick_batch()
        if world_batch is None:
            return NOTHING
        autopilot_batch = onboard.tick_batch(
            TimesyncRequests(silent_until_us, silent_until_us, MAX_WAITING_WINDOWS, (vehicle_datagrams,))
        )
        if autopilot_batch is None:
            return NOTHING
        sensors = simulator.sensor_datagram()
        exchange.sensors[: len(sensors)] = np.frombuffer(sensors, np.uint8)
        exchange.sizes[:] = len(sensors), 0
        reason = self._entry(autopilot_batch, world_batch)(exchange, autopilot_batch, world_batch)
        decide = tick_to_decide(autopilot_batch) if reason == NEEDS_DECISION else None
        if not onboard.finish_batch():
            return FlownTicks(decide=decide)
        simulator.finish_batch(sensors_sent=reason != WORLD_MOVED)
        *ended, last = onboard.unsent_windows
        truth, windows, start = exchange.truth[: exchange.sizes[1]].tobytes(), [], 0
        for datagrams, (end, ends_us) in zip(ended, exchange.ends[: len(ended)].tolist(), strict=True):
            windows.append(Window(truth[start:end], datagrams, ends_us))
            start = end
        return FlownTicks((*windows, Window(truth[start:], last)), reason == WORLD_MOVED, decide)

    def warm_up(self) -> None:
        """Load or compile the machine code now, if it can be used."""
        world_batch = self._simulator.tick_batch()
        if world_batch is not None:
            self._entry(self._onboard.warmup_batch(), world_batch)

    def _entry(self, autopilot_batch: AutopilotBatch, world_batch: WorldBatch) -> Any:
        self._compiled = self._compiled or entry_point_of(
            fly_ticks, self._exchange, autopilot_batch, world_batch
        )
        return self._compiled
