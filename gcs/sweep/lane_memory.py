"""The memory of eight flights: separately for each flight, and a second time side by side, in lanes.

All numbers that a flight keeps from tick to tick are moved into one block for each flight, and its rows
become views of the block, so that a copy into lanes or back is the transpose of a matrix. Of the ring of past
states, which is longer than all the rest, only the part that is recent enough to be needed is copied.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.core.tick import ControlMemory, CoreRows
from autopilot.estimation.inbox import COLUMNS as READING_COLUMNS
from autopilot.estimation.records import PADDED_SIZE, RING_COLUMNS, RING_LENGTH, EstimatorState
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lane_numbers import LANES
from autopilot.geometry.packed import field_offset
from autopilot.geometry.wide import aligned_zeros
from autopilot.supervisor.quiescence import Stretch
from gcs.sweep.flight import SweepFlight
from sitl.world import Floats, WorldRows

# arrays of each flight; `core.inbox` comes behind these, and only its first row is copied
_WORLD = ("world", "seed", "errors", "queue", "commands", "rotors")
_CORE = ("estimator", "control", "summary", "commands", "stretch", "rotors")
_HISTORY = ("covariance", "consistency")
_SCRATCH = ("error", "jacobian", "gain", "scalars")
_SHARED = ("clock", "command_ring")  # of the world: integers, the same for all flights
_SPARE_ROWS = 3  # of the ring, beyond the age of the oldest reading
# columns of the covariance in lanes: with 32, a row would take 2 KiB, and the numbers of one column would
# compete for few places of the processor's cache
_COLUMNS = PADDED_SIZE + 8
_MEMORY, _HEAD, _RESETS = (field_offset(EstimatorState, name) for name in ("memory_s", "head", "resets"))
_STOP_US, _MODE, _WATCH = (field_offset(Stretch, name) for name in ("stop_us", "mode", "watch"))
_CONTROL_MODE = field_offset(ControlMemory, "control_mode")


Indices = NDArray[np.intp]


def _rows_of(flight: SweepFlight) -> dict[str, NDArray[Any]]:
    """All arrays of a flight, in the order of its block."""
    core, world = flight.core.rows, flight.world
    found = {f"world.{name}": getattr(world, name) for name in _WORLD}
    found |= {f"core.{name}": getattr(core, name) for name in _CORE}
    found |= {f"history.{name}": getattr(core.history, name) for name in _HISTORY}
    found |= {"law": flight.core.law_rows.memory, "figures": flight.figures, "core.inbox": core.inbox}
    found |= {f"shared.{name}": getattr(world, name) for name in _SHARED}
    return found | {"history.ring": core.history.ring}


def _without_prefix(prefix: str, arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}


class LaneMemory:
    """The memory of up to eight flights of one cell of a sweep; from now on, their rows are views of it.

    `world`, `core`, `law_rows`, `figures` and `requested_path` are the arguments of `fly_lanes`, after
    `copy_in`.
    """

    def __init__(self, flights: Sequence[SweepFlight]) -> None:
        self.flights = flights
        first = flights[0]
        arrays = _rows_of(first)
        slices, end = {}, 0
        for name, array in arrays.items():
            slices[name] = slice(end, end + array.size)
            end += array.size
        blocks = self._blocks = np.zeros((len(flights), end))
        for block, flight in zip(blocks, flights, strict=True):
            _replace_rows(flight, {name: _view(block[place], arrays[name]) for name, place in slices.items()})
        inbox, shared = slices["core.inbox"], slices["shared.clock"]
        covariance, ring_slice = slices["history.covariance"], slices["history.ring"]
        end = inbox.start + READING_COLUMNS
        self._offsets = _Offsets(covariance.start, covariance.stop, end, ring_slice.start)
        self._shared = slice(shared.start, slices["shared.command_ring"].stop)
        lanes = self._lanes = aligned_zeros(shared.start, LANES)
        ring = aligned_zeros(arrays["history.ring"].size, LANES)
        square = self._square = aligned_zeros(PADDED_SIZE * _COLUMNS, LANES).reshape(
            PADDED_SIZE, _COLUMNS, LANES
        )
        common = self._common = np.zeros(self._shared.stop - self._shared.start)

        def in_lanes(name: str, array: NDArray[Any]) -> NDArray[Any]:
            place = slices[name]
            if name.startswith("shared."):
                return _view(common[place.start - shared.start : place.stop - shared.start], array)
            if name == "history.covariance":
                return square
            block = ring if name == "history.ring" else lanes[place]
            return block.view(array.dtype).reshape(*array.shape, LANES)

        self._estimator = lanes[slices["core.estimator"]]
        self._block_estimator = blocks[:, slices["core.estimator"]]
        self._block_stretch, self._block_control = (
            blocks[:, slices["core.stretch"]],
            blocks[:, slices["core.control"]],
        )
        self._lane_ring = ring.reshape(*arrays["history.ring"].shape, LANES)
        lane_rows = {name: in_lanes(name, array) for name, array in arrays.items()}
        history = first.core.rows.history
        scratch = {
            name: aligned_zeros(getattr(history, name).size, LANES).reshape(
                *getattr(history, name).shape, LANES
            )
            for name in _SCRATCH
        }
        history = history._replace(
            columns=np.zeros_like(history.columns), **_without_prefix("history.", lane_rows), **scratch
        )
        self.core: CoreRows = first.core.rows._replace(history=history, **_without_prefix("core.", lane_rows))
        self.world: WorldRows = first.world._replace(
            **_without_prefix("world.", lane_rows), **_without_prefix("shared.", lane_rows)
        )
        self.law_rows = first.core.law_rows._replace(memory=lane_rows["law"])
        self.figures = lane_rows["figures"]
        self.requested_path: tuple[Floats, ...] = ()
        self.lanes: Indices = np.zeros(LANES, np.intp)  # the flight in each lane

    def copy_in(self, members: Sequence[int]) -> None:
        """Copy these flights into lanes; if they are fewer than eight, the last one fills the other lanes."""
        self.lanes[:] = [*members, *[members[-1]] * (LANES - len(members))]
        self._common[:] = self._blocks[members[0], self._shared]
        # the estimator's numbers first: they determine which part of the ring is recent
        self._estimator[:] = self._block_estimator[self.lanes].T
        lane_arrays = self._lanes, self._square, self._lane_ring
        _copy_in(self._blocks, self.lanes, self._offsets, *lane_arrays, self._recent_rows())
        flights = [self.flights[member] for member in self.lanes.tolist()]
        flight_rows: dict[str, Any] = {
            name: tuple(getattr(flight.core.rows, name) for flight in flights)
            for name in ("targets", "references")
        }
        for name in ("winch", "constants", "table"):
            flight_rows[name] = getattr(flights[0].core.rows, name)
        self.core = self.core._replace(**flight_rows)
        self.requested_path = tuple(flight.requested_path for flight in flights)

    def copy_out(self, members: Sequence[int], ticks: int) -> None:
        """Copy some of the flights that were taken back from their lanes, after this number of ticks."""
        lanes = [self.lanes.tolist().index(member) for member in members]
        lane_arrays = self._lanes, self._square, self._lane_ring
        members_and_lanes = np.asarray(members, np.intp), np.asarray(lanes, np.intp)
        _copy_out(self._blocks, *members_and_lanes, self._offsets, *lane_arrays, self._recent_rows(ticks))
        self._blocks[members, self._shared] = self._common

    def ring_suffices(self) -> bool:
        """Whether the estimator needs the ring only as far back as when the flights were taken, and was not
        reset; judged by the first lane."""
        before, now = self._block_estimator[self.lanes[0]], self._estimator[:, 0]
        return bool(before[_MEMORY] == now[_MEMORY] and before[_RESETS] == now[_RESETS])

    def grouping_key(self, member: int) -> tuple[Any, ...]:
        """What must be equal for flights that are flown together."""
        flight = self.flights[member]
        return (
            self._block_stretch[member, _MODE],
            self._block_control[member, _CONTROL_MODE],
            len(flight.requested_path) > 0,
            self._blocks[member, self._shared].tobytes(),
            flight.core.rows.winch.tobytes(),
            flight.core.lost_rotors,  # by these alone differ the constants and the mixer's tables of a cell
        )

    def stop_us(self, member: int) -> int:
        """The time at which the supervisor must decide for a flight, at the latest."""
        return int(self._block_stretch[member, _STOP_US])

    def watch(self, member: int) -> int:
        """What the supervisor watches for in a flight."""
        return int(self._block_stretch[member, _WATCH])

    def _recent_rows(self, ticks: int = 0) -> Indices:
        """Rows of the ring that may be needed, and those of the last ticks."""
        memory_s, head = self._estimator[_MEMORY, 0], int(self._estimator[_HEAD, 0])
        length = ceil(memory_s / (self.flights[0].tick_us * 1e-6)) + _SPARE_ROWS + ticks
        return np.arange(head - min(length, RING_LENGTH - 1), head + 1) % RING_LENGTH


class _Offsets(NamedTuple):
    """Indices at which the parts of a flight's block begin and end."""

    covariance: int
    after_covariance: int  # behind the covariance
    end: int  # of the numbers that are copied one by one
    ring: int


