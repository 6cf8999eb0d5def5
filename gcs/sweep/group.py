"""Up to eight flights of one cell of a sweep, flown at once while they take the same branches.

A block of ticks is flown in lanes (`gcs.sweep.lane_kernel`). Where a flight takes another branch than the
others, or where the supervisor must decide for one, all of them are flown alone for a few ticks: they stay at
the same tick, and a few ticks alone cost less than a short block. Ticks of a block that are not valid for a
flight are flown again from its own memory, which is still as it was when the block began. Every flight is
therefore the same to the bit as if it were flown alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from autopilot.core.tick import Winch
from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.packed import unpack
from autopilot.supervisor.quiescence import NO_WATCH
from gcs.sweep.flight import SweepFlight
from gcs.sweep.lane_kernel import fly_lanes
from gcs.sweep.lane_memory import LaneMemory
from sitl.world import JITTER, LOSS, OUTAGE_CHANCE, WorldModel

MIN_FLIGHTS = 3  # least number of flights for which lanes are faster
_MAX_BLOCK, _MIN_BLOCK = 2000, 8  # ticks of a block
# the same while the supervisor waits for a pull or a touch: it comes at another tick in each flight, and a
# block that fails there is flown again
_MAX_WATCHED_BLOCK = 128
# ticks at a time that flights are flown alone which are behind, differ from the others in more than their
# course, or for which the supervisor decides at every tick
_ALONE_TICKS = 16
# ticks that flights are flown alone after they took different branches: more if they do so again soon
_MIN_ALONE, _MAX_ALONE = 8, 32

_ENTRIES: dict[type, Callable[..., tuple[int, int]]] = {}  # machine code, by the type of the law's rows


def fits_in_lanes(flight: SweepFlight) -> bool:
    """Whether a flight can be flown in lanes: no reading is lost or late at random, and the cable has no
    links."""
    gnss = unpack(WorldModel, flight.world.model, 0).gnss
    random_effects = flight.world.delivery[:, [LOSS, OUTAGE_CHANCE, JITTER]]
    deterministic = not random_effects.any() and gnss.float_chance == 0.0 and gnss.lost_chance == 0.0
    return deterministic and flight.chain is None


class LaneGroup:
    """Flights of one cell in progress."""

    def __init__(self, flights: Sequence[SweepFlight]) -> None:
        self._flights = flights
        self._memory = LaneMemory(flights)
        self._block = _MIN_BLOCK
        self._alone = _MIN_ALONE
        self.lane_ticks = 0  # ticks that were flown in lanes, of all flights

    def compile(self) -> None:
        """Compile or load the machine code."""
        self._fly_lanes(range(len(self._flights)), 0)

    def run(self) -> None:
        """Fly all flights to their ends."""
        flying = list(range(len(self._flights)))
        self._fly_alone(flying, 1)
        while len(flying) >= MIN_FLIGHTS:
            self._advance(flying)
            flying = [i for i in flying if not self._flights[i].result.outcome]
        for i in flying:
            self._flights[i].run()
        for flight in self._flights:
            flight.conclude()

    def _advance(self, flying: Sequence[int]) -> None:
        """Fly the flights that are behind, at most until they reach those that are ahead."""
        ticks = [self._flights[i].tick for i in flying]
        tick = min(ticks)
        behind = [i for i, own in zip(flying, ticks, strict=True) if own == tick]
        others = [own for own in ticks if own > tick]
        max_ticks = min(others) - tick if others else _MAX_BLOCK
        group = self._largest_group(behind)
        if len(group) < MIN_FLIGHTS or max_ticks < _MIN_BLOCK:
            self._fly_alone(behind, tick + min(max_ticks, _ALONE_TICKS))
            return
        self._fly_alone([i for i in behind if i not in group], tick + _ALONE_TICKS)
        ahead = {i: self._ticks_to_decision(i) for i in group}
        soon = [ticks for ticks in ahead.values() if ticks < _MIN_BLOCK]
        if soon:
            self._fly_alone(group, tick + min(max(soon) + 1, max_ticks))
            return
        max_block = min(self._block, *(self._max_block(i) for i in group))
        self._fly_block(group, min(max_ticks, max_block, *ahead.values()))

    def _max_block(self, i: int) -> int:
        return _MAX_BLOCK if self._memory.watch(i) == NO_WATCH else _MAX_WATCHED_BLOCK

    def _largest_group(self, members: Sequence[int]) -> list[int]:
        """The greatest number of these flights that can be flown together."""
        flights = self._flights
        now_us = flights[members[0]].now_us
        groups: dict[object, list[int]] = {}
        for i in members:
            core = flights[i].core
            decides_at_every_tick = self._memory.stop_us(i) <= now_us
            # while it reels, the growth of the cable would be passed on twice
            if not decides_at_every_tick and not core.is_reeling:
                core.move_cable(now_us + flights[i].tick_us)
                groups.setdefault(self._memory.grouping_key(i), []).append(i)
        largest = max(groups.values(), key=len, default=[])
        if not largest:
            return []
        winch = unpack(Winch, flights[largest[0]].core.rows.winch, 0)
        is_reeling = winch.length_change != 0.0 or winch.cable.rate != 0.0 or winch.cable.accel != 0.0
        return [] if winch.released or is_reeling else largest

    def _ticks_to_decision(self, i: int) -> int:
        """Ticks that a flight can fly before the supervisor must decide, or the ground station has a turn."""
        flight = self._flights[i]
        now_us = flight.now_us
        to_decide = -(-(self._memory.stop_us(i) - now_us) // flight.tick_us) - 1
        return max(min(to_decide, flight.stop_tick(now_us) - flight.tick), 0)

    # ---- in lanes

    def _fly_block(self, members: Sequence[int], ticks: int) -> None:
        """Fly these ticks in lanes, or as many as all flights fly alike."""
        memory = self._memory
        tick = self._flights[members[0]].tick
        agreed_ticks, diverged_bits = self._fly_lanes(members, ticks)
        if not memory.ring_suffices():
            # the estimator was reset or needs a longer memory: the lanes do not hold all of the ring for it
            self._fly_alone(members, tick + min(agreed_ticks + 1, ticks))
            return
        diverged = [i for lane, i in enumerate(members) if diverged_bits >> lane & 1]
        agreeing = [i for i in members if i not in diverged]
        if agreeing:
            self._copy_back(agreeing, agreed_ticks + 1 if diverged else agreed_ticks)
        if diverged:
            # fewer than `MIN_FLIGHTS` are flown again alone, which is as fast
            if agreed_ticks > 0 and len(diverged) >= MIN_FLIGHTS:
                self._fly_lanes(diverged, agreed_ticks)
                self._copy_back(diverged, agreed_ticks)
            self._fly_alone(members, tick + agreed_ticks + (self._alone if agreeing else 1))
            self._alone = min(2 * self._alone, _MAX_ALONE)
            self._block = max(self._block // 2, _MIN_BLOCK)
        else:
            self._alone = _MIN_ALONE
            self._block = min(2 * self._block, _MAX_BLOCK)

    def _fly_lanes(self, members: Sequence[int], ticks: int) -> tuple[int, int]:
        """Take the members into lanes and call `fly_lanes`, with its result."""
        memory = self._memory
        memory.copy_in(members)
        law = type(memory.law_rows)
        arguments = (
            memory.world,
            memory.core,
            memory.law_rows,
            self._flights[0].cell.wire,
            memory.figures,
            memory.requested_path,
            ticks,
        )
        if law not in _ENTRIES:
            _ENTRIES[law] = entry_point_of(fly_lanes, *arguments)
        return _ENTRIES[law](*arguments)

    def _copy_back(self, members: Sequence[int], ticks: int) -> None:
        slack_before = [self._flights[i].slack_events for i in members]
        self._memory.copy_out(members, ticks)
        self.lane_ticks += ticks * len(members)
        for i, before in zip(members, slack_before, strict=True):
            self._flights[i].account_lane_ticks(ticks, before)

    # ---- alone

    def _fly_alone(self, members: Sequence[int], last_tick: int) -> None:
        for flight in (self._flights[i] for i in members):
            while not flight.result.outcome and flight.tick < last_tick:
                flight.advance(last_tick)