@kernel
def _copy_in(
    blocks: Floats,
    members: Indices,
    offsets: _Offsets,
    lanes: Floats,
    covariance: Floats,
    ring: Floats,
    rows: Indices,
) -> None:
    """Copy flights into lanes, number by number; of the ring only `rows`."""
    for i in range(offsets.covariance):
        for lane in range(LANES):
            lanes[i, lane] = blocks[members[lane], i]
    for i in range(offsets.after_covariance, offsets.end):
        for lane in range(LANES):
            lanes[i, lane] = blocks[members[lane], i]
    for i in range(PADDED_SIZE):
        for j in range(PADDED_SIZE):
            for lane in range(LANES):
                covariance[i, j, lane] = blocks[members[lane], offsets.covariance + PADDED_SIZE * i + j]
    for row in rows:
        for j in range(RING_COLUMNS):
            for lane in range(LANES):
                ring[row, j, lane] = blocks[members[lane], offsets.ring + RING_COLUMNS * row + j]


@kernel
def _copy_out(
    blocks: Floats,
    members: Indices,
    source_lanes: Indices,
    offsets: _Offsets,
    lanes: Floats,
    covariance: Floats,
    ring: Floats,
    rows: Indices,
) -> None:
    """Copy the lanes `source_lanes` back into the blocks of the flights `members`."""
    count = members.shape[0]
    for i in range(offsets.covariance):
        for k in range(count):
            blocks[members[k], i] = lanes[i, source_lanes[k]]
    for i in range(offsets.after_covariance, offsets.end):
        for k in range(count):
            blocks[members[k], i] = lanes[i, source_lanes[k]]
    for i in range(PADDED_SIZE):
        for j in range(PADDED_SIZE):
            for k in range(count):
                blocks[members[k], offsets.covariance + PADDED_SIZE * i + j] = covariance[
                    i, j, source_lanes[k]
                ]
    for row in rows:
        for j in range(RING_COLUMNS):
            for k in range(count):
                blocks[members[k], offsets.ring + RING_COLUMNS * row + j] = ring[row, j, source_lanes[k]]


def _view(block: Floats, array: NDArray[Any]) -> NDArray[Any]:
    return block.view(array.dtype).reshape(array.shape)


def _replace_rows(flight: SweepFlight, new_rows: dict[str, NDArray[Any]]) -> None:
    """Replace the flight's rows by `new_rows`, with the same numbers."""
    for name, array in _rows_of(flight).items():
        new_rows[name][...] = array
    core = flight.core
    history = core.rows.history._replace(**_without_prefix("history.", new_rows))
    core.rows = core.rows._replace(history=history, **_without_prefix("core.", new_rows))
    core.law_rows = core.law_rows._replace(memory=new_rows["law"])
    flight.world = flight.world._replace(
        **_without_prefix("world.", new_rows), **_without_prefix("shared.", new_rows)
    )
    flight.figures = new_rows["figures"]
